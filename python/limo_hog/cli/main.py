"""Routes `limo-hog COMMAND` to the command's module, and turns named errors into one line.

A command is a module with `add_parser(subparsers) -> None` and `run(args) -> int`, named as the command: the detector's
and the robot's are beside this one, the arena's in `limo_sim.cli`. Only the module of the command that was asked for is
imported; where the arena is not installed, the error names the line that installs it.
"""

from __future__ import annotations

import argparse
import importlib
import os
import signal
import sys
from collections.abc import Iterable, Sequence
from contextlib import suppress
from functools import partial
from types import ModuleType, SimpleNamespace
from typing import Any, NoReturn

from limo_hog.cli.support.output import WRITTEN, UsageError, guarded_outputs, lasting_streams, one_line, printable
from limo_hog.exceptions import LimoHogError
from limo_hog.extras import missing_extra
from limo_hog.signals import stopping

#: Commands of this package and their line in `limo-hog --help`.
BUILT_IN = {
    "detect": "find people in photographs, folders and videos",
    "train": "train a detector from labelled pictures",
    "evaluate": "measure detectors on labelled pictures",
    "bench": "time this detector against OpenCV's, with parity checked in the same run",
    "replay": "run the detector and the follower on a recording",
    "topic": "look at ROS 2 topics, as `ros2 topic` does",
    "info": "versions, CPU features, chosen backend, and what OpenCV is installed",
    "completion": "print the completion of commands and options for a shell",
}
#: Commands of the distribution limo-sim and their line in `limo-hog --help`.
ARENA = {
    "follow": "watch a robot find and follow a walking person in the arena, and score it",
    "run": "run an ordinary ROS 2 Python node against the arena, without ROS",
    "workshop": "learn it: a template node, a checker, and model solutions",
    "arena": "the arena alone, in real time, for ROS 2 nodes to drive",
    "score": "compare controllers over scenarios and seeds, on all cores",
    "export": "write labelled pictures of the arena, to train and to measure detectors on",
}

#: Pixels of the largest picture that a command reads: of the largest that `PeopleDetector` searches [px].
_MOST_PIXELS = 2**28


class _Help(argparse.HelpFormatter):
    """Breaks lines between words alone: an address stays one that can be clicked."""

    def _split_lines(self, text: str, width: int) -> list[str]:
        # Imported here: only help needs it.
        from textwrap import wrap

        return wrap(" ".join(text.split()), width, break_on_hyphens=False, break_long_words=False)

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return "\n".join(indent + line for line in self._split_lines(text, width))


class _Parser(argparse.ArgumentParser):
    """Answers a wrong argument in two lines, without all the options before."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**{"formatter_class": _Help, **options})

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"usage: {self.prog} [options], as {self.prog} --help lists them\n{self.prog}: error: {message}\n")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return 0 done, 1 a named error, 2 wrong arguments, 128 + n stopped by signal n."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    # OpenCV refuses a larger picture by its header, before it decodes; it reads the limit when it is loaded.
    os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(_MOST_PIXELS))
    with lasting_streams():
        return _answered(arguments)


def _answered(arguments: list[str]) -> int:
    """Run the command; answer named errors by a line and their code."""
    try:
        with stopping():
            code = _run(arguments)
        # What is still buffered is written here, where a full disk can be answered.
        sys.stdout.flush()
    except KeyboardInterrupt as error:
        print("limo-hog: stopped", file=sys.stderr)
        return 128 + getattr(error, "signal", signal.SIGINT)
    except BrokenPipeError:
        # The reader of what was asked for has left.
        return 1
    except (LimoHogError, OSError, MemoryError, ImportError) as error:
        if isinstance(error, ImportError) and not isinstance(error, LimoHogError):
            error = missing_extra(f"limo-hog {arguments[0]}", error)
        if "--debug" in arguments:
            raise
        print(f"limo-hog: {printable(one_line(error))}", file=sys.stderr)
        return 2 if isinstance(error, UsageError) else 1
    return code


def _run(arguments: list[str]) -> int:
    wanted = next((argument for argument in arguments if not argument.startswith("-")), None)
    parser = _Parser(
        prog="limo-hog", description="OpenCV's HOG people detector, many times faster, and a robot arena to try it on."
    )
    parser.add_argument("--version", action="store_true", help="print the version and stop")
    parser.add_argument("--debug", action="store_true", help="show the traceback of an error")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", title="commands")
    module = None
    for name, line in (ARENA | BUILT_IN).items():
        if name != wanted:
            commands.add_parser(name, help=line)
    if wanted is not None and (module := _module_of(wanted, arguments)) is not None:
        module.add_parser(commands)
        _add_common(commands.choices[wanted])
    try:
        if wanted is not None and module is None:
            hint = _likely(wanted, commands.choices) or "limo-hog --help lists them all"
            parser.error(f"no command {wanted!r}; {hint}")
        args, unknown = parser.parse_known_args(arguments)
        if unknown:
            asked = commands.choices[wanted] if wanted else parser
            hint = _likely(unknown[0].partition("=")[0], asked._option_string_actions)
            asked.error("; ".join(filter(None, [f"unrecognized arguments: {' '.join(unknown)}", hint])))
    except SystemExit as exit_:
        # argparse has printed its help (0) or what was wrong (2).
        return int(exit_.code or 0)
    if args.version:
        import limo_hog

        print(f"limo-hog {limo_hog.__version__}")
        return 0
    if module is None:
        parser.print_help(sys.stderr)
        return 2
    with guarded_outputs(args):
        return int(module.run(args))


def _add_common(parser: argparse.ArgumentParser) -> None:
    """Add --debug to a command and its actions, and --overwrite where they write files."""
    for action in parser._actions:
        for one in action.choices.values() if isinstance(action, argparse._SubParsersAction) else ():
            _add_common(one)
    words = "show the traceback of an error"
    parser.add_argument("--debug", action="store_true", default=argparse.SUPPRESS, help=words)
    if "--overwrite" not in parser._option_string_actions and any(one.dest in WRITTEN for one in parser._actions):
        parser.add_argument("--overwrite", action="store_true", help="replace files that are there")


def whole_parser() -> argparse.ArgumentParser:
    """Return a parser that knows the options of every installed command."""
    parser = argparse.ArgumentParser(prog="limo-hog")
    commands = parser.add_subparsers(metavar="COMMAND")
    for name, line in (ARENA | BUILT_IN).items():
        with suppress(ModuleNotFoundError):
            module = _module_of(name, [])
            if module is not None:
                # A command has no line of its own in the help; completion leaves out those without.
                module.add_parser(SimpleNamespace(add_parser=partial(commands.add_parser, help=line)))
                _add_common(commands.choices[name])
    return parser


def _likely(word: str, known: Iterable[str]) -> str:
    """Return the question whether another word was meant; nothing where none is like it."""
    # Imported here: only a mistyped word needs it.
    from difflib import get_close_matches

    # Without dashes, which every option has in common.
    bare = {name.lstrip("-"): name for name in known}
    found = get_close_matches(word.lstrip("-"), bare, 1, cutoff=0.7)
    return f"did you mean {bare[found[0]]}?" if found else ""


def _module_of(command: str, arguments: list[str]) -> ModuleType | None:
    """Import a command's module; None where there is no such command."""
    if command == "follow" and "--ros2" in arguments:
        # The robot has no simulator.
        return importlib.import_module("limo_hog.cli.follow_robot")
    if command in BUILT_IN:
        return importlib.import_module(f"limo_hog.cli.{command}")
    if command in ARENA:
        return importlib.import_module(f"limo_sim.cli.{command}")
    return None
