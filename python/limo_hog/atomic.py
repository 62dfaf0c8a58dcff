"""Files that appear under their name only when they are whole."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

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
    """Return the name that an unfinished file keeps, for a later run to go on from: hidden, beside it, same suffix.

    A pipe or a device is written to under its own name. Raises `IsADirectoryError` where `path` is a folder.
    """
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    return path if is_stream(path) else _hidden(path, "part")


def _hidden(path: Path, word: str) -> Path:
    name = f".{path.stem}.{word}{path.suffix}"
    if len(os.fsencode(name)) > _LONGEST_NAME:
        digest = hashlib.sha256(os.fsencode(path.name)).hexdigest()[:32]
        name = f".{digest}.{word}{path.suffix[:16]}"
    return path.with_name(name)


@contextmanager
def about(path: Path) -> Iterator[None]:
    """Errors inside name `path`, not its temporary file."""
    try:
        yield
    except OSError as error:
        if error.filename is not None and not _is_part(Path(str(error.filename)), path):
            raise
        raise _named(error, path) from error


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a name to write to, and rename it to `path` when all went well; else nothing is left behind.

    Folders are made as needed. A pipe or a device stays what it is: the name is its own. Raises `OSError` where the
    file cannot be written; it names `path`.
    """
    part = part_of(path)
    if part == path:
        yield path
        return
    # Two runs that write one file do not meet: the last one's stays.
    part = _hidden(path, f"part-{secrets.token_hex(4)}")
    with about(path):
        path.parent.mkdir(parents=True, exist_ok=True)
    try:
        yield part
        part.replace(path)
    except BaseException as error:
        with suppress(OSError):
            part.unlink()
        if isinstance(error, OSError) and error.filename is not None and _is_part(Path(str(error.filename)), path):
            raise _named(error, path) from error
        raise


@contextmanager
def alone(path: Path) -> Iterator[None]:
    """Keep other runs from writing `path` in this block, by a lock beside it that ends with this process.

    Where the system or the file system has no locks, runs are not kept apart. Raises `BlockingIOError` where another
    run writes it.
    """
    if os.name != "posix" or is_stream(path):
        yield
        return
    import fcntl

    lock = _hidden(path, "lock")
    with about(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        file = lock.open("ab")
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # A run that has just ended may have removed the file between opening and locking.
            free = os.fstat(file.fileno()).st_ino == lock.stat().st_ino
        except OSError as error:
            free = error.errno not in (errno.EWOULDBLOCK, errno.EACCES, errno.ENOENT)
        if not free:
            raise BlockingIOError(errno.EWOULDBLOCK, f"another run is writing it, and holds {lock.name}", str(path))
        try:
            yield
        finally:
            with suppress(OSError):
                lock.unlink()


def json_text(value: object, **options: Any) -> str:
    """Return JSON that every reader takes; `options` are those of `json.dumps`.

    Raises `ValueError` where a number is infinite or NaN, which JSON does not know.
    """
    return json.dumps(value, allow_nan=False, **options)  # noqa: TID251


def write_text(path: Path, text: str) -> None:
    """Write text as UTF-8; bytes of a file's name that are no UTF-8 are written as they are.

    Raises `OSError` where the file cannot be written; it names `path`.
    """
    with whole_file(path) as part, about(path):
        part.write_text(text, "utf-8", "surrogateescape")


def _is_part(name: Path, path: Path) -> bool:
    """Say whether a name is a temporary one of `path`."""
    return name.parent == path.parent and name.name.startswith(".") and (".part" in name.name or ".lock" in name.name)


def _named(error: OSError, path: Path) -> OSError:
    """Return the error with another file name: a new one, since a library's own kind may not let its name be set."""
    return OSError(error.errno or errno.EIO, error.strerror or str(error), str(path))
