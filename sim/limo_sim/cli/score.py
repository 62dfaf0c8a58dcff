"""`limo-hog score`: many seeds of scenarios and controllers on all cores, and their statistics."""

from __future__ import annotations

import argparse
import csv
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from rich import box
from rich.console import Console
from rich.table import Table

from limo_hog.atomic import about, whole_file
from limo_hog.cli.support.arguments import count, file_ending, metres, output_file, seconds, seed
from limo_hog.cli.support.environment import cores
from limo_hog.cli.support.output import STDOUT, write_json
from limo_hog.cli.support.progress import progress
from limo_hog.follow.control.naming import CONTROLLERS, controller_named
from limo_hog.follow.sense.detectors import NAMES, detector_named

if TYPE_CHECKING:
    from limo_sim.run.score import ScoreCard
    from limo_sim.run.sweep import Estimate, Summary

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
    )
    parser.add_argument("--scenario", nargs="+", metavar="NAME|FILE.toml", help="only these (all that come along)")
    parser.add_argument("--controller", nargs="+", choices=CONTROLLERS, default=CONTROLLERS, help="only these (all)")
    parser.add_argument("--seeds", type=count, default=20, metavar="N", help="how many of each (%(default)s)")
    parser.add_argument("--seed-start", type=seed, default=0, metavar="N", help="the first of the seeds (%(default)s)")
    parser.add_argument("--seconds", type=seconds, default=60.0, metavar="S", help="simulated time of a run (60)")
    parser.add_argument("--target", type=metres, metavar="M", help="distance to hold [m], not for approach (1.5)")
    parser.add_argument(
        "--detector",
        default="hog",
        metavar="|".join((*NAMES, "hog:MODEL", "onnx:FILE")),
        help="the people detector (%(default)s)",
    )
    parser.add_argument("--workers", type=count, metavar="N", help="processes (one for each core)")
    parser.add_argument(
        "--json", type=output_file, metavar="FILE", help="write every score card and the summary; - is standard output"
    )
    parser.add_argument(
        "--csv",
        type=file_ending(".csv"),
        metavar="FILE.csv",
        help="write the score cards' figures, a line for each run",
    )
    parser.add_argument(
        "--plot", type=file_ending(".png", ".svg", ".pdf"), metavar="FILE.png", help="draw the comparison"
    )


def run(args: argparse.Namespace) -> int:
    """Play all runs, show the table, and write what was asked for."""
    from limo_sim.run.catalogue import load
    from limo_sim.run.sweep import Run, play_all, summarise
    from limo_sim.world.scenario import Scenario

    if args.plot:
        # A missing library is named before the work, not after.
        from limo_sim.view.sweep_plot import plot
    scenarios = args.scenario or Scenario.names()
    # What is wrong with a name is told before the work, too.
    for name in scenarios:
        load(name)
    detector_named(args.detector)
    for name in args.controller:
        controller_named(name, args.target)
    runs = [
        Run(scenario, controller, args.detector, number, args.seconds, args.target)
        for scenario in scenarios
        for controller in args.controller
        for number in range(args.seed_start, args.seed_start + args.seeds)
    ]
    card_of = {}
    with progress("runs") as bar:
        task = bar.add_task("playing", total=len(runs))
        for played, card in play_all(runs, args.workers or cores()):
            card_of[played] = card
            bar.advance(task)
    cards = [card_of[run] for run in runs]
    summaries = summarise(cards)
    if args.json:
        result = {"runs": [card.to_json() for card in cards], "summary": [asdict(one) for one in summaries]}
        write_json(args.json, result)
    if args.csv:
        _write_csv(args.csv, cards)
    if args.plot:
        plot(summaries, args.plot)
    if args.json != STDOUT:
        Console(highlight=False).print(_table(summaries, args.seconds))
    return 0


def _write_csv(path: Path, cards: Sequence[ScoreCard]) -> None:
    """Write one line for each card; shares of modes and reasons, which have no fixed names, are left out."""
    rows = [
        {name: value for name, value in card.to_json().items() if name not in ("modes", "reasons")} for card in cards
    ]
    with whole_file(path) as part, about(path), part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, rows[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def _table(summaries: Sequence[Summary], duration: float) -> Table:
    table = Table(
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
        caption=f"mean and, below, half the 95 % interval over {summaries[0].runs} seeds of {duration:g} s",
        caption_justify="left",
    )
    table.add_column("\n", no_wrap=True)
    for _, heading, unit, _ in _COLUMNS:
        table.add_column(f"{heading}\n[dim]{unit}[/]", justify="right", no_wrap=True)
    before = ""
    for one in summaries:
        if one.scenario != before:
            table.add_section()
            table.add_row(f"[bold]{one.scenario}[/]")
        cells = [_cell(one.measures[name], name, unit, style) for name, _, unit, style in _COLUMNS]
        table.add_row(f"  {one.controller}", *cells)
        before = one.scenario
    return table


def _cell(estimate: Estimate | None, name: str, unit: str, style: str) -> str:
    if estimate is None:
        return "[dim]–[/]"
    factor = 100 if unit == "%" else 1
    if name == "clearance_min_m":
        # What counts is the worst run, which has no interval.
        return format(estimate.least, style)
    mean = format(factor * estimate.mean, style)
    if estimate.interval is None:
        return mean
    return f"{mean}\n[dim]±{format(factor * estimate.interval, style)}[/]"
