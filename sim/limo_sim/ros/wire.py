"""The messages between a node's process and the arena's, plain data, and the node's end of the link."""

from __future__ import annotations

import array
import ctypes
import json
import os
import signal
import socket
import struct
import sys
from collections.abc import Sequence
from typing import Any

#: Of a message: how long its JSON is, and of one of the node's, its bytes.
HEAD = struct.Struct("<II")
#: Whether a node's process is a copy of one that has imported everything.
FORKS = sys.platform == "linux"
#: A topic, its message as CDR, and the bytes of an Image's pixels, whose message comes without them; None for others.
News = tuple[str, bytes, Any]


def prctl(option: int, value: int) -> None:
    """Set an attribute of this process, on Linux."""
    if FORKS:
        ctypes.CDLL(None).prctl(option, value, 0, 0, 0)


def packed(content: Any, size: int = 0) -> bytes:
    """Return a message's JSON; as many bytes as `size` says are to follow it, which are not copied into it."""
    # A node may command NaN, which Python's JSON carries: the arena refuses it.
    said = json.dumps(content).encode()  # noqa: TID251
    return HEAD.pack(len(said), size) + said


class SocketLink:
    """The node's way to the arena. A node that hangs is not interrupted while a message is half sent."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection
        self._reading = connection.makefile("rb")

    def tell(self, told: str, *content: Any, data: Any = b"") -> None:
        """Tell what the script does: numbers, texts, None and lists of them, and a picture, an array in C order."""
        bare = memoryview(data)
        before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGALRM,)) if os.name != "nt" else ()
        try:
            self._connection.sendall(packed([told, *content], bare.nbytes))
            self._connection.sendall(bare)
        finally:
            if os.name != "nt":
                signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def advance(self, wanted: Sequence[str], target: float | None, until: float) -> tuple[float, list[News]]:
        """Let time pass, to `until` [s] or to the next message; returns the time [s], and the topics' messages."""
        self.tell("advance", wanted, target, until)
        said, _ = HEAD.unpack(self._reading.read(HEAD.size))
        time, sizes = json.loads(self._reading.read(said))
        news: list[News] = []
        for topic, length, size in sizes:
            data, pixels = self._reading.read(length), None
            if size:
                # (An image is received into what the node is given, and copied nowhere else.)
                pixels = array.array("B", [0]) * size
                self._reading.readinto(pixels)
            news.append((topic, data, pixels))
        return time, news

    def leave(self) -> None:
        """Close the link in a process that the node has forked."""
        socket.close(self._connection.detach())
