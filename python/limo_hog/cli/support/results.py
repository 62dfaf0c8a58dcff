"""JSON lines of a `detect` run: whole lines whatever happens, and what an earlier run has done."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from limo_hog.atomic import about, part_of
from limo_hog.cli.support.output import STDOUT
from limo_hog.exceptions import LimoHogError


class ResumeError(LimoHogError):
    """The results of an earlier run cannot be gone on from."""


class Results(NamedTuple):
    """Where results go, and which frames of which source are there already: None where nothing is kept."""

    write: Callable[[dict[str, Any]], None]
    done: dict[str, set[int]] | None


@contextmanager
def json_lines(target: str | None, resume: bool) -> Iterator[Results]:
    """Open a file (or "-", or nothing) for one JSON object a line.

    The file gets its name at the end, or when the run is stopped: with every line written so far, and no half one.
    A run that was killed leaves it beside, and is gone on from all the same.
    """
    if target is None or target == STDOUT:
        # Flushed line by line for who reads along.
        show = (lambda result: print(json.dumps(result), flush=True)) if target else (lambda _: None)
        yield Results(show, None)
        return
    path = Path(target)
    part = part_of(path)
    done = _take_up(path, part) if resume else {}
    with about(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        opened = part.open("ab" if resume else "wb", buffering=0)
    with opened as file:
        whole = file.tell()

        def write(result: dict[str, Any]) -> None:
            nonlocal whole
            data = json.dumps(result).encode() + b"\n"
            with about(path):
                while data:
                    data = data[file.write(data) :]
            whole = file.tell()

        try:
            yield Results(write, done)
        finally:
            # A full disk may have taken half a line.
            file.truncate(whole)
            part.replace(path)


def _take_up(path: Path, part: Path) -> dict[str, set[int]]:
    """Make `part` what an earlier run has done, without half a line at its end."""
    if not part.exists():
        if not path.exists():
            return {}
        path.replace(part)
    text = part.read_bytes()
    whole = text.rfind(b"\n") + 1
    done: dict[str, set[int]] = defaultdict(set)
    try:
        for line in text[:whole].splitlines():
            result = json.loads(line)
            done[result["source"]].add(result["frame"])
    except (ValueError, KeyError, TypeError) as error:
        part.replace(path)
        raise ResumeError(f"{path}: not the JSON lines of an earlier run") from error
    with part.open("rb+") as file:
        file.truncate(whole)
    return done
