"""Ctrl-C, SIGTERM and SIGHUP end a command as one exception, between two writes: what it keeps is whole or absent."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

#: A terminal that closes and a service manager stop a program as Ctrl-C does; Windows has no SIGHUP.
_SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]


#: Signals that come sooner than this after the first are one request to stop: a terminal that closes sends two or
#: three, and files take less to close [s]. One that comes later interrupts the closing.
IMPATIENT_S = 3.0


class Stopped(KeyboardInterrupt):
    """The command is to stop."""

    def __init__(self, signal_: int) -> None:
        super().__init__(f"stopped by signal {signal_}")
        self.signal = signal_  #: the signal that said so


class _State:
    """How many blocks hold signals back at present, and the signal that came first with its time [s]."""

    depth = 0
    came: int | None = None
    when = 0.0


@contextmanager
def stopping() -> Iterator[None]:
    """Let the signals raise `Stopped` in this block; one that is ignored, as nohup does with SIGHUP, stays so."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    _State.came = None
    before = {number: signal.getsignal(number) for number in _SIGNALS}
    for number, handler in before.items():
        if handler is not signal.SIG_IGN:
            signal.signal(number, _stop)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        _State.came = None


@contextmanager
def held() -> Iterator[None]:
    """Let a signal that comes in this block raise only after it: a write is not left half done.

    One that came before and was swallowed, as some libraries do while they are imported, raises again.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    _State.depth += 1
    try:
        yield
    finally:
        _State.depth -= 1
    if not _State.depth and _State.came is not None:
        raise Stopped(_State.came)


def _stop(number: int, _: FrameType | None) -> None:
    now = time.monotonic()
    if _State.came is not None and now - _State.when < IMPATIENT_S:
        return
    _State.came, _State.when = number, now
    if not _State.depth:
        raise Stopped(number)


def end_with(alive: Connection) -> None:
    """End this worker process as soon as the other end of a pipe is closed, by its parent or with it.

    It is here, where little is imported, so that a worker that has hardly begun ends, too.
    """

    def wait() -> None:
        alive.poll(None)
        os._exit(1)

    # Ctrl-C in a terminal reaches every process; the parent decides.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=wait, daemon=True).start()
