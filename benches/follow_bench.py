"""Scenes of Follow-Bench (arXiv 2509.10796) at 1:2, where a Limo is half of its robot and our person half of a man.

    uv run python -m benches.follow_bench FOLDER --controllers tracking oracle sighted crude --json out/runs.jsonl

FOLDER holds files of its `dynamic_scenarios/config` and `layout_scenarios/config`, of which none come along; of these
the files `…_back_1.yaml` to `…_back_40.yaml` are played, each with its number as the seed. Lengths and speeds are
halved, times are as they are. All people walk by social forces, to and fro on the routes that the files give. A run
is a line of the file: one that was stopped goes on where it was. Beside our controllers there are the two of
`benches.oracle`, which are given true positions.
"""

from __future__ import annotations

import argparse
import bisect
import itertools
import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from benches.follower import contacts_by  # type: ignore[attr-defined]  # mypy takes the folder of that name
from benches.oracle import ORACLES, oracle

import limo_hog
from limo_hog.atomic import whole_file
from limo_hog.exceptions import LimoHogError
from limo_hog.follow import detector_named
from limo_hog.parallel import cores
from limo_sim.run.arena import Arena
from limo_sim.run.baselines import controller_of
from limo_sim.run.episode import play as drive
from limo_sim.run.episode import run_episode, score
from limo_sim.run.log import Step
from limo_sim.run.matching import CRITERIA, NO_PERSON, person_of
from limo_sim.run.provenance import code_version, fingerprint
from limo_sim.run.sweep import in_processes
from limo_sim.world.people import SOCIAL_FORCE, Person, Vary, check_person
from limo_sim.world.scenario import Robot, Room, Scenario, Wall
from limo_sim.world.schema import ScenarioError

#: Of our lengths and speeds to theirs.
SCALE = 0.5
#: How far the robot starts behind the person it is to follow [m]: from half of theirs HOG sees no whole person.
BEHIND = 1.75
#: Nearer than this to the end of its first way a person has arrived [m]: half of Follow-Bench's threshold of 1 m.
ARRIVED = 0.5
#: Files with higher numbers are kept back to check with.
LAST = 40
NAME = re.compile(r"[A-Za-z0-9.]+_back_([1-9]|[123]\d|40)")
SECONDS = 60.0
#: Blocks thicker than a wall may be become hollow, with walls so thick [m].
SOLID, SHELL = 1.0, 0.1
#: What a place on a route keeps from the room's walls, and the robot at its start [m].
_PERSON_MARGIN, _ROBOT_MARGIN = 0.6, 0.3
Place = tuple[float, float]


class FollowBenchError(LimoHogError):
    """A file that is no scene of Follow-Bench, or one that is kept back."""


def number_of(path: Path) -> int:
    """Return the number of a scene, by its file's name; refuse those kept back, and those not followed from behind."""
    if (found := NAME.fullmatch(path.stem)) is None:
        raise FollowBenchError(f"{path.name}: want a name such as KIND_back_N.yaml, N from 1 to {LAST}")
    return int(found[1])


def read(path: Path) -> Scenario:
    """Return one of Follow-Bench's files as a scenario: the first person is the one to follow.

    Corners of routes that our people cannot reach are left out; `summary` says how many.
    """
    from ruamel.yaml import YAML

    table = YAML(typ="safe", pure=True).load(path.read_text(encoding="utf-8"))
    width, height = table["world"]["width"], table["world"]["height"]
    half = SCALE * max(width, height) / 2

    def place(state: Sequence[float], margin: float = _PERSON_MARGIN) -> Place:
        return inside((SCALE * (state[0] - width / 2), SCALE * (state[1] - height / 2)), half - margin)

    target, humans = table["target"][0], table.get("human", [])
    yaw = float(target["state"][2])
    (x, y), ahead, aside = place(target["state"]), BEHIND * math.cos(yaw), BEHIND * math.sin(yaw)
    start = inside((x - ahead, y - aside), half - _ROBOT_MARGIN)
    walls = [
        wall
        for obstacle in table.get("obstacle", [])
        for wall in walls_of(obstacle, place(obstacle["state"], 0.0), half)
    ]
    room = Scenario(path.stem, robot=Robot(*start, yaw), room=Room(half), walls=tuple(walls), vary=Vary(clothes=True))
    ways = [[(start[0] + ahead, start[1] + aside), place(target["goal"])]]
    for human in humans:
        goal = human["goal"][0] if isinstance(human["goal"][0], list) else [human["state"], human["goal"]]
        ways.append([place(corner) for corner in goal])
    speeds = [SCALE * max(person["vel_max"]) for person in (target, *humans)]
    kept = [[corner for corner in way if fits(walker([corner], 1.0), room)] for way in ways]
    if len(kept[0]) < 2:
        raise FollowBenchError(f"{path.name}: the person to follow must start and arrive in free places: {ways[0]}")
    dropped = sum(map(len, ways)) - sum(map(len, kept))
    people = [walker(way, speed) for way, speed in zip(kept, speeds, strict=True) if way]
    scenario = replace(room, people=tuple(people), summary=f"Follow-Bench at 1:2, {dropped} corners left out")
    scenario.check(f"{path.name}: ")
    return scenario


def inside(place: Place, limit: float) -> Place:
    """Return the nearest place whose x and y are within ± `limit` [m]."""
    return min(max(place[0], -limit), limit), min(max(place[1], -limit), limit)


def walker(way: Sequence[Place], speed: float) -> Person:
    """Return a person who walks to and fro on a way."""
    return Person(tuple((x, y, 0.0) for x, y in (*way, *way[-2:0:-1])), speed, behaviour=SOCIAL_FORCE)


def fits(person: Person, room: Scenario) -> bool:
    """Whether a person can stand where the route begins."""
    try:
        check_person(person, room.surroundings, "")
    except ScenarioError:
        return False
    return True


def walls_of(block: dict[str, Any], middle: Place, half: float) -> list[Wall]:
    """Return a rectangle as one wall, or hollow as four; none for the thin lines that are the room's own walls."""
    sides, yaw = (SCALE * block["shape"]["length"], SCALE * block["shape"]["width"]), block["state"][2]
    length, breadth = max(sides), min(sides)
    yaw += math.pi / 2 if sides[0] < sides[1] else 0.0
    if breadth < 0.01:
        return []

    def end(along: float, across: float) -> Place:
        x = middle[0] + along * math.cos(yaw) - across * math.sin(yaw)
        return inside((x, middle[1] + along * math.sin(yaw) + across * math.cos(yaw)), half)

    if breadth <= SOLID:
        return [Wall(end(-length / 2, 0.0), end(length / 2, 0.0), breadth)]
    u, v = length / 2 - SHELL / 2, breadth / 2 - SHELL / 2
    corners = [end(-u, -v), end(u, -v), end(u, v), end(-u, v)]
    return [Wall(*ends, SHELL) for ends in itertools.pairwise((*corners, corners[0]))]


@dataclass(frozen=True, slots=True)
class Play:
    """One run: a file, and who drives."""

    path: Path
    controller: str
    seconds: float


def play(run: Play) -> dict[str, Any]:
    """Play a run in this process, on one core, and return its figures."""
    limo_hog.set_num_threads(1)
    cv2.setNumThreads(1)
    scenario, seed, steps = read(run.path), number_of(run.path), list[Step]()

    def watch(step: Step) -> None:
        steps.append(step.bare())

    if run.controller in ORACLES:
        arena = Arena(scenario, seed)
        names = (run.controller, "truth")
        episode = drive(arena, oracle(run.controller, arena), run.seconds, names=names, watch=watch)
    else:
        controller, names = controller_of(run.controller), (run.controller, "hog")
        episode = run_episode(scenario, controller, detector_named("hog"), run.seconds, seed, names=names, watch=watch)
    card = score(episode).to_json()
    own, pushed = contacts_by(steps)
    followed = first_followed(steps)
    return (
        card
        | until_arrival(steps, scenario.people[0])
        | {
            "kind": re.split(r"Orca|Sfm", run.path.stem.removeprefix("Normal"))[0],
            "success": bool(card["success"]) and followed == 0,
            "first_followed": followed,
            "contacts_own": own,
            "contacts_other": pushed,
            "believed": believed(steps),
        }
    )


def first_followed(steps: Sequence[Step]) -> int | None:
    """Return the first person who was the target, by the scenario's order; None where nobody was."""
    for step in steps:
        target = step.log.decision.target
        if target is not None and step.seen is not None:
            person = person_of(step.log.detections.windows[target], step.seen.people)
            if person != NO_PERSON:
                return person
    return None


def believed(steps: Sequence[Step]) -> list[tuple[int, int]]:
    """Return how many boxes of tracks are as probable as each part of `PARTS` says, and on how many is the person."""
    told = [[0, 0] for _ in PARTS]
    for step in steps:
        if step.seen is None:
            continue
        for person in step.log.decision.belief.people:
            part = bisect.bisect(PARTS, person.same or 0.0) - 1
            if person.box is not None and part >= 0:
                told[part][0] += 1
                told[part][1] += person_of(step.log.detections.windows[person.box], step.seen.people) == 0
    return [(count, right) for count, right in told]


def until_arrival(steps: Sequence[Step], target: Person) -> dict[str, float | None]:
    """Return what a run shows until the person to follow first arrives, or to its end where they do not.

    `arrived_s`: when [s], None for never; `in_view_until`: share of frames with half of them in view, from the start;
    `away_then_m`: how far off the robot is then [m].
    """
    goal, frames, arrived, away = target.route[1][:2], [], None, None
    for step in steps:
        person = step.truth.people[0]
        if person is None:
            continue
        if step.seen is not None:
            seen = step.seen.people[0]
            frames.append(seen is not None and seen.box is not None and seen.visible >= CRITERIA.in_view)
        away = person.distance
        if math.dist((person.x, person.y), goal) < ARRIVED:
            arrived = step.log.time
            break
    return {"arrived_s": arrived, "in_view_until": float(np.mean(frames)) if frames else None, "away_then_m": away}


#: Where each part of the probabilities that a track is the person followed begins.
PARTS = (0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.97)
PAGE = Path(__file__).parents[1] / "docs" / "benchmark.md"
HEADING = "## Follow-Bench at 1:2"
PROSE = """Scenes that others wrote ([Follow-Bench](https://arxiv.org/abs/2509.10796), MIT), one run of 60 s each, by
`python -m benches.follow_bench FOLDER --page`, which says how its files are read. `oracle` is `tracking` with true
positions in place of what it sees, `sighted` with those of the people alone whom camera or scan show; `crude` a sampled
rollout with true positions and no routes: what could be won by better senses, by better tracking, and by a better
planner. "Until arrival" is the way on which the person first walks to their goal.

The figures are not comparable with those of the paper. There, planners know all positions and a run ends at the goal;
here the senses are honest, the camera sees 71°, ORCA's people walk by social forces, and all walk to and fro, so that
they meet the robot head-on as well. "Without a collision until arrival", their success, a robot that stands has too.

The files are those of commit 7284e8e, copied by hand and as long as the originals to the character. 20 of the 40 scenes
(1, 2, 6, 7, 8, 12, 13, 14, 18, 19, 20, 24, 25, 26, 30, 31, 32, 36, 37, 38) were looked at while `tracking` was made."""

RELIABILITY = """How probable `tracking` takes its tracks to be the person followed, and the share of these boxes
that are on that person (a reliability diagram, as a table):"""

COLUMNS = {
    "success": "success",
    "in view": "in_view",
    "right person": "follows_first",
    "kept up": "kept_up",
    "mean m": "distance_mean_m",
    "until arrival: in view": "in_view_until",
    "m away then": "away_then_m",
    "own contacts": "contacts_own",
    "other contacts": "contacts_other",
}  # fmt: skip


#: Columns that count runs or contacts.
COUNTS = (
    "runs", "success", "own contacts", "other contacts",
    "≥ .8 and ≤ 4 m then", "nearer than .1 m", "other followed first",
)  # fmt: skip


def row(cards: Sequence[dict[str, Any]]) -> dict[str, float]:
    """Return the figures of a table's row over the cards of some scenes."""
    told = {"runs": float(len(cards))}
    for title, key in COLUMNS.items():
        values = [card[key] for card in cards if card[key] is not None]
        told[title] = float(sum(values) if title in COUNTS else np.mean(values)) if values else math.nan
    told["≥ .8 and ≤ 4 m then"] = sum(card["in_view_until"] >= 0.8 and card["away_then_m"] <= 4.0 for card in cards)
    told["nearer than .1 m"] = sum((card["clearance_min_m"] or 0.0) < 0.1 for card in cards)
    told["other followed first"] = sum(card["first_followed"] != 0 for card in cards)
    return told


def table(groups: dict[str, Sequence[dict[str, Any]]]) -> list[str]:
    """Return a Markdown table with a row for each group of cards."""
    rows = {label: row(cards) for label, cards in groups.items()}
    titles = list(next(iter(rows.values())))
    lines = [f"| | {' | '.join(titles)} |", "|---" * (len(titles) + 1) + "|"]
    for label, told in rows.items():
        cells = (f"{value:.0f}" if title in COUNTS else f"{value:.2f}" for title, value in told.items())
        lines.append(f"| {label} | {' | '.join(cells)} |")
    return lines


def section(cards: dict[str, dict[str, dict[str, Any]]]) -> str:
    """Return what docs/benchmark.md says of these cards, by controller and scene."""
    by_kind: dict[str, list[str]] = {}
    for scene, card in next(iter(cards.values())).items():
        by_kind.setdefault(card["kind"], []).append(scene)
    lines = [HEADING, "", PROSE, "", *table({f"`{name}`": list(of.values()) for name, of in cards.items()}), ""]
    if "tracking" in cards:
        lines += [RELIABILITY, ""]
        parts = np.sum([card["believed"] for card in cards["tracking"].values()], axis=0)
        ends = [*PARTS[1:], 1.0]
        lines.append(f"| probability | {' | '.join(f'{a:g} … {b:g}' for a, b in zip(PARTS, ends, strict=True))} |")
        lines.append("|---" * (len(PARTS) + 1) + "|")
        lines.append(f"| boxes | {' | '.join(f'{count:,}' for count, _ in parts)} |")
        lines.append(f"| on the person | {' | '.join(f'{right / max(count, 1):.2f}' for count, right in parts)} |")
        lines.append("")
    lines.append(f"| kind | successes: {' | '.join(f'`{name}`' for name in cards)} | files | hash of the scenes |")
    lines.append("|---" * (len(cards) + 3) + "|")
    for kind, scenes in sorted(by_kind.items()):
        won = [f"{sum(of[scene]['success'] for scene in scenes)} of {len(scenes)}" for of in cards.values()]
        hashes = "".join(next(iter(cards.values()))[scene]["scenario_hash"] for scene in scenes)
        names = ", ".join(f"`{scene.removeprefix('Normal').removeprefix(kind)}`" for scene in scenes)
        lines.append(f"| {kind} | {' | '.join(won)} | {names} | `{fingerprint(hashes.encode())[:16]}` |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Play what is missing, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="of Follow-Bench's files")
    parser.add_argument("--controllers", nargs="+", default=["tracking"], help=f"ours, or {' or '.join(ORACLES)}")
    parser.add_argument("--match", default="*", help="only files whose name without .yaml is like this (%(default)s)")
    parser.add_argument("--seconds", type=float, default=SECONDS, help="of each run (%(default)s)")
    parser.add_argument("--workers", type=int, default=cores(), help="processes (%(default)s)")
    parser.add_argument("--json", type=Path, default=Path("out/follow_bench.jsonl"), help="a line a run (%(default)s)")
    parser.add_argument("--page", action="store_true", help=f"rewrite that part of docs/{PAGE.name}")
    args = parser.parse_args()
    paths = [path for path in args.folder.glob(f"{args.match}.yaml") if NAME.fullmatch(path.stem)]
    paths.sort(key=lambda path: (number_of(path), path.name))
    print(f"{len(paths)} files; those with numbers above {LAST} and of other following positions are left out")
    runs = [Play(path, controller, args.seconds) for controller in args.controllers for path in paths]
    args.json.parent.mkdir(parents=True, exist_ok=True)
    args.json.touch()
    known = {}
    for line in args.json.read_text(encoding="utf-8").splitlines():
        card = json.loads(line)
        if card["code_version"] == code_version():
            known[card["controller"], card["scenario"]] = card
    missing = [run for run in runs if (run.controller, run.path.stem) not in known]
    with args.json.open("a", encoding="utf-8") as file:
        for run, card in in_processes(play, missing, args.workers):
            known[run.controller, run.path.stem] = card
            file.write(json.dumps(card) + "\n")
            file.flush()
            print(run.controller, run.path.stem, *row([card]).values(), flush=True)
    cards = {name: {path.stem: known[name, path.stem] for path in paths} for name in args.controllers}
    for name, of in cards.items():
        kinds = {
            kind: [card for card in of.values() if card["kind"] == kind] for kind in {c["kind"]: 0 for c in of.values()}
        }
        print("\n".join([f"\n{name}", *table({**kinds, "**all**": list(of.values())})]))
    if args.page:
        before = PAGE.read_text(encoding="utf-8").partition(HEADING)[0].rstrip()
        with whole_file(PAGE) as part:
            part.write_text(f"{before}\n\n{section(cards)}", encoding="utf-8")


if __name__ == "__main__":
    main()
