"""Replacements in `cv2` of a node's process: windows without a display, and a HOG detector whose results are logged."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

import limo_hog
from limo_hog.cv2_api.install import install_into_cv2
from limo_hog.extras import needed
from limo_sim.ros.lockstep.world import World

with needed(by="limo-hog run"):
    import cv2

#: No screen is larger, nor a JPEG [px].
_LARGEST = 16_384
_WITHOUT_EFFECT = (
    "namedWindow moveWindow resizeWindow setWindowTitle setWindowProperty setMouseCallback startWindowThread "
    "createTrackbar"
).split()
_TRACKER = re.compile(r"Tracker\w+_create")


def watch_cv2(world: World) -> None:
    """Put the replacements into `cv2`, until this process ends."""
    # OpenCV 5 has no HOG: ours takes its place.
    install_into_cv2()
    vars(cv2).update(_windows(world), HOGDescriptor=_watched(cv2.HOGDescriptor, world))
    if world.checked:
        vars(limo_hog)["HOGDescriptor"] = _watched(limo_hog.HOGDescriptor, world)
        limo_hog.PeopleDetector.detect = _watched_detect(limo_hog.PeopleDetector.detect, world)  # type: ignore[method-assign]
        vars(cv2).update({name: _tracker(make, world) for name, make in vars(cv2).items() if _TRACKER.fullmatch(name)})


def _windows(world: World) -> dict[str, Callable[..., Any]]:
    def imshow(winname: str, mat: Any) -> None:
        if not isinstance(mat, np.ndarray) or mat.size == 0:
            raise cv2.error(f"imshow: want a picture that is not empty, came {type(mat).__name__}")
        if mat.ndim not in (2, 3) or (mat.ndim == 3 and mat.shape[2] not in (1, 3, 4)):
            raise cv2.error(f"imshow: want (H, W) or 1, 3 or 4 channels, came {mat.shape}")
        if not isinstance(winname, str) or max(mat.shape[:2]) > _LARGEST:
            raise cv2.error(f"imshow: want a title and at most {_LARGEST} px a side, came {winname!r}, {mat.shape}")
        picture = _as_shown(mat)
        world.link.tell("shown", str(winname), world.line(), picture.shape, data=picture)

    return {
        "imshow": imshow,
        "destroyWindow": lambda winname: world.link.tell("closed", str(winname)),
        "destroyAllWindows": lambda: world.link.tell("closed", None),
        **dict.fromkeys(("waitKey", "waitKeyEx", "pollKey"), lambda delay=0: -1),  # noqa: ARG005 — OpenCV's signature
        **dict.fromkeys(_WITHOUT_EFFECT, lambda *_, **__: None),
    }


def _as_shown(picture: NDArray[Any]) -> NDArray[np.uint8]:
    """Return it as imshow draws it: 8 bits as they are, 16 bits divided by 256, numbers from 0 to 1 times 255."""
    if picture.dtype == np.uint8:
        return np.ascontiguousarray(picture)
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
            world.once("looked", looked_at, world.line(), self._has_svm)
            began = time.perf_counter()
            rects, weights = self._descriptor.detectMultiScale(img, *args, **kwargs)
            ms = 1e3 * (time.perf_counter() - began)
            _found(world, img, np.reshape(rects, (-1, 4)).tolist(), np.reshape(weights, -1).tolist(), ms, hog=True)
            return rects, weights

    return HOGDescriptor


def _found(
    world: World, img: Any, boxes: list[Any], scores: list[float], ms: float = 0.0, *, hog: bool = False
) -> None:
    """Tell what was found in a picture, and where the arena wants to see it, the picture."""
    seen = world.checked and isinstance(img, np.ndarray) and img.dtype == np.uint8
    if hog or seen:
        world.link.tell("found", np.shape(img), boxes, scores, ms, hog, data=np.ascontiguousarray(img) if seen else b"")


def _watched_detect(detect: Callable[..., Any], world: World) -> Callable[..., Any]:
    def watched(detector: Any, image: Any) -> Any:
        found = detect(detector, image)
        _found(world, image, found.windows.tolist(), found.scores.tolist())
        return found

    return watched


def _tracker(create: Callable[..., Any], world: World) -> Callable[..., Any]:
    class Tracker:
        """One of OpenCV's trackers; where it sees what it tracks is told."""

        def __init__(self, *args: Any) -> None:
            self._tracker = create(*args)

        def __getattr__(self, name: str) -> Any:
            return getattr(self._tracker, name)

        def update(self, image: Any) -> Any:
            ok, box = self._tracker.update(image)
            _found(world, image, [[round(side) for side in box]] if ok else [], [1.0] if ok else [])
            return ok, box

    return Tracker
