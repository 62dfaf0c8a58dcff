"""`limo-hog workshop grade`: a folder of nodes, some of them hostile."""

import csv
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest
from tests.sim.workshop.strangers import table_of, written

from limo_hog.cli.main import main
from limo_sim.ros.runner import Limits
from limo_sim.workshop import template
from limo_sim.workshop.grade import grade, nodes_in

LOOP = "while True:\n    try:\n        n = 0\n        while True: n += 1\n    except BaseException: pass\n"


def test_a_hostile_node_ends_within_its_limits_and_gets_no_points(tmp_path: Path) -> None:
    written(tmp_path, node="import subprocess\nsubprocess.Popen(['sleep', '600'])\n" + LOOP)
    (graded,) = grade(nodes_in(tmp_path), tmp_path, 1, "follower", Limits(patience=2.0, seconds=60.0))
    assert graded.result is not None and graded.result["points"] == 0
    assert "it took no interrupt" in graded.result["checkpoints"][0]["evidence"]


def test_what_is_no_file_costs_its_own_row_alone(tmp_path: Path) -> None:
    deep = "import os\nfor _ in range(1500):\n    os.mkdir('d'); os.chdir('d')\n"
    folder = written(tmp_path / "class", amy=template("follower"))
    (folder / "bob.py").symlink_to(folder / "gone.py")
    (folder / "eve.py").symlink_to(folder / "eve.py")
    os.mkfifo(folder / "ian.py")
    (folder / "joe.py").mkdir()
    (folder / os.fsdecode(b"kim\xe9.py")).write_text(template("follower"))
    written(folder / "lou", node=deep)
    before = set(Path(tempfile.gettempdir()).glob("limo-hog-*"))
    rows = table_of(folder)
    assert len(rows) == 7 and {row["points"] for row in rows.values()} == {"0"}
    assert rows["amy.py"]["first_mistake"].startswith("the camera image is shown")
    assert rows["kim\\xe9.py"]["max_points"] == "100"
    assert rows["ian.py"]["first_mistake"] == "it cannot be graded: it is no regular file"
    for name in ("bob.py", "eve.py"):
        assert rows[name]["first_mistake"].startswith("it cannot be graded: ")
    assert set(Path(tempfile.gettempdir()).glob("limo-hog-*")) <= before


def test_no_student_is_run_among_the_files_of_another(tmp_path: Path) -> None:
    folder = written(tmp_path / "class", amy="import bob\n", bob=template("follower"))
    # (Names that this program or a library imports late.)
    written(folder, **dict.fromkeys(("ruamel", "helper", "sitecustomize"), "raise RuntimeError('imported')\n"))
    written(folder / "eve", node="import own\n", own=template("follower"))
    rows = table_of(folder)
    assert "No module named 'bob'" in rows["amy.py"]["first_mistake"]
    assert rows["bob.py"]["first_mistake"].startswith("the camera image is shown")
    assert "ModuleNotFoundError" not in rows["eve/node.py"]["first_mistake"]


def test_a_signal_to_grade_keeps_the_rows_that_are_done_and_ends_the_nodes(tmp_path: Path) -> None:
    folder = written(tmp_path / "class", amy="raise ValueError\n", bob=LOOP, eve=LOOP)
    table, unfinished = tmp_path / "points.csv", tmp_path / ".points.part.csv"
    command = [sys.executable, "-m", "limo_hog", "workshop", "grade", str(folder), "--csv", str(table)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True) as run:
        until = time.monotonic() + 60
        while not (unfinished.is_file() and "amy.py" in unfinished.read_text()) and time.monotonic() < until:
            time.sleep(0.1)
        run.terminate()
        began = time.monotonic()
        run.communicate(timeout=60)
        assert time.monotonic() - began < 15
        assert run.returncode == 128 + 15
    assert [row["file"] for row in csv.DictReader(table.read_text().splitlines())] == ["amy.py"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["class", "points.csv"]


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a node's process is killed at once")
@pytest.mark.parametrize("action", ["check", "grade"])
def test_a_signal_does_not_wait_for_a_nodes_process_that_still_imports(action: str, tmp_path: Path) -> None:
    written(tmp_path, sitecustomize="import sys, time\nif 'limo_sim.ros.child' in sys.orig_argv:\n    time.sleep(30)\n")
    written(tmp_path / "class", amy=template("follower"))
    command = [sys.executable, "-m", "limo_hog", "workshop", action, "class" if action == "grade" else "class/amy.py"]
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    with subprocess.Popen(command, cwd=tmp_path, env=environment, stdout=subprocess.DEVNULL) as run:
        time.sleep(4.0)
        run.terminate()
        assert run.wait(5) == 128 + 15


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="this system binds no process to a core")
def test_where_one_core_may_be_used_one_node_runs_at_a_time(tmp_path: Path) -> None:
    log = tmp_path / "log.txt"
    busy = f"def note(word):\n    with open({str(log)!r}, 'a') as log:\n        log.write(f'{{word}} ')\n"
    busy += "note('begun')\nsum(range(40_000_000))\nnote('ended')\nimport os\nos._exit(0)\n"
    written(tmp_path, amy=busy, bob=busy)
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
