"""JSON to a file or to standard output, and errors in one line."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from limo_hog.atomic import write_text
from limo_hog.exceptions import LimoHogError

#: The file name that stands for standard output.
STDOUT = "-"


class UsageError(LimoHogError):
    """Arguments are wrong, or contradict each other."""


def write_json(target: str, value: object) -> None:
    """Write one JSON value, indented, to a file, or to standard output where the target is "-".

    Raises
    ------
    ValueError
        A number in it is not finite, which JSON does not know.
    """
    text = json.dumps(value, indent=2, allow_nan=False) + "\n"
    if target == STDOUT:
        sys.stdout.write(text)
        return
    write_text(Path(target), text)


def printable(text: str) -> str:
    """Return text that standard output can show: characters that its encoding lacks are escaped."""
    encoding = sys.stdout.encoding or "utf-8"
    return text.encode(encoding, "backslashreplace").decode(encoding)


def one_line(error: Exception) -> str:
    """Return an error in one line, with the name of its file."""
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror}"
    if isinstance(error, MemoryError):
        return f"out of memory: {error}"
    return " ".join(str(error).split())
