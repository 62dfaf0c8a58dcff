"""`limo-hog workshop grade`: a folder of nodes, some of them hostile."""

from __future__ import annotations

import csv
import os
import time
from pathlib import Path

import pytest

from limo_hog.cli.main import main
from limo_sim.workshop import solution, template
from limo_sim.workshop.grade import Limits, grade, nodes_in

LOOP = "while True:\n    try:\n        n = 0\n        while True: n += 1\n    except BaseException: pass\n"
HOSTILE = {
    "loop": LOOP,
    "exit": "import os\nos._exit(0)\n",
    "memory": "keep = bytearray(10 * 10**9)\n",
    "child": "import subprocess\nsubprocess.Popen(['sleep', '600'])\n" + LOOP,
}
REASONS = {"loop": "more than 12 s", "exit": "exit code 0", "child": "more than 12 s"}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_node_ends_within_its_limits_and_gets_no_points(tmp_path: Path, name: str) -> None:
    (tmp_path / "node.py").write_text(HOSTILE[name])
    (graded,) = grade(nodes_in(tmp_path), 1, limits=Limits(seconds=60.0 if name == "memory" else 12.0))
    if name == "memory":
        assert graded.result is not None
        assert graded.result["points"] == 0
        assert "MemoryError" in graded.result["checkpoints"][0]["evidence"]
    else:
        assert graded.result is None
        assert REASONS[name] in graded.reason


def test_a_folder_becomes_a_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "amy").mkdir()
    (tmp_path / "amy" / "node.py").write_text(solution("follower"))
    (tmp_path / "bob.py").write_text(template("follower"))
    (tmp_path / "eve.py").write_text(HOSTILE["exit"])
    table = tmp_path / "points.csv"
    assert main(["workshop", "grade", str(tmp_path), "--csv", str(table)]) == 0
    rows = list(csv.DictReader(table.read_text(encoding="utf-8").splitlines()))
    assert [(row["file"], row["points"]) for row in rows] == [("amy/node.py", "100"), ("bob.py", "0"), ("eve.py", "0")]
    assert [rows[0][f"task_{task}"] for task in (1, 2, 3, 4)] == ["10", "25", "25", "40"]
    assert rows[1]["first_mistake"].startswith("the camera image is shown: ")
    assert "os._exit" in rows[2]["first_mistake"]
    assert "3 files" in capsys.readouterr().err


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="this system binds no process to a core")
def test_where_one_core_may_be_used_one_node_runs_at_a_time(tmp_path: Path) -> None:
    log = tmp_path / "log.txt"
    busy = f"def note(word):\n    with open({str(log)!r}, 'a') as log:\n        log.write(f'{{word}} ')\n"
    busy += "note('begun')\nsum(range(40_000_000))\nnote('ended')\nimport os\nos._exit(0)\n"
    for name in ("amy", "bob"):
        (tmp_path / f"{name}.py").write_text(busy)
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(allowed)})
    try:
        assert main(["workshop", "grade", str(tmp_path), "--csv", str(tmp_path / "points.csv")]) == 0
    finally:
        os.sched_setaffinity(0, allowed)
    assert log.read_text().split() == ["begun", "ended"] * 2


def test_a_folder_without_nodes_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["workshop", "grade", str(tmp_path)]) == 2
    assert "no Python file" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_thirty_submissions_three_of_them_hostile_are_graded_in_five_minutes(tmp_path: Path) -> None:
    good, empty = solution("follower"), template("follower")
    wrong = good.replace("middle - cx", "cx - middle")
    for number in range(27):
        (tmp_path / f"s{number:02}.py").write_text((good, wrong, empty)[number % 3])
    for name in ("loop", "memory", "exit"):
        (tmp_path / f"x_{name}.py").write_text(HOSTILE[name])
    table = tmp_path / "points.csv"
    began = time.monotonic()
    assert main(["workshop", "grade", str(tmp_path), "--csv", str(table)]) == 0
    took = time.monotonic() - began
    rows = list(csv.DictReader(table.read_text(encoding="utf-8").splitlines()))
    assert [row["points"] for row in rows[:27]] == ["100", "80", "0"] * 9
    assert "the sign is swapped" in rows[1]["first_mistake"]
    assert [row["points"] for row in rows[27:]] == ["0", "0", "0"]
    # The loop catches what interrupts it, unless it is interrupted between two rounds.
    loop = rows[28]["first_mistake"]
    assert "more than 100 s" in loop or "a loop or a call that never ends" in loop
    assert took < 300, f"{took:.0f} s"
