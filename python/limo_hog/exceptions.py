"""The named errors of limo-hog; each message says what came and what is wanted."""

from __future__ import annotations


class LimoHogError(Exception):
    """Whatever limo-hog refuses to do, with one line that says why."""
