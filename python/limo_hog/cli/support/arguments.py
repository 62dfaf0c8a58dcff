"""Arguments that several commands take, and their types; argparse names them in its complaints."""

from __future__ import annotations

from argparse import ArgumentParser, ArgumentTypeError
from collections.abc import Callable
from pathlib import Path


def size(text: str) -> tuple[int, int]:
    """Read WIDTHxHEIGHT [px]."""
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        raise ArgumentTypeError(f"{text!r} is no size; wanted is WIDTHxHEIGHT such as 640x480")
    return int(width), int(height)


def count(text: str) -> int:
    """Read a whole number from 1 on."""
    if not text.isdecimal() or int(text) == 0:
        raise ArgumentTypeError(f"{text!r} is no count; wanted is a whole number from 1 on")
    return int(text)


def threads(text: str) -> int:
    """Read a number of threads, 0 for all cores."""
    if not text.isdecimal():
        raise ArgumentTypeError(f"{text!r} is no number of threads; wanted is 0 (all cores) or more")
    return int(text)


def number(text: str, low: float, high: float, what: str) -> float:
    """Read a number within bounds."""
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not low <= value <= high:
        raise ArgumentTypeError(f"{text!r} is no {what}; wanted is a number from {low:g} to {high:g}")
    return value


def metres(text: str) -> float:
    """Read a distance [m]."""
    return number(text, 0.1, 8.0, "distance in metres")


def seconds(text: str) -> float:
    """Read a duration [s]."""
    return number(text, 0.1, 86400.0, "duration in seconds")


def seed(text: str) -> int:
    """Read a seed."""
    if not text.isdecimal():
        raise ArgumentTypeError(f"{text!r} is no seed; wanted is a whole number from 0 on")
    return int(text)


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
    from limo_hog.follow.sense.detectors import NAMES

    parser.add_argument("--controller", choices=CONTROLLERS, default="tracking", help="the controller (%(default)s)")
    parser.add_argument("--target", type=metres, metavar="M", help="distance to hold [m], not for approach (1.5)")
    parser.add_argument(
        "--detector",
        default="hog",
        metavar="|".join((*NAMES, "onnx:FILE")),
        help="the people detector: ours, ours on the half image, OpenCV's, or a network (%(default)s)",
    )
