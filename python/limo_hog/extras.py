"""Libraries that only some parts need: what is said where one is missing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from limo_hog.exceptions import LimoHogError


class MissingExtraError(LimoHogError):
    """A library that only some commands need is not installed; the message says how to get it."""


@contextmanager
def needed(by: str, what: str, install: str) -> Iterator[None]:
    """Say what to install when an import inside fails.

    >>> with needed(by="limo-hog follow", what="the simulator", install="limo-sim"):
    ...     import limo_sim

    Raises
    ------
    MissingExtraError
        "limo-hog follow needs the simulator: pip install limo-sim".
    """
    try:
        yield
    except ModuleNotFoundError as error:
        raise MissingExtraError(f"{by} needs {what}: pip install {install}") from error
