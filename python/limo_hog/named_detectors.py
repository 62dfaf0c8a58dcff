"""The people detectors behind one protocol, by the names of `--detector`: ours, OpenCV's HOG, a network."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from limo_hog import _core
from limo_hog.atomic import is_utf8
from limo_hog.detections import Detections, Detector
from limo_hog.exceptions import LimoHogError
from limo_hog.extras import needed
from limo_hog.models import PERSON_BOX, WHOLE_WINDOW, PersonBox
from limo_hog.suppression import nms

if TYPE_CHECKING:
    import cv2

Image = NDArray[np.uint8]

#: What `--detector` takes.
NAMES = ("hog", "hog-half", "hog:MODEL", "cv2", "onnx:FILE")


class DetectorError(LimoHogError):
    """There is no such detector, or a file is not a network."""


def detector_named(name: str) -> Detector:
    """Return one of `NAMES`; MODEL is a model of `PeopleDetector`, by name or file, FILE a network.

    "hog" groups its hits as `cv2.HOGDescriptor` does, "hog:MODEL" suppresses them greedily; neither enlarges the image.
    Raises `DetectorError` where there is none, OpenCV has no HOG or the file is no network.
    """
    kind, colon, file = name.partition(":")
    if kind == "onnx" and colon:
        return OnnxDetector(Path(file))
    if name == "cv2":
        return Cv2Detector()
    # Imported here, as a detector of the user's own does not need it.
    from limo_hog.detector import PeopleDetector

    if kind == "hog" and colon:
        return PeopleDetector(model=file, min_height=None)
    hog = PeopleDetector(model="opencv", min_height=None, nms="group")
    if name == "hog":
        return hog
    if name == "hog-half":
        return AtScale(hog, 0.5)
    raise DetectorError(f"no detector {name!r}: want one of {', '.join(NAMES)}")


def by_score(boxes: NDArray[Any], scores: NDArray[Any], person_box: PersonBox = PERSON_BOX) -> Detections:
    """Return windows (N, 4) and scores (N,) of any type as `Detections`, the highest score first."""
    order = np.argsort(-scores, kind="stable")
    return Detections(boxes[order].astype(np.int32), scores[order].astype(np.float64), person_box)


@dataclass(frozen=True)
class AtScale:
    """Search the image at `scale` times its size, a half or a whole number.

    0.5 is the workshop's speed tip, blind to people lower than 200 px. 2 finds people half as high as 1 does, for four
    times the work.
    """

    detector: Detector
    scale: float

    def detect(self, image: Image) -> Detections:
        """Find people, best first; windows are in the image as it is. At half its size an odd row or column is left."""
        height, width = (int(self.scale * side) for side in image.shape[:2])
        whole = np.ascontiguousarray(image[: round(height / self.scale), : round(width / self.scale)])
        found = self.detector.detect(_core.resize(whole, width, height))
        return replace(found, windows=(found.windows / self.scale).astype(np.int32))


@dataclass(frozen=True)
class Cv2Detector:
    """OpenCV's own HOG with the workshop's parameters.

    Raises `MissingExtraError` or `DetectorError` where there is no OpenCV, or it has no HOG.
    """

    def __post_init__(self) -> None:
        # An OpenCV without HOG is an error before the robot starts, not a fault of every frame.
        _ = self._hog

    def detect(self, image: Image) -> Detections:
        """Find people, best first."""
        boxes, scores = self._hog.detectMultiScale(image, winStride=(8, 8), padding=(4, 4), scale=1.05)
        return by_score(np.asarray(boxes).reshape(-1, 4), np.asarray(scores).reshape(-1))

    @cached_property
    def _hog(self) -> cv2.HOGDescriptor:
        with needed(by="the detector cv2"):
            import cv2
        if not hasattr(cv2, "HOGDescriptor"):
            raise DetectorError(f"OpenCV {cv2.__version__} has no HOGDescriptor: use the detector hog, or OpenCV 4")
        hog = cv2.HOGDescriptor()
        hog.setSVMDetector(np.asarray(cv2.HOGDescriptor.getDefaultPeopleDetector()))
        return hog


@dataclass(frozen=True)
class OnnxDetector:
    """A network from a file, run by `cv2.dnn`.

    The network takes float32 (1, 3, size, size), RGB in 0..1, and gives (1, 4 + classes, N): centre x, centre y, width,
    height [px of its input] and a score in 0..1 for each class, people first: what YOLOv8 exports. The image is made to
    fit at its own aspect, grey below or beside it.
    """

    path: Path  #: The ONNX file.
    size: int = 640  #: Side of the network's input [px].
    threshold: float = 0.25  #: Least score of a person [0..1].
    #: Boxes with a larger intersection over union are one person [1]; both are YOLOv8's defaults.
    overlap: float = 0.45

    def __post_init__(self) -> None:
        # A wrong file is an error before the robot starts, not a fault of every frame.
        _ = self._network

    def detect(self, image: Image) -> Detections:
        """Find people, best first."""
        import cv2

        shrink = self.size / max(image.shape[:2])
        fitted = cv2.resize(image, (0, 0), fx=shrink, fy=shrink)
        square = np.full((self.size, self.size, 3), 114, np.uint8)
        square[: fitted.shape[0], : fitted.shape[1]] = fitted[: self.size, : self.size]
        self._network.setInput(cv2.dnn.blobFromImage(square, 1 / 255, swapRB=True))
        try:
            output = np.asarray(self._network.forward())
        except cv2.error as error:
            raise DetectorError(f"{self.path}: the network failed: {error}") from error
        if output.ndim != 3 or output.shape[0] != 1 or output.shape[1] < 5:
            raise DetectorError(f"{self.path}: the network gives {output.shape}, want (1, 4 + classes, boxes)")
        x, y, w, h, score = output[0, :5]
        likely = score >= self.threshold
        boxes = np.stack([x - w / 2, y - h / 2, w, h], axis=1)[likely] / shrink
        kept = nms(boxes, score[likely], self.overlap)
        # Like an SVM's margin: 0 at the threshold, and without an upper limit.
        sure = np.clip(score[likely][kept], 1e-6, 1 - 1e-6).astype(np.float64)
        margin = np.log(sure / (1 - sure)) - math.log(self.threshold / (1 - self.threshold))
        return by_score(np.rint(boxes[kept]), margin, WHOLE_WINDOW)

    @cached_property
    def _network(self) -> cv2.dnn.Net:
        with needed(by="an ONNX detector"):
            import cv2

        if not self.path.is_file():
            raise DetectorError(f"{self.path}: no such file; --detector onnx:FILE wants an ONNX network")
        if not is_utf8(str(self.path)):
            raise DetectorError(f"{self.path}: OpenCV takes no name that is not UTF-8; give the file another")
        try:
            return cv2.dnn.readNetFromONNX(str(self.path))
        except cv2.error as error:
            raise DetectorError(f"{self.path}: OpenCV cannot read this as an ONNX network") from error
