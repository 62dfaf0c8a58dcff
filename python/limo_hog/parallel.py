"""Work on several threads, with results in the order of the items."""

from __future__ import annotations

import os
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from concurrent.futures import Future

Item = TypeVar("Item")
Result = TypeVar("Result")

#: How long a caller who stops waits for work that is under way [s]; a reader may wait for a drive that never answers.
_PATIENCE_S = 0.5


def cores() -> int:
    """Count the processor cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def in_order(work: Callable[[Item], Result], items: Iterable[Item], threads: int) -> Iterator[Result]:
    """Yield `work(item)` for each item, in the items' order, computed by `threads` threads.

    Items are taken as results are, twice as many ahead as there are threads: neither many items nor many results are
    held. What `work` raises is raised at its item's turn. Where the caller takes no more, nothing more is begun, and
    what is under way is left after `_PATIENCE_S`. Threads that cannot be had are done without; the caller's works
    where there is none.
    """
    # Imported here: it would lengthen the import of this package.
    from concurrent.futures import Future

    jobs: queue.SimpleQueue[tuple[Item, Future[Result]] | None] = queue.SimpleQueue()
    waiting: deque[Future[Result]] = deque()
    helpers: list[threading.Thread] = []

    def help_() -> None:
        while (job := jobs.get()) is not None:
            _do(work, *job)

    try:
        for item in items:
            job = item, Future[Result]()
            waiting.append(job[1])
            if len(helpers) < threads:
                helper = threading.Thread(target=help_, name="limo-hog", daemon=True)
                try:
                    helper.start()
                    helpers.append(helper)
                except RuntimeError:
                    threads = len(helpers)
            if helpers:
                jobs.put(job)
            else:
                _do(work, *job)
            if len(waiting) > 2 * threads:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
    finally:
        with suppress(queue.Empty):
            while True:
                jobs.get_nowait()
        for _ in helpers:
            jobs.put(None)
        patient_until = time.monotonic() + _PATIENCE_S
        for helper in helpers:
            helper.join(max(0.0, patient_until - time.monotonic()))


def _do(work: Callable[[Item], Result], item: Item, done: Future[Result]) -> None:
    try:
        done.set_result(work(item))
    except BaseException as error:
        done.set_exception(error)
