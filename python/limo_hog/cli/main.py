"""Routes `limo-hog COMMAND` to the command's module, and turns named errors into one line.

A command is a module beside this one, named as the command, with `add_parser(subparsers) -> None` and
`run(args) -> int`. Only the module of the command that was asked for is imported.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from collections.abc import Sequence

from limo_hog.cli.output import UsageError, one_line
from limo_hog.exceptions import LimoHogError

#: Every command and its line in `limo-hog --help`.
COMMANDS = {
    "follow": "watch a robot find and follow a walking person in the arena, and score it",
    "run": "run an ordinary ROS 2 Python node against the arena, without ROS",
    "workshop": "learn it: a template node, a checker, and model solutions",
    "arena": "the arena alone, in real time, for ROS 2 nodes to drive",
    "topic": "look at ROS 2 topics, as `ros2 topic` does",
    "detect": "find people in photographs, folders and videos",
    "score": "compare controllers over scenarios and seeds, on all cores",
    "replay": "let detector and follower look at a recording",
    "bench": "time this detector against OpenCV's, with parity checked in the same run",
    "info": "versions, CPU features, chosen backend, and what OpenCV is installed",
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return 0 done, 1 a named error, 2 wrong arguments, 130 Ctrl-C."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    try:
        code = _run(arguments)
        # What is still buffered is written here, where a closed pipe or a full disk can be answered.
        sys.stdout.flush()
    except KeyboardInterrupt:
        print("limo-hog: stopped", file=sys.stderr)
        return 130
    except BrokenPipeError:
        # The reader has seen enough; Python must not complain again when it closes standard output.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except (LimoHogError, OSError) as error:
        if "--debug" in arguments:
            raise
        print(f"limo-hog: {one_line(error)}", file=sys.stderr)
        return 2 if isinstance(error, UsageError) else 1
    return code


def _run(arguments: list[str]) -> int:
    wanted = next((argument for argument in arguments if not argument.startswith("-")), None)
    parser = argparse.ArgumentParser(
        prog="limo-hog",
        description="OpenCV's HOG people detector, many times faster, and a robot arena to try it on.",
    )
    parser.add_argument("--version", action="store_true", help="print the version and stop")
    parser.add_argument("--debug", action="store_true", help="show the traceback of an error")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", title="commands")
    module = None
    for name, line in COMMANDS.items():
        if name != wanted:
            commands.add_parser(name, help=line)
            continue
        module = importlib.import_module(f"limo_hog.cli.{name}")
        module.add_parser(commands)
        commands.choices[name].add_argument(
            "--debug", action="store_true", default=argparse.SUPPRESS, help="show the traceback of an error"
        )
    try:
        args = parser.parse_args(arguments)
    except SystemExit as exit_:
        # argparse has printed its help (0) or what was wrong (2).
        return int(exit_.code or 0)
    if args.version:
        from importlib.metadata import version

        print(f"limo-hog {version('limo-hog')}")
        return 0
    if module is None:
        parser.print_help(sys.stderr)
        return 2
    return int(module.run(args))


if __name__ == "__main__":
    sys.exit(main())
