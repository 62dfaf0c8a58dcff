"""What a person wears: the colours of shirt and trousers, which tell people apart where their paths cross."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Clothes = NDArray[np.float64]
"""(2, 3): shirt and trousers; share of red, share of green and logarithm of the brightness, each in standard
deviations of `ColourSampling`."""


@dataclass(frozen=True, slots=True)
class ColourSampling:
    """Where in a detection window the clothes are, and how much their colours vary.

    Attributes
    ----------
    chest, hips
        Middle and half height of each patch, in window heights. HOG's window has the head at .1 to .2 and the feet at
        .9; so the patches are on shirt and trousers of the arena's figure from all sides.
    half_width
        Half the width of the patches, in window heights. Chosen: narrower than a person seen from the side.
    dark
        Added to each channel [of 255]. Chosen: 8 standard deviations of the camera's noise, so that the hue of black
        cloth is not the hue of noise.
    red, green, brightness
        Standard deviation of the same cloth in other light: share of red, share of green, logarithm of the brightness.
        Chosen so that light from half to 1.3 times as bright, with noise, stays below half of `Appearance.other`.
    """

    chest: tuple[float, float] = (0.35, 0.07)
    hips: tuple[float, float] = (0.54, 0.03)
    half_width: float = 0.04
    dark: float = 8.0
    red: float = 0.05
    green: float = 0.05
    brightness: float = 0.5


def clothes_in(
    image: NDArray[np.uint8], boxes: NDArray[np.int32], sampling: ColourSampling | None = None
) -> NDArray[np.float64]:
    """Return what the person in each box wears.

    Parameters
    ----------
    image
        uint8 (H, W, 3), BGR, or (H, W), in which all clothes are gray.
    boxes
        int32 (N, 4): x, y, w, h of detection windows [px].
    sampling
        Where to look.

    Returns
    -------
    float64 (N, 2, 3): `Clothes` of each; NaN where they are out of the image.
    """
    sampling = sampling or ColourSampling()
    worn: NDArray[np.float64] = np.full((len(boxes), 2, 3), np.nan)
    # An array of another shape is a fault; the safety layer reports it and stops the robot.
    for index, (x, y, w, h) in enumerate(boxes.tolist() if boxes.shape[1:] == (4,) else ()):
        middle, half = x + w / 2, max(sampling.half_width * h, 1)
        columns = slice(max(round(middle - half), 0), max(round(middle + half), 0))
        for part, (centre, reach) in enumerate((sampling.chest, sampling.hips)):
            rows = slice(max(round(y + (centre - reach) * h), 0), max(round(y + (centre + reach) * h), 0))
            patch = image[rows, columns]
            if patch.size:
                blue, green, red = np.broadcast_to(np.median(patch, axis=(0, 1)), 3) + sampling.dark
                total = blue + green + red
                worn[index, part] = red / total, green / total, np.log(total)
    worn /= np.array([sampling.red, sampling.green, sampling.brightness])
    return worn


@dataclass(frozen=True, slots=True)
class Appearance:
    """Compares and learns clothes.

    Attributes
    ----------
    max_shirt, max_trousers
        The most that each can add to the cost [chi-squared of 3 numbers]. Chosen: the trousers less, since hands and
        the gap between two legs are seen in their patch, and below `other`, so that only a shirt tells people apart.
    other
        A larger cost means another person [chi-squared]. Chosen between the arena's shirts (16 and more apart) and one
        shirt in other light (below 6).
    rate
        Share by which the known clothes of a confirmed person move towards those in a new box [1]. Chosen: a time
        constant of 20 frames, 2 s, slower than a shadow is crossed.
    """

    max_shirt: float = 16.0
    max_trousers: float = 9.0
    other: float = 12.0
    rate: float = 0.05

    def cost(self, known: Clothes | None, seen: Clothes | None, *, slips: bool = True) -> float:
        """Return how much the colours in a box differ from known clothes [chi-squared].

        At most `max_shirt` + `max_trousers`; 0 where either is unknown. A box that is too low shows trousers in the
        place of the shirt: where it may have slipped, the smaller cost of both readings counts.
        """
        if known is None or seen is None:
            return 0.0
        shirt, trousers = known.tolist()
        seen_shirt, seen_trousers = seen.tolist()
        of_trousers = min(chi_squared(trousers, seen_trousers), self.max_trousers)
        cost = min(chi_squared(shirt, seen_shirt), self.max_shirt) + of_trousers
        if slips:
            cost = min(cost, min(chi_squared(trousers, seen_shirt), self.max_shirt) + of_trousers)
        return cost

    def learn(self, known: Clothes, seen: Clothes) -> Clothes:
        """Move known clothes towards those in a box; a shirt or trousers that clearly differ are left out."""
        most = self.max_shirt, self.max_trousers
        parts = zip(known.tolist(), seen.tolist(), most, strict=True)
        same = np.array([chi_squared(old, new) < limit for old, new, limit in parts])
        moved: Clothes = known + self.rate * same[:, None] * (seen - known)
        return moved


def chi_squared(known: list[float], seen: list[float]) -> float:
    """Return chi-squared of the three numbers of a shirt or of trousers."""
    (a, b, c), (x, y, z) = known, seen
    return (x - a) ** 2 + (y - b) ** 2 + (z - c) ** 2
