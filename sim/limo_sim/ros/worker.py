"""Processes that have imported what nodes need, and wait for one."""

from __future__ import annotations

import atexit
import base64
import os
import select
import signal
import socket
import struct
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from limo_hog.atomic import json_text
from limo_hog.extras import needed
from limo_sim.ros.lockstep.records import StubError
from limo_sim.ros.wire import FORKS

with needed(by="limo-hog run"):
    import cv2  # noqa: F401 — the node's process needs it, and could not say so as well


class Worker:
    """A process that has imported what nodes need."""

    def __init__(self) -> None:
        self.status: int | None = None
        self._leaves = False
        self._control, theirs = socket.socketpair()
        self._process = subprocess.Popen(
            [sys.executable, "-m", "limo_sim.ros.child"],
            cwd=Path(os.sep).resolve(),  # in the root folder no file has a module's name
            stdin=subprocess.PIPE if os.name == "nt" else theirs.fileno(),
            stdout=subprocess.DEVNULL,
            start_new_session=True,
        )
        theirs.close()

    def begin(self, job: dict[str, Any], ends: Sequence[socket.socket]) -> None:
        """Run a node."""
        self.status = None
        if os.name == "nt":
            shares = [base64.b64encode(end.share(self._process.pid)).decode() for end in ends]  # type: ignore[attr-defined]
            if pipe := self._process.stdin:
                pipe.write(json_text(job | {"shares": shares}).encode() + b"\n")
                pipe.close()
            return
        socket.send_fds(self._control, [json_text(job).encode()], [end.fileno() for end in ends])

    @property
    def waits(self) -> bool:
        """Whether the process can be given another node: the last one's end is known, and it was not told to leave."""
        return FORKS and self.alive and self.status is not None and not self._leaves

    @property
    def alive(self) -> bool:
        """Whether the process, which tells of its node's end, is there."""
        return self._process.poll() is None

    def is_alone(self, seconds: float) -> bool:
        """Wait until the node has ended by itself, no longer than this [s]; return whether it has."""
        if FORKS:
            return bool(select.select([self._control], [], [], seconds)[0])
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(seconds)
        return not self.alive

    def end(self, how: bytes = b"k") -> int | None:
        """End the node, with all that it started; return its status, None where that is not known.

        It is killed; with `how` b"w", its fault handler tells first where it was.
        """
        if self.status is not None:
            return self.status
        if not FORKS:
            self.kill()
            self.status = self._process.returncode
            return self.status
        self._process.terminate()  # heeded only while it imports, and cannot answer
        with suppress(OSError):
            self._control.sendall(how)
            told = self._control.recv(4)
            if len(told) == 4:
                (self.status,) = struct.unpack("i", told)
                return self.status
        self.kill()
        return None

    def kill(self) -> None:
        """End the process and all of its group, if that has not been done."""
        if self._control.fileno() == -1:
            return
        self._control.close()
        if hasattr(os, "killpg"):
            # Of a group there may be others when its first is gone.
            with suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGKILL)
        else:
            self._process.kill()
        self._process.wait()

    def leave(self) -> None:
        """Let the process end, and its node with it; it takes no other."""
        self._leaves = True
        if FORKS:
            self._process.terminate()
            with suppress(OSError):
                self._control.shutdown(socket.SHUT_WR)
        else:
            self.kill()


#: Processes that wait for a node, and those that have one.
idle: list[Worker] = []
busy: list[Worker] = []
#: Set while no node may start.
_closed = threading.Event()


def _waiting() -> Worker | None:
    """Take a process that waits; a list's `pop` gives each of several threads another."""
    while idle:
        try:
            worker = idle.pop()
        except IndexError:
            break
        if worker.waits:
            return worker
        # A node can signal every process of its user: one that waited may be gone.
        worker.kill()
    return None


@contextmanager
def ready() -> Iterator[Worker]:
    """Give a process that has imported what nodes need; it is kept for the next node unless it has ended.

    Raises `StubError` inside of `no_nodes`.
    """
    worker = _waiting() or Worker()
    busy.append(worker)
    try:
        if _closed.is_set():
            raise StubError("no node may start any more")
        yield worker
    finally:
        busy.remove(worker)
        if worker.waits:
            idle.append(worker)
        else:
            worker.kill()


@contextmanager
def no_nodes() -> Iterator[None]:
    """End the nodes of all threads, whose runs return soon, and let none start."""
    _closed.set()
    try:
        for worker in tuple(busy):
            worker.leave()
        yield
    finally:
        _closed.clear()


@atexit.register
def _close_workers() -> None:
    for worker in idle:
        worker.leave()
