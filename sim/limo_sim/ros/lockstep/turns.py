"""Turns: of a script's threads one runs at a time, so that a run with threads is as repeatable as one without.

A thread that holds the turn keeps it until it waits: for a message, for simulated time, for another thread. The turn
then goes to the next thread whose wait is over, in the order in which the threads were started; where no wait is over,
the arena advances by one step.
"""

from __future__ import annotations

import math
import threading
from _thread import allocate_lock
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class RunOver(KeyboardInterrupt):
    """The run's time is up."""


class ThreadEnded(BaseException):
    """The script has ended, and with it its daemon threads; not an Exception, so that scripts let it through."""


class ExternalShutdownException(Exception):  # noqa: N818 — rclpy's name
    """The context was shut down during a wait."""


def at_once() -> float:
    """Say of a wait that any step of simulated time may end it."""
    return 0.0


class Seat:
    """One thread of the script."""

    def __init__(self, *, daemon: bool) -> None:
        self.daemon = daemon  #: whether the script ends without waiting for the thread
        #: ready, until, wakes: what it waits for, until when [s], and the time before which that can come with a
        #: message alone [s].
        self.ready: Callable[[], bool] = lambda: True
        self.until = math.inf
        self.wakes: Callable[[], float] = at_once
        self.ended = False
        #: Above zero while the run's own code works in this thread: its sleeps and locks are real.
        self.outside = 0
        self.turn = allocate_lock()
        self.turn.acquire()


class Turns:
    """The threads of one run.

    `advance` lets a step of simulated time pass, or several, as long as no message comes and a time is not reached [s];
    `now` tells simulated time [s]. When the run is `over`, every wait ends. `failed` is given what a thread raises.
    """

    def __init__(
        self,
        advance: Callable[[float], None],
        now: Callable[[], float],
        over: Callable[[], bool],
        failed: Callable[[BaseException], None],
    ) -> None:
        self._advance, self.now, self._over, self._failed = advance, now, over, failed
        self._order: list[Seat] = []
        self._seats: dict[int, Seat] = {}
        self._current: Seat | None = None
        self._broken = False

    def seat(self) -> Seat | None:
        """Return the seat of the thread that calls; None of a thread that is not the script's."""
        return self._seats.get(threading.get_ident())

    @property
    def inside(self) -> bool:
        """Whether the caller is the script, not the run's own code or another thread."""
        seat = self.seat()
        return seat is not None and not seat.outside

    @property
    def alone(self) -> bool:
        """Whether the script has one thread."""
        return len(self._order) == 1

    @contextmanager
    def main(self) -> Iterator[None]:
        """Make the calling thread the script's first; at the end the others are waited for, daemons are ended."""
        self._current = self._seats[threading.get_ident()] = seat = Seat(daemon=False)
        self._order.append(seat)
        try:
            yield
            self.wait(lambda: all(other.daemon for other in self._order if other is not seat))
        finally:
            self._end_others(seat)
            del self._seats[threading.get_ident()]

    def wait(self, ready: Callable[[], bool], until: float = math.inf, wakes: Callable[[], float] = at_once) -> bool:
        """Give the turn away until `ready()` holds or simulated time reaches `until` [s]; returns `ready()`.

        Before the time `wakes()` [s], `ready()` changes by a message or by another thread alone. Raises `RunOver` if
        the time is up and `ready()` does not hold.
        """
        me = self._seats[threading.get_ident()]
        if me.ended:
            raise ThreadEnded
        me.ready, me.until, me.wakes = ready, until, wakes
        while (chosen := self._next(self._order.index(me) + 1)) is None:
            self._step()
        if chosen is not me:
            self._hand_to(chosen)
            me.turn.acquire()
        if me.ended:
            raise ThreadEnded
        if ready():
            return True
        if self.now() >= until - 1e-9:
            return False
        raise RunOver

    def sleep(self, seconds: float) -> None:
        """Let simulated time pass, as a script's `time.sleep` does: messages are queued, callbacks wait."""
        self.wait(lambda: False, self.now() + seconds, lambda: math.inf)

    def start(self, thread: threading.Thread, start: Callable[[threading.Thread], None]) -> None:
        """Start a thread of the script; it runs when its turn comes."""
        seat = Seat(daemon=thread.daemon)
        run = thread.run

        def run_in_turn() -> None:
            self._seats[threading.get_ident()] = seat
            seat.turn.acquire()
            try:
                if not seat.ended:
                    run()
            except (RunOver, ThreadEnded, ExternalShutdownException, SystemExit):
                pass
            except BaseException as error:  # whatever a thread raises ends the run
                self._failed(error)
                self._broken = True
            finally:
                self._leave(seat)

        thread.run = run_in_turn  # type: ignore[method-assign]
        # Python does not wait for it at exit: a thread in an endless loop would never let it end.
        thread.daemon = True
        thread.limo_seat = seat  # type: ignore[attr-defined]
        self._order.append(seat)
        with self.outside():
            start(thread)

    def alive(self, seat: Seat) -> bool:
        """Whether a thread still runs."""
        return seat in self._order

    @contextmanager
    def outside(self) -> Iterator[None]:
        """Let the run's own code work in a thread of the script: what it waits for is real."""
        seat = self._seats[threading.get_ident()]
        seat.outside += 1
        try:
            yield
        finally:
            seat.outside -= 1

    def _step(self) -> None:
        with self.outside():
            self._advance(min(min(other.until, other.wakes()) for other in self._order))

    def _step_or_break(self) -> None:
        try:
            self._step()
        except BaseException as error:  # whatever a page raises ends the run
            self._failed(error)
            self._broken = True

    def _due(self, seat: Seat) -> bool:
        return seat.ended or self._broken or self._over() or seat.ready() or self.now() >= seat.until - 1e-9

    def _next(self, at: int) -> Seat | None:
        """Return the first thread from position `at` on, round to before it, that can go on; None where all wait."""
        return next((seat for seat in (*self._order[at:], *self._order[:at]) if self._due(seat)), None)

    def _hand_to(self, seat: Seat) -> None:
        self._current = seat
        seat.turn.release()

    def _leave(self, me: Seat) -> None:
        """Give the turn away for good."""
        if me in self._order:
            at = self._order.index(me)
            self._order.remove(me)
            while (chosen := self._next(at)) is None:
                self._step_or_break()
            self._hand_to(chosen)
        del self._seats[threading.get_ident()]

    def _end_others(self, me: Seat) -> None:
        others = [seat for seat in self._order if seat is not me]
        for seat in others:
            seat.ended = True
        if self._current is me:
            for seat in others:
                # Each ends in its turn, and hands the turn on: at last to this thread.
                if seat in self._order:
                    me.ready = lambda: len(self._order) == 1
                    self._hand_to(seat)
                    me.turn.acquire()
            return
        # A signal came while another thread had the turn: each goes to its end by itself.
        self._order = [me]
        for seat in others:
            if seat.turn.locked():
                seat.turn.release()
