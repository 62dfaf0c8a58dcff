"""The messages between a node's process and the arena's: plain data."""

from __future__ import annotations

import ctypes
import json
import struct
import sys
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
