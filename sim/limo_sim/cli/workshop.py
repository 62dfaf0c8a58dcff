"""`limo-hog workshop`: the template to begin with, the checker, and the model solutions."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from limo_hog.cli.support.output import STDOUT, UsageError
from limo_hog.exceptions import LimoHogError
from limo_hog.extras import needed

if TYPE_CHECKING:
    from limo_sim.workshop.check import Verdict


class CheckpointError(LimoHogError):
    """A checkpoint of the workshop does not hold."""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `workshop`."""
    parser = subparsers.add_parser(
        "workshop",
        description="Write a ROS 2 node that finds a person and follows them, task by task. The tasks are at "
        "https://github.com/limo-hog/limo-hog/blob/main/docs/workshop/README.md",
    )
    actions = parser.add_subparsers(dest="action", metavar="new|check|solution", required=True)
    for action, words in (
        ("new", "write the template to begin with"),
        ("check", "run a node and show which checkpoints hold"),
        ("solution", "write the model solution; - is standard output"),
    ):
        one = actions.add_parser(action, help=words, description=words.capitalize() + ".")
        one.add_argument(
            "file", metavar="FILE.py", type=Path, nargs=None if action == "check" else "?", help="the node"
        )
        one.add_argument("--sequel", action="store_true", help="the second part: keep a distance")


def run(args: argparse.Namespace) -> int:
    """Do one of the three."""
    from limo_sim.workshop import solution, template

    node = "proxemic" if args.sequel else "follower"
    if args.action == "check":
        with needed(by="limo-hog workshop", what="rosbags", install="'limo-hog[record]'"):
            from limo_sim.workshop.check import check
        verdicts = check(args.file, node)
        _show(verdicts)
        failed = [verdict for verdict in verdicts if verdict.holds is False]
        if failed:
            raise CheckpointError(f"{args.file}: {len(failed)} of {len(verdicts)} checkpoints do not hold")
        return 0
    text = template(node) if args.action == "new" else solution(node)
    suffix = "" if args.action == "new" else "_solution"
    path = args.file or Path(f"{node}{suffix}.py")
    if str(path) == STDOUT:
        sys.stdout.write(text)
        return 0
    if path.exists():
        raise UsageError(f"{path} is there already; give another name")
    path.write_text(text, encoding="utf-8")
    print(f"{path} is written; try it: limo-hog run {path}", file=sys.stderr)
    return 0


def _show(verdicts: list[Verdict]) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    marks = {True: Text("✓", style="green"), False: Text("✗", style="bold red"), None: Text("–", style="dim")}
    table = Table(box=None, show_header=False, padding=(0, 1))
    table.add_column(no_wrap=True)
    table.add_column(style="dim", no_wrap=True)
    table.add_column()
    table.add_column(style="dim", overflow="fold")
    for verdict in verdicts:
        evidence = Text(verdict.evidence, style="" if verdict.holds is False else "dim")
        table.add_row(marks[verdict.holds], f"task {verdict.task}", verdict.checkpoint, evidence)
    Console(highlight=False).print(table)
