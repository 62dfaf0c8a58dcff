"""A node in a process of its own: however it ends, there are a score card and one line of why."""

from __future__ import annotations

import gc
import json
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import pytest
from tests.sim.logs import kept_in
from tests.sim.ros.scripts import DRIVE, FOLLOW, STANDING, node, run_script

from limo_hog.cli.main import main
from limo_sim.ros import runner
from limo_sim.ros.stage import Ended, score_of
from limo_sim.run.log import Step

#: Drives for ten images, then does something else.
THEN = f"self.n = getattr(self, 'n', 0) + 1\nif self.n < 10:\n    {DRIVE}\n    return\n"


def log(steps: list[Step]) -> list[tuple[object, ...]]:
    return [
        (step.log.time, step.truth, step.log.decision, step.seen, step.log.detections.windows.tolist())
        for step in steps
    ]


def figures(ended: Ended) -> dict[str, object]:
    """The card of a run, but for the wall clock's figures."""
    clock = ("detect_ms_p50", "detect_ms_p95", "detect_ms_mean", "render_ms_p50", "real_time_factor")
    return {name: value for name, value in score_of(ended).to_json().items() if name not in clock}


def test_the_same_node_scenario_and_seed_give_the_same_run(script: Callable[[str], Path]) -> None:
    path = script(node(FOLLOW, "self.declare_parameter('target_distance', 1.8)"))
    first: list[Step] = []
    second: list[Step] = []
    ended = run_script(path, STANDING, 1.5, 3, watch=kept_in(first))
    again = run_script(path, STANDING, 1.5, 3, watch=kept_in(second))
    assert log(first) == log(second)
    assert len(first) > 10
    assert figures(ended) == figures(again)
    assert (ended.failure, ended.episode.detector, ended.episode.target_distance) == ("", "hog", 1.8)


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("import os; os._exit(3)", "died at 0.90 s: its process ended with status 3 before the run was over"),
        ("import os; os._exit(0)", "died at 0.90 s: its process ended with status 0"),
        ("import ctypes; ctypes.string_at(0)", "died at 0.90 s: its process was ended by SIGSEGV"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGKILL)", "its process was ended by SIGKILL"),
        (
            "import os, signal\nif os.fork() == 0:\n    signal.signal(signal.SIGALRM, signal.SIG_DFL)\n"
            "    signal.alarm(20); signal.pause()\nos._exit(1)",
            "its process ended with status 1",
        ),
        ("1 / 0", "failed with ZeroDivisionError at 0.90 s"),
    ],
)
def test_a_node_that_dies_leaves_its_log_and_a_robot_that_stands(
    script: Callable[[str], Path], body: str, said: str
) -> None:
    steps: list[Step] = []
    after_raising: list[Step] = []
    ended = run_script(script(node(THEN + body)), STANDING, 20.0, watch=kept_in(steps))
    assert ended.failure.startswith("node.py ")
    assert said in ended.failure
    assert ended.failure.endswith("; the watchdog stopped the robot")
    assert "\n" not in ended.failure
    # What followed is what follows where a node raises at the same time: the arena is the same one.
    text = THEN + "raise RuntimeError"
    raised = run_script(script(node(text)), STANDING, 20.0, watch=kept_in(after_raising))
    assert [(step.log.time, step.truth) for step in steps] == [(step.log.time, step.truth) for step in after_raising]
    assert ended.episode.contacts == raised.episode.contacts
    assert steps[-1].log.time == pytest.approx(2.9, abs=0.11)
    assert figures(ended) | {"failure": ""} == figures(raised) | {"failure": ""}


def test_the_memory_of_a_run_does_not_grow(script: Callable[[str], Path], capsys: pytest.CaptureFixture[str]) -> None:
    said = f"""
import gc, tracemalloc
self.n = getattr(self, 'n', 0) + 1
{DRIVE}
if self.n == 1:
    tracemalloc.start()
if self.n in (50, 150):
    gc.collect()
    print(tracemalloc.get_traced_memory()[0])
"""
    here: list[int] = []

    def watch(_: Step) -> None:
        gc.collect()
        here.append(tracemalloc.get_traced_memory()[0])

    tracemalloc.start()
    try:
        run_script(script(node(said)), STANDING, 15.5, watch=watch)
    finally:
        tracemalloc.stop()
    there = [int(line) for line in capsys.readouterr().out.split()]
    # Of each of a hundred control periods a step would keep 4 kB; a command keeps 24 bytes, the card's percentiles 12.
    assert there[1] - there[0] < 100 * 400
    assert here[150] - here[50] < 100 * 400


@pytest.mark.parametrize(
    "body",
    [
        "import signal; signal.signal(signal.SIGALRM, signal.SIG_IGN)\nwhile True: pass",
        # (Python looks for the handler of an interrupt at the jump back one place before the loop, so that a statement
        # of the `try` must stand there: without it one interrupt in sixty is not caught.)
        "while True:\n    try:\n        n = range(99)\n        while True: sum(n)\n    except BaseException: pass",
    ],
)
def test_a_node_that_takes_no_interrupt_is_stopped(
    script: Callable[[str], Path], body: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runner, "GRACE_S", 1.0)
    began = time.monotonic()
    # (Patience is wall time: a busy machine may keep the node from its loop for a second.)
    ended = run_script(script(node(THEN + body)), STANDING, 20.0, patience=4.0)
    assert "hung at 0.90 s: no simulated time has passed for 4 s, and it took no interrupt" in ended.failure
    assert time.monotonic() - began < 60


def test_a_node_that_prints_for_ever_is_interrupted(script: Callable[[str], Path]) -> None:
    ended = run_script(script(node("while True: print(end='')")), STANDING, 2.0, patience=2.0)
    assert "hung at 0.00 s" in ended.failure
    assert "print(end='')" in ended.traceback


def test_what_a_node_prints_comes_out_here_even_right_before_its_death(
    script: Callable[[str], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    body = "import os, sys\nprint('hello'); print('wrong', file=sys.stderr); os._exit(1)"
    run_script(script(node(body)), STANDING, 2.0)
    said = capsys.readouterr()
    assert (said.out, said.err) == ("hello\n", "wrong\n")


def test_a_watcher_that_fails_ends_the_node(script: Callable[[str], Path]) -> None:
    def full(_: Step) -> None:
        raise OSError("no space left on device")

    with pytest.raises(OSError, match="no space left"):
        run_script(script(node(DRIVE)), STANDING, 2.0, watch=full)


def test_the_command_line_writes_a_card_and_ends_with_one_line(
    script: Callable[[str], Path], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path, card = script(node(THEN + "import os; os._exit(3)")), tmp_path / "card.json"
    assert main(["run", str(path), "--seconds", "5", "--json", str(card), "--scenario", "followable"]) == 1
    said = capfd.readouterr()
    assert json.loads(card.read_text())["controller"] == "node.py"
    assert "followable" in said.out
    assert said.err.splitlines()[-1].startswith("limo-hog: node.py died at 0.90 s: its process ended with status 3")


def test_ctrl_c_ends_run_and_node_and_leaves_no_process(script: Callable[[str], Path]) -> None:
    path = script(node("import os; print('pid', os.getpid(), flush=True); " + DRIVE))
    command = [sys.executable, "-m", "limo_hog.cli.main", "run", str(path), "--seconds", "3600", "--view", "0"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as run:
        assert run.stdout
        pid = int(run.stdout.readline().split()[1])
        run.terminate()
        began = time.monotonic()
        run.communicate(timeout=60)
        assert run.returncode == 128 + 15
        assert time.monotonic() - began < 20
    assert not Path(f"/proc/{pid}").exists()
