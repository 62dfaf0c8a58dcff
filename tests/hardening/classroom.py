"""A class of hundreds, a tenth of it hostile, in half an hour: every other mark is as when graded alone."""

import argparse
import csv
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tests.sim.ros.scripts import HEAD, node
from tests.sim.workshop.strangers import RIGHT, WRONG
from tests.sim.workshop.test_hostile import FILES, IN_A_CALLBACK, THEN, left_running

#: Short, so that hundreds are graded in minutes.
EXERCISE = """
title = "three scenes"
scenes = ["left", "nobody", "two"]
checkpoints = { shown = 10, found = 20, logged = 10, stands = 20, best = 20, turns = 10, speaks = 10 }
"""


def grade(folder: Path, exercise: Path) -> dict[str, str]:
    """Grade a folder; return the points by file."""
    table = folder.with_suffix(".csv")
    command = [sys.executable, "-m", "limo_hog", "workshop", "grade", str(folder), "--exercise", str(exercise)]
    done = subprocess.run([*command, "--csv", str(table)], check=False, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"grade ended with {done.returncode}: {done.stderr}")
    return {row["file"]: row["points"] for row in csv.DictReader(table.read_text(encoding="utf-8").splitlines())}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--kinds", type=int, default=60, help="how many different honest nodes")
    count, kinds = vars(parser.parse_args()).values()
    honest = [text for exercise, text in (*RIGHT.values(), *WRONG.values()) if exercise == "follower"]
    honest = honest[:: max(len(honest) // kinds, 1)]
    hostile = [HEAD + node(THEN + body) for body, _ in IN_A_CALLBACK.values()] + [text for text, _ in FILES.values()]
    with tempfile.TemporaryDirectory() as scratch:
        exercise = Path(scratch) / "three.toml"
        exercise.write_text(EXERCISE)
        alone, folder = [], Path(scratch) / "class"
        for number, text in enumerate(honest):
            one = Path(scratch) / f"alone{number}"
            one.mkdir()
            (one / "node.py").write_text(text)
            alone.append(grade(one, exercise)["node.py"])
        folder.mkdir()
        wanted = dict[str, str]()
        for number in range(count):
            name, one_of_ten = f"s{number:03}.py", number % 10 == 9
            text = hostile[number // 10 % len(hostile)] if one_of_ten else honest[number % len(honest)]
            (folder / name).write_text(text)
            wanted |= {} if one_of_ten else {name: alone[number % len(honest)]}
        began = time.monotonic()
        marks = grade(folder, exercise)
        took = time.monotonic() - began
        other = {name: (points, marks.get(name)) for name, points in wanted.items() if marks.get(name) != points}
        print(f"{len(marks)} of {count} rows in {took:.0f} s; other marks than alone: {other or 'none'}")
        print(f"left running: {left_running() or 'nothing'}; marks alone: {sorted(set(alone), key=int)}")
        raise SystemExit(bool(other) or len(marks) != count or bool(left_running()))


if __name__ == "__main__":
    main()
