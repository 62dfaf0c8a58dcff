"""`limo-hog follow --ros2`: the follower on a robot."""

from __future__ import annotations

import argparse
import math
import re
import statistics
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import IO, Any

import numpy as np
from rich.progress import Progress

from limo_hog.atomic import json_text
from limo_hog.cli.support.arguments import (
    add_follower,
    add_json,
    add_robot,
    add_ros_arguments,
    node_of,
    number,
    seconds,
)
from limo_hog.cli.support.output import STDOUT
from limo_hog.cli.support.progress import progress
from limo_hog.follow.control.naming import controller_named, detector_of
from limo_hog.follow.pipeline import FrameLog
from limo_hog.follow.robot import LIMO, load_robot
from limo_hog.named_detectors import detector_named
from limo_hog.ros2.dds import Bus
from limo_hog.ros2.follower import Report, Settings, drive
from limo_hog.ros2.network import BusError
from limo_hog.ros2.outputs import FRAMES


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `follow` as a robot has it."""
    parser = subparsers.add_parser(
        "follow",
        description="Follow a person with a ROS 2 robot, or with the one of `limo-hog arena --ros2`: read the "
        "workshop's topics, detect, and publish /cmd_vel behind a safety layer.",
        epilog="To watch or record: give --view, --video or --record to `limo-hog arena --ros2`, or use ros2 bag.",
    )
    add_follower(parser)
    parser.add_argument(
        "--seconds", type=seconds, default=math.inf, metavar="S", help="stop after this time (at Ctrl-C)"
    )
    speed = partial(number, low=0.05, high=5.0, what="speed in m/s")
    turn = partial(number, low=0.05, high=10.0, what="turn rate in rad/s")
    parser.add_argument("--max-speed", type=speed, default=math.inf, metavar="M/S", help="drive no faster [m/s]")
    parser.add_argument("--max-turn", type=turn, default=math.inf, metavar="RAD/S", help="turn no faster [rad/s]")
    parser.add_argument("--compressed", action="store_true", help="take compressed images, though there are raw ones")
    add_json(parser, "a line of JSON for each change of mode or reason, and last one of what happened")
    parser.add_argument(
        "--no-drive", action="store_true", help="publish what is found and no commands: a planner, such as Nav2, drives"
    )
    add_robot(parser)
    parser.add_argument(
        "--without-lidar", action="store_true", help="drive by depth alone where no scan comes: slowly, never backwards"
    )
    parser.add_argument("--ros2", action="store_true", help="follow on a ROS 2 robot instead of in the arena")
    add_ros_arguments(parser, f"; parameters are {', '.join(FRAMES)}")


def run(args: argparse.Namespace) -> int:
    """Drive the robot that publishes the workshop's topics, then print how it went."""
    controller = controller_named(args.controller, args.target, args.person)
    robot = load_robot(args.robot) if args.robot else LIMO
    robot = replace(robot, max_speed=min(robot.max_speed, args.max_speed), max_turn=min(robot.max_turn, args.max_turn))
    args.detector = args.detector or detector_of(args.controller)
    detector = detector_named(args.detector)
    bus = Bus(node_of(args, "limo_hog_follower"))
    for name in bus.node.parameters.keys() - FRAMES.keys() - {"use_sim_time"}:
        print(f"parameter {name} is not known; known are {', '.join(FRAMES)}", file=sys.stderr)
    report = Report()
    stopped: KeyboardInterrupt | BusError | None = None
    with ExitStack() as stack:
        lines = None
        if args.json:
            lines = sys.stdout if args.json == STDOUT else stack.enter_context(Path(args.json).open("w", buffering=1))
        bar = stack.enter_context(progress("s"))
        began = time.monotonic()
        try:
            settings = Settings(
                args.seconds,
                robot,
                moves=not args.no_drive,
                without_lidar=args.without_lidar,
                compressed=args.compressed,
                watch=_told(args, bar, lines, began),
                say=lambda line: print(line, file=sys.stderr),
            )
            drive(bus, controller, detector, settings, report)
        except (KeyboardInterrupt, BusError) as error:
            stopped = error
        card = _card(args, report, time.monotonic() - began)
        if lines is not None:
            print(json_text(card), file=lines, flush=True)
    if args.json != STDOUT:
        modes = ", ".join(f"{mode} {count}" for mode, count in report.modes.items())
        unsent = ", not sent" if args.no_drive else ""
        print(f"{report.frames} images, a person in {report.found}; commands{unsent}: {modes}")
        print(
            f"command {card['answer_ms_p50'] or 0:.1f} ms after an image; messages dropped {report.dropped}",
            file=sys.stderr,
        )
    if stopped is not None:
        raise stopped
    return 0


def _told(args: argparse.Namespace, bar: Progress, lines: IO[str] | None, began: float) -> Callable[[FrameLog], None]:
    """Return what tells each change of mode or reason, on the terminal and as a line of JSON."""
    task = bar.add_task("search", total=None if math.isinf(args.seconds) else args.seconds)
    shown: tuple[str, str] | None = None

    def watch(log: FrameLog) -> None:
        nonlocal shown
        mode, reason = log.decision.mode.value, log.decision.reason
        at = time.monotonic() - began
        bar.update(task, completed=at, description=f"{mode}: {reason}")
        # A reason whose numbers alone change is the same.
        now = mode, re.sub(r"[\d.]+", "", reason)
        if now == shown:
            return
        shown = now
        if args.json != STDOUT:
            bar.console.print(f"{at:.1f} s {mode}: {reason}", markup=False, highlight=False, soft_wrap=True)
        if lines is not None:
            event = {"seconds": round(at, 3), "stamp": log.time, "mode": mode, "reason": reason}
            print(json_text(event), file=lines, flush=True)

    return watch


def _card(args: argparse.Namespace, report: Report, taken: float) -> dict[str, Any]:
    """Return how the drive of `taken` seconds went, for JSON."""
    answers = report.answer_ms
    return {
        "controller": args.controller,
        "detector": args.detector,
        "seconds": taken,
        "frames": report.frames,
        "found": report.found,
        "dropped": report.dropped,
        "answer_ms_p50": statistics.median(answers) if answers else None,
        "answer_ms_p95": float(np.percentile(answers, 95)) if answers else None,
        "modes": report.modes,
    }
