"""The messages between a node's process and the arena's: plain data."""

from __future__ import annotations

import ctypes
import json
import struct
import sys
from typing import Any

#: Of a message: how long its JSON and its bytes are.
HEAD = struct.Struct("<II")
#: Whether a node's process is a copy of one that has imported everything.
FORKS = sys.platform == "linux"


def prctl(option: int, value: int) -> None:
    """Set an attribute of this process, on Linux."""
    if FORKS:
        ctypes.CDLL(None).prctl(option, value, 0, 0, 0)


def packed(content: Any, data: bytes = b"", more: int = 0) -> bytes:
    """Return a message: JSON, and bytes that are none; as many as `more` says are to follow it."""
    # A node may command NaN, which Python's JSON carries: the arena refuses it.
    said = json.dumps(content).encode()  # noqa: TID251
    return HEAD.pack(len(said), len(data) + more) + said + data
