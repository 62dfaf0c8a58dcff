"""Warnings in one line on standard error, as errors are."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from limo_hog.cli.support.output import printable


@contextmanager
def warnings_in_one_line() -> Iterator[None]:
    """Print every warning raised inside as `limo-hog: warning: ...`, once."""
    shown: set[str] = set()

    def show(message: Warning | str, *_: Any, **__: Any) -> None:
        line = printable(" ".join(str(message).split()))
        if line not in shown:
            shown.add(line)
            print(f"limo-hog: warning: {line}", file=sys.stderr)

    with warnings.catch_warnings():
        warnings.simplefilter("always")
        warnings.showwarning = show
        yield
