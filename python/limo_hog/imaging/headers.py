"""The size of an encoded picture by its first bytes: a small file may hold a picture too big for memory."""

from __future__ import annotations

import struct

_PNG = b"\x89PNG\r\n\x1a\n"
#: Markers that begin with a size: all SOFn of ITU T.81, B.1, which are not DHT, JPG or DAC.
_SIZES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}


def picture_size(data: bytes) -> tuple[int, int] | None:
    """Return width and height [px] of a PNG or JPEG; None of anything else, and where they are cut off."""
    try:
        if data.startswith(_PNG):
            width, height = struct.unpack_from(">II", data, 16)
            return width, height
        at = 2 if data.startswith(b"\xff\xd8") else len(data)
        while True:
            marker, length, _, height, width = struct.unpack_from(">HHBHH", data, at)
            if marker < 0xFF00:
                return None
            if marker & 0xFF in _SIZES:
                return width, height
            # A byte of 255 before a marker is filling.
            at += 1 if marker == 0xFFFF else 2 + length
    except struct.error:
        return None
