"""`limo-hog workshop`: the template to begin with, the checker, and the model solutions."""

from __future__ import annotations

import argparse
import itertools
import os
import shlex
import sys
from collections.abc import Callable
from contextlib import ExitStack, closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from limo_hog.atomic import part_of, whole_file, write_text
from limo_hog.cli.support.arguments import add_json, count, output_file, seconds
from limo_hog.cli.support.console import console
from limo_hog.cli.support.output import STDOUT, UsageError, write_json
from limo_hog.cli.support.progress import progress
from limo_hog.exceptions import LimoHogError
from limo_hog.extras import needed
from limo_hog.parallel import cores

if TYPE_CHECKING:
    from limo_sim.workshop.check import Verdict
    from limo_sim.workshop.grade import Grade, Table


#: What `check` prints is no wider [columns].
WIDTH = 80
#: More checkpoints in a row that were not tried are told in one line.
_FOLDED = 2


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `workshop`."""
    parser = subparsers.add_parser(
        "workshop",
        description="Write a ROS 2 node that finds a person and follows them, task by task. The tasks are at "
        "https://github.com/limo-hog/limo-hog/blob/main/docs/workshop/README.md",
    )
    actions = parser.add_subparsers(dest="action", metavar="new|check|solution|grade", required=True)
    for action, words in (
        ("new", "write the template to begin with"),
        ("check", "run a node and show which checkpoints hold"),
        ("solution", "write the model solution; - is standard output"),
    ):
        one = actions.add_parser(action, help=words, description=words.capitalize() + ".")
        add = one.add_argument
        add("file", metavar="FILE.py", type=Path, nargs=None if action == "check" else "?", help="the node")
        if action == "check":
            hints = "show N hints for the first checkpoint that does not hold (1)"
            add("--hint", nargs="?", type=count, const=1, default=0, metavar="N", help=hints)
            add_json(one, "points and evidence as JSON")
            add("--html", metavar="FILE", help="write a report with the node's pictures as one page")
            _add_exercise(one)
            results = "write results.json for a Gradescope autograder"
            add("--gradescope", type=output_file, metavar="FILE", help=results)
        else:
            add("--sequel", action="store_true", help="the second part: keep a distance")
    words = "check every node in a folder, each in a process of its own, and write a table of points"
    one = actions.add_parser("grade", help=words, description=words.capitalize() + ".")
    add, table = one.add_argument, "where the table goes (-: standard output)"
    add("folder", metavar="FOLDER", type=Path, help="a .py file or a folder, such as a package, a student")
    add("--csv", type=output_file, metavar="FILE", default=STDOUT, help=table)
    add("--seconds", type=seconds, default=100.0, metavar="S", help="wall time of a node (100)")
    add("--memory", type=count, default=4000, metavar="MB", help="memory of a node, not on Windows (4000)")
    add("--html", metavar="DIR", type=Path, help="write a page of feedback for each node into this folder")
    _add_exercise(one)


def _add_exercise(parser: argparse.ArgumentParser) -> None:
    group = parser.add_mutually_exclusive_group()
    group.add_argument("--sequel", action="store_true", help="the second part: keep a distance")
    group.add_argument("--stretch", choices=tuple("abcde"), help="a stretch task instead of tasks 1 to 4")
    group.add_argument("--exercise", metavar="FILE.toml", help="an exercise of your own instead of tasks 1 to 4")


def run(args: argparse.Namespace) -> int:
    """Do one of the four."""
    from limo_sim.workshop import solution, template

    node = "proxemic" if args.sequel else "follower"
    if getattr(args, "stretch", None):
        node = f"stretch {args.stretch}"
    node = getattr(args, "exercise", None) or node
    if args.action == "grade":
        return _grade(args, node)
    if args.action == "check":
        with needed(by="limo-hog workshop"):
            from limo_sim.workshop.check import examine
            from limo_sim.workshop.html_report import to_html
            from limo_sim.workshop.report import to_gradescope, to_json
        # What the node prints must not mix with the report or the JSON.
        said = partial(print, end="", file=sys.stderr)
        examination = examine(args.file, node, said=lambda _, text: said(text), workers=min(cores(), 2))
        verdicts = examination.verdicts
        if args.html:
            write_text(Path(args.html), to_html(args.file, node, examination))
        if args.json:
            write_json(args.json, to_json(args.file, node, verdicts))
        if args.gradescope:
            write_json(args.gradescope, to_gradescope(args.file, verdicts))
        if STDOUT not in (args.json, args.gradescope):
            _show(verdicts, args.hint)
        missed = [verdict for verdict in verdicts if not verdict.holds]
        if missed:
            raise LimoHogError(f"{args.file}: {len(missed)} of {len(verdicts)} checkpoints do not hold")
        return 0
    if args.action == "solution" and os.environ.get("LIMO_HOG_HIDE_SOLUTION"):
        raise UsageError("the model solution is hidden on this computer: LIMO_HOG_HIDE_SOLUTION is set")
    text = template(node) if args.action == "new" else solution(node)
    path = args.file or Path(f"{node}.py" if args.action == "new" else f"{node}_solution.py")
    if str(path) == STDOUT:
        sys.stdout.write(text)
        return 0
    if path.exists():
        raise UsageError(f"{path} is there already; give another name")
    write_text(path, text)
    print(f"{path} is written; try it: limo-hog run {shlex.quote(str(path))}", file=sys.stderr)
    return 0


def _grade(args: argparse.Namespace, node: str) -> int:
    with needed(by="limo-hog workshop"):
        from limo_sim.ros.runner import Limits
        from limo_sim.workshop.grade import Table, grade, nodes_in
    if not args.folder.is_dir():
        raise UsageError(f"{args.folder}: no such folder; wanted is one with the nodes' .py files")
    files = nodes_in(args.folder)
    if not files:
        raise UsageError(f"{args.folder}: no Python file in it, nor in the folders in it")
    limits = Limits(seconds=args.seconds, memory_mb=args.memory)
    if args.html is not None:
        args.html.mkdir(parents=True, exist_ok=True)
    grades: list[Grade] = []
    with ExitStack() as stack:
        target = sys.stdout
        if args.csv != STDOUT:
            # Rows as they come, in a hidden file beside it: what was graded before a kill is not lost.
            path = Path(args.csv)
            target = stack.enter_context(part_of(path).open("w", encoding="utf-8", newline=""))
            if part_of(path) != path:
                stack.callback(_in_order, path, grades, lambda target: Table(node, args.folder, target))
        table = Table(node, args.folder, target)
        bar = stack.enter_context(progress("files"))
        task = bar.add_task("graded", total=len(files))
        for graded in stack.enter_context(closing(grade(files, args.folder, cores(), node, limits, pages=args.html))):
            table.add(graded)
            grades.append(graded)
            bar.advance(task)
    failed = sum(graded.result is None for graded in grades)
    print(f"{len(files)} files graded, {failed} of them without a result", file=sys.stderr)
    return 0


def _in_order(path: Path, grades: list[Grade], table_in: Callable[[TextIO], Table]) -> None:
    """Write the table of what was graded, in the order of the files' names, in place of the unfinished one."""
    with whole_file(path) as part, part.open("w", encoding="utf-8", newline="") as target:
        table = table_in(target)
        for graded in sorted(grades, key=lambda graded: graded.file):
            table.add(graded)
    part_of(path).unlink()


def _show(verdicts: list[Verdict], hints: int) -> None:
    """Print each checkpoint on one line, its evidence below, and the points; no line is wider than 80 columns."""
    from rich.padding import Padding
    from rich.text import Text

    from limo_sim.workshop.exercises import task_name
    from limo_sim.workshop.report import by_task, evidence, total

    marks = {True: ("✓", "green"), False: ("✗", "bold red"), None: ("–", "dim")}
    screen = console()
    width = min(screen.width, WIDTH)
    for holds, group in itertools.groupby(verdicts, key=lambda verdict: verdict.holds):
        for verdict in (several := list(group)):
            won = f"{verdict.points:3d}/{verdict.worth:<3d}" if verdict.worth else " " * 7
            title = f" task {task_name(verdict.task)} {won} {verdict.checkpoint}"
            if holds is None and len(several) > _FOLDED:
                tasks = f"{task_name(verdict.task)} to {task_name(several[-1].task)}"
                title = f" {len(several)} checkpoints of task {tasks}"
            screen.print(Text.assemble(marks[holds], title))
            if not holds:
                told = Padding(Text(evidence(verdict), overflow="fold"), (0, 0, 0, 4), expand=False)
                screen.print(told, width=width, style="dim" if holds is None else "")
            if holds is None and len(several) > _FOLDED:
                break
    points, worth = total(verdicts)
    tasks = ", ".join(f"task {task_name(task)}: {won} of {of}" for task, (won, of) in by_task(verdicts).items())
    screen.print(f"{points} of {worth} points ({tasks})", width=width)
    missed = next((verdict for verdict in verdicts if not verdict.holds and verdict.hints), None)
    if hints and missed is not None:
        screen.print(f"Hints for task {task_name(missed.task)}, {missed.checkpoint}:", width=width)
        for hint in missed.hints[:hints]:
            screen.print(Padding(Text(hint), (0, 0, 0, 4), expand=False), width=width)
        if hints < len(missed.hints):
            screen.print(f"One more: --hint {hints + 1}")
