"""Files that appear under their name only when they are whole."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def part_of(path: Path) -> Path:
    """Return the name a file has while it is written: hidden, beside it, with the same suffix.

    Raises
    ------
    IsADirectoryError
        `path` is a folder.
    """
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    return path.with_name(f".{path.stem}.part{path.suffix}")


@contextmanager
def about(path: Path) -> Iterator[None]:
    """Let an error that names the unfinished file, or none, name the file the user knows."""
    try:
        yield
    except OSError as error:
        if error.filename is not None and str(error.filename) != str(part_of(path)):
            raise
        raise _named(error, path) from error


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a name to write to, and rename it to `path` when all went well; else nothing is left behind.

    Folders are made as needed.

    Raises
    ------
    OSError
        The file cannot be written; it names `path`.
    """
    part = part_of(path)
    with about(path):
        path.parent.mkdir(parents=True, exist_ok=True)
    try:
        yield part
        part.replace(path)
    except BaseException as error:
        part.unlink(missing_ok=True)
        if isinstance(error, OSError) and str(error.filename) == str(part):
            raise _named(error, path) from error
        raise


def _named(error: OSError, path: Path) -> OSError:
    """Return the error with another file name: a new one, since a library's own kind may not let its name be set."""
    return OSError(error.errno or errno.EIO, error.strerror or str(error), str(path))
