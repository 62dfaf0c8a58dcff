"""Files that appear under their name only when they are whole."""

from __future__ import annotations

import errno
import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

#: Longest name of a file [bytes] on Linux's and macOS's file systems.
_LONGEST_NAME = 255


def is_stream(path: Path) -> bool:
    """Say whether a name is a pipe's or a device's: what is written there is no file, and replaces none."""
    return path.exists() and not path.is_file() and not path.is_dir()


def is_utf8(name: str) -> bool:
    """Say whether a file's name can be written as UTF-8; OpenCV crashes on those that cannot."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True


def part_of(path: Path) -> Path:
    """Return the name a file has while it is written: hidden, beside it, with the same suffix.

    A pipe or a device is written to under its own name.

    Raises
    ------
    IsADirectoryError
        `path` is a folder.
    """
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if is_stream(path):
        return path
    name = f".{path.stem}.part{path.suffix}"
    if len(os.fsencode(name)) > _LONGEST_NAME:
        digest = hashlib.sha256(os.fsencode(path.name)).hexdigest()[:32]
        name = f".{digest}.part{path.suffix[:16]}"
    return path.with_name(name)


@contextmanager
def about(path: Path) -> Iterator[None]:
    """Errors inside name `path`, not its temporary file."""
    try:
        yield
    except OSError as error:
        if error.filename is not None and str(error.filename) != str(part_of(path)):
            raise
        raise _named(error, path) from error


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a name to write to, and rename it to `path` when all went well; else nothing is left behind.

    Folders are made as needed. A pipe or a device stays what it is: the name is its own.

    Raises
    ------
    OSError
        The file cannot be written; it names `path`.
    """
    part = part_of(path)
    if part == path:
        yield path
        return
    with about(path):
        path.parent.mkdir(parents=True, exist_ok=True)
    try:
        yield part
        part.replace(path)
    except BaseException as error:
        with suppress(OSError):
            part.unlink()
        if isinstance(error, OSError) and str(error.filename) == str(part):
            raise _named(error, path) from error
        raise


def write_text(path: Path, text: str) -> None:
    """Write text as UTF-8; bytes of a file's name that are no UTF-8 are written as they are.

    Raises
    ------
    OSError
        The file cannot be written; it names `path`.
    """
    with whole_file(path) as part, about(path):
        part.write_text(text, "utf-8", "surrogateescape")


def _named(error: OSError, path: Path) -> OSError:
    """Return the error with another file name: a new one, since a library's own kind may not let its name be set."""
    return OSError(error.errno or errno.EIO, error.strerror or str(error), str(path))
