"""Recordings: ROS 2 messages in an MCAP file, which `ros2 bag play` and Foxglove read; and any ROS 2 bag read back.

A recording may be cut off, damaged or made to do harm. So an MCAP file is read from front to back, not by its index;
no read and no chunk is longer than `MAX_RECORD`; and checksums are compared.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, cast

import numpy as np

from limo_hog.atomic import about, whole_file
from limo_hog.detections import Detections
from limo_hog.exceptions import LimoHogError
from limo_hog.extras import needed
from limo_hog.models import WHOLE_WINDOW
from limo_hog.ros2.messages import serialize, typestore
from limo_hog.ros2.names import DETECTIONS_TYPE, TYPES

with needed(by="a recording"):
    import lz4.frame
    import zstandard
    from mcap.records import Channel, Chunk, DataEnd, McapRecord, Message, Schema
    from mcap.stream_reader import StreamReader, breakup_chunk
    from mcap.writer import CompressionType, Writer
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
    from rosbags.typesys.store import Typestore

#: The longest record and the largest chunk that are read [bytes]: five 4K images as they come from a camera.
MAX_RECORD = 1 << 27
#: The most records of a chunk that are read [1], each some 500 bytes of Python: 4 MB of the shortest messages.
MAX_RECORDS = 1 << 17
#: The longest message definition that is read [bytes]; the longest of ROS 2's own has 12 000.
MAX_DEFINITION = 1 << 17
#: The most of them that are read [1]; all of ROS 2's own are some 300.
MAX_DEFINITIONS = 1000
#: Types whose fields are read: a recording must mean by them what ROS 2 Humble and Jazzy mean.
_READ = {*TYPES.values(), DETECTIONS_TYPE}


class BagError(LimoHogError):
    """A file is no recording that can be read, or lacks what is wanted of it."""


class Record(NamedTuple):
    """One message of a recording: its topic, when it was written [s], and what it says."""

    topic: str
    time: float
    message: Any


def to_detections(message: Any) -> Detections:
    """Read a Detection2DArray; it holds the boxes around people alone, so these are the windows, too.

    Raises `BagError` if a box has no score.
    """
    if not all(detection.results for detection in message.detections):
        raise BagError(f"a {DETECTIONS_TYPE} has a box without a hypothesis: its score is missing")
    found = [detection.bbox for detection in message.detections]
    middles = [(box.center.position, box.size_x, box.size_y) for box in found]
    boxes = [(middle.x - width / 2, middle.y - height / 2, width, height) for middle, width, height in middles]
    scores = [detection.results[0].hypothesis.score for detection in message.detections]
    people = np.rint(np.array(boxes).reshape(-1, 4)).astype(np.int32)
    return Detections(people, np.array(scores, np.float64), WHOLE_WINDOW)


@contextmanager
def bag_writer(path: Path) -> Iterator[Callable[[str, float, Any], None]]:
    """Give a function that writes a message to a topic at a time [s].

    The file has its name only when it is whole.
    """
    with whole_file(path) as part, ExitStack() as stack:
        with about(path):
            file = part.open("wb")

        @stack.callback
        def close() -> None:
            with about(path):
                file.close()

        writer = Writer(file, compression=CompressionType.ZSTD)
        writer.start(profile="ros2", library="limo-hog")
        channels: dict[str, int] = {}

        def write(topic: str, time: float, message: Any) -> None:
            if topic not in channels:
                name = message.__msgtype__
                definition, _ = typestore().generate_msgdef(name, ros_version=2)
                schema = writer.register_schema(name, "ros2msg", definition.encode())
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            nanoseconds = round(time * 1e9)
            with about(path):
                writer.add_message(channels[topic], nanoseconds, serialize(message), nanoseconds)

        yield write
        with about(path):
            writer.finish()  # type: ignore[no-untyped-call]


def read_bag(path: Path) -> Iterator[Record]:
    """Read a ROS 2 recording in the order it was written: an MCAP file, or a rosbag2 folder.

    Raises `BagError` if it is none, or damaged or cut off: what was whole before that has been given by then; `OSError`
    if it cannot be read.
    """
    if not path.exists():
        raise BagError(f"{path}: no such recording")
    try:
        for topic, nanoseconds, message in _messages(path):
            yield Record(topic, nanoseconds * 1e-9, message)
    # Foreign bytes in other libraries' parsers: whatever they raise, the file is why.
    except Exception as error:
        # The system's errors have a number; rosbags raises a FileNotFoundError of its own without.
        if isinstance(error, OSError) and error.errno is not None:
            error.filename = error.filename or str(path)
            raise
        why = " ".join(str(error).split()) or type(error).__name__
        raise BagError(f"{path}: no ROS 2 recording that can be read, or cut off: {why[:200]}") from error


def _messages(path: Path) -> Iterator[tuple[str, int, Any]]:
    # The parts of a rosbag2 folder are numbered: _9 comes before _10.
    parts = sorted(path.glob("*.mcap"), key=lambda part: (len(part.name), part.name)) if path.is_dir() else [path]
    if parts and all(part.suffix == ".mcap" for part in parts):
        for part in parts:
            with part.open("rb") as file:
                try:
                    yield from _mcap_messages(file)
                except OSError:
                    raise
                except Exception as error:
                    raise BagError(f"at byte {file.tell()}: {error or type(error).__name__}") from error
        return
    with AnyReader([path], default_typestore=typestore()) as reader:
        for connection in reader.connections:
            _check_type(reader.typestore, connection.msgtype)
        for connection, nanoseconds, data in reader.messages():
            yield connection.topic, nanoseconds, reader.deserialize(data, connection.msgtype)


class _Source:
    """A file for mcap's reader, which takes less than it asked for as the whole."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file

    def read(self, size: int) -> bytes:
        data = self._file.read(size) if 0 <= size <= MAX_RECORD else b""
        if len(data) != size:
            raise BagError("cut off, or a length that is wrong")
        # The opcode, which is read alone. Where a file was never written it is zeros, and mcap skips 9 of them a time.
        if data == b"\0":
            raise BagError("a record of no kind")
        return data


def _mcap_messages(file: BinaryIO) -> Iterator[tuple[str, int, Any]]:
    """Give topic, time [ns] and message of an MCAP file, in its order; within a chunk by time."""
    source: Any = _Source(file)
    reader = StreamReader(source, emit_chunks=True, validate_crcs=True, record_size_limit=MAX_RECORD)
    stores: dict[int, tuple[str, Typestore]] = {}
    topics: dict[int, tuple[str, str, Typestore]] = {}
    for outer in reader.records:
        if isinstance(outer, DataEnd):
            return
        for record in _in_chunk(outer) if isinstance(outer, Chunk) else [outer]:
            if isinstance(record, Schema):
                if len(stores) >= MAX_DEFINITIONS and record.id not in stores:
                    raise BagError(f"more definitions than the {MAX_DEFINITIONS} that are read")
                stores[record.id] = record.name, _definitions(record.name, record.encoding, record.data)
            elif isinstance(record, Channel):
                if record.message_encoding != "cdr":
                    raise BagError(f"{record.topic} is encoded as {record.message_encoding!r}, not 'cdr'")
                if record.schema_id not in stores:
                    raise BagError(f"{record.topic} is of the type {record.schema_id}, which is not defined")
                topics[record.id] = record.topic, *stores[record.schema_id]
            elif isinstance(record, Message):
                if record.channel_id not in topics:
                    raise BagError(f"a message of channel {record.channel_id}, which is not declared")
                topic, type_name, store = topics[record.channel_id]
                yield topic, record.log_time, store.deserialize_cdr(record.data, type_name)


def _in_chunk(chunk: Chunk) -> list[McapRecord]:
    size = chunk.uncompressed_size
    if size > MAX_RECORD:
        raise BagError(f"a chunk of {size} bytes; {MAX_RECORD} are read at most")
    # One byte more than there should be shows that there is more.
    if chunk.compression == "zstd":
        data = zstandard.ZstdDecompressor().stream_reader(chunk.data).read(size + 1)
    elif chunk.compression == "lz4":
        data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
    elif not chunk.compression:
        data = chunk.data
    else:
        raise BagError(f"a chunk compressed by {chunk.compression!r}; known are zstd and lz4")
    if len(data) != size:
        raise BagError(f"a chunk that is not {size} bytes long, as it says")
    at = count = 0
    while at + 9 <= size and count <= MAX_RECORDS:
        at, count = at + 9 + int.from_bytes(data[at + 1 : at + 9], "little"), count + 1
    if count > MAX_RECORDS:
        raise BagError(f"a chunk of many records; {MAX_RECORDS} records are read at most")
    records = breakup_chunk(replace(chunk, compression="", data=data), validate_crc=True)
    # Definitions and channels come before the messages that need them.
    return sorted(records, key=lambda record: cast(int, getattr(record, "log_time", -1)))


@lru_cache(maxsize=32)
def _definitions(name: str, encoding: str, data: bytes) -> Typestore:
    """Return the message definitions that a schema brings; the Humble ones where it brings none."""
    if not encoding:
        return typestore()
    if len(data) > MAX_DEFINITION:
        raise BagError(f"a definition of {len(data)} bytes; {MAX_DEFINITION} are read at most")
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
        raise BagError(f"a definition in {encoding!r}; known are ros2msg and ros2idl")
    _check_type(store, name)
    return store


def _check_type(store: Typestore, name: str) -> None:
    """Compare a type that is read with our definition of it, by its hash (REP-2016)."""
    if name in _READ and store.hash_rihs01(name) != typestore().hash_rihs01(name):
        raise BagError(f"its {name} has other fields than that of ROS 2 Humble")
