"""Pictures from files, folders, globs, a camera, an address or standard input."""

from __future__ import annotations

import glob
import os
import queue
import shutil
import stat
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Container, Generator, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
from numpy.typing import NDArray

from limo_hog.atomic import is_utf8
from limo_hog.exceptions import ImageError
from limo_hog.extras import needed

with needed(by="reading pictures"):
    import cv2

IMAGE_SUFFIXES = (".bmp", ".jpeg", ".jpg", ".jp2", ".pbm", ".pgm", ".png", ".ppm", ".tif", ".tiff", ".webp")
VIDEO_SUFFIXES = (".avi", ".m4v", ".mkv", ".mov", ".mp4", ".mpeg", ".mpg", ".ts", ".webm", ".wmv")

#: The input that stands for standard input.
STDIN = "-"
#: Bytes of the largest file of a picture: 2²⁸ pixels of three bytes, and a header.
_MOST_BYTES = 3 * 2**28 + 2**20
#: How long a stream may take to open, or to send its next frame [s]; cameras on a network take one or two.
STREAM_TIMEOUT_S = 10
#: How long is waited before a live source that broke off is opened again [s]: after the last of them it is given up.
RETRY_AFTER_S = (1, 2, 4, 8, 16, 32)

#: Number, uint8 (height, width, 3) BGR and time [s] of a frame.
LiveFrame = tuple[int, NDArray[np.uint8], float]


class ReadError(ImageError):
    """An input is not a picture, a video or a camera that can be read."""


class Kind(Enum):
    """Kinds of inputs."""

    IMAGE = "image"
    VIDEO = "video"
    CAMERA = "camera"
    STREAM = "stream"


@dataclass(frozen=True, slots=True)
class Source:
    """One picture, video, camera or stream: its name as the user gave it, and where to read it.

    The path of a stream is that part of its address, without folders, which a copy of it is named after.
    """

    name: str
    path: Path
    kind: Kind


def find_sources(name: str) -> list[Source]:
    """Expand one input; a folder stands for all pictures and videos below it, a glob for what it matches.

    Raises `ReadError` if it stands for nothing.
    """
    if not name:
        raise ReadError("the name of an input is empty; a file, folder, glob, camera or address is wanted")
    path = Path(name)
    if "://" in name:
        try:
            address = urlsplit(name)
        except ValueError as error:
            raise ReadError(f"{name}: not an address: {error}") from error
        return [Source(name, Path(Path(address.path).name or address.hostname or "stream"), Kind.STREAM)]
    if name == STDIN:
        return [Source(name, path, Kind.IMAGE)]
    if path.is_dir():
        found = sorted(p for p in path.rglob("*") if _kind_by_suffix(p) is not None and not p.is_dir())
        if not found:
            raise ReadError(f"{name}: no image or video in this folder")
    elif path.exists():
        found = [path]
    elif name.isdecimal():
        return [Source(name, path, Kind.CAMERA)]
    else:
        # Path.glob takes no absolute patterns.
        found = sorted(Path(p) for p in glob.glob(name, recursive=True))  # noqa: PTH207
        if not found:
            raise ReadError(f"{name}: no such file, folder or glob")
    return [Source(str(p), p, _kind_by_suffix(p) or Kind.IMAGE) for p in found]


def _kind_by_suffix(path: Path) -> Kind | None:
    suffix = path.suffix.lower()
    if suffix in IMAGE_SUFFIXES:
        return Kind.IMAGE
    return Kind.VIDEO if suffix in VIDEO_SUFFIXES else None


@contextmanager
def standard_input() -> Iterator[Source]:
    """Keep standard input (one image or one video) in a temporary file."""
    with tempfile.TemporaryDirectory(prefix="limo-hog-") as folder:
        path = Path(folder) / "stdin"
        if sys.stdin is None:
            raise ReadError(f"{STDIN}: standard input is closed")
        with path.open("wb") as file:
            shutil.copyfileobj(sys.stdin.buffer, file)
        kind = Kind.IMAGE if is_utf8(folder) and cv2.haveImageReader(str(path)) else Kind.VIDEO
        yield Source(STDIN, path, kind)


def read_image(source: Source) -> NDArray[np.uint8]:
    """Read an image as uint8 (height, width, 3) BGR, as `cv2.imread` does.

    Raises `ReadError` if the file is no regular one, empty, too large or no image; OSError if it cannot be opened.
    """
    # Opened without waiting: a pipe would wait for its writer.
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    with os.fdopen(os.open(source.path, flags), "rb") as file:
        _assert_regular(source, os.fstat(file.fileno()))
        # Some files are longer than they say, such as those of /proc.
        content = file.read(_MOST_BYTES + 1)
    if len(content) > _MOST_BYTES:
        raise ReadError(f"{source.name}: more than {_MOST_BYTES >> 20} MiB; no picture is so large")
    if not content:
        raise ReadError(f"{source.name}: the file is empty")
    data = np.frombuffer(content, np.uint8)
    try:
        image = cv2.imdecode(data, cv2.IMREAD_COLOR)
    except cv2.error as error:
        if "MAX_IMAGE" in (error.err or ""):
            limit = os.environ.get("OPENCV_IO_MAX_IMAGE_PIXELS", "fewer")
            raise ReadError(f"{source.name}: too many pixels; at most {limit} are read") from error
        raise ReadError(f"{source.name}: OpenCV cannot decode this image: {error.err}") from error
    if image is None:
        raise ReadError(f"{source.name}: not an image that OpenCV can read ({data.size} bytes)")
    return image.astype(np.uint8, copy=False)


def _assert_regular(source: Source, status: os.stat_result) -> None:
    if not stat.S_ISREG(status.st_mode):
        raise ReadError(
            f"{source.name}: a pipe, a device or a folder; a regular file is wanted, or - for standard input"
        )


@contextmanager
def _name_for_opencv(source: Source) -> Iterator[str]:
    """Give a name of a file that OpenCV can take: it crashes on those that are no UTF-8.

    Such a file is read through a link of another name.
    """
    if is_utf8(str(source.path)):
        yield str(source.path)
        return
    with tempfile.TemporaryDirectory(prefix="limo-hog-") as folder:
        suffix = source.path.suffix.lower()
        link = Path(folder) / f"film{suffix if suffix in VIDEO_SUFFIXES else ''}"
        if not is_utf8(str(link)):
            raise ReadError(f"{source.name}: OpenCV takes no name that is not UTF-8; give the file another")
        link.symlink_to(source.path.absolute())
        yield str(link)


@dataclass(frozen=True, slots=True)
class Video:
    """An open video file, camera or stream."""

    source: Source
    fps: float  #: frames a second by the file's header; 25 where it has none
    frame_count: int  #: number of frames by the file's header; 0 where it has none, and for a camera
    _capture: cv2.VideoCapture

    @property
    def live(self) -> bool:
        """Whether it is a camera, or a stream whose end nobody knows: one that does not wait for its reader."""
        return self.source.kind in (Kind.CAMERA, Kind.STREAM) and not self.frame_count

    def frames(self, every: int = 1, skip: Container[int] = frozenset()) -> Iterator[tuple[int, NDArray[np.uint8]]]:
        """Yield (number, uint8 (height, width, 3) BGR) of every `every`-th frame not in `skip`.

        Raises `ReadError` at the end, if that comes well before the announced one, or before the first frame.
        """
        number = 0
        while self._capture.grab():
            if number % every == 0 and number not in skip:
                ok, image = self._capture.retrieve()
                if not ok:
                    break
                yield number, image.astype(np.uint8, copy=False)
            number += 1
        if not number:
            raise ReadError(f"{self.source.name}: no frame of it could be read")
        # Containers estimate their frame count from duration and rate: a few frames fewer are no error.
        if number < 0.98 * self.frame_count - 2:
            raise ReadError(f"{self.source.name}: cut off: {number} of {self.frame_count} frames could be read")


@contextmanager
def open_video(source: Source) -> Iterator[Video]:
    """Open a video file, a camera, or a stream such as rtsp://… or http://….

    Raises `ReadError` where OpenCV cannot read it.
    """
    with ExitStack() as stack:
        if source.kind is Kind.CAMERA:
            wanted = "no camera with this index"
            try:
                capture = cv2.VideoCapture(int(source.name))
            except (cv2.error, ValueError) as error:  # the index is no integer of 32 bits, or of thousands of digits
                raise ReadError(f"{source.name}: {wanted}") from error
        elif source.kind is Kind.STREAM:
            if not is_utf8(source.name):
                raise ReadError(f"{source.name}: no address: it is not UTF-8; write other bytes as %XX")
            limits = (cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, cv2.CAP_PROP_READ_TIMEOUT_MSEC)
            timeouts = [word for limit in limits for word in (limit, 1000 * STREAM_TIMEOUT_S)]
            capture = cv2.VideoCapture(source.name, cv2.CAP_ANY, timeouts)
            wanted = (
                f"OpenCV found no video there within {STREAM_TIMEOUT_S} s; wanted is the address of a stream or a "
                "video, such as rtsp://HOST/PATH"
            )
        else:
            status = source.path.stat()
            _assert_regular(source, status)
            if status.st_size == 0:
                raise ReadError(f"{source.name}: the file is empty")
            wanted = "not a video that OpenCV can read"
            capture = cv2.VideoCapture(stack.enter_context(_name_for_opencv(source)))
        stack.callback(capture.release)
        if not capture.isOpened():
            raise ReadError(f"{source.name}: {wanted}")
        frames = 0 if source.kind is Kind.CAMERA else max(0, int(capture.get(cv2.CAP_PROP_FRAME_COUNT)))
        yield Video(source, capture.get(cv2.CAP_PROP_FPS) or 25.0, frames, capture)


def newest_frames(
    video: Video, opened: ExitStack, every: int, tell: Callable[[str], None], drop: Callable[[], None]
) -> Generator[LiveFrame, None, None]:
    """Yield the newest frame of a camera or a stream; `drop` is called for each that nobody took in time.

    A thread reads it, which owns the open video from now on; `opened` closes that. Raises `ReadError` where the source
    never sent a frame, or did not come back.
    """
    held: queue.Queue[LiveFrame | BaseException | None] = queue.Queue(1)
    stopped = threading.Event()

    def read() -> None:
        end = None
        try:
            for frame in _live_frames(video, opened, every, tell, stopped):
                with suppress(queue.Empty):
                    held.get_nowait()
                    drop()
                held.put(frame)
        except BaseException as error:
            end = error
        if not stopped.is_set():
            held.put(end)

    thread = threading.Thread(target=read, name="limo-hog source", daemon=True)
    thread.start()
    try:
        while True:
            # Woken now and then, so that Ctrl-C works on every system.
            with suppress(queue.Empty):
                frame = held.get(timeout=0.5)
                if not isinstance(frame, tuple):
                    break
                yield frame
        if frame is not None:
            raise frame
    finally:
        stopped.set()
        # A camera that sends nothing is left to the end of the process.
        thread.join(1.0)


def _live_frames(
    video: Video, opened: ExitStack, every: int, tell: Callable[[str], None], stopped: threading.Event
) -> Iterator[LiveFrame]:
    """Yield frames until `stopped`; what breaks off is opened again, after growing pauses, and numbers go on."""
    source, first, pauses = video.source, 0, iter(RETRY_AFTER_S)
    while True:
        number = -1
        try:
            with opened:
                video = opened.enter_context(open_video(source)) if first else video
                for number, image in video.frames(every):
                    if stopped.is_set():
                        return
                    yield first + number, image, time.monotonic()
        except (ReadError, OSError):
            if not first:
                raise
        if number >= 0:
            first, pauses = first + number + 1, iter(RETRY_AFTER_S)
            tell(f"{source.name}: broke off after {first} frames; trying again for {sum(RETRY_AFTER_S)} s")
        pause = next(pauses, None)
        if pause is None:
            raise ReadError(f"{source.name}: broke off after {first} frames, and did not come back")
        if stopped.wait(pause):
            return
