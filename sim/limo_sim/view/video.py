"""A run as a film of what the follower saw."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from limo_hog.imaging.writing import video_writer
from limo_sim.run.log import Step, Watch
from limo_sim.view.reading import annotated


@contextmanager
def filmed(path: Path, fps: float) -> Iterator[Watch]:
    """Give a function that appends a step's annotated frame to an H.264 video."""
    with video_writer(path, fps) as write:

        def watch(step: Step) -> None:
            if step.log.frame is not None:
                write(annotated(step.log))

        yield watch
