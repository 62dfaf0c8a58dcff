"""Training windows: where objects and their surroundings lie in pictures, cut out as the search sees them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from limo_hog.extras import needed
from limo_hog.learn.labels import Picture
from limo_hog.models import PERSON_BOX, PersonBox

with needed(by="training"):
    import cv2

#: Cells are 8 × 8 px, blocks 2 × 2 cells: windows are whole cells, at least one block.
_CELL, _BLOCK = 8, 16
#: Surroundings on each side of the object [px]: what OpenCV's 64 × 128 window has at the sides of a person of 40 × 100.
_MARGIN_PX = 12
#: Area of the object in a window that no option sets [px²], that person's; less where many objects are smaller.
_OBJECT_AREA_PX2 = 4000.0


@dataclass(frozen=True, slots=True)
class WindowShape:
    """A detection window: its width and height [px], and where the object stands in it, as shares of both.

    The defaults are those of crops of people.
    """

    size: tuple[int, int] = (64, 128)
    object_box: PersonBox = PERSON_BOX


@dataclass(frozen=True, slots=True)
class Region:
    """A part of a picture [px], perhaps beyond its edges, where the picture is mirrored: x, y, width, height."""

    path: Path
    box: tuple[float, float, float, float]


def shape_for(sizes: NDArray[np.float64], size: tuple[int, int] | None) -> WindowShape:
    """Choose a window for objects of these widths and heights [px], float64 (N, 2); `size` sets its own.

    The object has the boxes' median ratio of width to height, and 12 px around it. Its area is at most that of most
    (80 %) of the boxes, so that these are found without enlarging pictures.
    """
    ratio = float(np.median(sizes[:, 0] / sizes[:, 1]))
    if size is None:
        area = min(_OBJECT_AREA_PX2, float(np.percentile(sizes.prod(axis=1), 20)))
        width, height = np.sqrt(area * ratio), np.sqrt(area / ratio)
        size = _whole_cells(width), _whole_cells(height)
    else:
        room = [max(_CELL, side - 2 * _MARGIN_PX) for side in size]
        height = min(room[1], room[0] / ratio)
        width = height * ratio
    w, h = width / size[0], height / size[1]
    return WindowShape(size, PersonBox((1 - w) / 2, (1 - h) / 2, w, h))


def _whole_cells(object_side: float) -> int:
    return max(_BLOCK, int(-(-(object_side + 2 * _MARGIN_PX) // _CELL)) * _CELL)


def positive_regions(pictures: Sequence[Picture], shape: WindowShape) -> list[Region]:
    """Return the window around each box that counts: as high as the box asks for, centred on it."""
    share = shape.object_box
    regions = []
    for picture in pictures:
        for box in picture.boxes:
            if not box.ignored:
                height = box.height / share.height
                width = height * shape.size[0] / shape.size[1]
                x = box.x + box.width / 2 - (share.x + share.width / 2) * width
                y = box.y + box.height / 2 - (share.y + share.height / 2) * height
                regions.append(Region(picture.path, (x, y, width, height)))
    return regions


def read_gray(path: Path) -> NDArray[np.uint8]:
    """Read a picture as uint8 (height, width).

    Raises `ReadError` or `OSError` where the file is no picture, or cannot be read.
    """
    return cv2.cvtColor(Picture(path, ()).read(), cv2.COLOR_BGR2GRAY).astype(np.uint8, copy=False)


def cut(image: NDArray[np.uint8], box: Sequence[float], size: tuple[int, int]) -> NDArray[np.uint8]:
    """Cut x, y, width, height [px] out of a gray image, uint8 (height, width), at the size of a window.

    Linear interpolation without a mean over what is shrunk, as between the levels of the search; mirrored (reflect-101)
    beyond the edges.
    """
    x, y, width, height = box
    sx, sy = width / size[0], height / size[1]
    if sx == sy == 1 and x == int(x) and y == int(y):
        left, top = int(x), int(y)
        inside = image[max(0, top) : top + size[1], max(0, left) : left + size[0]]
        if left >= 0 and top >= 0 and inside.shape == (size[1], size[0]):
            return inside
    at = np.array([[sx, 0, x + sx / 2 - 0.5], [0, sy, y + sy / 2 - 0.5]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return cv2.warpAffine(image, at, size, flags=flags, borderMode=cv2.BORDER_REFLECT_101).astype(np.uint8, copy=False)


@dataclass(frozen=True)
class Jitter:
    """How a second copy of each object differs from the first; stronger jitter made people harder to find."""

    shift: float = 2.0  #: most pixels of the window it is moved by, each way
    size: float = 0.04  #: most it is enlarged or shrunk, as a share
    blurred: float = 0.3  #: share of the copies that are blurred
    #: Least and most standard deviation of the Gaussian blur [px of the window].
    sigma: tuple[float, float] = (0.45, 0.8)


def positive_crops(
    image: NDArray[np.uint8],
    box: Sequence[float],
    size: tuple[int, int],
    jitter: Jitter,
    mirror: bool,
    rng: np.random.Generator,
) -> list[NDArray[np.uint8]]:
    """Cut one object out twice, plain and jittered; with `mirror` both ways round, each with a jitter of its own.

    What is returned are two or four uint8 (height, width), the plain one first.
    """
    x, y, width, height = box
    crops = []
    for flip in (False, True) if mirror else (False,):
        dx, dy = rng.uniform(-jitter.shift, jitter.shift, 2) * (width / size[0], height / size[1])
        grow = 1 + rng.uniform(-jitter.size, jitter.size)
        blur, sigma = rng.random() < jitter.blurred, rng.uniform(*jitter.sigma)
        left, top = x + dx - width * (grow - 1) / 2, y + dy - height * (grow - 1) / 2
        moved = cut(image, (left, top, width * grow, height * grow), size)
        if blur:
            moved = cv2.GaussianBlur(moved, (0, 0), sigma).astype(np.uint8, copy=False)
        pair = [cut(image, box, size), moved]
        crops += [np.ascontiguousarray(crop[:, ::-1]) for crop in pair] if flip else pair
    return crops


def random_boxes(
    image_size: tuple[int, int], size: tuple[int, int], count: int, rng: np.random.Generator
) -> list[tuple[float, float, float, float]]:
    """Draw `count` windows that fit into an image of width and height [px], of all sizes; none if it is smaller."""
    largest = min(image_size[0] / size[0], image_size[1] / size[1])
    if largest < 1:
        return []
    boxes = []
    for scale in np.exp(rng.uniform(0, np.log(largest), count)):
        width, height = size[0] * scale, size[1] * scale
        x, y = rng.uniform(0, max(0.0, image_size[0] - width)), rng.uniform(0, max(0.0, image_size[1] - height))
        boxes.append((x, y, width, height))
    return boxes
