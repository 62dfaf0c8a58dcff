"""Grades a folder of nodes: each runs in processes of its own, among its own files, with limits of time and memory."""

from __future__ import annotations

import csv
import os
import re
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

from limo_hog.atomic import write_text
from limo_sim.ros.runner import Limits
from limo_sim.ros.worker import no_nodes
from limo_sim.workshop import solution
from limo_sim.workshop.check import examine
from limo_sim.workshop.exercises import exercise
from limo_sim.workshop.html_report import to_html
from limo_sim.workshop.mistakes import fingerprint
from limo_sim.workshop.report import to_json

#: What is taken of a student's folder: so many files, in so many folders in each other, of so many bytes together.
_MOST_FILES, _DEEPEST, _MOST_BYTES = 1000, 8, 200 * 10**6
#: Longest cell of the table [characters].
_CELL = 1000
#: Files of a package that are no nodes.
_ASIDE = re.compile(r"(^|/)((setup|conftest|__init__|test_[^/]*|[^/]*[._]launch)\.py$|(tests?|launch|build|install)/)")
#: What students hand in that must be unpacked or exported first.
_PACKED = (".zip", ".ipynb", ".gz", ".7z", ".rar")


@dataclass(frozen=True, slots=True)
class Grade:
    """One file's result: what `to_json` returns, or None with the reason; and what is equal in copies of it."""

    file: Path
    result: dict[str, Any] | None
    reason: str = ""
    like: str = ""


def nodes_in(folder: Path) -> list[Path]:
    """Return each student's node: a .py file of the folder, or the node in a folder of it, such as an ament package.

    What holds no node stands for itself, and is told when it is graded.
    """
    if any((folder / name).exists() for name in ("package.xml", "setup.py")):
        return [_node_in(folder)]
    entries = [entry for entry in folder.iterdir() if not entry.name.startswith((".", "__"))]
    return sorted(
        _node_in(entry) if entry.is_dir() and entry.suffix != ".py" else entry
        for entry in entries
        if entry.suffix in (".py", *_PACKED) or entry.is_dir()
    )


def _node_in(folder: Path) -> Path:
    """Return the file of a student's folder that is the node; the folder if that cannot be told."""
    try:
        files = [Path(entry.path) for entry in _files(folder) if entry.name.endswith(".py")]
        text = {file: file.read_text(encoding="utf-8", errors="replace") for file in files}
    except (OSError, ValueError):
        return folder
    nodes = [file for file in files if not _ASIDE.search(file.relative_to(folder).as_posix())]
    # (What another file imports is its helper.)
    nodes = [file for file in nodes if not _imported(file.stem, [text[other] for other in nodes if other != file])]
    starts = "".join(text[file] for file in files if file.name == "setup.py")
    named = [file for file in nodes if re.search(rf"=\s*[\w.]*\b{re.escape(file.stem)}:", starts)]
    drive = [file for file in named or nodes if "rclpy" in text[file] and "cmd_vel" in text[file]]
    spin = [file for file in drive if "spin" in text[file]]
    return next((those[0] for those in (spin, drive, named, nodes) if len(those) == 1), folder)


def _imported(module: str, texts: Sequence[str]) -> bool:
    named = re.compile(rf"^\s*(from|import)\s+(?!rclpy)[\w.]*\b{re.escape(module)}\b", re.MULTILINE)
    return any(named.search(text) for text in texts)


def _files(folder: Path) -> Iterator[os.DirEntry[str]]:
    """Yield the regular files of a folder and of those in it; a `ValueError` says that it holds too much."""
    files, size, waiting = 0, 0, [(str(folder), 0)]
    while waiting:
        source, depth = waiting.pop()
        for entry in sorted(os.scandir(source), key=lambda entry: entry.name):
            if entry.is_dir(follow_symlinks=False) and depth < _DEEPEST:
                waiting.append((entry.path, depth + 1))
            elif entry.is_file(follow_symlinks=False):
                files, size = files + 1, size + entry.stat().st_size
                if files > _MOST_FILES or size > _MOST_BYTES:
                    raise ValueError(f"its folder holds more than {_MOST_FILES} files or {_MOST_BYTES // 10**6} MB")
                yield entry


def grade(
    files: Sequence[Path], folder: Path, workers: int, node: str, limits: Limits, *, pages: Path | None = None
) -> Generator[Grade, None, None]:
    """Check each file of `nodes_in(folder)`, `workers` of them at once; yield the grades as they come.

    The limits of time are those of all scenes together; in the folder `pages` a page is written for each file. A caller
    who leaves early ends the nodes that run.
    """
    with ThreadPoolExecutor(workers) as pool:
        waiting = [pool.submit(_grade, file, folder, node, limits, pages) for file in files]
        try:
            for done in as_completed(waiting):
                yield done.result()
        except BaseException:
            with no_nodes():
                pool.shutdown(cancel_futures=True)
            raise


def _grade(file: Path, folder: Path, node: str, limits: Limits, pages: Path | None) -> Grade:
    try:
        with _scratch() as scratch:
            script = _alone(file, folder, scratch)
            examination = examine(script, node, replace(limits, folder=script.parent))
            if pages is not None:
                write_text(pages / f"{_name(file, folder).replace('/', '.')}.html", to_html(script, node, examination))
            return Grade(file, to_json(script, node, examination.verdicts), like=fingerprint(script))
    except (OSError, ValueError, RecursionError, MemoryError) as error:
        # One file costs no other its grade.
        return Grade(file, None, f"it cannot be graded: {error}")


def _name(file: Path, folder: Path) -> str:
    """Return a file's name in the table; names from old archives are not UTF-8."""
    return os.fsencode(file.relative_to(folder).as_posix()).decode("utf-8", "backslashreplace")


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
    """Copy a file, and of a student's own folder the files in it; return the copy.

    A `ValueError` says that the file is none, or that the folder holds too much.
    """
    if file.suffix in _PACKED:
        raise ValueError(f"it is a {file.suffix} file: wanted is a .py file, or a folder")
    if file.is_dir() and file.suffix != ".py":
        raise ValueError("it has no Python file, or several that may be the node: wanted is one that drives and spins")
    if not stat.S_ISREG(file.stat().st_mode):
        raise ValueError("it is no regular file")
    own = folder if (folder / "setup.py").exists() else folder / file.relative_to(folder).parts[0]
    if own == file:
        return Path(shutil.copyfile(file, scratch / file.name))
    for entry in _files(own):
        copy = scratch / Path(entry.path).relative_to(own)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(entry.path, copy)
    return scratch / file.relative_to(own)


class Table:
    """A line for each file: points, points of each task, the first mistake with its line, and of what it is a copy."""

    def __init__(self, node: str, folder: Path, target: TextIO) -> None:
        wanted = exercise(node)
        self._folder, self._target = folder, target
        self._seen = {fingerprint(solution(wanted.solution)): "the model solution"} if wanted.solution else {}
        tasks = (f"task_{task}" for task in sorted({point.task for point in wanted.checkpoints if point.points}))
        columns = ["file", "points", "max_points", *tasks, "line", "first_mistake", "copy_of"]
        self._writer = csv.DictWriter(target, columns, lineterminator="\n")
        self._writer.writeheader()

    def add(self, graded: Grade) -> None:
        """Write a line, to the disk."""
        name = _cell(_name(graded.file, self._folder))
        like = self._seen.setdefault(graded.like, name) if graded.like else ""
        row: dict[str, Any] = {"file": name, "points": 0, "first_mistake": _cell(graded.reason)}
        if graded.result is not None:
            row |= {key: graded.result[key] for key in ("points", "max_points")}
            row["copy_of"] = "" if like == name else like
            row |= {f"task_{task['task']}": task["points"] for task in graded.result["tasks"]}
            missed = next((entry for entry in graded.result["checkpoints"] if not entry["holds"]), None)
            if missed is not None:
                said = _cell(f"{missed['checkpoint']}: " + " ".join(missed["evidence"].split()))
                row |= {"line": missed["line"], "first_mistake": said}
        self._writer.writerow(row)
        self._target.flush()


def _cell(text: str) -> str:
    """Return a text that no spreadsheet takes for a formula, and no longer than a reader reads."""
    return ("'" if text.startswith(("=", "+", "-", "@")) else "") + text[:_CELL]
