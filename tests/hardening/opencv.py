"""The second oracle: calls with ordinary arguments, and OpenCV 4.14's answers from a process of its own."""

from __future__ import annotations

import pickle
import subprocess
import sys
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import limo_hog

#: Window, block, stride and cell [px], bins; the first two have a people model.
GEOMETRIES: list[tuple[Any, ...]] = [
    ((64, 128), (16, 16), (8, 8), (8, 8), 9),
    ((48, 96), (16, 16), (8, 8), (8, 8), 9),
    ((32, 24), (16, 16), (8, 8), (8, 8), 9),
    ((24, 36), (12, 12), (6, 6), (6, 6), 7),
    ((16, 16), (8, 16), (8, 8), (4, 8), 18),
]


@dataclass(frozen=True)
class Asked:
    """One call for which OpenCV's answer is defined: the method's name, the detector and the arguments."""

    method: str
    geometry: tuple[Any, ...]
    svm: NDArray[np.float32]
    arguments: tuple[Any, ...]

    @classmethod
    def of(cls, number: int) -> Asked:
        """Return call `number`."""
        rng = np.random.default_rng(number)
        which = int(rng.integers(len(GEOMETRIES)))
        geometry = (*GEOMETRIES[which], 1, -1.0, 0, 0.2, bool(rng.integers(2)))
        win, block, stride, _, nbins = geometry[:5]
        blocks = [(w - b) // s + 1 for w, b, s in zip(win, block, stride, strict=True)]
        cells = [b // c for b, c in zip(block, geometry[3], strict=True)]
        svm = rng.normal(0, 1, int(np.prod(blocks) * np.prod(cells)) * nbins + 1).astype(np.float32)
        if which < 2:
            svm = (limo_hog.HOGDescriptor_getDefaultPeopleDetector, limo_hog.HOGDescriptor_getDaimlerPeopleDetector)[
                which
            ]()
        method = str(rng.choice(["detectMultiScale", "detect", "compute", "computeGradient", "groupRectangles"]))
        if method == "groupRectangles":
            rects = rng.integers((0, 0, 10, 10), (40, 40, 50, 50), (int(rng.integers(1, 30)), 4))
            return cls(
                method, geometry, svm, (rects.tolist(), int(rng.integers(0, 4)), float(rng.choice([0.2, 0.05, 1.0])))
            )
        size = (win[1] + int(rng.integers(0, 60)), win[0] + int(rng.integers(0, 60)))
        values = rng.integers(0, int(rng.choice([256, 256, 3])), (*size, 3), dtype=np.uint8)
        image = values if rng.random() < 0.5 else np.ascontiguousarray(values[:, :, 0])
        if method == "computeGradient":
            return cls(method, geometry, svm, (image, None, None, (4, 8), (8, 4)))
        win_stride = tuple(int(s * k) for s, k in zip(stride, rng.integers(1, 3, 2), strict=True))
        padding = tuple(int(16 * s * k) for s, k in zip(stride, rng.integers(0, 2, 2), strict=True))
        if method == "compute":
            return cls(method, geometry, svm, (image, win_stride, padding))
        threshold = float(rng.choice([-1.0, 0.0, 0.3, -1e9]))
        if method == "detect":
            return cls(method, geometry, svm, (image, threshold, win_stride, padding))
        scale, group = float(rng.choice([1.05, 1.2, 2.0])), float(rng.choice([0, 1, 2]))
        return cls(method, geometry, svm, (image, threshold, win_stride, padding, scale, group))

    def answer(self, library: Any) -> Any:
        """Return the answer of `limo_hog` or `cv2`."""
        if self.method == "groupRectangles":
            return library.groupRectangles(*self.arguments)
        hog = library.HOGDescriptor(*self.geometry)
        hog.setSVMDetector(self.svm)
        return getattr(hog, self.method)(*self.arguments)


class Opencv:
    """OpenCV in a process of its own, which may die."""

    def __init__(self) -> None:
        self._child: subprocess.Popen[bytes] | None = None

    def answer(self, asked: Asked) -> Any:
        """Return OpenCV's answer; None where it refused or died."""
        if self._child is None or self._child.poll() is not None:
            self._child = subprocess.Popen(
                [sys.executable, "-m", "tests.hardening.opencv"], stdin=subprocess.PIPE, stdout=subprocess.PIPE
            )
        assert self._child.stdin and self._child.stdout
        try:
            pickle.dump(asked, self._child.stdin)
            self._child.stdin.flush()
            return pickle.load(self._child.stdout)
        except (EOFError, BrokenPipeError):
            self._child = None
            return None

    def close(self) -> None:
        """End the process."""
        if self._child is not None:
            assert self._child.stdin and self._child.stdout
            self._child.stdin.close()
            self._child.stdout.close()
            self._child.wait()


def disagreement(asked: Asked, opencv: Opencv) -> str:
    """Return how the two answers differ, "" where they do not or OpenCV has none."""
    theirs = opencv.answer(asked)
    if theirs is None:
        return ""
    ours = asked.answer(limo_hog)
    pairs = [(ours, theirs)] if asked.method == "compute" else list(zip(ours, theirs, strict=True))
    for place, (our, their) in enumerate(pairs):
        our, their = np.asarray(our), np.asarray(their)
        exact = our.dtype.kind in "iu" and their.dtype.kind in "iu"
        if our.shape != their.shape:
            return f"{asked.method}, result {place}: shape {our.shape} where OpenCV has {their.shape}"
        if our.size and not (np.array_equal(our, their) if exact else np.allclose(our, their, rtol=0, atol=1e-5)):
            return f"{asked.method}, result {place}: {our.ravel()[:8]} where OpenCV has {their.ravel()[:8]}"
    return ""


def _serve() -> None:
    import cv2

    cv2.setNumThreads(1)
    while True:
        try:
            asked = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        try:
            found = asked.answer(cv2)
        except cv2.error:
            found = None
        pickle.dump(found, sys.stdout.buffer)
        sys.stdout.flush()


if __name__ == "__main__":
    _serve()
