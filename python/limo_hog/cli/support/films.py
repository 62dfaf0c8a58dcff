"""Films and live sources in `detect`: the newest frame, identities with trails, copies in pieces."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from limo_hog.detections import Detections
from limo_hog.extras import needed
from limo_hog.imaging.writing import video_writer
from limo_hog.tracking import Tracker

Image = NDArray[np.uint8]
#: Number, image and time [s].
Frame = tuple[int, Image, float]


class Newest:
    """The newest frame of a source that does not wait: a thread takes them, and drops the one that nobody took.

    What the source raises is raised after the frame before it.
    """

    def __init__(self, frames: Callable[[threading.Event], Iterator[Frame]]) -> None:
        self.dropped = 0
        self._frames, self._held = frames, queue.Queue[Frame | BaseException | None](1)
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._take, name="limo-hog source", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop the thread."""
        self._stopped.set()
        with suppress(queue.Empty):
            self._held.get_nowait()
        # A camera that sends nothing is left to the end of the process.
        self._thread.join(1.0)

    def _take(self) -> None:
        end = None
        try:
            for frame in self._frames(self._stopped):
                with suppress(queue.Empty):
                    self._held.get_nowait()
                    self.dropped += 1
                self._held.put(frame)
        except BaseException as error:
            end = error
        if not self._stopped.is_set():
            self._held.put(end)

    def __iter__(self) -> Iterator[Frame]:
        while True:
            try:
                # Woken now and then, so that Ctrl-C works on every system.
                held = self._held.get(timeout=0.5)
            except queue.Empty:
                continue
            if held is None:
                return
            if isinstance(held, BaseException):
                raise held
            yield held


class Identities(Tracker):
    """Numbers the people of one film, and draws where each came from."""

    def __init__(self, name: str, threshold: float, fps: float) -> None:
        super().__init__(name, threshold, fps)
        with needed(by="drawing trails"):
            from supervision import ColorLookup, Position, TraceAnnotator
        self._trails = TraceAnnotator(
            position=Position.BOTTOM_CENTER, trace_length=round(2 * fps), color_lookup=ColorLookup.TRACK
        )

    def draw(self, people: Detections, picture: Image) -> Image:
        """Draw boxes, numbers and trails into a copy of the next picture."""
        drawn: Image = self._trails.annotate(people.draw(picture), people.to_supervision())
        return drawn


@contextmanager
def pieces(path: Path, fps: float, seconds: float) -> Iterator[Callable[[Image, float], None]]:
    """Give a function that appends a frame taken at a time [s] to a film in whole pieces: PATH, PATH-2 and so on.

    A killed run loses the piece that is open, and no other.
    """
    number, begun = 0, 0.0
    with ExitStack() as piece:
        append: Callable[..., None]

        def write(image: Image, at: float) -> None:
            nonlocal number, begun, append
            if not number or at - begun >= seconds:
                piece.close()
                number, begun = number + 1, at
                name = path if number == 1 else path.with_name(f"{path.stem}-{number}{path.suffix}")
                append = piece.enter_context(video_writer(name, fps))
            append(image, at - begun)

        yield write
