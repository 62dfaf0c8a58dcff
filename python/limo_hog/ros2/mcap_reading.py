"""The ROS 2 messages of an MCAP file (https://mcap.dev/spec), read from front to back.

A recording may be cut off, damaged or made to do harm. So nothing is taken from its index: records are read one after
the other, none is longer than `MAX_RECORD`, no chunk gives more than it says, and checksums are compared.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from limo_hog.exceptions import LimoHogError
from limo_hog.extras import needed
from limo_hog.ros2.messages import typestore
from limo_hog.ros2.names import DETECTIONS_TYPE, TYPES

with needed(by="a recording"):
    import lz4.frame
    import zstandard
    from mcap.data_stream import ReadDataStream
    from mcap.opcode import Opcode
    from mcap.records import Channel, Chunk, Header, Message, Schema
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
    from rosbags.typesys.store import Typestore

#: The longest record and the largest chunk that are read [bytes]: ten 4K images as they come from a camera.
MAX_RECORD = 1 << 28
#: The longest message definition that is read [bytes]; the longest of ROS 2's own has 12 000.
MAX_DEFINITION = 1 << 17
#: Types whose fields are read: a recording must mean by them what ROS 2 Humble and Jazzy mean.
_READ = {*TYPES.values(), DETECTIONS_TYPE}
_MAGIC = b"\x89MCAP0\r\n"


class DamagedError(LimoHogError):
    """What is at one place of a file is not what an MCAP file holds there."""


class _Topic(NamedTuple):
    name: str
    type_name: str
    store: Typestore


def mcap_messages(path: Path) -> Iterator[tuple[str, int, Any]]:
    """Give topic, time [ns] and message of an MCAP file, in its order; within a chunk by time.

    Raises
    ------
    DamagedError
        Where the file is damaged or cut off, with the place; what was whole before has been given by then.
    """
    with path.open("rb") as file:
        if file.read(len(_MAGIC)) != _MAGIC:
            raise DamagedError("it does not begin as an MCAP file does")
        reader = _Reader()
        for place, opcode, data in _records(file):
            if opcode == Opcode.DATA_END:
                return
            try:
                yield from reader.read(opcode, data)
            # Foreign bytes in other libraries' parsers: whatever they raise, the file is why.
            except Exception as error:
                raise DamagedError(f"at byte {place}: {error or type(error).__name__}") from error
        raise DamagedError(f"cut off at byte {file.tell()}")


class _Reader:
    """What has been declared so far: stores of message definitions by schema, topics by channel."""

    def __init__(self) -> None:
        self.schemas: dict[int, tuple[str, Typestore]] = {}
        self.topics: dict[int, _Topic] = {}

    def read(self, opcode: int, data: bytes) -> Iterator[tuple[str, int, Any]]:
        stream = ReadDataStream(io.BytesIO(data))
        if opcode == 0:
            raise DamagedError("a record of no kind")
        if opcode == Opcode.HEADER:
            profile = Header.read(stream).profile
            if profile != "ros2":
                raise DamagedError(f"its profile is {profile!r}, not 'ros2'")
        elif opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            if len(schema.data) > MAX_DEFINITION:
                raise DamagedError(f"a definition of {len(schema.data)} bytes; {MAX_DEFINITION} are read at most")
            self.schemas[schema.id] = schema.name, _definitions(schema.name, schema.encoding, schema.data)
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(stream)
            if channel.message_encoding != "cdr":
                raise DamagedError(f"{channel.topic} is encoded as {channel.message_encoding!r}, not 'cdr'")
            self.topics[channel.id] = _Topic(channel.topic, *self.schemas[channel.schema_id])
        elif opcode == Opcode.MESSAGE:
            message = Message.read(stream, len(data))
            topic = self.topics[message.channel_id]
            yield topic.name, message.log_time, topic.store.deserialize_cdr(message.data, topic.type_name)
        elif opcode == Opcode.CHUNK:
            inner = [
                (opcode, data)
                for _, opcode, data in _records(io.BytesIO(_unpacked(Chunk.read(stream))), " of the chunk")
            ]
            # Declarations come before the messages that need them; the log time is 6 bytes after a message's start.
            inner.sort(
                key=lambda record: struct.unpack_from("<Q", record[1], 6) if record[0] == Opcode.MESSAGE else (0,)
            )
            for record in inner:
                if record[0] != Opcode.CHUNK:
                    yield from self.read(*record)


def _records(file: BinaryIO, of: str = "") -> Iterator[tuple[int, int, bytes]]:
    """Give place, opcode and bytes of each record, to the end of the file."""
    while True:
        place = file.tell()
        head = file.read(9)
        if not head:
            return
        opcode, length = struct.unpack("<BQ", head) if len(head) == 9 else (0, 0)
        if length > MAX_RECORD:
            raise DamagedError(f"a record of {length} bytes at byte {place}{of}; {MAX_RECORD} are read at most")
        data = file.read(length)
        if len(head) < 9 or len(data) < length:
            raise DamagedError(f"cut off in the record at byte {place}{of}")
        yield place, opcode, data


def _unpacked(chunk: Chunk) -> bytes:
    size = chunk.uncompressed_size
    if size > MAX_RECORD:
        raise DamagedError(f"a chunk of {size} bytes; {MAX_RECORD} are read at most")
    # One byte more than there should be shows that there is more.
    if chunk.compression == "zstd":
        data = zstandard.ZstdDecompressor().stream_reader(io.BytesIO(chunk.data)).read(size + 1)
    elif chunk.compression == "lz4":
        data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
    elif not chunk.compression:
        data = chunk.data
    else:
        raise DamagedError(f"compressed by {chunk.compression!r}; known are zstd and lz4")
    if len(data) != size:
        raise DamagedError(f"a chunk that is not {size} bytes long, as it says")
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise DamagedError("a chunk whose checksum is wrong")
    return data


@lru_cache(maxsize=32)
def _definitions(name: str, encoding: str, data: bytes) -> Typestore:
    """Return the message definitions that a schema brings; the Humble ones where it brings none."""
    if not encoding:
        return typestore()
    text = data.decode()
    store = get_typestore(Stores.EMPTY)
    if encoding == "ros2msg":
        store.register(get_types_from_msg(text, name))
    elif encoding == "ros2idl":
        # Several files in one, each under a line that names it.
        parts = text.split("=" * 80 + "\n")[1:] or [text]
        for part in parts:
            store.register(get_types_from_idl(part.partition("\n")[2] if part.startswith("IDL: ") else part))
    else:
        raise DamagedError(f"a definition in {encoding!r}; known are ros2msg and ros2idl")
    check_type(store, name)
    return store


def check_type(store: Typestore, name: str) -> None:
    """Compare a type that is read with our definition of it, by its hash (REP-2016).

    Raises
    ------
    DamagedError
        It has other fields.
    """
    if name in _READ and store.hash_rihs01(name) != typestore().hash_rihs01(name):
        raise DamagedError(f"its {name} has other fields than that of ROS 2 Humble")
