"""Python's own waits, in a node's process: in a thread of the script they give the turn away and take simulated time.

CPython's privates are touched here alone. A run goes on without one of them, less exact:

- `threading._time`, `queue.time`, the clock that timeouts are compared with: these timeouts are the wall's;
- `Condition._waiters`, `_release_save` and `_acquire_restore`, by which `notify` releases a waiter: waits are real, and
  one for a thread of the script ends as hung;
- `Thread._target`, which tells a pool's thread from the script's: a wait for a pool ends as hung.
"""

from __future__ import annotations

import math
import queue
import threading
import time
from _thread import allocate_lock
from collections.abc import Callable
from typing import Any

from limo_sim.ros.lockstep.turns import Turns

#: `time.monotonic` at the start of a run [s]: by the machine's, the digits lost in sums would differ from run to run.
_BEGAN = float(2**17)


def take_turns(turns: Turns) -> None:
    """Replace what starts, joins, stops and times threads; other threads than the script's notice nothing.

    `time.time` and `time.monotonic` go on with simulated time; `time.perf_counter` stays the wall's.
    """
    real_sleep, real_start, real_join = time.sleep, threading.Thread.start, threading.Thread.join
    real_wait = threading.Condition.wait

    def sleep(seconds: float) -> None:
        if turns.inside:
            turns.sleep(seconds)
        else:
            real_sleep(seconds)

    def clock(real: Callable[[], float], began: float) -> Callable[[], float]:
        return lambda: began + turns.now() if turns.inside else real()

    def until(timeout: float | None) -> float:
        return math.inf if timeout is None else turns.now() + max(timeout, 0.0)

    def start(thread: threading.Thread) -> None:
        # The workers of a pool wait in C, where no turn can be given away: they are no threads of the script.
        pooled = getattr(getattr(thread, "_target", None), "__module__", "") == "concurrent.futures.thread"
        if turns.inside and not pooled:
            turns.start(thread, real_start)
        else:
            real_start(thread)

    def join(thread: threading.Thread, timeout: float | None = None) -> None:
        seat = getattr(thread, "limo_seat", None)
        if turns.inside and seat is not None:
            if turns.wait(lambda: not turns.alive(seat), until(timeout)):
                real_join(thread)
        else:
            real_join(thread, timeout)

    def wait(condition: Any, timeout: float | None = None) -> bool:
        if not turns.inside or (timeout is None and turns.alone):
            # A thread of no other kind can notify the script's only one: that takes no simulated time, or hangs.
            return real_wait(condition, timeout)
        # As `Condition.wait` of CPython, with the turn given away where that blocks.
        waiter = allocate_lock()
        waiter.acquire()
        condition._waiters.append(waiter)
        saved = condition._release_save()
        try:
            notified = turns.wait(lambda: not waiter.locked(), until(timeout))
        finally:
            condition._acquire_restore(saved)
            if waiter.locked():
                condition._waiters.remove(waiter)
        return notified

    monotonic = clock(time.monotonic, _BEGAN)
    replaced: list[tuple[Any, str, Any]] = [
        (time, "sleep", sleep),
        (time, "time", clock(time.time, time.time())),
        (time, "monotonic", monotonic),
        (threading, "_time", monotonic),
        (queue, "time", monotonic),
        (threading.Thread, "start", start),
        (threading.Thread, "join", join),
    ]
    if all(hasattr(threading.Condition(), name) for name in ("_waiters", "_release_save", "_acquire_restore")):
        replaced.append((threading.Condition, "wait", wait))
    for owner, name, value in replaced:
        if hasattr(owner, name):
            setattr(owner, name, value)
