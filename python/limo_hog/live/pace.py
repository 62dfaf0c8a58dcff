"""How fast a run goes: paused, step by step, at a multiple of real time, or as fast as it can."""

from __future__ import annotations

import threading
import time

#: How often a waiting run wakes, so that Ctrl-C works on every system [s].
_WAKE_S = 0.5


class Pace:
    """Slows, pauses and steps a run; set from any thread, by its methods."""

    def __init__(self, speed: float = 1.0) -> None:
        self._changed = threading.Condition()
        self.speed = speed  #: simulated seconds in a second; 0 is as fast as it can
        self.paused = False  #: whether the run stands still
        self._steps = 0
        # Simulated and wall time from which the speed counts.
        self._since: tuple[float, float] | None = None

    def set_speed(self, speed: float) -> None:
        """Go on at another speed."""
        with self._changed:
            self.speed, self._since = speed, None
            self._changed.notify()

    def pause(self) -> None:
        """Stand still."""
        with self._changed:
            self.paused, self._steps = True, 0

    def resume(self) -> None:
        """Go on."""
        with self._changed:
            self.paused, self._since = False, None
            self._changed.notify()

    def step(self) -> None:
        """Stand still, after one more control period."""
        with self._changed:
            self.paused = True
            self._steps += 1
            self._changed.notify()

    def wait(self, now: float) -> None:
        """Return when it is time for what comes after the simulated second `now`."""
        with self._changed:
            while True:
                if self.paused:
                    self._since = None
                    if self._steps:
                        self._steps -= 1
                        return
                    left = _WAKE_S
                elif not self.speed:
                    return
                else:
                    if self._since is None:
                        self._since = now, time.monotonic()
                    then, wall = self._since
                    left = wall + (now - then) / self.speed - time.monotonic()
                    if left <= 0:
                        # Time lost is not made up for later.
                        self._since = now, time.monotonic()
                        return
                self._changed.wait(min(left, _WAKE_S))
