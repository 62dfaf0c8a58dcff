"""Processes that wait for nodes, handed to one thread each."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from limo_sim.ros import worker


class Waiting:
    """A process that waits, and is never started."""

    waits = True

    def kill(self) -> None:
        raise AssertionError("it waits")


class TakenMeanwhile(list[Waiting]):
    """A list that looks as it did before another thread took the last of it."""

    def __len__(self) -> int:
        return 1


@pytest.fixture(autouse=True)
def no_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker, "Worker", Waiting)
    monkeypatch.setattr(worker, "idle", [])


def test_a_process_that_another_thread_takes_meanwhile_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker, "idle", TakenMeanwhile())
    with worker.ready() as given:
        assert isinstance(given, Waiting)


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
