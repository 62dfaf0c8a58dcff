"""OpenCV's HOG people detector, many times faster, and a follower to use it with."""

from __future__ import annotations

from limo_hog._core import get_num_threads, set_num_threads
from limo_hog.crops import describe
from limo_hog.cv2_api.functions import (
    HOGDESCRIPTOR_DEFAULT_NLEVELS,
    HOGDESCRIPTOR_DESCR_FORMAT_COL_BY_COL,
    HOGDESCRIPTOR_DESCR_FORMAT_ROW_BY_ROW,
    HOGDESCRIPTOR_L2HYS,
    HOGDescriptor_DEFAULT_NLEVELS,
    HOGDescriptor_DESCR_FORMAT_COL_BY_COL,
    HOGDescriptor_DESCR_FORMAT_ROW_BY_ROW,
    HOGDescriptor_getDaimlerPeopleDetector,
    HOGDescriptor_getDefaultPeopleDetector,
    HOGDescriptor_L2Hys,
    groupRectangles,
)
from limo_hog.cv2_api.hog import HOGDescriptor
from limo_hog.cv2_api.install import install_into_cv2
from limo_hog.detections import Detections
from limo_hog.detector import PeopleDetector
from limo_hog.exceptions import (
    BackendError,
    DetectorSizeError,
    GeometryError,
    HogError,
    ImageError,
    ImageTypeError,
    LimoHogError,
    ModelFileError,
    ModelFormatError,
    ModelMissingError,
    ParameterError,
    ParameterTypeError,
)
from limo_hog.extras import MissingExtraError
from limo_hog.visualize import visualize

#: As Cargo.toml has it; looked up when first asked for.
__version__: str

__all__ = [
    "HOGDESCRIPTOR_DEFAULT_NLEVELS",
    "HOGDESCRIPTOR_DESCR_FORMAT_COL_BY_COL",
    "HOGDESCRIPTOR_DESCR_FORMAT_ROW_BY_ROW",
    "HOGDESCRIPTOR_L2HYS",
    "BackendError",
    "Detections",
    "DetectorSizeError",
    "GeometryError",
    "HOGDescriptor",
    "HOGDescriptor_DEFAULT_NLEVELS",
    "HOGDescriptor_DESCR_FORMAT_COL_BY_COL",
    "HOGDescriptor_DESCR_FORMAT_ROW_BY_ROW",
    "HOGDescriptor_L2Hys",
    "HOGDescriptor_getDaimlerPeopleDetector",
    "HOGDescriptor_getDefaultPeopleDetector",
    "HogError",
    "ImageError",
    "ImageTypeError",
    "LimoHogError",
    "MissingExtraError",
    "ModelFileError",
    "ModelFormatError",
    "ModelMissingError",
    "ParameterError",
    "ParameterTypeError",
    "PeopleDetector",
    "describe",
    "get_num_threads",
    "groupRectangles",
    "install_into_cv2",
    "set_num_threads",
    "visualize",
]


def __getattr__(name: str) -> str:
    if name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    # Imported here: it would double the time to import this package.
    from importlib.metadata import version

    return version("limo-hog")
