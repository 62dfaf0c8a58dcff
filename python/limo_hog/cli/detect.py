"""`limo-hog detect`: people in photographs, folders, videos, a camera, a stream, standard input."""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from functools import partial
from pathlib import Path

from limo_hog.atomic import is_stream
from limo_hog.cli.support import arguments
from limo_hog.cli.support.arguments import MODEL, add_json, add_search, output_file
from limo_hog.cli.support.output import STDOUT, UsageError
from limo_hog.cli.support.page import PORT, add_view, announce
from limo_hog.cli.support.results import Result, json_lines, write_coco, write_csv, write_mot
from limo_hog.detector import PeopleDetector
from limo_hog.exceptions import ParameterError
from limo_hog.tracking import TRACKERS

#: What the results of a run depend on, and its JSON lines hold.
PARAMETERS = ("model", "threshold", "min_height", "max_height", "nms", "overlap", "every", "search", "second_look")


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `detect`."""
    parser = subparsers.add_parser(
        "detect",
        description="Find people in photographs, folders, globs, videos, a camera (its index), a stream (rtsp://…, "
        "http://…) or standard input (-). What cannot be read is named, the rest is done, and the exit code is 1 then.",
    )
    parser.add_argument("inputs", nargs="+", metavar="INPUT")
    _add_outputs(parser)
    _add_search(parser)
    again = parser.add_mutually_exclusive_group()
    again.add_argument("--resume", action="store_true", help="go on where an earlier run with --json or --out stopped")
    again.add_argument("--overwrite", action="store_true", help="replace the files of an earlier run")


def _add_outputs(parser: argparse.ArgumentParser) -> None:
    """Add the options of what is written and shown."""
    parser.add_argument("--out", type=Path, metavar="DIR", help="write annotated copies of pictures and videos (MP4)")
    parser.add_argument(
        "--format", choices=["jpg", "png"], help="of annotated pictures (JPEG where the picture is, else PNG)"
    )
    add_json(parser, "one JSON object a line")
    tables = {"csv": "a table, a line a person", "coco": "COCO's JSON of images and annotations"}
    for name, what in (tables | {"mot": "one film's people as MOTChallenge's lines (with --track)"}).items():
        parser.add_argument(f"--{name}", type=output_file, metavar="FILE", help=f"write {what}")
    parser.add_argument(
        "--track",
        nargs="?",
        const="bytetrack",
        choices=tuple(TRACKERS),
        help="number each person of a film, or of pictures in their order at 25/s, and draw trails (bytetrack)",
    )
    add_view(
        parser,
        f"show pictures, boxes and the rate on a live page ({PORT}), with a pause and the threshold; films are no "
        "faster than real time then",
    )


def _add_search(parser: argparse.ArgumentParser) -> None:
    """Add the options of the search."""
    parser.add_argument("--model", default=PeopleDetector.model, metavar="NAME|FILE", help=f"{MODEL} (%(default)s)")
    add_search(parser)
    parser.add_argument("--threshold", type=arguments.score, metavar="T", help="least score of a hit (the model's own)")
    parser.add_argument(
        "--no-second-look",
        dest="second_look",
        action="store_const",
        const=False,
        help="do not let a small network look again at limo's best 50 windows: HOG alone, with more misses",
    )
    parser.add_argument(
        "--min-height",
        type=arguments.least_height,
        default=PeopleDetector.min_height,
        metavar="PX",
        help="find people from this height on; half of it takes four times as long; none: from 75 px on (opencv: "
        "100), at a picture's own size (%(default)g)",
    )
    parser.add_argument("--max-height", type=arguments.height, metavar="PX", help="leave out people taller than this")
    parser.add_argument(
        "--nms",
        choices=["overlap", "group"],
        default=PeopleDetector.nms,
        help="how one box is made of a person's many hits; group is OpenCV's way (%(default)s)",
    )
    parser.add_argument(
        "--overlap",
        type=partial(arguments.number, low=0, high=1, what="overlap"),
        metavar="X",
        help="how much two people's boxes may overlap, 0..1 (0.65)",
    )
    parser.add_argument(
        "--threads", type=arguments.threads, default=0, metavar="N", help="how many cores to keep busy; 0: all (0)"
    )
    parser.add_argument("--every", type=arguments.count, default=1, metavar="N", help="every Nth frame of a video (1)")


def _tables(args: argparse.Namespace) -> Mapping[Path, Callable[[Path, Iterable[Result]], None]]:
    """Return what writes each table that is wanted; refuse files that contradict each other or would be lost."""
    # Standard output, a pipe or a device holds nothing to go on from.
    kept = args.json not in (None, STDOUT) and not is_stream(Path(args.json))
    if args.resume and not kept and args.out is None:
        raise UsageError("--resume goes on from what --json FILE or --out DIR holds: give one of them")
    wanted = ((args.csv, write_csv), (args.coco, write_coco), (args.mot, write_mot))
    tables = {Path(name): write for name, write in wanted if name}
    if any(name == STDOUT for name, _ in wanted):
        raise UsageError("--csv, --coco and --mot want a file's name; standard output is for --json -")
    if args.mot and not args.track:
        raise UsageError("--mot writes the numbers that --track gives: add --track")
    if args.resume and tables and not kept:
        raise UsageError("--resume with --csv, --coco or --mot takes the earlier results from --json FILE: give it")
    return tables


def run(args: argparse.Namespace) -> int:
    """Search all inputs and return 1 if some could not be read, else 0."""
    parameters = {name: getattr(args, name) for name in PARAMETERS}
    try:
        detector = PeopleDetector(**{name: value for name, value in parameters.items() if name != "every"})
    except ParameterError as error:
        raise UsageError(str(error)) from error
    if args.track:
        parameters["track"] = args.track
    tables = _tables(args)
    # The error names a broken file in one line; the decoders' own lines are switched off.
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    # OpenCV's second reader of AVI prints bytes of a file that it cannot read; FFmpeg reads the others.
    os.environ.setdefault("OPENCV_VIDEOIO_PRIORITY_CV_MJPEG", "0")
    from limo_hog.cli.support.pictures import Run

    with ExitStack() as stack:
        bar = page = None
        if sys.stderr.isatty():
            # Imported only where it is shown: rich takes a sixth of a call for one picture.
            from limo_hog.cli.support.progress import progress

            bar = stack.enter_context(progress("pictures"))
        run = Run(args, detector, bar, stack)
        if args.view:
            # Imported here: the server is an extra.
            from limo_hog.cli.support.film_page import FilmPage

            page = stack.enter_context(FilmPage(run, *args.view))
            run.show = page.watch
            announce(page.url)
        only = args.out is None and not tables
        results = stack.enter_context(json_lines(args.json, parameters, args.resume, args.overwrite, only))
        start = time.perf_counter()
        try:
            run.look(results)
        finally:
            # Also when stopped: what is done is kept.
            for path, write in tables.items():
                write(path, run.results or [])
            summary = run.summary(time.perf_counter() - start)
            if page:
                page.end({"summary": summary})
            print(summary, file=sys.stderr)
    return 1 if run.failed else 0
