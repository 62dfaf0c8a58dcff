"""`limo-hog score`: many seeds of scenarios and controllers on all cores, and their statistics."""

from __future__ import annotations

import argparse
import csv
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from rich import box
from rich.table import Table
from rich.text import Text

from limo_hog.atomic import about, whole_file
from limo_hog.cli.support import arguments
from limo_hog.cli.support.arguments import count, file_ending, seconds, seed
from limo_hog.cli.support.console import console
from limo_hog.cli.support.output import STDOUT, UsageError, write_json
from limo_hog.cli.support.progress import progress
from limo_hog.follow.control.naming import CONTROLLERS, detector_of
from limo_hog.named_detectors import detector_named
from limo_hog.parallel import cores

if TYPE_CHECKING:
    from limo_sim.run.score import ScoreCard
    from limo_sim.run.suite import Suite
    from limo_sim.run.sweep import Comparison, Estimate, Run, Summary

#: Those of `limo_sim.run.baselines`, which is not imported before it is needed.
_BASELINES = ("pursuit", "ppo")
#: Simulated time of a run that is not of a suite [s].
_SECONDS = 60.0
#: Figures of a card that are tables by name.
_NAMED = ("modes", "reasons", "critics")
#: Columns of the table: a figure of the score card, its heading, its unit, how it is written.
_COLUMNS = (
    ("success", "suc-\ncess", "%", ".0f"),
    ("in_view", "in\nview", "%", ".1f"),
    ("pixel_error_mean", "off\ncentre", "px", ".1f"),
    ("distance_rms_error_m", "dist.\nerror", "m", ".2f"),
    ("found_again", "found\nagain", "%", ".1f"),
    ("follows_first", "same\nperson", "%", ".1f"),
    ("clearance_min_m", "least\nclear", "m", ".2f"),
    ("contacts_person", "con-\ntacts", "", ".2g"),
    ("path_wrong_m", "path\nwrong", "m", ".2f"),
)


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `score`."""
    parser = subparsers.add_parser(
        "score",
        description="Play every scenario with every controller and several seeds, and compare: mean and 95 % "
        "interval of the score cards' figures.",
        epilog="What the figures mean, and what other benchmarks call them: "
        "https://github.com/limo-hog/limo-hog/blob/main/docs/metrics.md",
    )
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--scenario", nargs="+", metavar="NAME|FILE.toml", help="only these (all that come along)")
    which.add_argument("--suite", metavar="v1", help="the frozen scenarios of a benchmark, summed up by group")
    add = parser.add_argument
    named = "of approach, proxemic, tracking, pursuit, ppo and policy:FILE.npz (the first three)"
    add("--controller", nargs="+", type=_controller, metavar="NAME", default=CONTROLLERS, help=f"only these, {named}")
    arguments.add_robot(parser)
    add("--against", metavar="NAME", help="compare the others with this controller, run by run")
    add("--seeds", type=count, default=20, metavar="N", help="how many of each (%(default)s)")
    add("--seed-start", type=seed, default=0, metavar="N", help="the first of the seeds (%(default)s)")
    add("--seconds", type=seconds, metavar="S", help=f"simulated time of a run ({_SECONDS:g})")
    arguments.add_target_and_detector(parser)
    add("--workers", type=count, metavar="N", help="processes (one for each core)")
    arguments.add_json(parser, "every score card and the summary as JSON")
    lines = "write the score cards' figures, a line for each run"
    add("--csv", type=file_ending(".csv"), metavar="FILE.csv", help=lines)
    add("--plot", type=file_ending(".png", ".svg", ".pdf"), metavar="FILE.png", help="draw the comparison")


def _controller(text: str) -> str:
    if text not in CONTROLLERS and text not in _BASELINES and not text.startswith("policy:"):
        known = ", ".join((*CONTROLLERS, *_BASELINES))
        raise argparse.ArgumentTypeError(f"{text!r} is no controller; wanted is one of {known}, policy:FILE.npz")
    return text


def run(args: argparse.Namespace) -> int:
    """Play all runs, show the table, and write what was asked for."""
    from limo_sim.run.suite import Suite
    from limo_sim.run.sweep import WorkerError, compare, in_processes, play, summarise

    if args.plot:
        # A missing library is named before the work, not after.
        from limo_sim.view.sweep_plot import plot
    suite = Suite.load(args.suite) if args.suite else None
    runs = _runs(args, suite)
    card_of = {}
    failure: WorkerError | KeyboardInterrupt | None = None
    with progress("runs") as bar:
        task = bar.add_task("playing", total=len(runs))
        try:
            for played, card in in_processes(play, runs, args.workers or cores()):
                card_of[played] = card
                bar.advance(task)
        except (WorkerError, KeyboardInterrupt) as error:
            # The finished runs are kept.
            if not card_of:
                raise
            failure = error
    cards = [card_of[run] for run in runs if run in card_of]
    groups = None if suite is None else suite.groups
    summaries = summarise(cards)
    of_groups = [] if groups is None else [*summarise(cards, groups), *summarise(cards, dict.fromkeys(groups, "all"))]
    comparisons = []
    if args.against:
        comparisons = compare(cards, args.against, groups)
        comparisons += compare(cards, args.against, {card.scenario: "all" for card in cards})
    if args.json:
        tables: dict[str, Sequence[Summary | Comparison]]
        tables = {"summary": summaries, "groups": of_groups, "comparison": comparisons}
        result = {name: [asdict(row) for row in rows] for name, rows in tables.items()}
        write_json(args.json, {"runs": [card.to_json() for card in cards], **result})
    if args.csv:
        _write_csv(args.csv, cards)
    if args.plot:
        plot(of_groups or summaries, args.plot)
    if args.json != STDOUT:
        _show(of_groups or summaries, comparisons, f"{args.seeds} seeds of {runs[0].seconds:g} s")
    if failure is not None:
        raise failure
    return 0


def _runs(args: argparse.Namespace, suite: Suite | None) -> list[Run]:
    """Return the runs that are asked for; what is wrong with a name is told here, before the work."""
    from limo_sim.run.baselines import controller_of
    from limo_sim.run.sweep import Run
    from limo_sim.world.scenario import Scenario

    if suite is not None and args.seconds is not None:
        raise UsageError(f"--seconds and --suite {suite.name}: a run of this suite takes {suite.seconds:g} s")
    if args.against and args.against not in args.controller:
        known = ", ".join(args.controller)
        raise UsageError(f"--against {args.against}: is none of the controllers, want one of {known}")
    frozen = [] if suite is None else [str(suite.path(entry)) for entry in suite.scenarios]
    scenarios = frozen or args.scenario or Scenario.names()
    # The table and the score cards know a scenario by the name it gives itself.
    called: dict[str, str] = {}
    for name in scenarios:
        title = Scenario.load(name, args.robot).name
        if title in called:
            raise UsageError(f"{name}: is called {title!r}, as {called[title]} is; give it another name")
        called[title] = name
    for name in args.controller:
        detector_named(args.detector or detector_of(name))
        controller_of(name, args.target)
    duration = suite.seconds if suite is not None else args.seconds or _SECONDS
    return [
        Run(scenario, controller, args.detector or detector_of(controller), number, duration, args.target, args.robot)
        for scenario in scenarios
        for controller in args.controller
        for number in range(args.seed_start, args.seed_start + args.seeds)
    ]


def _write_csv(path: Path, cards: Sequence[ScoreCard]) -> None:
    """Write one line for each card; what has no fixed names, `_NAMED`, is left out."""
    rows = [{name: value for name, value in card.to_json().items() if name not in _NAMED} for card in cards]
    with whole_file(path) as part, about(path), part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, rows[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def _show(summaries: Sequence[Summary], comparisons: Sequence[Comparison], runs: str) -> None:
    """Print both tables on standard output; `runs` says how many there were of each."""
    screen = console()
    rows = [(summary.scenario, summary.controller, summary.measures) for summary in summaries]
    screen.print(_table(rows, f"mean and, below, half the 95 % interval over {runs}"))
    if comparisons:
        rows = [(comparison.scenario, comparison.controller, comparison.differences) for comparison in comparisons]
        words = f"minus {comparisons[0].against}, run by run; bold: the interval leaves out 0"
        screen.print(_table(rows, words, "+"))


def _table(rows: Sequence[tuple[str, str, dict[str, Estimate | None]]], caption: str, sign: str = "") -> Table:
    """Lay figures out; `sign` is "+" for differences."""
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), caption=caption, caption_justify="left")
    table.add_column("\n", no_wrap=True)
    for _, heading, unit, _ in _COLUMNS:
        table.add_column(f"{heading}\n[dim]{unit}[/]", justify="right", no_wrap=True)
    before = ""
    for scenario, controller, measures in rows:
        if scenario != before:
            table.add_section()
            table.add_row(Text(scenario, style="bold"))
        cells = (_cell(measures[name], name, unit, sign + style) for name, _, unit, style in _COLUMNS)
        table.add_row(Text(f"  {controller}"), *cells)
        before = scenario
    return table


def _cell(estimate: Estimate | None, name: str, unit: str, style: str) -> str:
    if estimate is None:
        return "[dim]–[/]"
    mean, interval = estimate.written(name, 100 if unit == "%" else 1, style)
    text = f"{mean}\n[dim]{interval.replace(' ', '')}[/]" if interval else mean
    return f"[bold]{text}[/]" if style.startswith("+") and estimate.is_sure else text
