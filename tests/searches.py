"""Random searches for the sweep, the goldens and the random calls: each is made of its number alone."""

import math
import random
from dataclasses import dataclass
from typing import Any

import numpy as np
from tests.parity.goldens import images
from tests.parity.goldens.case import DAIMLER, PEOPLE
from tests.parity.goldens.images import Image

import limo_hog

Pair = tuple[int, int]

#: About the most values and windows of one `compute` call: larger strides are taken where it would be more.
ELEMENTS_MAX, WINDOWS_MAX = 2_000_000, 1_500
SCALES = (1.02, 1.05, 1.1, 1.3, 2.0, 1.0, 0.5)
BINS = (1, 2, 3, 4, 7, 9, 9, 9, 12, 18, 31, 127, 128)


class Draw(random.Random):
    """Random numbers by float arithmetic alone: three times as fast as the library's exact ones, and as good here."""

    def randrange(self, stop: int) -> int:  # type: ignore[override]
        return int(self.random() * stop)

    def randint(self, a: int, b: int) -> int:
        return a + int(self.random() * (b - a + 1))

    def choice(self, seq: Any) -> Any:
        return seq[int(self.random() * len(seq))]

    def pair(self, low: int, high: int) -> Pair:
        """Two numbers, `high` excluded, which are equal half of the time."""
        x, y = self.randint(low, high - 1), self.randint(low, high - 1)
        return x, x if self.random() < 0.5 else y


def some_image(draw: Draw, width: int, height: int) -> Image:
    """Noise, few-valued noise (colour ties), a photograph's detail, or a flat picture; in any memory layout."""
    kind = draw.choice(("noise", "noise", "ties", "photograph", "photograph", "squares", "flat"))
    seed = draw.getrandbits(32)
    if kind == "photograph":
        x, y = draw.randrange(100), draw.randrange(100)
        whole = images.photograph(draw.choice(("astronaut", "coffee", "rocket")))
        image = np.resize(whole[y : y + height, x : x + width], (height, width, 3))
    elif kind == "squares":
        image = images.blocks(seed, height, width, 3, size=draw.randint(3, 12))
    else:
        image = images.noise(seed, height, width, 3, values={"noise": 256, "ties": 3, "flat": 1}[kind])
    if draw.random() < 0.5:
        image = image[:, :, 1:2] if draw.random() < 0.2 else image[:, :, 1]
    layout = draw.choice(("C", "F", "flipped", "view", "read-only"))
    image = np.array(image, order="F" if layout == "F" else "C")
    if layout == "flipped":
        return image[::-1, ::-1]
    if layout == "view":
        return np.repeat(np.repeat(image, 2, axis=0), 2, axis=1)[::2, ::2]
    image.flags.writeable = layout != "read-only"
    return image


def some_geometry(draw: Draw, clip: float = 0.2) -> tuple[Any, ...]:
    """Constructor arguments; OpenCV reads past the block's end where it has fewer than 4 elements."""
    shape = draw.random()
    if shape < 0.15:
        *sizes, nbins = PEOPLE if shape < 0.1 else DAIMLER
    else:
        cell, cells, blocks = draw.pair(2, 13), draw.pair(1, 4), draw.pair(1, 6)
        block = (cell[0] * cells[0], cell[1] * cells[1])
        stride = draw.choice((cell, block, draw.pair(1, 17)))
        win = (block[0] + (blocks[0] - 1) * stride[0], block[1] + (blocks[1] - 1) * stride[1])
        sizes = [win, block, stride, cell]
        nbins = max(draw.choice(BINS), math.ceil(4 / (cells[0] * cells[1])))
    sigma = draw.choice((-1.0, 0.0, 0.7, 3.0, 12.0))
    gamma, signed = draw.random() < 0.5, draw.random() < 0.5
    return (*sizes, nbins, 1, sigma, 0, clip, gamma, draw.choice((1, 3, 64)), signed)


def some_padding(draw: Draw) -> Pair | None:
    """A padding; OpenCV takes a negative one as none."""
    return draw.choice((None, (0, 0), (8, 8), draw.pair(0, 48), draw.pair(0, 48), draw.pair(-8, 80)))  # type: ignore[no-any-return]


@dataclass(frozen=True)
class Search:
    seed: int
    geometry: tuple[Any, ...]
    size: Pair
    #: As a golden's: a people model, or the seed of random coefficients.
    detector: str | int
    win_stride: Pair | None
    padding: Pair | None
    around: tuple[Pair, Pair]
    locations: list[Pair]
    scale: float

    def image(self) -> Image:
        return some_image(Draw(f"image {self.seed}"), *self.size)

    def steps(self, method: str) -> tuple[Pair, bool]:
        """The padding as OpenCV rounds it, and whether its `detect` and `detectMultiScale` accept that."""
        block_stride, cell = self.geometry[2:4]
        stride = self.win_stride or (block_stride if method == "detectMultiScale" else cell)
        common = [math.gcd(stride[i], block_stride[i]) for i in (0, 1)]
        pad = [(max(side, 0) + step - 1) & -step for side, step in zip(self.padding or (0, 0), common, strict=True)]
        return (pad[0], pad[1]), all(pad[i] % common[i] == 0 for i in (0, 1))

    def fits(self, method: str) -> bool:
        """Where the padded image is smaller than the window OpenCV reads and writes foreign memory."""
        pad, _ = self.steps(method)
        return all(self.size[i] + 2 * pad[i] >= self.geometry[0][i] for i in (0, 1))


def some_search(seed: int, clip: float = 0.2) -> Search:
    draw = Draw(seed)
    geometry = some_geometry(draw, clip)
    win, cell = geometry[0], geometry[3]
    width, height = (max(side + room, 1) for side, room in zip(win, draw.pair(-20, 120), strict=True))
    win_stride: Pair | None = draw.choice((None, None, (8, 8), (4, 4), (16, 8), draw.pair(1, 33), (100, 100)))
    length = limo_hog.HOGDescriptor(*geometry).getDescriptorSize()
    windows = max(width - win[0] + 160, 1) * max(height - win[1] + 160, 1)
    step = win_stride or cell
    while max(length, ELEMENTS_MAX // WINDOWS_MAX) * windows / (step[0] * step[1]) > ELEMENTS_MAX:
        win_stride = step = (step[0] * 2 + 1, step[1] * 2)
    detector: str | int = draw.randrange(10**6)
    if geometry[:5] in (PEOPLE, DAIMLER) and draw.random() < 0.8:
        detector = draw.choice(("default", "default_no_bias")) if geometry[:5] == PEOPLE else "daimler"
    return Search(
        seed=seed,
        geometry=geometry,
        size=(width, height),
        detector=detector,
        win_stride=win_stride,
        padding=some_padding(draw),
        around=(draw.pair(4, 20), draw.pair(-4, 20)),
        locations=[draw.pair(-30, 120) for _ in range(6)],
        scale=draw.choice(SCALES),
    )
