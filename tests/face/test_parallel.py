"""Work on several threads gives results in order, holds few of them, and stops when it should."""

import random
import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest

import limo_hog
from limo_hog import PeopleDetector
from limo_hog.parallel import cores, in_order


def test_results_come_in_the_order_of_their_items_whatever_each_takes() -> None:
    naps = random.Random(5)

    def work(item: int) -> int:
        time.sleep(naps.random() / 200)
        return item * item

    assert list(in_order(work, range(100), 4)) == [item * item for item in range(100)]
    assert list(in_order(work, (), 4)) == []


@pytest.mark.parametrize("threads", [1, 3])
def test_no_more_items_are_taken_ahead_than_twice_the_threads(threads: int) -> None:
    taken: list[int] = []

    def items() -> Iterator[int]:
        for item in range(50):
            taken.append(item)
            yield item

    for result in in_order(abs, items(), threads):
        assert len(taken) - result <= 2 * threads + 1
    assert len(taken) == 50


def test_what_work_raises_is_raised_at_its_items_turn() -> None:
    results = in_order(lambda item: 6 // item, (1, 2, 0, 3), 2)
    assert [next(results), next(results)] == [6, 3]
    with pytest.raises(ZeroDivisionError):
        next(results)


def test_a_caller_who_stops_begins_nothing_more_and_leaves_no_thread() -> None:
    begun: list[int] = []

    def work(item: int) -> int:
        begun.append(item)
        time.sleep(0.05)
        return item

    before = {*threading.enumerate()}
    results = in_order(work, range(1000), 2)
    next(results)
    results.close()  # type: ignore[attr-defined]
    assert len(begun) <= 6
    assert not [thread for thread in {*threading.enumerate()} - before if "limo-hog" in thread.name]


def test_threads_that_cannot_be_had_are_done_without(monkeypatch: pytest.MonkeyPatch) -> None:
    start = threading.Thread.start
    for most in (0, 2):
        started: list[threading.Thread] = []

        def refuse(thread: threading.Thread, most: int = most, started: list[threading.Thread] = started) -> None:
            if len(started) == most:
                raise RuntimeError("can't start new thread")
            started.append(thread)
            start(thread)

        monkeypatch.setattr(threading.Thread, "start", refuse)
        assert list(in_order(abs, range(50), 8)) == list(range(50)) and len(started) == most


def test_a_detector_uses_no_more_threads_than_there_are_cores(threads_put_back: None) -> None:
    limo_hog.set_num_threads(10**6)
    for _ in PeopleDetector(min_height=None).detect_many([np.zeros((140, 80), np.uint8)] * 300):
        assert sum(thread.name == "limo-hog" for thread in threading.enumerate()) <= cores()
