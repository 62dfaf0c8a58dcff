"""Interrupts a script that hangs: one that lets no simulated time pass for too much wall time."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

#: How often the timer goes off until the script is interrupted [s]. The system may give a signal to any thread, such as
#: one of OpenCV's after Ctrl-Z and `fg`: a main thread that waits does not notice it. Chosen: soon for a person.
_AGAIN_S = 0.1


class HungError(BaseException):
    """The script hangs; not an Exception, so that `except Exception` in a script does not hide it."""


class Patience:
    """A timer that starts again whenever simulated time passes.

    It needs the main thread and a system with interval timers; elsewhere (Windows), and where the script takes no
    interrupt, `limo_sim.ros.runner` stops its process.
    """

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self._running = False

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Raise `HungError` inside when no simulated time passes for too long."""
        if not hasattr(signal, "setitimer"):
            yield
            return
        handler = signal.signal(signal.SIGALRM, self._alarm)
        self._running = True
        self._start()
        try:
            yield
        finally:
            self._running = False
            signal.setitimer(signal.ITIMER_REAL, 0)
            signal.signal(signal.SIGALRM, handler)

    @contextmanager
    def suspended(self) -> Iterator[None]:
        """Stop the timer while the arena works or the live view is paused, and start it again."""
        if self._running:
            signal.setitimer(signal.ITIMER_REAL, 0)
        yield
        if self._running:
            self._start()

    def _start(self) -> None:
        signal.setitimer(signal.ITIMER_REAL, self.seconds, _AGAIN_S)

    def _alarm(self, _signal: int, _frame: FrameType | None) -> None:
        signal.setitimer(signal.ITIMER_REAL, 0)
        raise HungError(f"no simulated time has passed for {self.seconds:g} s: a loop or a call that never ends")
