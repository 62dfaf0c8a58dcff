"""Plays a suite with every baseline, and rewrites docs/benchmark.md with its plot.

    uv run python benches/benchmark.py --seeds 10

The cards are kept in a file as they come, so that a run that was stopped goes on where it was. Cards of other code are
played again; with `--controllers tracking` those of this controller alone: the rows of the others stay, and the page
says which code played them.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from limo_hog.atomic import whole_file
from limo_hog.cli.support.progress import progress
from limo_hog.follow.control.naming import detector_of
from limo_hog.parallel import cores
from limo_sim.run.provenance import code_version
from limo_sim.run.score import ScoreCard
from limo_sim.run.suite import Suite
from limo_sim.run.sweep import Comparison, Estimate, Run, Summary, compare, in_processes, play, summarise
from limo_sim.view.sweep_plot import plot

DOCS = Path(__file__).parents[1] / "docs"
#: The part of the page that `follow_bench` writes begins so.
OTHER = "## Follow-Bench"
BASELINES = ("approach", "proxemic", "pursuit", "ppo", "tracking")
#: Figures of the page: name, heading, factor, style.
FIGURES = (
    ("success", "success [%]", 100, ".0f"),
    ("in_view", "in view [%]", 100, ".0f"),
    ("distance_rms_error_m", "distance error [m]", 1, ".2f"),
    ("time_to_find_again_s", "time to find again [s]", 1, ".1f"),
    ("identity_switches", "identity switches", 1, ".1f"),
    ("clearance_min_m", "least clearance [m]", 1, ".2f"),
    ("intrusion_intimate", "intimate [%]", 100, ".1f"),
    ("intrusion_personal", "personal [%]", 100, ".1f"),
    ("contacts_person", "contacts", 1, ".2f"),
    ("jerk_mean", "jerk [m/s³]", 1, ".1f"),
)


def main() -> None:
    """Play what is missing, then write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--suite", default="v1", choices=Suite.names(), help="which (%(default)s)")
    parser.add_argument("--seeds", type=int, default=10, help="how many of each (%(default)s)")
    parser.add_argument("--controllers", nargs="+", choices=BASELINES, default=BASELINES, help="play only these")
    parser.add_argument("--cards", type=Path, default=Path("out/benchmark.jsonl"), help="kept cards (%(default)s)")
    parser.add_argument("--workers", type=int, default=cores(), help="processes (%(default)s)")
    args = parser.parse_args()
    suite = Suite.load(args.suite)
    known = kept(args.cards)
    runs = {
        controller: [
            Run(str(suite.path(entry)), controller, detector_of(controller), seed, suite.seconds)
            for seed in range(args.seeds)
            for entry in suite.scenarios
        ]
        for controller in BASELINES
    }
    wanted = [run for controller in args.controllers for run in runs[controller]]
    missing = [run for run in wanted if key(run) not in known or known[key(run)].code_version != code_version()]
    began = time.monotonic()
    args.cards.parent.mkdir(parents=True, exist_ok=True)
    with args.cards.open("a", encoding="utf-8") as file, progress("runs") as bar:
        task = bar.add_task("playing", total=len(missing))
        for run, card in in_processes(play, missing, args.workers):
            known[key(run)] = card
            file.write(json.dumps(card.to_json(), allow_nan=False) + "\n")
            file.flush()
            bar.advance(task)
    print(f"{len(missing)} runs in {time.monotonic() - began:.0f} s with {args.workers} workers")
    cards: list[ScoreCard] = []
    for controller, of in runs.items():
        found = [known[key(run)] for run in of if key(run) in known]
        if len(found) == len(of):
            cards += found
        else:
            print(f"{controller}: {len(found)} of {len(of)} cards; its row is left out")
    write_page(suite, cards, args)


def key(run: Run) -> tuple[str, str, int]:
    """Return what tells the runs of one suite apart."""
    return Path(run.scenario).stem, run.controller, run.seed


def kept(path: Path) -> dict[tuple[str, str, int], ScoreCard]:
    """Return the newest card of every run in a file."""
    if not path.exists():
        return {}
    cards = [ScoreCard(**json.loads(line)) for line in path.read_text(encoding="utf-8").splitlines()]
    return {(card.scenario, card.controller, card.seed): card for card in cards}


def played_by(cards: Sequence[ScoreCard]) -> str:
    """Return which code played which controllers."""
    controllers: dict[str, list[str]] = {}
    for card in cards:
        of = controllers.setdefault(card.code_version, [])
        if f"`{card.controller}`" not in of:
            of.append(f"`{card.controller}`")
    if len(controllers) == 1:
        return f"Code: {next(iter(controllers))}."
    return "Code: " + "; ".join(f"{', '.join(names)}: {code}" for code, names in controllers.items()) + "."


def write_page(suite: Suite, cards: Sequence[ScoreCard], args: argparse.Namespace) -> None:
    """Replace docs/benchmark.md and its plot."""
    groups = suite.groups
    overall = summarise(cards, dict.fromkeys(groups, "all"))
    by_group = summarise(cards, groups)
    each = summarise(cards)
    picture = DOCS / "images" / "benchmark.png"
    plot([*by_group, *overall], picture)
    lines = [
        f"# Benchmark {suite.name}",
        "",
        f"{suite.summary} Written by `python benches/benchmark.py --seeds {args.seeds}`; "
        "[metrics.md](metrics.md) defines every figure and gives the names other benchmarks have for it.",
        "",
        "```",
        f"limo-hog score --suite {suite.name} --seeds {args.seeds} "
        "--controller approach proxemic pursuit ppo tracking --against tracking",
        "```",
        "",
        f"{shown_for(args.seeds)} Means over {len(groups)} scenarios of {suite.seconds:g} s; detector `hog`; "
        "least clearance: the worst run.",
        "",
        *table(overall),
        "",
        f"![The baselines by group](images/{picture.name})",
        "",
        "## By group",
        "",
    ]
    rows = [summary for group in dict.fromkeys(groups.values()) for summary in by_group if summary.scenario == group]
    lines += [
        *table(rows, "group"),
        "",
        "## Against `tracking`, run by run",
        "",
        *(["Bold: the interval leaves out 0.", ""] if args.seeds > 1 else []),
        *differences(compare(cards, "tracking", dict.fromkeys(groups, "all"))),
    ]
    lines += [
        "",
        "## Success by scenario",
        "",
        f"{played_by(cards)} The files of the suite are in `sim/limo_sim/suites/{suite.name}`; "
        f"`limo-hog score --suite {suite.name}` refuses them if one was changed.",
        "",
        *successes(suite, each),
    ]
    page = DOCS / "benchmark.md"
    old = page.read_text(encoding="utf-8")
    other = [old[old.index(OTHER) :]] if OTHER in old else []
    with whole_file(page) as part:
        part.write_text("\n".join([*lines, "", *other]), encoding="utf-8")


def shown_for(seeds: int) -> str:
    """Return what the tables show of so many seeds."""
    if seeds == 1:
        return "One seed, and therefore no intervals: small differences may be chance."
    return f"Mean ± half of the 95 % interval over {seeds} seeds."


def table(summaries: Sequence[Summary], of: str = "") -> list[str]:
    """Return a markdown table, a controller a line; before it a column `of` that names the scenarios."""
    heads = [*filter(None, [of]), "controller", *(heading for _, heading, _, _ in FIGURES)]
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for one in summaries:
        cells = [cell(one.measures[name], name, factor, style) for name, _, factor, style in FIGURES]
        lines.append(f"| {one.scenario + ' | ' if of else ''}`{one.controller}` | " + " | ".join(cells) + " |")
    return lines


def cell(estimate: Estimate | None, name: str, factor: int, style: str) -> str:
    """Return a mean with its interval; of the clearance, the least."""
    return "–" if estimate is None else " ".join(estimate.written(name, factor, style)).rstrip()


def successes(suite: Suite, summaries: Sequence[Summary]) -> list[str]:
    """Return a markdown table of the scenarios: what happens, the file, and how many runs succeeded."""
    from limo_sim.world.scenario import Scenario

    controllers = list(dict.fromkeys(one.controller for one in summaries))
    of: dict[tuple[str, str], Any] = {(one.scenario, one.controller): one for one in summaries}
    heads = ["group", "scenario", "what happens", "SHA-256 of the file", *(f"`{name}`" for name in controllers)]
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for entry in suite.scenarios:
        cells = []
        for controller in controllers:
            one = of[entry.name, controller]
            success = one.measures["success"]
            cells.append("–" if success is None else f"{round(success.mean * one.runs)} of {one.runs}")
        about = f"{Scenario.load(suite.path(entry)).summary} | `{entry.sha256[:16]}`"
        lines.append(f"| {entry.group} | `{entry.name}` | {about} | " + " | ".join(cells) + " |")
    return lines


def differences(comparisons: Sequence[Comparison]) -> list[str]:
    """Return a markdown table of the differences to one controller."""
    shown = [figure for figure in FIGURES if figure[0] != "clearance_min_m"]
    lines = ["| controller | " + " | ".join(heading for _, heading, _, _ in shown) + " |"]
    lines.append("|---" * (len(shown) + 1) + "|")
    for one in comparisons:
        cells = []
        for name, _, factor, style in shown:
            difference = one.differences[name]
            text = cell(difference, name, factor, f"+{style}")
            cells.append(f"**{text}**" if difference is not None and difference.is_sure else text)
        lines.append(f"| `{one.controller}` | " + " | ".join(cells) + " |")
    return lines


if __name__ == "__main__":
    main()
