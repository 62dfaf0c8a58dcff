"""The work of `limo-hog detect`: read, detect, draw and write on all cores; results in the order of the inputs."""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

import limo_hog
from limo_hog.cli.support.output import UsageError, emit, one_line, printable, refuse_to_overwrite
from limo_hog.cli.support.results import Result, Results
from limo_hog.detections import Detections, people
from limo_hog.detector import PeopleDetector
from limo_hog.exceptions import ImageError
from limo_hog.imaging.reading import (
    STDIN,
    Kind,
    ReadError,
    Source,
    find_sources,
    open_video,
    read_image,
    standard_input,
)
from limo_hog.imaging.writing import WriteError, video_writer, write_image
from limo_hog.parallel import cores, in_order

if TYPE_CHECKING:
    from rich.progress import Progress

Image = NDArray[np.uint8]


@dataclass(frozen=True)
class Row:
    """The people found in one picture."""

    source: str
    frame: int
    width: int
    height: int
    people: Detections
    ms: float

    def result(self) -> Result:
        """Return it as plain values; a model without calibration has None for each probability."""
        people = self.people
        return {
            "source": self.source,
            "frame": self.frame,
            "width": self.width,
            "height": self.height,
            "boxes": people.boxes.tolist(),
            "windows": people.windows.tolist(),
            "scores": people.scores.tolist(),
            "probabilities": people.probabilities.round(4).tolist() if people.calibration else [None] * len(people),
            "ms": self.ms,
        }


class Run:
    """One `detect` run: its options and its results so far; `bar` shows them on a terminal."""

    def __init__(self, args: argparse.Namespace, detector: PeopleDetector, bar: Progress | None) -> None:
        self._args, self._detector, self._bar = args, detector, bar
        self._sources: list[Source] = []
        self._copies: dict[Source, Path] = {}
        self._workers = 1
        self._write: Callable[[Result], None]
        self._done: dict[str, set[int]] | None = None
        #: The result of each picture, kept if a table is written at the end.
        self.results: list[Result] | None = [] if args.csv or args.coco else None
        self._task = bar.add_task("looking", total=0) if bar else None
        self.pictures = self.peopled = self.people = self.failed = self.known = 0
        self._ms = 0.0
        self._films = False

    def find(self, stack: ExitStack) -> None:
        """Expand every input, and name each annotated copy.

        Raises
        ------
        UsageError
            Copies would overwrite files.
        """
        # A picture that two inputs name is searched once.
        named: dict[object, Source] = {}
        for name in self._args.inputs:
            for source in self._expand(name, stack):
                named.setdefault(_identity(source), source)
        self._sources = list(named.values())
        self._films = any(source.kind is not Kind.IMAGE for source in self._sources)
        if self._args.out is not None:
            self._copies = _copies(self._sources, self._args.out, self._args.format)
            own = {_real(source.path) for source in self._sources}
            for copy in self._copies.values():
                if _real(copy) in own:
                    raise UsageError(f"{copy} is itself an input: choose another folder for --out")
            if not self._args.resume and not self._args.overwrite:
                refuse_to_overwrite(self._copies.values(), ", --resume makes only what is missing")

    def look(self, results: Results) -> None:
        """Search every input."""
        self._write = results.write
        self._done = None if results.earlier is None else results.done()
        if self.results is not None:
            self.results += results.earlier or []
        self._share_cores(self._sources)
        self._expect(sum(source.kind is Kind.IMAGE for source in self._sources))
        for images, group in groupby(self._sources, key=lambda source: source.kind is Kind.IMAGE):
            if images:
                self._look_at_images(list(group))
            else:
                for source in group:
                    self._look_at_video(source)

    def summary(self, seconds: float) -> str:
        """Return counts and times in one line."""
        # The same person is found in frame after frame of a film.
        found = f"{self.people} detections" if self._films else f"{people(self.people)} in {self.peopled} of them"
        if not self._films and self.pictures == 1:
            found = people(self.people)
        words = [f"{_of(self.pictures, 'frame' if self._films else 'picture')}, {found}"]
        if self.pictures:
            each = " each" if self.pictures > 1 else ""
            words.append(f"detection {self._ms / self.pictures:.1f} ms{each}")
        if self.pictures > 1:
            words[-1] += f", with reading and writing {1e3 * seconds / self.pictures:.1f} ms"
        if self.known:
            words.append(f"{self.known} done before")
        if self.failed:
            words.append(f"{self.failed} could not be read")
        return "; ".join(words)

    def _expand(self, name: str, stack: ExitStack) -> list[Source]:
        try:
            found = [stack.enter_context(standard_input())] if name == STDIN else find_sources(name)
        except (ReadError, OSError) as error:
            self._fail(one_line(error))
            return []
        out = self._args.out and _real(self._args.out)
        if out and _real(Path(name)) in out.parents:
            # Copies of an earlier run, in a folder below the pictures', are no inputs.
            found = [source for source in found if out not in _real(source.path).parents]
        return found

    def _share_cores(self, sources: list[Source]) -> None:
        """Use a core for each of many pictures, and all cores for a single one."""
        threads = self._args.threads or cores()
        many = len(sources) > 1 or any(source.kind is Kind.VIDEO for source in sources)
        self._workers = threads if many else 1
        limo_hog.set_num_threads(1 if many else threads)
        cv2.setNumThreads(1 if many else threads)

    def _look_at_images(self, sources: list[Source]) -> None:
        def work(source: Source) -> Row | str:
            try:
                found, picture = self._find(source, 0, read_image(source))
            except (ImageError, OSError, MemoryError) as error:
                return _named(source, error)
            if picture is not None:
                write_image(self._copies[source], picture)
            return found

        new = [source for source in sources if not self._is_done(source)]
        self.known += len(sources) - len(new)
        for found in in_order(work, new, self._workers):
            if isinstance(found, str):
                self._fail(found)
            elif found.frame not in self._done_of(found.source):
                self._keep(found)
            self._advance()

    def _look_at_video(self, source: Source) -> None:
        try:
            self._look_at_frames(source)
        except (ReadError, WriteError) as error:
            self._fail(_named(source, error))

    def _look_at_frames(self, source: Source) -> None:
        copy = self._copies.get(source)
        if self._args.resume and copy is not None and copy.exists():
            if self._done is None:
                self.known += 1
                return
            # The copy is whole; frames may lack their line.
            copy = None
        with ExitStack() as stack:
            try:
                video = stack.enter_context(open_video(source))
            except OSError as error:
                self._fail(_named(source, error))
                return
            every, done = self._args.every, self._done_of(source.name)
            write = copy and stack.enter_context(video_writer(copy, video.fps / every))
            # An annotated copy always starts at the first frame.
            skip = set() if write else done
            self.known += len(skip)
            self._expect(max(0, -(-video.frame_count // every) - len(skip)))

            def frames() -> Iterator[tuple[int, Image]]:
                try:
                    yield from video.frames(every, skip)
                except ReadError as error:
                    self._fail(str(error))

            def work(job: tuple[int, Image]) -> tuple[Row, Image | None] | str:
                try:
                    return self._find(source, *job)
                except (ImageError, MemoryError) as error:
                    return _named(source, error)

            try:
                for result in in_order(work, frames(), self._workers):
                    if isinstance(result, str):
                        self._fail(result)
                        break  # the other frames are as large
                    found, picture = result
                    if write and picture is not None:
                        write(picture)
                    if found.frame not in done:
                        self._keep(found, film=True)
                    self._advance()
            except KeyboardInterrupt:
                # Ctrl-C is how a camera's or a stream's run ends: its copy is complete.
                if source.kind not in (Kind.CAMERA, Kind.STREAM):
                    raise

    def _find(self, source: Source, frame: int, image: Image) -> tuple[Row, Image | None]:
        start = time.perf_counter()
        detections = self._detector.detect(image)
        ms = 1e3 * (time.perf_counter() - start)
        height, width = image.shape[:2]
        found = Row(source.name, frame, width, height, detections, round(ms, 3))
        return found, detections.draw(image) if source in self._copies else None

    def _is_done(self, source: Source) -> bool:
        if not self._args.resume:
            return False
        written = self._done is None or 0 in self._done_of(source.name)
        return written and (source not in self._copies or self._copies[source].exists())

    def _done_of(self, name: str) -> set[int]:
        """Return the frames of a source that an earlier run has done."""
        return (self._done or {}).get(name, set())

    def _expect(self, pictures: int) -> None:
        if self._bar and self._task is not None:
            self._bar.update(self._task, total=(self._bar.tasks[0].total or 0) + pictures)

    def _advance(self) -> None:
        if self._bar and self._task is not None:
            self._bar.advance(self._task)

    def _keep(self, found: Row, film: bool = False) -> None:
        result, seen = found.result(), found.people
        self._write(result)
        if self.results is not None:
            self.results.append(result)
        self.pictures += 1
        self.people += len(seen)
        self.peopled += len(seen) > 0
        self._ms += found.ms
        if self._args.json is None and self._args.out is None:
            where = f"{found.source}:{found.frame}" if film else found.source
            # Where nothing is kept, a reader who has left ends the run.
            line = " ".join((f"{printable(where)}  {people(len(seen))} ", *seen.labels))
            (emit if self.results is None else print)(line)

    def _fail(self, line: str) -> None:
        self.failed += 1
        line = f"limo-hog: {printable(line)}"
        if self._bar:
            self._bar.console.print(line, highlight=False, markup=False, soft_wrap=True)
        else:
            print(line, file=sys.stderr)


def _of(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"


def _real(path: Path) -> Path:
    """Return a path without links; one that leads to itself stays, where `Path.resolve` raises."""
    return Path(os.path.realpath(path))


def _named(source: Source, error: Exception) -> str:
    """Return an error in one line that names its picture."""
    line = one_line(error)
    return line if source.name in line else f"{source.name}: {line}"


def _identity(source: Source) -> object:
    """Return what two spellings of one picture or video file have in common; a link to it is one of its own."""
    if source.kind in (Kind.IMAGE, Kind.VIDEO):
        return _real(source.path.parent) / source.path.name, source.kind
    return source


def _copies(sources: list[Source], folder: Path, wanted: str | None) -> dict[Source, Path]:
    """Name each source's annotated copy: its place below what all sources have in common, in `folder`.

    Images are of the `wanted` format, or else JPEG where the source is, and PNG where not.
    """
    # Without `..`, which would lead out of `folder`.
    folders = {
        source: Path(os.path.normpath(source.path.absolute().parent)) for source in sources if source.name != STDIN
    }
    root = os.path.commonpath(folders.values()) if folders else ""
    names: dict[Source, Path] = {}
    for source in sources:
        like_source = "jpg" if source.path.suffix.lower() in (".jpg", ".jpeg") else "png"
        suffix = f".{wanted or like_source}" if source.kind is Kind.IMAGE else ".mp4"
        place = folder / folders[source].relative_to(root) if source in folders else folder
        stem = "stdin" if source.name == STDIN else source.path.stem
        names[source] = place / f"{stem}{suffix}"
    # Two pictures of one stem, such as a.jpg and a.png, keep their whole names.
    taken = Counter(names.values())
    return {
        source: path if taken[path] == 1 else path.with_name(source.path.name + path.suffix)
        for source, path in names.items()
    }
