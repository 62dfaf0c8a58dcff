"""Recordings: ROS 2 messages in an MCAP file, which `ros2 bag play` and Foxglove read; and any ROS 2 bag read back."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from limo_hog.atomic import about, whole_file
from limo_hog.detections import Detections
from limo_hog.exceptions import LimoHogError
from limo_hog.extras import needed
from limo_hog.ros2.mcap_reading import check_type, mcap_messages
from limo_hog.ros2.messages import serialize, typestore
from limo_hog.ros2.names import DETECTIONS_TYPE

with needed(by="a recording"):
    from mcap.writer import CompressionType, Writer
    from rosbags.highlevel import AnyReader


class BagError(LimoHogError):
    """A file is no recording that can be read."""


class Record(NamedTuple):
    """One message of a recording: its topic, when it was written [s], and what it says."""

    topic: str
    time: float
    message: Any


def to_detections(message: Any) -> Detections:
    """Read a Detection2DArray.

    Raises
    ------
    BagError
        If a box has no score.
    """
    if not all(one.results for one in message.detections):
        raise BagError(f"a {DETECTIONS_TYPE} has a box without a hypothesis: its score is missing")
    boxes = [
        (
            one.bbox.center.position.x - one.bbox.size_x / 2,
            one.bbox.center.position.y - one.bbox.size_y / 2,
            one.bbox.size_x,
            one.bbox.size_y,
        )
        for one in message.detections
    ]
    scores = [one.results[0].hypothesis.score for one in message.detections]
    return Detections(np.rint(np.array(boxes).reshape(-1, 4)).astype(np.int32), np.array(scores, np.float64))


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

    Raises
    ------
    BagError
        If it is none, or damaged or cut off: what was whole before that has been given by then.
    OSError
        If it cannot be read.
    """
    if not path.exists():
        raise BagError(f"{path}: no such recording")
    messages = _messages(path)
    while True:
        try:
            topic, nanoseconds, message = next(messages)
        except StopIteration:
            return
        # Foreign bytes in other libraries' parsers: whatever they raise, the file is why.
        except Exception as error:
            # The system's errors have a number; rosbags raises a FileNotFoundError of its own without.
            if isinstance(error, OSError) and error.errno is not None:
                error.filename = error.filename or str(path)
                raise
            why = " ".join(str(error).split()) or type(error).__name__
            raise BagError(f"{path}: no ROS 2 recording that can be read, or cut off: {why[:200]}") from error
        yield Record(topic, nanoseconds * 1e-9, message)


def _messages(path: Path) -> Iterator[tuple[str, int, Any]]:
    # The parts of a rosbag2 folder are numbered: _9 comes before _10.
    parts = sorted(path.glob("*.mcap"), key=lambda part: (len(part.name), part.name)) if path.is_dir() else [path]
    if parts and all(part.suffix == ".mcap" for part in parts):
        for part in parts:
            yield from mcap_messages(part)
        return
    with AnyReader([path], default_typestore=typestore()) as reader:
        for connection in reader.connections:
            check_type(reader.typestore, connection.msgtype)
        for connection, nanoseconds, data in reader.messages():
            yield connection.topic, nanoseconds, reader.deserialize(data, connection.msgtype)
