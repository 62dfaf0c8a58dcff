"""How well the follower does in hard scenes, a line a kind: `uv run python benches/follower.py --seeds 100:110`.

The kinds are the TOML files in `benches/follower/` and the scenarios that come with limo-sim; people differ from seed
to seed as each file's `[vary]` says. One process. `--cards` keeps every run's figures, so that a table can be made
of several calls.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import itertools
import json
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from unittest import mock

import cv2
import numpy as np

import limo_hog
from limo_hog.follow import controller_named, detector_named
from limo_hog.follow.control.naming import detector_of
from limo_hog.follow.safety import Guard
from limo_sim.run.episode import run_episode, score
from limo_sim.run.log import Step
from limo_sim.run.matching import CRITERIA
from limo_sim.run.score import Scorer
from limo_sim.world.scenario import Scenario
from limo_sim.world.variants import of_run

FOLDER = Path(__file__).with_name("follower")
KINDS = {path.stem: path for path in sorted(FOLDER.glob("*.toml"))}
#: A lost person counts as found again within this time [s]: issue 18, line 3.
FOUND_WITHIN_S = 8.0
#: A contact is the robot's fault if it drove at the person faster than this [m/s]. Chosen: above the wheels' noise.
OWN_SPEED = 0.03


def play(kind: str, controller: str, seed: int, seconds: float, target: float | None) -> dict[str, Any]:
    """Play one run and return its figures."""
    name = KINDS.get(kind, kind)
    scenario = dataclasses.replace(of_run(Scenario.load(name), seed), name=kind)
    steps: list[Step] = []
    with timed() as spent:
        episode = run_episode(
            scenario,
            controller_named(controller, target),
            detector_named(detector_of(controller)),
            seconds,
            seed,
            names=(controller, detector_of(controller)),
            watch=lambda step: steps.append(step.bare()),
        )
    scorer = Scorer(episode.scenario, dataclasses.replace(CRITERIA, found_within_s=FOUND_WITHIN_S))
    for step in steps:
        scorer.add(step)
    card = score(dataclasses.replace(episode, scorer=scorer)).to_json()
    own, pushed = contacts_by(steps)
    people = [person for step in steps for person in step.truth.people if person]
    return card | {
        "kind": kind,
        "starts": card["path_m"] > 0.1,
        "nearest_m": min((person.distance for person in people), default=None),
        "contacts_own": own,
        "contacts_other": pushed,
        "follower_ms": float(np.median(spent)),
        "follower_ms_p95": float(np.percentile(spent, 95)),
    }


@contextlib.contextmanager
def timed() -> Iterator[list[float]]:
    """Time what a frame costs without its detection, controller and `Guard` together [ms], inside of the block."""
    spent: list[float] = []
    plain = Guard.step

    def step(guard: Any, observation: Any, state: Any) -> Any:
        began = time.thread_time()
        decision = plain(guard, observation, state)
        spent.append(1e3 * (time.thread_time() - began))
        return decision

    with mock.patch.object(Guard, "step", step):
        yield spent


def contacts_by(steps: Sequence[Step]) -> tuple[int, int]:
    """Return how many contacts with people began while the robot drove at the person, and how many while it did not."""
    own = other = 0
    for before, after in itertools.pairwise(steps):
        if after.truth.contacts.person == before.truth.contacts.person:
            continue
        (x0, y0, _), (x1, y1, _) = before.truth.robot, after.truth.robot
        near = min((person for person in after.truth.people if person), key=lambda one: one.distance)
        dt = max(after.log.time - before.log.time, 1e-3)
        towards = ((x1 - x0) * (near.x - x0) + (y1 - y0) * (near.y - y0)) / dt / max(near.distance, 1e-3)
        if towards > OWN_SPEED:
            own += 1
        else:
            other += 1
    return own, other


COLUMNS = {
    "starts": "starts", "success": "success", "in view": "in_view", "detected": "detected", "px": "pixel_error_mean",
    "rms m": "distance_rms_error_m", "again": "found_again", "same": "follows_first", "nearest": "nearest_m",
    "clear": "clearance_min_m", "own": "contacts_own", "pushed": "contacts_other", "walls": "contacts_wall",
    "nobody m": "path_wrong_m", "first s": "first_detection_s", "ms": "follower_ms",
}  # fmt: skip
_LEAST, _SUM, _MOST = {"nearest", "clear"}, {"own", "pushed", "walls"}, {"nobody m"}


def line(cards: list[dict[str, Any]]) -> list[str]:
    """Return the figures of one kind: means, but for least distances, sums of contacts and the longest wrong way."""
    cells = []
    for title, key in COLUMNS.items():
        values = [float(card[key]) for card in cards if card[key] is not None]
        if not values:
            cells.append("–")
            continue
        of = min if title in _LEAST else sum if title in _SUM else max if title in _MOST else np.mean
        cells.append(f"{of(values):.{0 if title in _SUM else 1 if title == 'px' else 2}f}")
    return cells


def table(cards: list[dict[str, Any]]) -> str:
    """Return a Markdown table, a line for each kind and controller."""
    groups: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for card in cards:
        groups.setdefault((card["kind"], card["controller"]), []).append(card)
    rows = [["kind", "controller", "runs", *COLUMNS], ["---"] * (len(COLUMNS) + 3)]
    rows += [[kind, controller, str(len(group)), *line(group)] for (kind, controller), group in groups.items()]
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def main() -> None:
    """Play the kinds asked for and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kinds", nargs="*", default=[*KINDS], help=f"of {', '.join((*KINDS, *Scenario.names()))}")
    parser.add_argument("--seeds", default="0:3", help="first:end")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--controller", nargs="*", default=["tracking"])
    parser.add_argument("--target", type=float)
    parser.add_argument("--cards", type=Path, help="append every run's figures to this file of JSON lines")
    parser.add_argument("--only-table", type=Path, nargs="*", help="make the table of such files")
    args = parser.parse_args()
    if args.only_table:
        lines = [text for path in args.only_table for text in path.read_text(encoding="utf-8").splitlines()]
        print(table([json.loads(text) for text in lines]))
        return
    limo_hog.set_num_threads(1)
    cv2.setNumThreads(1)
    first, end = map(int, args.seeds.split(":"))
    cards = []
    for kind in args.kinds:
        for controller in args.controller:
            for seed in range(first, end):
                card = play(kind, controller, seed, args.seconds, args.target)
                cards.append(card)
                print(kind, controller, seed, *line([card]), flush=True)
                if args.cards:
                    with args.cards.open("a", encoding="utf-8") as file:
                        file.write(json.dumps(card) + "\n")
    print(table(cards))


if __name__ == "__main__":
    main()
