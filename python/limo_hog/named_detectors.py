"""The people detectors behind one protocol, by the names of `--detector`: ours, OpenCV's HOG, a network."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

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
NAMES = ("limo", "hog", "hog-half", "hog:MODEL", "cv2", "onnx:FILE")

#: Least score of the detector "limo". Chosen on six crowded scenes of the arena: of people less than 8 m away it finds
#: .73 (at the model's own, .63; "hog" .56), with a false box in 50 frames (250; 100).
_EAGER = -1.2


class DetectorError(LimoHogError):
    """There is no such detector, or a file is not a network."""


def detector_named(name: str) -> Detector:
    """Return one of `NAMES`; MODEL is a model of `PeopleDetector`, by name or file, FILE a network.

    "limo" is our model and its second look, with a low threshold: what is no person does not last in the tracks. "hog"
    groups its hits as `cv2.HOGDescriptor` does, "hog:MODEL" suppresses them greedily; none enlarges the image.
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
    if name == "limo":
        return FromThreshold(PeopleDetector(min_height=None, threshold=_EAGER), _EAGER)
    hog = PeopleDetector(model="opencv", min_height=None, nms="group")
    if name == "hog":
        return hog
    if name == "hog-half":
        return HalfSize(hog)
    raise DetectorError(f"no detector {name!r}: want one of {', '.join(NAMES)}")


def by_score(boxes: NDArray[Any], scores: NDArray[Any], person_box: PersonBox = PERSON_BOX) -> Detections:
    """Return windows (N, 4) and scores (N,) of any type as `Detections`, the highest score first."""
    order = np.argsort(-scores, kind="stable")
    return Detections(boxes[order].astype(np.int32), scores[order].astype(np.float64), person_box)


@dataclass(frozen=True)
class HalfSize:
    """The workshop's speed tip: search the image at half its size. Blind to people lower than 200 px."""

    detector: Detector

    def detect(self, image: Image) -> Detections:
        """Find people in every second pixel, each the mean of four; windows are in the whole image."""
        height, width = image.shape[0] // 2 * 2, image.shape[1] // 2 * 2
        rows = image[0:height:2].astype(np.uint16) + image[1:height:2]
        half = ((rows[:, 0:width:2] + rows[:, 1:width:2] + 2) >> 2).astype(np.uint8)
        found = self.detector.detect(half)
        return replace(found, windows=found.windows * 2)


@dataclass(frozen=True)
class FromThreshold:
    """Counts scores from a detector's threshold: 0 there, as OpenCV's margins, which followers are tuned to."""

    detector: Detector
    threshold: float

    def detect(self, image: Image) -> Detections:
        """Find people, best first."""
        found = self.detector.detect(image)
        return replace(found, scores=found.scores - self.threshold)


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
