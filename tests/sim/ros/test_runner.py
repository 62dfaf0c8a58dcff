"""A node in a process of its own: however it ends, there are a score card and one line of why; processes that wait."""

import gc
import itertools
import re
import subprocess
import sys
import threading
import time
import tracemalloc
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
from tests.sim.logs import WALL_CLOCK, kept_in
from tests.sim.ros.scripts import DRIVE, FOLLOW, STANDING, Run, node

from limo_sim.ros import worker
from limo_sim.ros.stage import Ended, score_of
from limo_sim.run.log import Step

#: Drives for ten images, then does something else.
THEN = f"self.n = getattr(self, 'n', 0) + 1\nif self.n < 10:\n    {DRIVE}\n    return\n"


def log(steps: list[Step]) -> list[tuple[object, ...]]:
    said = [(step, step.log) for step in steps]
    return [(one.time, step.truth, one.decision, step.seen, one.detections.windows.tolist()) for step, one in said]


def figures(ended: Ended) -> dict[str, object]:
    """The card of a run, but for the wall clock's figures."""
    return {name: value for name, value in score_of(ended).to_json().items() if name not in WALL_CLOCK}


def test_the_same_node_scenario_and_seed_give_the_same_run(run: Run) -> None:
    text, first, second = node(FOLLOW, "self.declare_parameter('target_distance', 1.8)"), list[Step](), list[Step]()
    ended, again = (run(text, STANDING, 1.5, 3, watch=kept_in(steps)) for steps in (first, second))
    assert log(first) == log(second)
    assert len(first) > 10
    assert figures(ended) == figures(again)
    assert (ended.failure, ended.episode.detector, ended.episode.target_distance) == ("", "hog", 1.8)


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("import os; os._exit(3)", "died at 0.90 s: its process ended with status 3 before the run was over"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGKILL)", "its process was ended by SIGKILL"),
        (
            "import os, signal\nif os.fork() == 0:\n    signal.signal(signal.SIGALRM, signal.SIG_DFL)\n"
            "    signal.alarm(20); signal.pause()\nos._exit(1)",
            "its process ended with status 1",
        ),
    ],
)
def test_a_node_that_dies_leaves_its_log_and_a_robot_that_stands(run: Run, body: str, said: str) -> None:
    steps, after_raising = list[Step](), list[Step]()
    ended = run(node(THEN + body), STANDING, 20.0, watch=kept_in(steps))
    assert re.fullmatch(f"node.py .*{re.escape(said)}.*; the watchdog stopped the robot", ended.failure)
    # What followed is what follows where a node raises at the same time: the arena is the same one.
    raised = run(node(THEN + "raise RuntimeError"), STANDING, 20.0, watch=kept_in(after_raising))
    assert [(step.log.time, step.truth) for step in steps] == [(step.log.time, step.truth) for step in after_raising]
    assert ended.episode.contacts == raised.episode.contacts
    assert steps[-1].log.time == pytest.approx(2.9, abs=0.11)
    assert figures(ended) | {"failure": ""} == figures(raised) | {"failure": ""}


def test_the_memory_of_a_run_does_not_grow(run: Run) -> None:
    said = f"import gc, tracemalloc\n{DRIVE}\nself.n = getattr(self, 'n', 0) + 1\nif self.n == 1:\n"
    said += "    tracemalloc.start()\nif self.n in (50, 150):\n    gc.collect()\n"
    said += "    print(tracemalloc.get_traced_memory()[0])"
    here, period = list[int](), itertools.count()

    def watch(_: Step) -> None:
        if next(period) in (50, 150):
            gc.collect()
            here.append(tracemalloc.get_traced_memory()[0])

    tracemalloc.start()
    try:
        printed = run(node(said), STANDING, 15.5, watch=watch).printed["stdout"]
    finally:
        tracemalloc.stop()
    there = [int(line) for line in printed.split()]
    # Of each of a hundred control periods a step would keep 4 kB; a command keeps 24 bytes, the card's percentiles 12.
    assert there[1] - there[0] < 100 * 400
    assert here[1] - here[0] < 100 * 400


def test_a_node_that_prints_for_ever_is_interrupted(run: Run) -> None:
    ended = run(node("while True: print(end='')"), STANDING, patience=2.0)
    assert "hung at 0.00 s" in ended.failure
    assert "print(end='')" in ended.traceback


def test_what_a_node_prints_comes_out_here_even_right_before_its_death(run: Run) -> None:
    body = "import os, sys\nprint('hello'); print('wrong', file=sys.stderr); os._exit(1)"
    assert run(node(body), STANDING).printed == {"stdout": "hello\n", "stderr": "wrong\n"}


def test_a_watcher_that_fails_ends_the_node(run: Run) -> None:
    def full(_: Step) -> None:
        raise OSError("no space left on device")

    with pytest.raises(OSError, match="no space left"):
        run(node(DRIVE), STANDING, watch=full)


def test_a_node_that_cannot_be_started_leaves_no_connection(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker.Worker, "begin", begin := Mock(side_effect=OSError))
    with pytest.raises(OSError):
        run(node(FOLLOW))
    assert [end.fileno() for end in begin.call_args.args[1]] == [-1, -1, -1]


def test_ctrl_c_ends_run_and_node_and_leaves_no_process(script: Callable[[str], Path]) -> None:
    path = script(node("import os; print('pid', os.getpid(), flush=True); " + DRIVE))
    command = [sys.executable, "-m", "limo_hog", "run", str(path), "--seconds", "3600", "--view", "0"]
    piped: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, **piped, start_new_session=True) as run:
        assert run.stdout
        pid = int(run.stdout.readline().split()[1])
        run.terminate()
        began = time.monotonic()
        run.communicate(timeout=60)
        assert run.returncode == 128 + 15
        assert time.monotonic() - began < 20
    assert not Path(f"/proc/{pid}").exists()


class Waiting:
    waits = True

    def kill(self) -> None:
        raise AssertionError("it waits")


class TakenMeanwhile(list[Waiting]):
    """A list that looks as it did before another thread took the last of it."""

    def __len__(self) -> int:
        return 1


@pytest.fixture
def no_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker, "Worker", Waiting)
    monkeypatch.setattr(worker, "idle", [])


@pytest.mark.usefixtures("no_processes")
def test_a_process_that_another_thread_takes_meanwhile_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker, "idle", TakenMeanwhile())
    with worker.ready() as given:
        assert isinstance(given, Waiting)


@pytest.mark.usefixtures("no_processes")
def test_threads_never_share_a_process_and_leave_theirs_for_the_next() -> None:
    together = threading.Barrier(8)

    def take(_: int) -> int:
        with worker.ready() as given:
            together.wait(10)
            return id(given)

    with ThreadPoolExecutor(8) as pool:
        for _ in range(3):
            assert len(set(pool.map(take, range(8)))) == 8
    assert len(worker.idle) == 8
