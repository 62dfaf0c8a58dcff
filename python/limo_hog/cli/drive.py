"""`limo-hog follow --ros2`: the follower on a robot."""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from typing import Any

from limo_hog.cli.output import STDOUT, UsageError, write_json
from limo_hog.cli.progress import progress
from limo_hog.follow.decision import Decision
from limo_hog.follow.detectors import detector_named
from limo_hog.follow.naming import controller_named
from limo_hog.ros2.dds import Bus
from limo_hog.ros2.follower import drive as follow


def drive(args: argparse.Namespace) -> int:
    """Drive whatever publishes the workshop's topics, then tell how it went."""
    asked = [f"--{name}" for name in ("view", "video", "record", "plot", "rerun") if getattr(args, name) is not None]
    if asked:
        raise UsageError(f"{', '.join(asked)}: a robot shows and records itself; give it to `limo-hog arena --ros2`")
    controller = controller_named(args.controller, args.target)
    detector = detector_named(args.detector)
    bus = Bus()
    with progress("s") as bar:
        task = bar.add_task("search", total=args.seconds)
        began = time.monotonic()

        def watch(decision: Decision[Any]) -> None:
            bar.update(
                task, completed=time.monotonic() - began, description=f"{decision.mode.value}: {decision.reason}"
            )

        report = follow(bus, controller, detector, args.seconds, watch)
    answer = statistics.median(report.answer_ms) if report.answer_ms else None
    card = {
        "controller": args.controller,
        "detector": args.detector,
        "seconds": args.seconds,
        "frames": report.frames,
        "found": report.found,
        "dropped": report.dropped,
        "answer_ms_p50": answer,
        "modes": report.modes,
    }
    if args.json:
        write_json(args.json, card)
    if args.json != STDOUT:
        modes = ", ".join(f"{mode} {count}" for mode, count in report.modes.items())
        print(f"{report.frames} pictures, somebody in {report.found}; commands: {modes}")
        print(f"answer {answer or 0:.1f} ms after a picture; messages dropped {report.dropped}", file=sys.stderr)
    return 0
