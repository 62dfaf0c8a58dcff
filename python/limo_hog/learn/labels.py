"""Labelled pictures: which boxes are sought in which file, and what is wrong with them."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from limo_hog.exceptions import LimoHogError
from limo_hog.imaging.reading import Kind, Source, read_image


class LabelError(LimoHogError):
    """Labels that cannot be read, or that do not name what was asked for."""


class LabelWarning(UserWarning):
    """Labels of which a part is left out; the message says which part and why."""


@dataclass(frozen=True, slots=True)
class Box:
    """One labelled object: x, y, width, height [px] of a box, top left corner first."""

    label: str  #: what it is; empty where the labels do not say
    x: float
    y: float
    width: float
    height: float
    ignored: bool = False  #: finding it is neither right nor wrong ("difficult", "crowd", "ignore")


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture and its labelled boxes."""

    path: Path
    boxes: tuple[Box, ...]

    def arrays(self) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return the boxes, float64 (N, 4) x, y, w, h [px], and which are ignored, bool (N,)."""
        boxes = np.array([(b.x, b.y, b.width, b.height) for b in self.boxes], np.float64).reshape(-1, 4)
        return boxes, np.array([b.ignored for b in self.boxes], np.bool_)

    def read(self) -> NDArray[np.uint8]:
        """Read the picture as uint8 (height, width, 3) BGR.

        Raises `ReadError` or `OSError` where the file is no picture, or cannot be read.
        """
        return read_image(Source(str(self.path), self.path, Kind.IMAGE))


def choose(pictures: Sequence[Picture], label: str | None) -> list[Picture]:
    """Return the pictures with only the boxes of one label, which may be left open where there is just one.

    Boxes without area are left out. Raises `LabelError` where there is no box, none of this label or only some without
    area, or several labels to choose from. Warns `LabelWarning` where boxes were left out.
    """
    counts = Counter(box.label for picture in pictures for box in picture.boxes if not box.ignored)
    known = ", ".join(f"{name or '(none)'} ({n})" for name, n in counts.most_common())
    if not counts:
        raise LabelError(f"no labelled box in {len(pictures)} pictures; at least one is wanted")
    if label is None:
        if len(counts) > 1:
            raise LabelError(f"several labels: {known}; choose one with --label")
        label = next(iter(counts))
    elif label not in counts:
        raise LabelError(f"no box has the label {label!r}; there are {known}")
    empty = 0
    chosen = []
    for picture in pictures:
        # What is to be ignored may carry any label: crowds, reflections.
        boxes = [box for box in picture.boxes if box.ignored or box.label == label]
        whole = [box for box in boxes if box.width > 0 and box.height > 0]
        empty += len(boxes) - len(whole)
        chosen.append(Picture(picture.path, tuple(whole)))
    if not len(sizes_of(chosen)):
        raise LabelError(f"none of the {counts[label]} labelled boxes has an area; at least one that has is wanted")
    if empty:
        warnings.warn(f"{empty} boxes without area are left out", LabelWarning, stacklevel=2)
    return chosen


def inside(picture: Picture, size: tuple[int, int]) -> Picture:
    """Return the picture without boxes that lie wholly outside of its width and height [px].

    Warns `LabelWarning` where boxes were left out.
    """
    width, height = size
    kept = tuple(b for b in picture.boxes if b.x < width and b.y < height and b.x + b.width > 0 and b.y + b.height > 0)
    if left_out := len(picture.boxes) - len(kept):
        said = f"{picture.path}: {left_out} boxes outside of its {width} x {height} pixels are left out"
        warnings.warn(said, LabelWarning, stacklevel=2)
    return Picture(picture.path, kept)


def sizes_of(pictures: Iterable[Picture]) -> NDArray[np.float64]:
    """Return width and height [px] of every box that counts: float64 (N, 2)."""
    return np.array([(b.width, b.height) for p in pictures for b in p.boxes if not b.ignored]).reshape(-1, 2)
