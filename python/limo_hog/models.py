"""Trained people models: ours and OpenCV's two by name, and those in files."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from limo_hog import _core
from limo_hog.cv2_api.arguments import shown
from limo_hog.cv2_api.geometry import Geometry
from limo_hog.exceptions import ModelFormatError, ParameterError, ParameterTypeError


class PersonBox(NamedTuple):
    """Where the person stands in a detection window: x, y, width, height as shares of the window's."""

    x: float = 0.2
    y: float = 0.1
    width: float = 0.6
    height: float = 0.78

    def inside(self, windows: NDArray[Any]) -> NDArray[np.float64]:
        """Return the person's box in each window: float64 (N, 4) x, y, w, h [px] of windows (N, 4)."""
        x, y, w, h = windows.T.astype(np.float64)
        return np.stack([x + self.x * w, y + self.y * h, self.width * w, self.height * h], axis=1)

    def around(self, people: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the windows of these boxes, both float64 (N, 4) x, y, w, h [px]: the inverse of `inside`."""
        x, y, w, h = people.T
        width, height = w / self.width, h / self.height
        return np.stack([x - self.x * width, y - self.y * height, width, height], axis=1)


class Calibration(NamedTuple):
    """How a score becomes a probability: 1 / (1 + exp(-(slope · score + offset))) (Platt, 1999)."""

    slope: float
    offset: float

    def probabilities(self, margins: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the probability of each of (N,) SVM margins, float64 (N,); none overflows."""
        return np.asarray(0.5 + 0.5 * np.tanh(0.5 * (self.slope * margins + self.offset)))


class SecondLook(NamedTuple):
    """A small convolutional network's opinion of a model's best windows, and how scores with it are to be read.

    Made by `benches/second_look.py`. A window's score is its SVM margin + `share` · the network's logit. The network
    also says where in the window the person stands.
    """

    channels: tuple[int, int, int]  #: of the convolutions
    hidden: int  #: units of the dense layer
    weights: bytes  #: float16, little-endian: layer by layer weights [row][column][input][output], then biases
    share: float
    threshold: float  #: default of the least score of a person's window
    calibration: Calibration  #: from scores to probabilities

    @staticmethod
    def moved(people: NDArray[np.float64], windows: NDArray[np.float64], answers: NDArray[np.float32]) -> NDArray[Any]:
        """Return the boxes of `people` in `windows`, all (N, 4) x, y, w, h [px], corrected by the answers (N, 5)."""
        right, down, wider, higher = answers[:, 1:].T.astype(np.float64)
        width, height = people[:, 2] * np.exp(wider), people[:, 3] * np.exp(higher)
        x = people[:, 0] + people[:, 2] / 2 + right * windows[:, 2] - width / 2
        y = people[:, 1] + people[:, 3] / 2 + down * windows[:, 3] - height / 2
        return np.stack([x, y, width, height], axis=1)

    def compiled(self) -> _core.SecondLook:
        """Return the network; a `ModelFormatError` says what is wrong with its weights."""
        numbers = np.frombuffer(self.weights, "<f2").astype(np.float32)
        return _core.SecondLook(self.channels, self.hidden, numbers)


#: The person box of OpenCV's models; at IoU 0.5 the best of a grid on three sets of street photographs.
PERSON_BOX = PersonBox()
#: That of detectors whose windows have no margin.
WHOLE_WINDOW = PersonBox(0.0, 0.0, 1.0, 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """A linear SVM over HOG descriptors, and how its windows and margins are to be read: a value, that never changes.

    Attributes
    ----------
    geometry
        Window, blocks, cells and the rest of the descriptor.
    coefficients
        float32 (n,), finite: a weight per element of a descriptor, and perhaps a bias after them.
    person_box
        The person inside a window.
    threshold
        Default of the least SVM margin of a person's window.
    calibration
        From margins to probabilities; None where it was never measured.
    smaller
        A model with a smaller window, for people too small for this one; its margins mean what this one's do.
    second_look
        A network that looks again at the best windows of both.
    """

    geometry: Geometry
    coefficients: NDArray[np.float32] = field(repr=False)
    person_box: PersonBox = PERSON_BOX
    threshold: float = 0.0
    calibration: Calibration | None = None
    smaller: Model | None = None
    second_look: SecondLook | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        weights = np.array(self.coefficients, np.float32)
        if not np.isfinite(weights).all():
            raise ModelFormatError("a coefficient is infinite or NaN; finite numbers are wanted")
        weights.flags.writeable = False
        object.__setattr__(self, "coefficients", weights)

    def _values(self) -> tuple[object, ...]:
        reading = (self.person_box, self.threshold, self.calibration, self.smaller, self.second_look)
        return (self.geometry, self.coefficients.tobytes(), *reading)

    def __eq__(self, other: object) -> bool:
        """Whether another model finds the same."""
        return self._values() == other._values() if isinstance(other, Model) else NotImplemented

    def __hash__(self) -> int:
        """Return the same number for equal models."""
        return hash(self._values())

    @property
    def person_height(self) -> float:
        """Height of a person in the window [px]: the smallest that is found in an image at its own size."""
        return self.person_box.height * self.geometry.winSize[1]


# The calibrations were fitted to the boxes that `PeopleDetector(threshold=-1.2)` finds in the 100 photographs of USC-C,
# 813 and 1,985, of which 218 and 214 are people; mean calibration error in ten bins .025 and .010.
def _opencv() -> Model:
    return Model(Geometry(), _core.default_people_detector(), calibration=Calibration(3.47, -0.91))


def _daimler() -> Model:
    # With gamma correction off, as OpenCV's constructor with a window size has it.
    geometry = Geometry(winSize=(48, 96), gammaCorrection=False)
    return Model(geometry, _core.daimler_people_detector(), calibration=Calibration(2.38, -3.61))


# Kept, as reading the files takes longer than searching a picture.
@cache
def _limo() -> Model:
    """Return our own weights, trained as docs/models.md says.

    The small window's margins are put on the scale of the large one's, by both calibrations.
    """
    large, small = (_from_file(os.path.join(_WEIGHTS, f"limo_{size}.yml")) for size in ("64x128", "48x96"))  # noqa: PTH118
    if large.calibration is None or small.calibration is None:
        raise ModelFormatError(f"{_WEIGHTS}: the models' cards have no calibration; the installation is damaged")
    slope = small.calibration.slope / large.calibration.slope
    coefficients = small.coefficients * np.float32(slope)
    coefficients[-1] += np.float32((small.calibration.offset - large.calibration.offset) / large.calibration.slope)
    smaller = replace(small, coefficients=coefficients, calibration=large.calibration)
    return replace(large, smaller=smaller, second_look=_second_look(os.path.join(_WEIGHTS, "second_look.f16")))  # noqa: PTH118


def _second_look(path: str) -> SecondLook:
    """Read a network and its card; both are wanted, and that they belong together."""
    import hashlib
    from pathlib import Path

    try:
        weights, card = Path(path).read_bytes(), _read_card(f"{path}.json")
    except OSError as error:
        raise ModelFormatError(f"{path}: {error.strerror}; the installation is damaged") from error
    if hashlib.sha256(weights).hexdigest() != card.get("sha256"):
        raise ModelFormatError(f"{path} is not the file that its card describes; the installation is damaged")
    sides = [int(side) for side in _numbers(path, "layers", card.get("layers"), 4)]
    share, threshold = _numbers(path, "share, threshold", [card.get("share"), card.get("threshold")], 2)
    return SecondLook((sides[0], sides[1], sides[2]), sides[3], weights, share, threshold, _calibration(path, card))


#: The folder of our own weights.
_WEIGHTS = os.path.join(os.path.dirname(__file__), "weights")  # noqa: PTH118, PTH120 - as below
_NAMED: dict[str, Callable[[], Model]] = {"opencv": _opencv, "default": _opencv, "daimler": _daimler, "limo": _limo}


def is_named(model: object) -> bool:
    """Say whether this is the name of a model that comes along, and so always the same; a path equals no name."""
    return isinstance(model, str) and model in _NAMED


def load_model(name: str | os.PathLike[str] | Model) -> Model:
    """Return a model by its name, or from a file that OpenCV or limo-hog wrote; a `Model` as it is.

    Parameters
    ----------
    name
        "opencv" (also "default"; INRIA people, window 64 × 128), "daimler" (window 48 × 96), "limo" (ours, 64 × 128
        and, for small people, 48 × 96), or the path of an XML, YAML or JSON file as `HOGDescriptor.save` writes them.
        Its card, the file's name with `.json` after it (such as `model.yml.json`), is read where there is one:
        `person_box` [x, y, width, height], `threshold` and `calibration` {"slope", "offset"}, each optional.

    Raises
    ------
    ParameterError, ParameterTypeError
        There is neither such a model nor such a file.
    ModelFormatError
        The file holds no detector, or its card is none.
    OSError
        The file is there and cannot be read.
    """
    if isinstance(name, Model):
        return name
    if not isinstance(name, (str, os.PathLike)):
        raise ParameterTypeError(
            f"model is {shown(name)}; a name ({', '.join(_NAMED)}) or the path of a file is wanted"
        )
    if name in _NAMED:
        return _NAMED[name]()  # a path equals no name
    if not os.path.isfile(name):  # noqa: PTH113 - pathlib would double the time to import this package
        raise ParameterError(f"model is {os.fspath(name)!r}: no such file, and none of the names {', '.join(_NAMED)}")
    return _from_file(os.fspath(name))


def _from_file(path: str) -> Model:
    # Imported here: what reads files would double the time to import this package.
    from limo_hog.cv2_api import model_files

    geometry, coefficients = model_files.load(path)
    if not coefficients:
        raise ModelFormatError(f"{path} holds a geometry without an SVM; a trained detector is wanted")
    card = f"{path}.json"
    facts = _card(card) if os.path.isfile(card) else {}  # noqa: PTH113
    with np.errstate(over="ignore"):
        weights = np.array(coefficients, np.float32)
    if not np.isfinite(weights).all():
        raise ModelFormatError(f"{path}: a coefficient is infinite or NaN; finite numbers are wanted")
    return Model(geometry, weights, **facts)


def _read_card(path: str) -> dict[str, Any]:
    import json
    from pathlib import Path

    try:
        card = json.loads(Path(path).read_text("utf-8"))
    except (ValueError, RecursionError) as error:
        raise ModelFormatError(f"{path} is no model card: {error}") from error
    if not isinstance(card, dict):
        raise ModelFormatError(f"{path} is no model card: a JSON object is wanted")
    return card


def _card(path: str) -> dict[str, Any]:
    """Read person box, threshold and calibration from a model's card."""
    card = _read_card(path)
    facts: dict[str, Any] = {}
    if "person_box" in card:
        box = PersonBox(*_numbers(path, "person_box", card["person_box"], 4))
        if not (box.x >= 0 < box.width and box.y >= 0 < box.height and max(box.x + box.width, box.y + box.height) <= 1):
            raise ModelFormatError(f"{path}: person_box is {list(box)}; shares of the window, inside it, are wanted")
        facts["person_box"] = box
    if card.get("threshold") is not None:
        (facts["threshold"],) = _numbers(path, "threshold", [card["threshold"]], 1)
    if card.get("calibration") is not None:
        facts["calibration"] = _calibration(path, card)
    return facts


def _calibration(path: str, card: dict[str, Any]) -> Calibration:
    given = card.get("calibration")
    if not isinstance(given, dict) or not {"slope", "offset"} <= given.keys():
        raise ModelFormatError(f'{path}: calibration is {shown(given)}; {{"slope": …, "offset": …}} is wanted')
    return Calibration(*_numbers(path, "calibration", [given["slope"], given["offset"]], 2))


def _numbers(path: str, key: str, values: Any, count: int) -> list[float]:
    def finite(value: Any) -> bool:
        # A bool is an int to Python; an int may be larger than any float.
        return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) <= sys.float_info.max

    if not isinstance(values, list) or len(values) != count or not all(map(finite, values)):
        raise ModelFormatError(f"{path}: {key} is {shown(values)}; {count} finite numbers are wanted")
    return [float(value) for value in values]
