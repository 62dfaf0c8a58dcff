"""Whom to follow, where somebody asks for one person of several: by where they are in the image, or by number."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from limo_hog.exceptions import LimoHogError
from limo_hog.follow.sense.observation import Odometry
from limo_hog.follow.tracks.kalman import bearing_range
from limo_hog.follow.tracks.person import Person

#: A word of `_RANKS`, or the number of a tracked person.
Whom = str | int

#: What a word asks for, and what is largest of that person: of bearing [rad], distance [m] and `Person.window`.
_RANKS: dict[str, tuple[str, Callable[[float, float, float], float]]] = {
    "nearest": ("the nearest person", lambda _bearing, distance, _window: -distance),
    "left": ("the person furthest left", lambda bearing, _distance, _window: bearing),
    "right": ("the person furthest right", lambda bearing, _distance, _window: -bearing),
    "largest": ("the person largest in the image", lambda _bearing, distance, window: window / distance),
}
WORDS = tuple(_RANKS)


class WhomError(LimoHogError):
    """What names nobody, or a controller that follows nobody in particular."""


def checked(whom: Whom) -> Whom:
    """Return what was asked for, with a number as an int; raises `WhomError` for what names nobody."""
    if whom in WORDS and isinstance(whom, str):
        return whom
    text = whom.strip() if isinstance(whom, str) else whom
    if not isinstance(text, bool) and str(text).isdecimal() and 0 < len(str(text)) < 10 and int(text) > 0:
        return int(text)
    raise WhomError(f"got {str(whom)[:40]!r} for the person to follow; want {', '.join(WORDS)}, or a person's number")


def ask_of(controller: Any) -> Callable[[Whom, Any], Any]:
    """Return the method that asks a controller for a person; raises `WhomError` for one that has none."""
    ask: Callable[[Whom, Any], Any] | None = getattr(controller, "ask", None)
    if ask is None:
        raise WhomError(f"{type(controller).__name__} follows nobody in particular: use TrackingController")
    return ask


def named(whom: Whom) -> str:
    """Return what was asked for, in words."""
    return f"person {whom}" if isinstance(whom, int) else _RANKS[whom][0]


def picked(whom: Whom, people: Iterable[Person], pose: Odometry) -> Person | None:
    """Return the person of `people` that is asked for, as seen by a robot at `pose`; None where they are not there."""
    if isinstance(whom, int):
        return next((person for person in people if person.number == whom), None)
    rank = _RANKS[whom][1]
    return max(people, key=lambda person: rank(*bearing_range(person.track, pose), person.window), default=None)
