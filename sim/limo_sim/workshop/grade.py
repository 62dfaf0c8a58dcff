"""Grades a folder of nodes: each runs in processes of its own, among its own files, with limits of time and memory."""

from __future__ import annotations

import csv
import os
import shutil
import stat
import subprocess
import tempfile
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TextIO

from limo_sim.ros.runner import Limits
from limo_sim.ros.worker import no_nodes
from limo_sim.workshop.check import examine
from limo_sim.workshop.exercises import EXERCISES
from limo_sim.workshop.report import to_json

#: What is taken of a student's folder: so many files, in so many folders in each other, of so many bytes together.
_MOST_FILES, _DEEPEST, _MOST_BYTES = 1000, 8, 200 * 10**6


@dataclass(frozen=True, slots=True)
class Grade:
    """One file's result: what `to_json` returns, or None with the reason."""

    file: Path
    result: dict[str, Any] | None
    reason: str = ""


def nodes_in(folder: Path) -> list[Path]:
    """Return the Python files of a folder and of the folders in it, sorted."""
    return sorted((*folder.glob("*.py"), *folder.glob("*/*.py")))


def grade(
    files: Sequence[Path], folder: Path, workers: int, node: str = "follower", limits: Limits | None = None
) -> Generator[Grade, None, None]:
    """Check each file of `nodes_in(folder)`, `workers` of them at once; yield the grades as they come.

    The limits of time are those of all scenes together. A caller who leaves early ends the nodes that run.
    """
    allowed = limits or Limits(seconds=100.0)
    with ThreadPoolExecutor(workers) as pool:
        waiting = [pool.submit(_grade, file, folder, node, allowed) for file in files]
        try:
            for done in as_completed(waiting):
                yield done.result()
        except BaseException:
            with no_nodes():
                pool.shutdown(cancel_futures=True)
            raise


def _grade(file: Path, folder: Path, node: str, limits: Limits) -> Grade:
    try:
        with _scratch() as scratch:
            script = _alone(file, folder, scratch)
            examination = examine(script, node, replace(limits, folder=script.parent))
            return Grade(file, to_json(script, node, examination.verdicts))
    except (OSError, ValueError, RecursionError, MemoryError) as error:
        # One file costs no other its grade.
        return Grade(file, None, f"it cannot be graded: {error}")


@contextmanager
def _scratch() -> Iterator[Path]:
    """Make a folder that is removed whatever a node has left in it."""
    folder = Path(tempfile.mkdtemp(prefix="limo-hog-"))
    try:
        yield folder
    finally:
        if os.name == "posix":
            # (Folders in each other a thousand times are too deep for Python's own removal.)
            subprocess.run(["rm", "-rf", str(folder)], check=False, stderr=subprocess.DEVNULL)  # noqa: S603, S607
        else:
            shutil.rmtree(folder, ignore_errors=True)


def _alone(file: Path, folder: Path, scratch: Path) -> Path:
    """Copy a file, and of a student's own folder the files beside it; return the copy.

    Raises
    ------
    ValueError
        If the file is none, or the folder holds too much.
    """
    if not stat.S_ISREG(file.stat().st_mode):
        raise ValueError("it is no regular file")
    if file.parent == folder:
        return Path(shutil.copyfile(file, scratch / file.name))
    files, size = 0, 0
    waiting = [(file.parent, scratch, 0)]
    while waiting:
        source, target, depth = waiting.pop()
        for entry in os.scandir(source):
            if entry.is_dir(follow_symlinks=False) and depth < _DEEPEST:
                (target / entry.name).mkdir()
                waiting.append((Path(entry.path), target / entry.name, depth + 1))
            elif entry.is_file(follow_symlinks=False) or Path(entry.path) == file:
                files, size = files + 1, size + entry.stat().st_size
                if files > _MOST_FILES or size > _MOST_BYTES:
                    raise ValueError(f"its folder holds more than {_MOST_FILES} files or {_MOST_BYTES // 10**6} MB")
                shutil.copyfile(entry.path, target / entry.name)
    return scratch / file.name


class Table:
    """A line for each file: points, points of each task, and the first mistake with its line."""

    def __init__(self, node: str, folder: Path, target: TextIO) -> None:
        exercise = EXERCISES[node]
        self._tasks = sorted({point.task for point in exercise.checkpoints if point not in exercise.given})
        self._folder, self._target = folder, target
        self._writer = csv.writer(target, lineterminator="\n")
        tasks = (f"task_{task}" for task in self._tasks)
        self._writer.writerow(["file", "points", "max_points", *tasks, "line", "first_mistake"])

    def add(self, graded: Grade) -> None:
        """Write a line, to the disk."""
        # (Names from old archives are not UTF-8.)
        name = os.fsencode(graded.file.relative_to(self._folder)).decode("utf-8", "backslashreplace")
        if graded.result is None:
            self._writer.writerow([name, 0, "", *("" for _ in self._tasks), "", graded.reason])
        else:
            won = {task["task"]: task["points"] for task in graded.result["tasks"]}
            missed = next((entry for entry in graded.result["checkpoints"] if not entry["holds"]), None)
            line, said = "", ""
            if missed is not None:
                line = "" if missed["line"] is None else missed["line"]
                said = f"{missed['checkpoint']}: " + " ".join(missed["evidence"].split())
            points, worth = graded.result["points"], graded.result["max_points"]
            self._writer.writerow([name, points, worth, *(won.get(task, "") for task in self._tasks), line, said])
        self._target.flush()
