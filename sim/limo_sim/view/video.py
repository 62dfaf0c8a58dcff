"""A run as a film of what the follower saw."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from limo_hog.imaging.writing import video_writer
from limo_sim.run.episode import Moment
from limo_sim.view.reading import annotated


@contextmanager
def filmed(path: Path, fps: float) -> Iterator[Callable[[Moment], None]]:
    """Give a function that appends a moment's annotated frame to an H.264 video."""
    with video_writer(path, fps) as write:

        def watch(moment: Moment) -> None:
            if moment.frame is not None:
                write(annotated(moment.frame, moment.step))

        yield watch
