"""Options that several commands share, and the types that check them."""

from __future__ import annotations

from argparse import REMAINDER, ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from limo_hog.cv2_api.arguments import number as bounded

if TYPE_CHECKING:
    from limo_hog.ros2.arguments import NodeNames

#: What a picture of `--size` may have: 64 megapixels take 1 GB to draw, and no camera has more.
_MOST_PIXELS = 64_000_000
#: What names a model, as help says it.
MODEL = "limo, opencv, daimler, or the file of a trained model"
#: Digits of the largest whole number an option takes.
_MOST_DIGITS = 9


def size(text: str) -> tuple[int, int]:
    """Read WIDTHxHEIGHT [px]."""
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal() and width.strip("0") and height.strip("0")):
        raise ArgumentTypeError(f"{_cut(text)} is no size; wanted is WIDTHxHEIGHT such as 640x480")
    if max(len(width), len(height)) > _MOST_DIGITS or int(width) * int(height) > _MOST_PIXELS:
        raise ArgumentTypeError(f"{_cut(text)} is too large; at most {_MOST_PIXELS / 1e6:g} megapixels are allowed")
    return int(width), int(height)


def _whole(text: str, least: int, complaint: str) -> int:
    if not text.isdecimal() or len(text) > _MOST_DIGITS or int(text) < least:
        raise ArgumentTypeError(f"{_cut(text)} is {complaint}, of at most {_MOST_DIGITS} digits")
    return int(text)


#: A whole number from 1 on; a number of threads, 0 for all cores; a seed.
count = partial(_whole, least=1, complaint="no count; wanted is a whole number from 1 on")
threads = partial(_whole, least=0, complaint="no number of threads; wanted is 0 (all cores) or more")
seed = partial(_whole, least=0, complaint="no seed; wanted is a whole number from 0 on")


def _cut(text: str) -> str:
    return repr(text if len(text) <= 40 else f"{text[:40]}…")


def number(text: str, low: float, high: float, what: str) -> float:
    """Read a number within bounds."""
    try:
        return bounded(what, float(text), low, high)
    except ValueError:
        wanted = f"wanted is a number from {low:g} to {high:g}"
        raise ArgumentTypeError(f"{_cut(text)} is no {what}; {wanted}") from None


#: A distance [m], a duration [s], an SVM margin, and the height of people in pictures [px].
metres = partial(number, low=0.1, high=8.0, what="distance in metres")
seconds = partial(number, low=0.1, high=86400.0, what="duration in seconds")
score = partial(number, low=-100, high=100, what="score")
height = partial(number, low=8, high=10_000, what="height in pixels")


def output_file(text: str) -> str:
    """Read the name of a file to write, or "-" for standard output."""
    if not text:
        raise ArgumentTypeError("'' is no file; wanted is a file's name, or - for standard output")
    if Path(text).is_dir():
        raise ArgumentTypeError(f"{text!r} is a folder; wanted is a file's name, or - for standard output")
    return text


def add_json(parser: ArgumentParser, what: str) -> None:
    """Add --json, which writes what the command says."""
    parser.add_argument("--json", type=output_file, metavar="FILE", help=f"write {what}; - is standard output")


def add_labels(parser: ArgumentParser) -> None:
    """Add --label and --pictures, which say what of the labels is meant."""
    parser.add_argument("--label", metavar="NAME", help="which label is meant, where there are several")
    parser.add_argument("--pictures", type=Path, metavar="DIR", help="where the pictures lie, if not beside the labels")


def add_search(parser: ArgumentParser) -> None:
    """Add --search."""
    parser.add_argument(
        "--search",
        choices=("exact", "guided"),
        default="exact",
        help="guided: about twice as fast, a raw hit in two hundred is missed (%(default)s)",
    )


def least_height(text: str) -> float | None:
    """Read the height of the smallest person, or none for pictures at their own size [px]."""
    return None if text == "none" else height(text)


def file_ending(*suffixes: str) -> Callable[[str], Path]:
    """Read a file name that ends in one of some suffixes."""

    def file(text: str) -> Path:
        if Path(text).suffix.lower() not in suffixes:
            raise ArgumentTypeError(f"{text!r}: wanted is a name that ends in {' or '.join(suffixes)}")
        return Path(text)

    return file


def add_follower(parser: ArgumentParser) -> None:
    """Add the options that choose a controller and a detector."""
    from limo_hog.follow.control.naming import CONTROLLERS
    from limo_hog.follow.tracks.asking import WORDS

    parser.add_argument("--controller", choices=CONTROLLERS, default="tracking", help="the controller (%(default)s)")
    add_target_and_detector(parser)
    parser.add_argument(
        "--person", type=whom, metavar="|".join((*WORDS, "N")), help="whom of several to follow; N is a person's number"
    )


def whom(text: str) -> str | int:
    """Read whom to follow."""
    from limo_hog.follow.tracks.asking import WhomError, checked

    try:
        return checked(text)
    except WhomError as error:
        raise ArgumentTypeError(str(error)) from None


def add_target_and_detector(parser: ArgumentParser) -> None:
    """Add --target and --detector."""
    parser.add_argument("--target", type=metres, metavar="M", help="distance to hold [m], not for approach (1.5)")
    add_detector(parser)


def add_detector(parser: ArgumentParser) -> None:
    """Add --detector."""
    from limo_hog.named_detectors import NAMES

    parser.add_argument(
        "--detector",
        metavar="|".join(NAMES),
        help="the people detector: ours, OpenCV's HOG by us, on the half image, with another model, by OpenCV, or a "
        "network (limo for tracking, hog for others)",
    )


def add_robot(parser: ArgumentParser) -> None:
    """Add --robot."""
    parser.add_argument("--robot", metavar="FILE.toml", help="what differs from a Limo (see docs/own-robot.md)")


def add_ros_arguments(parser: ArgumentParser, more: str = "") -> None:
    """Add --ros-args; `more` ends its help."""
    parser.add_argument(
        "--ros-args",
        nargs=REMAINDER,
        default=[],
        metavar="...",
        help=f"-p name:=value, -r from:=to and --params-file FILE, as ROS 2 takes them; comes last{more}",
    )


def node_of(args: Namespace, name: str) -> NodeNames:
    """Return the node that a command is, named and with names as --ros-args says."""
    from limo_hog.ros2.arguments import parse_ros_arguments

    return parse_ros_arguments(["--ros-args", *args.ros_args]).named(name)
