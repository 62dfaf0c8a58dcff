"""`limo-hog evaluate`: how good detectors are on labelled pictures."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from limo_hog.cli.support.arguments import MODEL, add_json, add_labels, least_height, score
from limo_hog.cli.support.output import STDOUT, warnings_in_one_line, write_json

if TYPE_CHECKING:
    from limo_hog.learn.evaluation.run import Evaluation, Rival


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `evaluate`."""
    parser = subparsers.add_parser(
        "evaluate",
        description="Measure a detector on labelled pictures: log-average miss rate, recall, average precision, time; "
        "with intervals, and against others on the same pictures.",
    )
    parser.add_argument("model", metavar="MODEL", help=MODEL)
    parser.add_argument(
        "data",
        type=Path,
        metavar="DATA",
        help="labels: a folder of VOC XML or YOLO text files, a COCO JSON, CVAT XML or imglab XML file, or boxes.json",
    )
    parser.add_argument("--against", nargs="+", default=[], metavar="MODEL", help="other detectors, for comparison")
    add_labels(parser)
    parser.add_argument(
        "--min-height",
        type=least_height,
        nargs="+",
        metavar="PX",
        help="height of the smallest person sought, or `none` for pictures as they are; several are compared",
    )
    parser.add_argument("--least-score", type=score, default=-1.2, metavar="T", help="lowest score counted (-1.2)")
    parser.add_argument(
        "--first-look", action="store_true", help="also measure without the second look; --report does so by itself"
    )
    parser.add_argument("--report", type=Path, metavar="DIR", help="write a page with the curve and the worst mistakes")
    add_json(parser, "the figures as JSON")


def run(args: argparse.Namespace) -> int:
    """Measure, print a table and, if asked, write JSON and a page."""
    from limo_hog.cli.support.progress import progress
    from limo_hog.learn.evaluation.run import as_json, evaluate, few
    from limo_hog.learn.formats import read_labels
    from limo_hog.learn.labels import choose

    if args.report:
        # What it lacks is said before the work, not after.
        from limo_hog.learn.evaluation.report import write_report
    rivals = _rivals(args)
    with warnings_in_one_line():
        pictures = choose(read_labels(args.data, args.pictures), args.label)
        with progress("pictures") as bar:
            task = bar.add_task("evaluating", total=len(pictures))
            used, evaluations = evaluate(rivals, pictures, done=lambda: bar.advance(task))
    if args.json:
        write_json(args.json, as_json(used, evaluations))
    if args.json != STDOUT:
        objects = sum(not box.ignored for picture in used for box in picture.boxes)
        _print(f"{len(used)} pictures with {objects} objects", evaluations)
        if warning := few(objects):
            print(warning)
    if args.report:
        page = write_report(args.report, used, evaluations)
        if args.json != STDOUT:
            print(page)
    return 0


def _rivals(args: argparse.Namespace) -> list[Rival]:
    """Make every model at every height."""
    from dataclasses import replace

    from limo_hog.detector import PeopleDetector
    from limo_hog.learn.evaluation.run import Rival
    from limo_hog.models import load_model

    rivals = []
    for model in dict.fromkeys([args.model, *args.against]):
        for height in args.min_height or ["default"]:
            detector = PeopleDetector(model=model)
            name = model
            if height != "default":
                detector = replace(detector, min_height=height)
                name = f"{model} {'as is' if height is None else f'{height:g} px'}"
            stages = {name: detector}
            if (args.first_look or args.report) and load_model(model).second_look is not None:
                stages[f"{name}, first look"] = replace(detector, second_look=False)
            rivals += [Rival(name, replace(one, threshold=args.least_score), one) for name, one in stages.items()]
    return rivals


def _print(title: str, evaluations: list[Evaluation]) -> None:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    from limo_hog.cli.support.console import console
    from limo_hog.learn.evaluation.run import CONFIDENCE, compare

    table = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left")
    for column in ("model", "LAMR", f"{CONFIDENCE:.0%}", "R at .1", "R at 1", "AP", "T at .1", "ms"):
        table.add_column(column, justify="left" if column == "model" else "right")
    for evaluation in evaluations:
        low, high = evaluation.intervals["lamr"]
        figures = (f"{value:.3f}" for value in evaluation.figures[1:])
        table.add_row(
            Text(evaluation.name),
            f"{evaluation.figures.lamr:.3f}",
            f"{low:.2f}..{high:.2f}",
            *figures,
            f"{evaluation.threshold_01:.2f}",
            f"{evaluation.ms:.1f}",
        )
    screen = console()
    screen.print(table)
    for other in evaluations[1:]:
        lamr = compare(evaluations[0], other)[0]
        low, high = lamr.interval
        sure = "" if low <= 0 <= high else ", unlikely to be chance"
        names = f"{evaluations[0].name} minus {other.name}"
        screen.print(
            f"LAMR of {names}: {lamr.difference:+.3f} ({low:+.3f} to {high:+.3f}){sure}", soft_wrap=True, markup=False
        )
