"""`limo-hog detect`: people in photographs, folders, videos, a camera, standard input."""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

from limo_hog.cli.support.arguments import count, number, threads
from limo_hog.cli.support.output import STDOUT, UsageError
from limo_hog.detector import PeopleDetector
from limo_hog.exceptions import ParameterError


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `detect`."""
    parser = subparsers.add_parser(
        "detect",
        description="Find people in photographs, folders, globs, videos, a camera (its index) or standard input (-). "
        "What cannot be read is named, the rest is done, and the exit code is 1 then.",
    )
    parser.add_argument("inputs", nargs="+", metavar="INPUT")
    parser.add_argument("--out", type=Path, metavar="DIR", help="write annotated copies: PNG, and MP4 of videos")
    parser.add_argument("--json", metavar="FILE", help="write one JSON object a line; - is standard output")
    parser.add_argument(
        "--model",
        default="opencv",
        metavar="NAME|FILE",
        help="opencv, daimler, or a trained model's file (%(default)s)",
    )
    parser.add_argument("--threshold", type=_score, metavar="T", help="least SVM score of a hit (the model's own: 0)")
    parser.add_argument(
        "--min-height",
        type=_least_height,
        default=PeopleDetector.min_height,
        metavar="PX",
        help="find people from this height on; half of it takes four times as long; none: from 100 px on, at a "
        "picture's own size (%(default)g)",
    )
    parser.add_argument("--max-height", type=_pixels, metavar="PX", help="leave out people taller than this")
    parser.add_argument(
        "--nms",
        choices=["overlap", "iou", "soft", "group"],
        default=PeopleDetector.nms,
        help="how one box is made of a person's many hits; group is OpenCV's way (%(default)s)",
    )
    parser.add_argument(
        "--overlap", type=_overlap, metavar="X", help="how much two people's boxes may overlap, 0..1 (by --nms)"
    )
    parser.add_argument("--person-box", action="store_true", help="boxes tight around the person, without margin")
    parser.add_argument(
        "--threads", type=threads, default=0, metavar="N", help="how many cores to keep busy; 0: all (0)"
    )
    parser.add_argument("--every", type=count, default=1, metavar="N", help="every Nth frame of a video (1)")
    parser.add_argument("--resume", action="store_true", help="go on where an earlier run with --json or --out stopped")


def _pixels(text: str) -> float:
    return number(text, 8, 10_000, "height in pixels")


def _least_height(text: str) -> float | None:
    return None if text == "none" else _pixels(text)


def _overlap(text: str) -> float:
    return number(text, 0, 1, "overlap")


def _score(text: str) -> float:
    return number(text, -100, 100, "score")


def run(args: argparse.Namespace) -> int:
    """Look at all inputs and return 1 if some could not be read, else 0."""
    if args.resume and args.json in (None, STDOUT) and args.out is None:
        raise UsageError("--resume goes on from what --json FILE or --out DIR holds: give one of them")
    try:
        detector = PeopleDetector(
            model=args.model,
            min_height=args.min_height,
            max_height=args.max_height,
            threshold=args.threshold,
            nms=args.nms,
            overlap=args.overlap,
        )
    except ParameterError as error:
        raise UsageError(str(error)) from error
    # One line of ours says what is wrong with a file; its decoders shall not add theirs.
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    from limo_hog.cli.support.pictures import Run
    from limo_hog.cli.support.progress import progress
    from limo_hog.cli.support.results import json_lines

    with json_lines(args.json, args.resume) as results, progress("pictures") as bar:
        run = Run(args, detector, results, bar)
        start = time.perf_counter()
        try:
            run.look()
        finally:
            # Also when stopped: what is done is kept.
            print(run.summary(time.perf_counter() - start), file=sys.stderr)
    return 1 if run.failed else 0
