"""Pictures to learn from: descriptors of their objects, and of what a detector takes for one (hard negatives)."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from limo_hog import _core
from limo_hog.cv2_api.geometry import Geometry
from limo_hog.exceptions import ImageError
from limo_hog.learn.labels import LabelWarning
from limo_hog.learn.windows import Jitter, Region, WindowShape, cut, positive_crops, random_boxes, read_gray
from limo_hog.parallel import in_order
from limo_hog.suppression import intersection_over_union, nms


@dataclass(frozen=True)
class MiningParameters:
    """How negatives are found; with these, 3000 photographs gave the weights that are shipped."""

    #: Most windows drawn at random, from all negatives together, before there is a detector.
    random_windows: int = 20_000
    random_per_picture: int = 40  #: most of them of one picture: more would show the same again
    above: float = -1.0  #: least SVM margin of a hard negative: -1 is where the squared hinge begins to count
    per_picture: int = 6  #: most hard negatives of one picture and round
    scale: float = 1.1  #: ratio of neighbouring levels of the search
    surest: int = 500  #: hits of a picture that are looked at; the first detectors have thousands
    max_iou: float = 0.5  #: of two hits that overlap more, the surer is taken
    enlarged: float = 0.15  #: share of the pictures that are also searched at twice their size
    clear_of_objects: float = 0.3  #: most intersection over union of a negative with a labelled box


@dataclass(frozen=True)
class Negatives:
    """Pictures to take negatives from."""

    paths: tuple[Path, ...]  #: the pictures
    #: Of the pictures that do show objects, their boxes [px], float64 (N, 4).
    objects: dict[Path, NDArray[np.float64]] = field(default_factory=dict)


def hog_of(shape: WindowShape, coefficients: NDArray[np.float64] | None = None) -> _core.Hog:
    """Make the descriptor of a window, OpenCV's default in all but its size; with an SVM, a detector."""
    svm = None if coefficients is None else coefficients.astype(np.float32)
    return Geometry(winSize=shape.size).compiled(svm)


def describe(hog: _core.Hog, crops: Sequence[NDArray[np.uint8]]) -> NDArray[np.float32]:
    """Return the descriptors of crops of the window's size: float32 (N, D).

    By the exact path: the same pictures and seed give the same weights, bit for bit, whatever kernels a CPU has.
    """
    descriptors = np.empty((len(crops), hog.descriptor_len), np.float32)
    for row, crop in zip(descriptors, crops, strict=True):
        row[:] = hog.compute(np.ascontiguousarray(crop), (8, 8), (0, 0), None)
    return descriptors


def readable(path: Path) -> NDArray[np.uint8] | None:
    """Read a gray picture; None, with a warning, where it cannot be read.

    Warns `LabelWarning` where the file is left out.
    """
    try:
        return read_gray(path)
    except (ImageError, OSError) as error:
        warnings.warn(f"left out: {error}", LabelWarning, stacklevel=2)
        return None


def describe_objects(
    regions: Sequence[Region], shape: WindowShape, jitter: Jitter, mirror: bool, seed: int, workers: int
) -> Iterator[NDArray[np.float32]]:
    """Yield the descriptors of each object: float32 (n, D), the plain one first, then jittered and mirrored ones.

    An object that came before, or whose mirror image did, has none (0, D): some collections of crops hold both. So has
    one whose picture cannot be read.
    """
    hog = hog_of(shape)
    seen: set[bytes] = set()

    def work(job: tuple[int, Region]) -> tuple[list[bytes], NDArray[np.float32]]:
        number, region = job
        image = readable(region.path)
        if image is None:
            return [], describe(hog, [])
        # A box without width is the whole picture.
        box = region.box if region.box[2] > 0 else (0.0, 0.0, float(image.shape[1]), float(image.shape[0]))
        # A generator for each object: what is drawn for one does not depend on the others.
        crops = positive_crops(image, box, shape.size, jitter, mirror, np.random.default_rng([seed, 1, number]))
        ways = [crops[0], crops[0][:, ::-1]] if mirror else [crops[0]]
        return [hashlib.sha256(way.tobytes()).digest() for way in ways], describe(hog, crops)

    for marks, descriptors in in_order(work, enumerate(regions), workers):
        known = not seen.isdisjoint(marks)
        seen.update(marks[:1])
        yield descriptors[:0] if known else descriptors


#: Boxes float64 (n, 4) [px] and margins (n,).
_Hits = tuple[NDArray[np.float64], NDArray[np.float64]]


@dataclass(frozen=True, slots=True)
class Mined:
    """Negatives of one picture: its index, their boxes float64 (n, 4) [px], margins (n,), descriptors (n, D)."""

    picture: int
    boxes: NDArray[np.float64]
    margins: NDArray[np.float64]
    descriptors: NDArray[np.float32]


@dataclass(frozen=True)
class Miner:
    """Takes negatives of a window's shape from pictures; each picture draws from a generator of its own."""

    negatives: Negatives
    shape: WindowShape
    parameters: MiningParameters
    seed: int
    workers: int

    def random(self) -> Iterator[Mined]:
        """Yield windows drawn at random, of every picture about as many; a picture of a window's size gives itself."""
        how, size = self.parameters, self.shape.size
        share = min(how.random_per_picture, how.random_windows / max(1, len(self.negatives.paths)))

        def boxes_of(number: int, image: NDArray[np.uint8]) -> _Hits:
            rng = np.random.default_rng([self.seed, 2, number])
            count = int(share) + int(rng.random() < share % 1)
            height, width = image.shape
            if (width, height) == size:
                drawn = [(0.0, 0.0, float(width), float(height))]
            else:
                drawn = random_boxes((width, height), size, count, rng)
            return np.array(drawn, np.float64).reshape(-1, 4), np.zeros(len(drawn))

        return self._mined(boxes_of, how.random_per_picture)

    def hard(self, coefficients: NDArray[np.float64], known: Mapping[int, set[tuple[float, ...]]]) -> Iterator[Mined]:
        """Search every picture and yield what the detector takes for an object and is not `known`: boxes by picture."""
        how, detector = self.parameters, hog_of(self.shape, coefficients)

        def boxes_of(number: int, image: NDArray[np.uint8]) -> _Hits:
            boxes, margins = _search(detector, image, how)
            if np.random.default_rng([self.seed, 3, number]).random() < how.enlarged:
                more_boxes, more_margins = _search(detector, image, how, enlarged=2)
                boxes, margins = np.concatenate([boxes, more_boxes / 2]), np.concatenate([margins, more_margins])
            surest = np.argsort(-margins, kind="stable")[: how.surest]
            boxes, margins = boxes[surest], margins[surest]
            kept = nms(boxes, margins, how.max_iou)
            fresh = [tuple(box) not in known.get(number, ()) for box in boxes[kept].tolist()]
            kept = kept[np.array(fresh, np.bool_)]
            return boxes[kept], margins[kept]

        return self._mined(boxes_of, how.per_picture)

    def _mined(self, boxes_of: Callable[[int, NDArray[np.uint8]], _Hits], most: int) -> Iterator[Mined]:
        """Cut out of each picture the first `most` of its windows that are clear of labelled objects."""
        hog = hog_of(self.shape)

        def work(number: int) -> Mined:
            path = self.negatives.paths[number]
            image = readable(path)
            if image is None:
                return Mined(number, np.empty((0, 4)), np.empty(0), describe(hog, []))
            boxes, margins = boxes_of(number, image)
            objects = self.negatives.objects.get(path)
            if objects is not None and len(objects) and len(boxes):
                overlaps = intersection_over_union(self.shape.object_box.inside(boxes), objects).max(axis=1)
                clear = overlaps <= self.parameters.clear_of_objects
                boxes, margins = boxes[clear], margins[clear]
            boxes, margins = boxes[:most], margins[:most]
            return Mined(number, boxes, margins, describe(hog, [cut(image, box, self.shape.size) for box in boxes]))

        return in_order(work, range(len(self.negatives.paths)), self.workers)


def hardest(found: Sequence[Mined], room: int) -> tuple[list[Mined], int]:
    """Return as many negatives as have room [B], the hardest, in the order they came, and how many were left out."""
    margins = np.concatenate([np.empty(0), *(mined.margins for mined in found)])
    size = max((mined.descriptors[0].nbytes for mined in found if len(mined.descriptors)), default=1)
    most = max(0, room // size)
    if len(margins) <= most:
        return list(found), 0
    kept = np.zeros(len(margins), np.bool_)
    kept[np.argsort(-margins, kind="stable")[:most]] = True
    parts = np.split(kept, np.cumsum([len(mined.margins) for mined in found])[:-1])
    hardest = [
        Mined(mined.picture, mined.boxes[part], mined.margins[part], mined.descriptors[part])
        for mined, part in zip(found, parts, strict=True)
    ]
    return hardest, len(margins) - most


def _search(detector: _core.Hog, image: NDArray[np.uint8], parameters: MiningParameters, enlarged: int = 1) -> _Hits:
    # No padding: a window beyond the edge would learn what mirroring looks like.
    height, width = image.shape
    boxes, margins = detector.detect_multi_scale(
        image,
        hit_threshold=parameters.above,
        win_stride=(8, 8),
        scale=parameters.scale,
        searched_size=(enlarged * width, enlarged * height),
    )
    return boxes.astype(np.float64), margins
