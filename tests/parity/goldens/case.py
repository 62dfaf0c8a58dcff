"""One question to OpenCV and to limo-hog alike."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tests.parity.goldens.images import Image

#: Names of what each method returns.
RETURNS = {
    "computeGradient": ("grad", "angleOfs"),
    "compute": ("descriptors",),
    "detect": ("foundLocations", "weights"),
    "detectMultiScale": ("foundLocations", "foundWeights"),
}
#: The geometries of the two people models, without gamma correction.
PEOPLE = ((64, 128), (16, 16), (8, 8), (8, 8), 9)
DAIMLER = ((48, 96), (16, 16), (8, 8), (8, 8), 9)


@dataclass(frozen=True)
class Case:
    name: str
    why: str
    image: Callable[[], Image]
    method: str
    arguments: dict[str, Any] = field(default_factory=dict)
    #: Positional arguments of `HOGDescriptor`.
    geometry: tuple[Any, ...] = ()
    #: "default", "default_no_bias", "daimler", or the seed of random coefficients with a bias.
    detector: str | int | None = None

    @property
    def clip(self) -> float:
        """`L2HysThreshold`, which OpenCV takes from the first block of the process whatever a detector says."""
        return float(self.geometry[8]) if len(self.geometry) > 8 else 0.2


def coefficients(detector: str | int, library: Any, size: int) -> NDArray[np.float32]:
    """Take a model from the library under test, or make one of `size` weights from a seed; an odd one adds a bias."""
    if isinstance(detector, int):
        drawn = np.random.default_rng(detector).integers(-1000, 1001, size + detector % 2)
        return (drawn / 1000).astype(np.float32)
    if detector == "daimler":
        return np.ravel(library.HOGDescriptor_getDaimlerPeopleDetector())
    model: NDArray[np.float32] = np.ravel(library.HOGDescriptor_getDefaultPeopleDetector())
    return model[:-1] if detector == "default_no_bias" else model


def ask(case: Case, image: Image, library: Any) -> dict[str, Any]:
    """Put a case to `cv2` or to `limo_hog`: what is returned, by name."""
    hog = library.HOGDescriptor(*case.geometry)
    if case.detector is not None:
        hog.setSVMDetector(coefficients(case.detector, library, hog.getDescriptorSize()))
    outputs = {"grad": None, "angleOfs": None} if case.method == "computeGradient" else {}
    returned = getattr(hog, case.method)(image, **outputs, **case.arguments)
    names = RETURNS[case.method]
    return dict(zip(names, returned if len(names) > 1 else (returned,), strict=True))
