"""Ctrl-C, SIGTERM and SIGHUP end a command as one exception, between two writes: what it keeps is whole or absent."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

#: A terminal that closes and a service manager stop a program as Ctrl-C does; Windows has no SIGHUP.
_SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]


class Stopped(KeyboardInterrupt):
    """The command is to stop.

    Attributes
    ----------
    signal
        The signal that said so.
    """

    def __init__(self, signal_: int) -> None:
        super().__init__(f"stopped by signal {signal_}")
        self.signal = signal_


class _Held:
    """How many blocks hold signals back at present, and the first signal that came meanwhile."""

    depth = 0
    came: int | None = None


@contextmanager
def stopping() -> Iterator[None]:
    """Let the signals raise `Stopped` in this block; one that is ignored, as nohup does with SIGHUP, stays so."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {one: signal.getsignal(one) for one in _SIGNALS}
    for one, handler in before.items():
        if handler is not signal.SIG_IGN:
            signal.signal(one, _stop)
    try:
        yield
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)


@contextmanager
def held() -> Iterator[None]:
    """Let a signal that comes in this block raise only after it: a write is not left half done."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    _Held.depth += 1
    try:
        yield
    finally:
        _Held.depth -= 1
        if not _Held.depth and _Held.came is not None:
            came, _Held.came = _Held.came, None
            raise Stopped(came)


def _stop(number: int, _: FrameType | None) -> None:
    if _Held.depth:
        _Held.came = _Held.came or number
    else:
        raise Stopped(number)
