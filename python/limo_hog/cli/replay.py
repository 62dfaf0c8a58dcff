"""`limo-hog replay`: the detector and a follower over a recording."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.table import Table
from rich.text import Text

from limo_hog.cli.support.arguments import add_detector, add_json, add_robot, add_ros_arguments, file_ending, node_of
from limo_hog.cli.support.console import console
from limo_hog.cli.support.output import STDOUT, write_json
from limo_hog.cli.support.progress import progress
from limo_hog.follow.control.naming import CONTROLLERS, controller_named, detector_of
from limo_hog.follow.robot import LIMO, load_robot
from limo_hog.named_detectors import detector_named

if TYPE_CHECKING:
    from limo_hog.ros2.bag import Record
    from limo_hog.ros2.replay import Replayed


#: How the table words a figure, and what stands behind its number.
_SHOWN = {
    "same_detections": ("same detections", "of the {frames_recorded_with_detections} frames recorded with some"),
    "linear_difference_max": ("largest difference of forward speed", "m/s"),
    "angular_difference_max": ("largest difference of turn rate", "rad/s"),
    "detect_ms_p50": ("detection, median", "ms a frame"),
}
_WHY = "Detections and commands differ where another detector, controller or version made the recording."


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `replay`."""
    parser = subparsers.add_parser(
        "replay",
        description="Run the detector and a follower over a recording (an MCAP file of --record, or any ROS 2 bag), "
        "and compare detections and commands with those recorded.",
    )
    parser.add_argument("file", type=Path, metavar="FILE")
    parser.add_argument("--controller", choices=CONTROLLERS, default="tracking", help="controller (%(default)s)")
    add_detector(parser)
    add_robot(parser)
    parser.add_argument("--video", type=file_ending(".mp4"), metavar="FILE.mp4", help="video of the detections (H.264)")
    add_json(parser, "the figures as JSON")
    add_ros_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Replay a recording and show the figures."""
    from limo_hog.ros2.bag import read_bag
    from limo_hog.ros2.replay import elsewhere, kind_of, replay

    args.detector = args.detector or detector_of(args.controller)
    detector, controller = detector_named(args.detector), controller_named(args.controller)
    node, robot = node_of(args, "limo_hog_follower"), load_robot(args.robot) if args.robot else LIMO
    kinds: dict[str, str] = {}
    frames: list[dict[str, Any]] = []

    def records() -> Iterator[Record]:
        for record in read_bag(args.file):
            kinds.setdefault(record.topic, kind_of(record))
            yield record

    with progress("frames") as bar, _film(args.video) as show:
        task = bar.add_task("replaying", total=None)
        for frame in replay(records(), controller, detector, node, robot):
            frames.append(_compared(frame))
            show(frame)
            bar.advance(task)
    card = _card(args, frames)
    if args.json:
        write_json(args.json, card)
    if args.json != STDOUT:
        _print(card)
    for line in elsewhere(kinds, node):
        print(line, file=sys.stderr)
    failures = [frame["failure"] for frame in frames if frame["failure"]]
    if failures:
        print(f"{len(failures)} of {len(frames)} frames: {failures[0]}", file=sys.stderr)
    return 0


@contextmanager
def _film(path: Path | None) -> Iterator[Callable[[Replayed], None]]:
    """Give a function that appends a frame with its detections to a video, where one is wanted."""
    if path is None:
        yield lambda _: None
        return
    from limo_hog.imaging.drawing import annotate
    from limo_hog.imaging.writing import video_writer

    with video_writer(path, fps=10) as write:

        def show(frame: Replayed) -> None:
            found, target = frame.log.detections, frame.log.decision.target
            write(annotate(frame.frame.image, found.boxes, found.labels, target, f"{frame.frame.stamp:.1f} s"))

        yield show


def _print(card: dict[str, Any]) -> None:
    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    for name, value in card.items():
        shown = f"{value:.4g}" if isinstance(value, float) else "–" if value is None else str(value)
        label, unit = _SHOWN.get(name, (name.replace("_", " "), ""))
        table.add_row(label, Text(f"{shown} {unit.format(**card)}".rstrip()))
    out = console()
    out.print(table)
    if card["same_detections"] < card["frames_recorded_with_detections"] or card["linear_difference_max"]:
        out.print(_WHY, soft_wrap=True)


def _compared(frame: Replayed) -> dict[str, Any]:
    found, twist = frame.log.detections, frame.log.decision.twist
    row: dict[str, Any] = dict.fromkeys(("same", "linear", "angular"))
    row |= {"found": len(found) > 0, "failure": frame.log.failure, "detect_ms": frame.log.detect_ms}
    if frame.recorded is not None:
        boxes = np.array_equal(found.boxes, frame.recorded.boxes)
        row["same"] = boxes and bool(np.allclose(found.scores, frame.recorded.scores, rtol=0, atol=1e-5))
    if frame.recorded_twist is not None:
        row["linear"] = abs(twist.linear - frame.recorded_twist.linear)
        row["angular"] = abs(twist.angular - frame.recorded_twist.angular)
    return row


def _card(args: argparse.Namespace, frames: list[dict[str, Any]]) -> dict[str, Any]:
    compared = [frame["same"] for frame in frames if frame["same"] is not None]
    return {
        "file": str(args.file),
        "controller": args.controller,
        "detector": args.detector,
        "frames": len(frames),
        "frames_with_people": sum(frame["found"] for frame in frames),
        "frames_recorded_with_detections": len(compared),
        "same_detections": sum(compared),
        "linear_difference_max": max((f["linear"] for f in frames if f["linear"] is not None), default=None),
        "angular_difference_max": max((f["angular"] for f in frames if f["angular"] is not None), default=None),
        "detector_failures": sum(bool(frame["failure"]) for frame in frames),
        "detect_ms_p50": median(frame["detect_ms"] for frame in frames),
    }
