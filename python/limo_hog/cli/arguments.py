"""Kinds of argument that several commands take; argparse names them in its complaints."""

from __future__ import annotations

from argparse import ArgumentTypeError


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
