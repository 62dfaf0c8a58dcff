"""Grades a folder of nodes: each in a process of its own, with limits of time and memory.

`python -m limo_sim.workshop.grade FILE NODE RESULT MEMORY_MB` is that process: it writes the points as JSON.
"""

from __future__ import annotations

import contextlib
import csv
import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

import cv2

import limo_hog
from limo_hog.atomic import write_text
from limo_sim.workshop.check import check
from limo_sim.workshop.report import to_json


@dataclass(frozen=True, slots=True)
class Limits:
    """What one node may use.

    Attributes
    ----------
    seconds
        Wall time [s]. A correct node takes 5 s on one core of 2024; chosen: room for twenty times that.
    memory_mb
        Address space [MB], where the system limits it (not on Windows). Python with OpenCV reserves 1.5 GB; chosen.
    """

    seconds: float = 100.0
    memory_mb: int = 4000


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
    files: Sequence[Path],
    workers: int,
    node: str = "follower",
    limits: Limits | None = None,
    done: Callable[[Grade], None] = lambda _: None,
) -> list[Grade]:
    """Check each file in a process of its own, `workers` of them at once; `done` hears of each."""
    limits = limits or Limits()

    def one(file: Path) -> Grade:
        graded = _grade(file, node, limits)
        done(graded)
        return graded

    with ThreadPoolExecutor(workers) as pool:
        return list(pool.map(one, files))


def write_csv(grades: Sequence[Grade], folder: Path, target: TextIO) -> None:
    """Write a line for each file: points, points of each task, and the first mistake with its line."""
    tasks = sorted({task["task"] for graded in grades if graded.result for task in graded.result["tasks"]})
    writer = csv.writer(target, lineterminator="\n")
    writer.writerow(["file", "points", "max_points", *(f"task_{task}" for task in tasks), "line", "first_mistake"])
    for graded in grades:
        name = graded.file.relative_to(folder)
        if graded.result is None:
            writer.writerow([name, 0, "", *("" for _ in tasks), "", graded.reason])
            continue
        won = {task["task"]: task["points"] for task in graded.result["tasks"]}
        missed = [entry for entry in graded.result["checkpoints"] if not entry["holds"]]
        line, said = "", ""
        if missed:
            line = "" if missed[0]["line"] is None else missed[0]["line"]
            said = f"{missed[0]['checkpoint']}: " + " ".join(missed[0]["evidence"].split())
        points, worth = graded.result["points"], graded.result["max_points"]
        writer.writerow([name, points, worth, *(won.get(task, "") for task in tasks), line, said])


def _grade(file: Path, node: str, limits: Limits) -> Grade:
    with tempfile.TemporaryDirectory() as scratch:
        result = Path(scratch) / "result.json"
        command = [sys.executable, "-m", "limo_sim.workshop.grade", str(file.resolve()), node, str(result)]
        child = subprocess.Popen(  # noqa: S603 — the students' nodes are run: that is the purpose
            [*command, str(limits.memory_mb)],
            cwd=scratch,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        try:
            code = child.wait(limits.seconds)
        except subprocess.TimeoutExpired:
            return Grade(file, None, f"ran for more than {limits.seconds:g} s and was stopped")
        finally:
            _end(child)
        try:
            return Grade(file, json.loads(result.read_text(encoding="utf-8")))
        except (OSError, ValueError):
            return Grade(file, None, f"ended without a result, exit code {code}: out of memory, or os._exit was called")


def _end(child: subprocess.Popen[bytes]) -> None:
    """End a process and those it started."""
    if hasattr(os, "killpg"):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child.pid, signal.SIGKILL)
    else:
        child.kill()
    child.wait()


def _limit_memory(megabytes: int) -> None:
    try:
        import resource
    except ImportError:
        # Windows has no such limit.
        return
    resource.setrlimit(resource.RLIMIT_AS, (megabytes * 10**6, megabytes * 10**6))


def _main(file: str, node: str, result: str, memory_mb: str) -> None:
    _limit_memory(int(memory_mb))
    # The same boxes as OpenCV's, many times faster; this process ends with the check.
    vars(cv2)["HOGDescriptor"] = limo_hog.HOGDescriptor
    script = Path(file)
    found = json.dumps(to_json(script, node, check(script, node)))
    write_text(Path(result), found)


if __name__ == "__main__":
    _main(*sys.argv[1:])
