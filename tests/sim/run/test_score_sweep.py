"""Many runs: every card belongs to its run; worker processes end with their parent."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from limo_sim.run.sweep import Run, in_processes, play


def test_every_card_belongs_to_its_run_whatever_the_scenario_calls_itself(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text('name = "another name"\n')
    runs = [Run(str(tmp_path / "mine.toml"), "proxemic", "hog", 0, 0.2, 1.8)]
    runs += [Run("workshop", "approach", "hog", 1, 0.4), Run("empty", "proxemic", "hog", 2, 0.1)]
    cards = dict(in_processes(play, runs, 1))
    assert set(cards) == set(runs)
    assert [cards[run].scenario for run in runs] == ["another name", "workshop", "empty"]
    assert [cards[run].target_m for run in runs] == [1.8, None, 1.5]
    assert [cards[run].seed for run in runs] == [0, 1, 2]


def _stat(number: int | str) -> list[str]:
    """What Linux says of a process that runs, after its name; nothing of one that has ended."""
    with suppress(OSError):
        words = Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()
        return words if words[0] != "Z" else []
    return []


def _processes_of(parent: int) -> set[int]:
    """The children of a process, and theirs."""
    children = [int(one.name) for one in Path("/proc").glob("[0-9]*") if _stat(one.name)[1:2] == [str(parent)]]
    return {*children, *(number for child in children for number in _processes_of(child))}


@contextmanager
def _scoring(*more: str) -> Iterator[tuple[subprocess.Popen[str], set[int]]]:
    """`limo-hog score` at work with two workers that play, and its processes."""
    command = [sys.executable, "-m", "limo_hog", "score", "--scenario", "empty", "--controller", "approach", *more]
    with subprocess.Popen([*command, "--workers", "2"], stderr=subprocess.PIPE, text=True) as child:
        until = time.monotonic() + 60
        while len(busy := {one for one in _processes_of(child.pid) if _seconds_of(one) > 2.5}) < 2:
            assert time.monotonic() < until and child.poll() is None
            time.sleep(0.1)
        yield child, busy
        child.kill()


def _seconds_of(number: int) -> float:
    """Processor time of a process [s]; importing all it needs takes about two."""
    return sum(map(int, _stat(number)[11:13])) / os.sysconf("SC_CLK_TCK")


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_workers_end_with_their_parent_whatever_ends_it(number: signal.Signals) -> None:
    with _scoring("--seeds", "20", "--seconds", "3000") as (child, workers):
        began = time.monotonic()
        child.send_signal(number)
        assert child.wait(20) == (-number if number == signal.SIGKILL else 128 + number)
        while any(map(_stat, workers)):
            assert time.monotonic() - began < 3.0
            time.sleep(0.05)
        assert child.stderr is not None
        # After SIGKILL Python's own tracker of semaphores says that it cleaned up.
        assert number == signal.SIGKILL or child.stderr.read().splitlines() == ["limo-hog: stopped"]


@pytest.mark.parametrize("stop", [signal.SIGKILL, signal.SIGINT])
def test_finished_runs_are_kept_when_a_worker_is_killed_or_score_is_stopped(
    stop: signal.Signals, tmp_path: Path
) -> None:
    outputs = ["--json", str(tmp_path / "s.json"), "--csv", str(tmp_path / "s.csv")]
    with _scoring("--seeds", "300", "--seconds", "2", *outputs) as (child, workers):
        time.sleep(2.0)
        os.kill(min(workers) if stop == signal.SIGKILL else child.pid, stop)
        began = time.monotonic()
        code = child.wait(60)
        # Chosen: a machine shared with other tests takes three times as long as one that is not.
        assert stop == signal.SIGKILL or time.monotonic() - began < 3.0
        assert child.stderr is not None
        (line,) = child.stderr.read().splitlines()
    runs = json.loads((tmp_path / "s.json").read_text())["runs"]
    assert 0 < len(runs) < 300 and len((tmp_path / "s.csv").read_text().splitlines()) == len(runs) + 1
    if stop == signal.SIGINT:
        assert (code, line) == (130, "limo-hog: stopped")
    else:
        assert code == 1 and line.startswith("limo-hog: a worker process was killed")
        assert f" {300 - len(runs)} of 300 runs" in line
