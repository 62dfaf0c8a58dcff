"""Every method of HOGDescriptor against OpenCV's, call by call in turn, and whether the answers are equal.

Run on a quiet machine: `uv run python benches/methods.py [METHOD ...]`; the table is markdown.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import cv2
import numpy as np

import limo_hog
from limo_hog.cli.support.race import Rounds, race
from limo_hog.cli.support.scene import street

ROUNDS = Rounds(seconds=0.6, most=100_000)

WINDOWS = {"people": (64, 128), "Daimler": (48, 96), "random": (64, 128)}
COEFFICIENTS = {
    "people": cv2.HOGDescriptor_getDefaultPeopleDetector(),
    "Daimler": cv2.HOGDescriptor_getDaimlerPeopleDetector(),
    # Half of all windows are hits, with sums too large for the kernels' error bound: all take the exact path.
    "random": np.random.default_rng(0).normal(size=3781).astype(np.float32),
}
METHODS = ("compute", "computeGradient", "detect")
HEAD = ("method", "image", "model", "winStride", "padding", "limo-hog ms", "cv2 ms", "times faster", "answers")

Call = Callable[[Any], Any]


def lines() -> Iterator[tuple[str, str, Call]]:
    """A line's text, the model's name, and what is done with a detector."""
    frame = street(640, 480, 3)
    for name, colour, whole, pad in itertools.product(WINDOWS, ("gray", "BGR"), (False, True), (0, 8)):
        width, height = WINDOWS[name]
        image = frame if whole else frame[200 : 200 + height, 300 : 300 + width]
        image = np.ascontiguousarray(image if colour == "BGR" else image[:, :, 1])
        where = f"{image.shape[1]}×{image.shape[0]} {colour} | {name}"
        edge = (pad, pad)
        if name != "random":
            yield f"computeGradient | {where} | - | {pad}", name, _gradient(image, edge)
        for stride in (8, 4):
            if whole or pad or stride == 8:  # a window alone has no neighbours
                step = (stride, stride)
                if name != "random":
                    yield f"compute | {where} | {stride} | {pad}", name, _compute(image, step, edge)
                yield f"detect | {where} | {stride} | {pad}", name, _detect(image, step, edge)


def _gradient(image: Any, edge: tuple[int, int]) -> Call:
    return lambda hog: hog.computeGradient(image, None, None, edge, edge)


def _compute(image: Any, step: tuple[int, int], edge: tuple[int, int]) -> Call:
    return lambda hog: hog.compute(image, step, edge)


def _detect(image: Any, step: tuple[int, int], edge: tuple[int, int]) -> Call:
    return lambda hog: hog.detect(image, 0.0, step, edge)


def agreement(text: str, ours: Any, theirs: Any) -> str:
    """Gradients must be equal, descriptors within 1.5e-8, places equal and their weights within 1e-5."""
    if text.startswith("compute "):
        ours, theirs = (ours,), (theirs,)
    limits = {"compute ": (1.5e-8,), "computeG": (0, 0), "detect |": (0, 1e-5)}[text[:8]]
    for mine, other, limit in zip(ours, theirs, limits, strict=True):
        mine, other = np.asarray(mine, np.float64), np.asarray(other, np.float64)
        if mine.shape != other.shape or np.abs(mine - other).max(initial=0) > limit:
            return "DIFFERENT"
    return "equal"


def detector(module: Any, name: str) -> Any:
    """The detector `name` of OpenCV's or of ours; the people model has gamma correction, as by default."""
    hog = module.HOGDescriptor(WINDOWS[name], (16, 16), (8, 8), (8, 8), 9, 1, -1, 0, 0.2, name == "people")
    hog.setSVMDetector(COEFFICIENTS[name])
    return hog


def main() -> None:
    """Prints a line per call."""
    cv2.setNumThreads(1)
    limo_hog.set_num_threads(1)
    hogs = {name: [detector(module, name) for module in (limo_hog, cv2)] for name in WINDOWS}
    wanted = sys.argv[1:] or METHODS
    print(f"| {' | '.join(HEAD)} |\n{'|---' * len(HEAD)}|")
    ratios = []
    for text, name, call in lines():
        if text.split(" ")[0] not in wanted:
            continue
        limo, cv = hogs[name]
        answer = agreement(text, call(limo), call(cv))
        ours, theirs = (timing.min for timing in race([partial(call, limo), partial(call, cv)], ROUNDS))
        ratios.append(theirs / ours)
        print(f"| {text} | {ours:.3f} | {theirs:.3f} | {theirs / ours:.2f} | {answer} |", flush=True)
    slower, thrice = sum(ratio < 1 for ratio in ratios), sum(ratio >= 3 for ratio in ratios)
    print(f"\n{len(ratios)} lines: {slower} slower, {thrice} at least 3 times as fast, least {min(ratios):.2f}")


if __name__ == "__main__":
    main()
