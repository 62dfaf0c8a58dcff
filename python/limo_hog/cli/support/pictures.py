"""The work of `limo-hog detect`: read, detect, draw and write on all cores; results in the order of the inputs."""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from dataclasses import replace
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

import limo_hog
from limo_hog.cli.support.output import UsageError, emit, one_line, printable, refuse_to_overwrite
from limo_hog.cli.support.results import Result, Results, Row
from limo_hog.detections import people
from limo_hog.detector import PeopleDetector
from limo_hog.exceptions import ImageError
from limo_hog.imaging.reading import (
    STDIN,
    Kind,
    ReadError,
    Source,
    Video,
    find_sources,
    newest_frames,
    open_video,
    read_image,
    standard_input,
)
from limo_hog.imaging.writing import video_writer, write_image
from limo_hog.parallel import cores, in_order
from limo_hog.tracking import FED, Tracker

if TYPE_CHECKING:
    from rich.progress import Progress

Image = NDArray[np.uint8]
#: Pictures that are tracked are taken for a film of this rate [Hz].
_PICTURES_HZ = 25.0


class Run:
    """One `detect` run: its options and its results so far; `bar` shows them on a terminal.

    `stack` keeps standard input, where that is an input.

    Raises
    ------
    UsageError
        Copies would overwrite files.
    """

    def __init__(
        self, args: argparse.Namespace, detector: PeopleDetector, bar: Progress | None, stack: ExitStack
    ) -> None:
        self._args, self._detector, self._bar = args, detector, bar
        self._copies: dict[Source, Path] = {}
        self._workers = 1
        self._write: Callable[[Result], None]
        self._earlier: list[Result] | None = None
        # The frames of each source that an earlier run has done.
        self._done: dict[str, set[int]] = defaultdict(set)
        #: The result of each picture, kept if a table is written at the end.
        self.results: list[Result] | None = [] if args.csv or args.coco or args.mot else None
        #: Shows a picture, drawn into, at its time in a film [s] on the live page, where one is wanted.
        self.show: Callable[[tuple[Row, Image], float | None], None] | None = None
        self._tracker: Tracker | None = None
        self.set_threshold(detector.least_score)
        self._task = bar.add_task("looking", total=0) if bar else None
        self.pictures = self.peopled = self.people = self.failed = self.known = self.dropped = 0
        self._ms = 0.0
        # A picture that two inputs name is searched once.
        named: dict[object, Source] = {}
        for name in self._args.inputs:
            for source in self._expand(name, stack):
                named.setdefault(_identity(source), source)
        self._sources = list(named.values())
        self._films = any(source.kind is not Kind.IMAGE for source in self._sources)
        if self._args.mot and self._films and len(self._sources) > 1:
            raise UsageError(
                f"--mot is for one film, or for pictures that are one; these are {len(self._sources)} inputs"
            )
        if self._args.out is not None:
            self._copies = _copies(self._sources, self._args.out, self._args.format)
            own = {_real(source.path) for source in self._sources}
            for copy in self._copies.values():
                if _real(copy) in own:
                    raise UsageError(f"{copy} is itself an input: choose another folder for --out")
            if not self._args.resume and not self._args.overwrite:
                refuse_to_overwrite(self._copies.values(), ", --resume makes only what is missing")

    def set_threshold(self, threshold: float) -> None:
        """Report people from another SVM margin on, from the next picture on."""
        self.threshold = threshold
        if self._tracker is not None:
            self._tracker.set_threshold(threshold)
        self._detector = replace(self._detector, threshold=threshold - FED * bool(self._args.track))

    def look(self, results: Results) -> None:
        """Search every input."""
        self._write, self._earlier = results
        for result in self._earlier or []:
            self._done[result["source"]].add(result["frame"])
        if self.results is not None:
            self.results += self._earlier or []
        # A core for each of many pictures, and all cores for a single one.
        threads = self._args.threads or cores()
        many = len(self._sources) > 1 or any(source.kind is Kind.VIDEO for source in self._sources)
        self._workers = threads if many else 1
        limo_hog.set_num_threads(1 if many else threads)
        cv2.setNumThreads(1 if many else threads)
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
        what = f"{'frame' if self._films else 'picture'}{'' if self.pictures == 1 else 's'}"
        words = [f"{self.pictures} {what}, {found}"]
        if self.pictures:
            each = " each" if self.pictures > 1 else ""
            words.append(f"detection {self._ms / self.pictures:.1f} ms{each}")
        if self.pictures > 1:
            words[-1] += f", with reading and writing {1e3 * seconds / self.pictures:.1f} ms"
        if self.known:
            words.append(f"{self.known} done before")
        if self.dropped:
            words.append(f"{self.dropped} frames dropped, as they came faster")
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

    def _look_at_images(self, sources: list[Source]) -> None:
        self._tracker = self._tracker_at(_PICTURES_HZ)
        # Where people are numbered, pictures that are done are searched again.
        new = [source for source in sources if self._tracker or not self._is_done(source)]
        self.known += len(sources) - len(new)
        jobs = ((source, (0, None, place / _PICTURES_HZ)) for place, source in enumerate(new))
        results = in_order(lambda job: self._work(*job), jobs, self._workers)
        for result, source in zip(results, new, strict=True):
            if isinstance(result, str):
                self._fail(result)
            else:
                found, picture = self._finished(*result)
                if picture is not None and source in self._copies and self._tracker:
                    write_image(self._copies[source], picture)
                if found.frame not in self._done[found.source]:
                    self._keep(found)
            self._advance()

    def _look_at_video(self, source: Source) -> None:
        copy = self._copies.get(source)
        if self._args.resume and copy is not None and copy.exists():
            if self._earlier is None:
                self.known += 1
                return
            # The copy is whole; frames may lack their line.
            copy = None
        with ExitStack() as stack:
            try:
                video = stack.enter_context(open_video(source))
            except (ReadError, OSError) as error:
                self._fail(_named(source, error))
                return
            rate, done, write = video.fps / self._args.every, self._done[source.name], None
            self._tracker = self._tracker_at(rate)
            # An annotated copy, and people's numbers, always start at the first frame.
            skip = set() if copy or self._tracker else done
            self.known += len(skip)
            work = partial(self._work, source)
            results: Iterator[tuple[Row, Image | None] | str]
            if video.live:
                # The thread that reads it owns it from now on.
                newest = newest_frames(video, stack.pop_all(), self._args.every, self._tell, self._drop)
                results = map(work, stack.enter_context(closing(newest)))
            else:
                results = in_order(work, self._frames(video, skip), self._workers)
            try:
                for result in results:
                    if isinstance(result, str):
                        self._fail(result)
                        break  # the other frames are as large
                    found, picture = self._finished(*result, live=video.live)
                    if copy and picture is not None:
                        write = write or stack.enter_context(video_writer(copy, rate, grows=video.live))
                        write(picture, found.at)
                    if found.frame not in done:
                        self._keep(found, film=True)
                    self._advance()
            except ReadError as error:
                self._fail(_named(source, error))
            except KeyboardInterrupt:
                # Ctrl-C is how a camera's or a stream's run ends: its copy is complete.
                if source.kind not in (Kind.CAMERA, Kind.STREAM):
                    raise

    def _drop(self) -> None:
        self.dropped += 1

    def _frames(self, video: Video, skip: set[int]) -> Iterator[tuple[int, Image, float]]:
        """Yield number, image and time [s] of a film's frames."""
        self._expect(max(0, -(-video.frame_count // self._args.every) - len(skip)))
        try:
            for number, image in video.frames(self._args.every, skip):
                yield number, image, number / video.fps
        except ReadError as error:
            self._fail(str(error))

    def _tracker_at(self, rate: float) -> Tracker | None:
        return Tracker(self._args.track, self.threshold, rate) if self._args.track else None

    def _work(self, source: Source, frame: tuple[int, Image | None, float]) -> tuple[Row, Image | None] | str:
        """Search a frame, or the picture that is read here; return what is wrong where that fails."""
        number, image, at = frame
        try:
            image = read_image(source) if image is None else image
            start = time.perf_counter()
            detections = self._detector.detect(image)
            ms = 1e3 * (time.perf_counter() - start)
            picture = None
            if source in self._copies or self.show is not None:
                # Numbers are known later, so that boxes are drawn later then.
                picture = image if self._args.track else detections.draw(image)
        except (ImageError, OSError, MemoryError) as error:
            return _named(source, error)
        if picture is not None and source.kind is Kind.IMAGE and source in self._copies and not self._args.track:
            write_image(self._copies[source], picture)
        height, width = image.shape[:2]
        return Row(source.name, number, width, height, detections, round(ms, 3), at), picture

    def _finished(self, found: Row, picture: Image | None, live: bool = False) -> tuple[Row, Image | None]:
        """Give the people of the next picture their numbers, draw them, and show it on the page."""
        if self._tracker is not None:
            found = replace(found, people=self._tracker.update(found.people, found.at if live else None))
            picture = None if picture is None else self._tracker.draw(found.people, picture)
        if self.show and picture is not None:
            self.show((found, picture), None if live else found.at)
        return found, picture

    def _is_done(self, source: Source) -> bool:
        if not self._args.resume:
            return False
        written = self._earlier is None or 0 in self._done[source.name]
        return written and (source not in self._copies or self._copies[source].exists())

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
        self._tell(line)

    def _tell(self, line: str) -> None:
        line = f"limo-hog: {printable(line)}"
        if self._bar:
            self._bar.console.print(line, highlight=False, markup=False, soft_wrap=True)
        else:
            print(line, file=sys.stderr)


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
