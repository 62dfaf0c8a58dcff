"""Writing images and videos; a file appears under its name only when it is whole."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from fractions import Fraction
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from limo_hog.atomic import about, whole_file
from limo_hog.exceptions import LimoHogError
from limo_hog.extras import needed

with needed(by="writing pictures"):
    import cv2


#: Threads that encode a video: the bytes depend on how many there are, and so must not on the machine.
_THREADS = 2
#: Without mbtree, which reads memory that was never written, so that bytes differ from run to run; crf 22 is then as
#: large and as good as 20 with it.
_ENCODER = {"preset": "veryfast", "crf": "22", "x264-params": "mbtree=0"}
#: An MP4 of whole parts of 1 s [µs], each written out as it ends.
_GROWING = {"movflags": "frag_keyframe+empty_moov+default_base_moof", "frag_duration": "1000000", "flush_packets": "1"}


class WriteError(LimoHogError):
    """A picture could not be written."""


def write_image(path: Path, image: NDArray[np.uint8] | NDArray[np.uint16]) -> None:
    """Write uint8 BGR or gray (PNG also uint16) in the format of the path's suffix; folders are made as needed.

    Raises `WriteError` where OpenCV knows no such format, or cannot hold the picture in it; `OSError` where the file
    cannot be written; nothing is left under `path` then.
    """
    # Level 1 is three times as fast as the default and a tenth larger; other formats complain about it.
    how = [cv2.IMWRITE_PNG_COMPRESSION, 1] if path.suffix.lower() == ".png" else []
    try:
        ok, data = cv2.imencode(path.suffix, image, how)
    except cv2.error:
        ok = False
    if not ok:
        raise WriteError(f"{path}: OpenCV cannot encode {image.shape} {image.dtype} as {path.suffix or 'no format'}")
    with whole_file(path) as part, about(path):
        part.write_bytes(data.tobytes())


def jpeg(image: NDArray[np.uint8], quality: int = 80) -> bytes:
    """Return uint8 BGR or gray as the bytes of a JPEG file; quality 0..100, 80 hardly differs on a screen."""
    return cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()


@contextmanager
def video_writer(path: Path, fps: float, grows: bool = False) -> Iterator[Callable[..., None]]:
    """Give a function that appends one uint8 (height, width, 3) BGR frame to an H.264 video.

    A second argument is the frame's time [s], for a film whose rate is not steady; the film begins with the first.

    All frames have the size of the first. H.264 wants even sizes: an odd one gets one more row or column, a copy of the
    last. The file has its name only after the last frame; an error before leaves nothing behind. One that `grows` has
    it from the first frame on, and can be read as far as it is written: a killed run loses a second. Raises
    `WriteError` if no frame came.
    """
    with needed(by="writing H.264 video"):
        import av
    with ExitStack() as stack:
        with about(path):
            if grows:
                path.parent.mkdir(parents=True, exist_ok=True)
            part = path if grows else stack.enter_context(whole_file(path))
            container = av.open(part, "w", format="mp4", options=_GROWING if grows else {})

        @stack.callback
        def close() -> None:
            with about(path):
                container.close()

        stream = container.add_stream("libx264", rate=Fraction(fps).limit_denominator(1001))
        stream.pix_fmt = "yuv420p"
        stream.thread_count = _THREADS
        stream.options = dict(_ENCODER)
        shown_at = -1  # the last frame's place in the film; -1 before the first
        begun = 0.0  # the first frame's time

        def write(image: NDArray[np.uint8], at: float | None = None) -> None:
            nonlocal shown_at, begun
            height, width = image.shape[:2]
            if height % 2 or width % 2:
                image = np.pad(image, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
            if shown_at < 0:
                stream.height, stream.width = image.shape[:2]
                begun = at or 0.0
            shown_at = max(shown_at + 1, 0 if at is None else round((at - begun) * fps))
            with about(path):
                # OpenCV converts colours in a third of the time that swscale takes.
                planes = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2YUV_I420), np.uint8)
                frame = av.VideoFrame.from_ndarray(planes, format="yuv420p")
                frame.pts = shown_at
                container.mux(stream.encode(frame))

        yield write
        if shown_at < 0:
            raise WriteError(f"{path}: no frame to write")
        with about(path):
            container.mux(stream.encode(None))
