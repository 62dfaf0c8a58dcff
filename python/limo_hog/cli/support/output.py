"""All that a command prints: streams that outlast their readers, safe text, JSON, errors and warnings."""

from __future__ import annotations

import errno
import io
import os
import sys
import warnings
from argparse import Namespace
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout, suppress
from pathlib import Path
from typing import Any

from limo_hog.atomic import alone, is_stream, json_text, write_text
from limo_hog.exceptions import LimoHogError

#: The file name that stands for standard output.
STDOUT = "-"
#: Arguments that name files or folders to write, and those that name what is read.
WRITTEN = ("json", "csv", "coco", "mot", "out", "video", "record", "plot", "html", "gradescope", "report")
_READ = ("inputs", "model", "against", "data", "negatives", "validate", "scenario", "file", "node", "image")


class UsageError(LimoHogError):
    """Arguments are wrong, or contradict each other."""


def write_json(target: str, value: object) -> None:
    """Write one JSON value, indented, to a file, or to standard output where the target is "-".

    Raises `ValueError` where a number in it is not finite, which JSON does not know.
    """
    text = json_text(value, indent=2) + "\n"
    if target == STDOUT:
        sys.stdout.write(text)
        return
    write_text(Path(target), text)


@contextmanager
def guarded_outputs(args: Namespace) -> Iterator[None]:
    """Refuse, before the work, what should or can not be written; in this block no other run writes it.

    Raises `UsageError` where a file to write is one that is read, is named twice, or is there and is not to be
    replaced; `OSError` where it cannot be written, or another run writes it.
    """
    read = {os.path.realpath(name) for name in _named(args, _READ) if Path(name).is_file()}
    targets = [Path(name) for name in _named(args, WRITTEN) if name != STDOUT]
    if args.command == "train":
        targets.append(Path(f"{args.out}.json"))  # the model's card
    for target in targets:
        if os.path.realpath(target) in read:
            raise UsageError(f"{target} is itself an input: give another name")
        if sum(os.path.realpath(target) == os.path.realpath(other) for other in targets) > 1:
            raise UsageError(f"{target} is named twice, as a file to write: give each a name of its own")
        folder = next(folder for folder in target.absolute().parents if folder.exists())
        if not (folder.is_dir() and os.access(folder, os.W_OK)):
            number = errno.EACCES if folder.is_dir() else errno.ENOTDIR
            raise OSError(number, os.strerror(number), str(target))
    if args.command == "detect" and args.out:
        # A folder for many runs: each copy in it is looked at for itself.
        targets.remove(args.out)
    if not (getattr(args, "overwrite", False) or getattr(args, "resume", False)):
        refuse_to_overwrite(targets, ", --resume goes on from it" if hasattr(args, "resume") else "")
    with ExitStack() as stack:
        for target in targets:
            stack.enter_context(alone(target))
        yield


def _named(args: Namespace, names: Iterable[str]) -> list[str]:
    values = [getattr(args, name, None) for name in names]
    each = [one for value in values for one in (value if isinstance(value, (list, tuple)) else [value])]
    return [os.fspath(one) for one in each if isinstance(one, (str, Path)) and str(one)]


def refuse_to_overwrite(paths: Iterable[Path], resume: str = "") -> None:
    """Refuse to replace what exists; what is written to a pipe, a device or an empty folder replaces nothing.

    Raises `UsageError` where one of them exists; `resume` is the hint to the alternative of overwriting.
    """
    there = [
        path
        for path in paths
        if path.exists() and not is_stream(path) and not (path.is_dir() and not any(path.iterdir()))
    ]
    if there:
        more = f" and {len(there) - 1} more" if len(there) > 1 else ""
        raise UsageError(f"{there[0]}{more} would be overwritten: --overwrite replaces it{resume}")


def printable(text: str) -> str:
    """Return text in one line that a terminal shows and does not obey: other characters are escaped."""
    if text.isprintable():
        return text
    return "".join(sign if sign.isprintable() else ascii(sign)[1:-1] for sign in text)


def emit(line: str) -> None:
    """Print a line that is all a command is for, at once.

    Raises `BrokenPipeError` where nobody reads standard output any more.
    """
    print(line, flush=True)
    if getattr(sys.stdout, "lost", False):
        raise BrokenPipeError


class _Lasting:
    """A text stream that drops what is written once its reader or its terminal is gone."""

    def __init__(self, stream: Any, *, every_error: bool) -> None:
        self._stream, self._every_error = stream, every_error
        self.lost = False  #: whether its reader is gone

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        with self._lasting():
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        with self._lasting():
            self._stream.flush()

    @contextmanager
    def _lasting(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            # A full disk is told, but not on the full disk itself.
            if not (self._every_error or error.errno in (errno.EPIPE, errno.EBADF, errno.EIO)):
                raise OSError(error.errno, error.strerror, "standard output") from error
            self.lost = True
            with suppress(OSError):  # what is buffered goes nowhere, or Python complains at its end
                os.dup2(os.open(os.devnull, os.O_WRONLY), self._stream.fileno())


@contextmanager
def lasting_streams() -> Iterator[None]:
    """Let standard output and standard error survive a closed one, a lost reader and any encoding in this block."""
    # Descriptors 0, 1 and 2 that are closed would become those of the next files, which a library then writes into.
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(descriptor)
    with ExitStack() as stack:
        for stream, redirect in ((sys.stdout, redirect_stdout), (sys.stderr, redirect_stderr)):
            if stream is None:
                stream = stack.enter_context(open(os.devnull, "w", encoding="utf-8"))  # noqa: PTH123
            elif isinstance(stream, io.TextIOWrapper):
                stack.callback(stream.reconfigure, errors=stream.errors)
                stream.reconfigure(errors="backslashreplace")
            lasting = _Lasting(stream, every_error=redirect is redirect_stderr)
            stack.enter_context(redirect(lasting))
        yield


def one_line(error: Exception) -> str:
    """Return an error in one line, with the name of its file."""
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror}"
    if isinstance(error, MemoryError):
        return f"out of memory: {error}"
    return " ".join(str(error).split())


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
