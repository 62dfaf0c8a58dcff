"""`limo-hog follow --ros2`: the follower on a robot."""

from __future__ import annotations

import argparse
import statistics
import sys
import time

import numpy as np

from limo_hog.cli.support.arguments import add_follower, output_file, seconds
from limo_hog.cli.support.output import STDOUT, write_json
from limo_hog.cli.support.progress import progress
from limo_hog.follow.control.naming import controller_named
from limo_hog.follow.pipeline import FrameLog
from limo_hog.follow.robot import LIMO, load_robot
from limo_hog.follow.sense.detectors import detector_named
from limo_hog.ros2.dds import Bus
from limo_hog.ros2.follower import drive


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `follow` as a robot has it."""
    parser = subparsers.add_parser(
        "follow",
        description="Follow a person with a ROS 2 robot, or with the one of `limo-hog arena --ros2`: read the "
        "workshop's topics, detect, and publish /cmd_vel behind a safety layer.",
        epilog="To watch or record: give --view, --video or --record to `limo-hog arena --ros2`, or use ros2 bag.",
    )
    add_follower(parser)
    parser.add_argument("--seconds", type=seconds, default=60.0, metavar="S", help="stop after this time (60)")
    parser.add_argument(
        "--json", type=output_file, metavar="FILE", help="write what happened as JSON; - is standard output"
    )
    parser.add_argument(
        "--no-drive", action="store_true", help="publish what is found and no commands: a planner, such as Nav2, drives"
    )
    parser.add_argument("--robot", metavar="FILE.toml", help="what differs from a Limo (see `RobotGeometry`)")
    parser.add_argument(
        "--without-lidar", action="store_true", help="drive by depth alone where no scan comes: slowly, never backwards"
    )
    parser.add_argument("--ros2", action="store_true", help="follow on a ROS 2 robot instead of in the arena")


def run(args: argparse.Namespace) -> int:
    """Drive the robot that publishes the workshop's topics, then print how it went."""
    controller = controller_named(args.controller, args.target)
    detector = detector_named(args.detector)
    bus = Bus()
    with progress("s") as bar:
        task = bar.add_task("search", total=args.seconds)
        began = time.monotonic()

        def watch(log: FrameLog) -> None:
            decision = log.decision
            bar.update(
                task, completed=time.monotonic() - began, description=f"{decision.mode.value}: {decision.reason}"
            )

        report = drive(
            bus,
            controller,
            detector,
            args.seconds,
            watch,
            moves=not args.no_drive,
            robot=load_robot(args.robot) if args.robot else LIMO,
            without_lidar=args.without_lidar,
            say=lambda line: print(line, file=sys.stderr),
        )
    answer = statistics.median(report.answer_ms) if report.answer_ms else None
    card = {
        "controller": args.controller,
        "detector": args.detector,
        "seconds": args.seconds,
        "frames": report.frames,
        "found": report.found,
        "dropped": report.dropped,
        "answer_ms_p50": answer,
        "answer_ms_p95": float(np.percentile(report.answer_ms, 95)) if report.answer_ms else None,
        "modes": report.modes,
    }
    if args.json:
        write_json(args.json, card)
    if args.json != STDOUT:
        modes = ", ".join(f"{mode} {count}" for mode, count in report.modes.items())
        print(f"{report.frames} images, a person in {report.found}; commands: {modes}")
        print(f"command {answer or 0:.1f} ms after an image; messages dropped {report.dropped}", file=sys.stderr)
    return 0
