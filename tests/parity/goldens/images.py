"""Images made from numbers alone, the same on every machine: `answers.json` holds an MD5 of each.

Noise is the bit generator's (PCG64), whose stream NumPy promises. Drawings use +, -, × and ÷ of single float64 values,
which IEEE 754 rounds alike everywhere. The photographs are files of scikit-image's wheel; none is downloaded.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]

#: A person of 96 units standing at (0, 0): capsules (x0, y0, x1, y1, radius), x right and y down from the crown.
BODY = [
    *((0.0, 8.0, 0.0, 9.0, 7.5), (0.0, 14.0, 0.0, 22.0, 4.0)),  # head, neck
    *((-7.0, 24.0, 7.0, 24.0, 5.0), (-4.0, 26.0, -3.0, 48.0, 8.0), (4.0, 26.0, 3.0, 48.0, 8.0)),  # shoulders, trunk
]
#: Supersampling of drawings along each axis: a pixel is the mean of 16 points.
FINE = 4


def noise(seed: int, *shape: int, values: int = 256) -> Image:
    """Draw independent pixels from 0 to `values` - 1; few values make colours tie."""
    return np.random.default_rng(seed).integers(0, values, shape, dtype=np.uint8)


def blocks(seed: int, *shape: int, size: int) -> Image:
    """Enlarge noise to squares of `size` px: edges of every direction and strong hits at low thresholds."""
    height, width = (-(-side // size) for side in shape[:2])
    large = noise(seed, height, width, *shape[2:]).repeat(size, axis=0).repeat(size, axis=1)
    return np.ascontiguousarray(large[: shape[0], : shape[1]])


def flat(value: int, *shape: int) -> Image:
    return np.full(shape, value, np.uint8)


def ramp(height: int, width: int) -> Image:
    """Brighten by 3 per column and 5 per row, wrapping round at 256: constant angles between sharp edges."""
    y, x = np.mgrid[:height, :width]
    return np.asarray((3 * x + 5 * y) % 256, np.uint8)


def checkers(height: int, width: int, side: int) -> Image:
    y, x = np.mgrid[:height, :width]
    return np.asarray((x // side + y // side) % 2 * 255, np.uint8)


def view(seed: int) -> Image:
    """Cut from a larger image: not contiguous, and its neighbours do not belong to it."""
    return noise(seed, 300, 300, 3)[20:200, 30:150]


@cache
def photograph(name: str) -> Image:
    """Read a photograph of scikit-image's wheel, colours in OpenCV's order."""
    import skimage.data  # here, so that the drawn images need numpy alone

    shipped: Any = getattr(skimage.data, name)()
    return np.ascontiguousarray(shipped[:, :, ::-1]) if shipped.ndim == 3 else np.asarray(shipped)


@dataclass(frozen=True)
class Figure:
    """A drawn person: the middle and the top of the head [px], the height [px], the colour and the step."""

    x: int
    y: int
    height: int
    colour: tuple[int, int, int]
    #: Half the distance between the feet, in 96ths of the height.
    step: int = 9

    def capsules(self) -> list[tuple[float, ...]]:
        parts = [*BODY]
        for side in (-1, 1):
            knee, foot = side * (4.0 + self.step * 0.5), side * float(self.step)
            parts += [(side * 10.0, 25.0, side * 13.0, 52.0, 3.5), (side * 4.0, 50.0, knee, 70.0, 5.0)]
            parts.append((knee, 70.0, foot, 92.0, 4.0))
        return [tuple(value * self.height / 96 for value in part) for part in parts]


def coverage(figure: Figure, ys: range, xs: range) -> NDArray[np.float64]:
    """Share of each pixel of some rows and columns that a figure covers, in 16ths."""
    x, y = (side.start + (np.arange(len(side) * FINE) + 0.5) / FINE for side in (xs, ys))
    inside = np.zeros((len(y), len(x)), bool)
    for x0, y0, x1, y1, radius in figure.capsules():
        along, down = x1 - x0, y1 - y0
        from_x, from_y = (x - figure.x - x0)[None, :], (y - figure.y - y0)[:, None]
        at = np.clip((from_x * along + from_y * down) / (along * along + down * down), 0, 1)
        off_x, off_y = from_x - at * along, from_y - at * down
        inside |= off_x * off_x + off_y * off_y <= radius * radius
    return np.asarray(inside.reshape(len(ys), FINE, len(xs), FINE).mean((1, 3)))


def people(seed: int, height: int, width: int, figures: Sequence[Figure]) -> Image:
    picture = 150.0 + blocks(seed, height, width, size=24)[:, :, None] / 8 + noise(seed + 1, height, width, 3) / 16
    for figure in figures:
        reach = figure.height // 4
        ys = range(max(figure.y, 0), min(figure.y + figure.height, height))
        xs = range(max(figure.x - reach, 0), min(figure.x + reach, width))
        share = coverage(figure, ys, xs)[:, :, None]
        place = picture[ys.start : ys.stop, xs.start : xs.stop]
        place[:] = place * (1 - share) + np.asarray(figure.colour, np.float64) * share
    return picture.astype(np.uint8)


def gray(image: Image) -> Image:
    return np.ascontiguousarray(image[:, :, 1])
