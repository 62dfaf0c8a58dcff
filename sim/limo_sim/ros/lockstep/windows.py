"""Replacements in `cv2` for one run: windows without a display, and a HOG detector whose results are logged."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from limo_hog.cv2_api.install import install_into_cv2
from limo_hog.extras import needed
from limo_sim.ros.lockstep.world import World

with needed(by="limo-hog run"):
    import cv2

_MISSING = object()


@contextmanager
def watched_cv2(world: World) -> Iterator[None]:
    """Put the replacements into `cv2`, for one run."""
    # OpenCV 5 has no HOG: for this run, ours takes its place.
    installed = install_into_cv2()
    replacements = {**_windows(world), "HOGDescriptor": _watched(cv2.HOGDescriptor, world)}
    before = {name: getattr(cv2, name, _MISSING) for name in replacements}
    for name, value in replacements.items():
        setattr(cv2, name, value)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is _MISSING:
                delattr(cv2, name)
            else:
                setattr(cv2, name, value)
        for name in installed:
            delattr(cv2, name)


def _windows(world: World) -> dict[str, Callable[..., Any]]:
    def imshow(winname: str, mat: Any) -> None:
        if not isinstance(mat, np.ndarray) or mat.size == 0:
            raise cv2.error(f"imshow: want a picture that is not empty, came {type(mat).__name__}")
        if mat.ndim not in (2, 3) or (mat.ndim == 3 and mat.shape[2] not in (1, 3, 4)):
            raise cv2.error(f"imshow: want (H, W) or 1, 3 or 4 channels, came {mat.shape}")
        picture = _as_shown(mat)
        world.called("windows", str(winname))
        world.link.tell("shown", str(winname), picture.shape, data=picture.tobytes())

    def wait_key(delay: int = 0) -> int:  # noqa: ARG001 — OpenCV's signature
        return -1

    def destroy_window(winname: str) -> None:
        world.link.tell("closed", str(winname))

    def destroy_all() -> None:
        world.link.tell("closed", None)

    def nothing(*_: Any, **__: Any) -> None:
        return None

    return {
        "imshow": imshow,
        "waitKey": wait_key,
        "waitKeyEx": wait_key,
        "pollKey": wait_key,
        "destroyWindow": destroy_window,
        "destroyAllWindows": destroy_all,
        "namedWindow": nothing,
        "moveWindow": nothing,
        "resizeWindow": nothing,
        "setWindowTitle": nothing,
        "setWindowProperty": nothing,
        "setMouseCallback": nothing,
        "startWindowThread": nothing,
        "createTrackbar": nothing,
    }


def _as_shown(picture: NDArray[Any]) -> NDArray[np.uint8]:
    """Return a copy as imshow draws it: 8 bits as they are, 16 bits divided by 256, numbers from 0 to 1 times 255."""
    if picture.dtype == np.uint8:
        return np.array(picture, np.uint8)
    scaled = picture / 256 if picture.dtype == np.uint16 else picture * 255.0
    shown: NDArray[np.uint8] = np.clip(np.nan_to_num(scaled), 0, 255).astype(np.uint8)
    return shown


def _watched(base: Any, world: World) -> Any:
    class HOGDescriptor:
        """OpenCV's or limo-hog's descriptor; what `detectMultiScale` finds is noted in the run.

        It holds the descriptor: a Python class derived from one of cv2's crashes the garbage collector.
        """

        getDefaultPeopleDetector = staticmethod(base.getDefaultPeopleDetector)  # noqa: N815 — OpenCV's names
        getDaimlerPeopleDetector = staticmethod(base.getDaimlerPeopleDetector)  # noqa: N815

        def __init__(self, *args: Any, **kwargs: Any) -> None:
            self._descriptor = base(*args, **kwargs)
            self._has_svm = False

        def __getattr__(self, name: str) -> Any:
            return getattr(self._descriptor, name)

        def setSVMDetector(self, svmdetector: Any) -> Any:  # noqa: N802 — OpenCV's name
            self._has_svm = True
            return self._descriptor.setSVMDetector(svmdetector)

        def load(self, filename: str, *args: Any) -> Any:
            self._has_svm = True
            return self._descriptor.load(filename, *args)

        def detectMultiScale(self, img: Any, *args: Any, **kwargs: Any) -> Any:  # noqa: N802 — OpenCV's name
            looked_at = f"{getattr(img, 'dtype', type(img).__name__)} {np.shape(img)}"
            world.link.tell("looked", looked_at, world.line(), self._has_svm)
            began = time.perf_counter()
            rects, weights = self._descriptor.detectMultiScale(img, *args, **kwargs)
            ms = 1e3 * (time.perf_counter() - began)
            boxes, scores = np.reshape(rects, (-1, 4)), np.reshape(weights, -1)
            world.link.tell("found", np.shape(img), boxes.tolist(), scores.tolist(), ms)
            return rects, weights

    return HOGDescriptor
