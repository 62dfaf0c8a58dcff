"""Films and live sources in `detect`: the newest frame, identities with trails, copies in pieces."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from limo_hog.detections import Detections
from limo_hog.extras import needed
from limo_hog.imaging.writing import video_writer
from limo_hog.tracking import Tracker

Image = NDArray[np.uint8]
Item = TypeVar("Item")
#: Length of the pieces of a live source's copy [s]: what a killed run loses at most.
PIECE_S = 60.0


class Newest(Generic[Item]):
    """The newest item of a source that does not wait: a thread takes them, and drops the one that nobody took.

    A context manager, which stops the thread. What the source raises is raised after the item before it.
    """

    def __init__(self, items: Callable[[threading.Event], Iterator[Item]]) -> None:
        self.dropped = 0
        self._items, self._held = items, queue.Queue[tuple[Item] | BaseException](1)
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._take, name="limo-hog source", daemon=True)

    def __enter__(self) -> Newest[Item]:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopped.set()
        with suppress(queue.Empty):
            self._held.get_nowait()
        # A camera that sends nothing is left to the end of the process.
        self._thread.join(1.0)

    def _take(self) -> None:
        end: BaseException = StopIteration()
        try:
            for item in self._items(self._stopped):
                with suppress(queue.Empty):
                    self._held.get_nowait()
                    self.dropped += 1
                self._held.put((item,))
        except BaseException as error:
            end = error
        if not self._stopped.is_set():
            self._held.put(end)

    def __iter__(self) -> Iterator[Item]:
        while True:
            try:
                # Woken now and then, so that Ctrl-C works on every system.
                held = self._held.get(timeout=0.5)
            except queue.Empty:
                continue
            if isinstance(held, StopIteration):
                return
            if isinstance(held, BaseException):
                raise held
            yield held[0]


class Identities:
    """Numbers the people of one film, and draws where each came from."""

    def __init__(self, name: str, threshold: float, fps: float) -> None:
        self.tracker = Tracker(name, threshold, fps)
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
def pieces(path: Path, fps: float, seconds: float = PIECE_S) -> Iterator[Callable[[Image, float], None]]:
    """Give a function that appends a frame taken at a time [s] to a film in whole pieces: PATH, PATH-2 and so on.

    A killed run loses the piece that is open, and no other.
    """
    number, begun = 0, 0.0
    with ExitStack() as outer:
        piece = outer.enter_context(ExitStack())
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
