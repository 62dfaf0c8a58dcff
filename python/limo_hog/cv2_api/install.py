"""limo-hog's names put into `cv2` where it lacks them, as OpenCV 5 does."""

from __future__ import annotations

from limo_hog.cv2_api import functions
from limo_hog.cv2_api.hog import HOGDescriptor
from limo_hog.extras import needed

#: The functions and constants that left OpenCV with the HOG detector.
_FUNCTIONS = (
    "HOGDescriptor_L2Hys",
    "HOGDescriptor_DEFAULT_NLEVELS",
    "HOGDescriptor_DESCR_FORMAT_COL_BY_COL",
    "HOGDescriptor_DESCR_FORMAT_ROW_BY_ROW",
    "HOGDESCRIPTOR_L2HYS",
    "HOGDESCRIPTOR_DEFAULT_NLEVELS",
    "HOGDESCRIPTOR_DESCR_FORMAT_COL_BY_COL",
    "HOGDESCRIPTOR_DESCR_FORMAT_ROW_BY_ROW",
    "HOGDescriptor_getDefaultPeopleDetector",
    "HOGDescriptor_getDaimlerPeopleDetector",
    "groupRectangles",
)


def install_into_cv2() -> list[str]:
    """Put the HOG detector and `groupRectangles` into `cv2` where it lacks them, so that OpenCV 4 scripts run.

    Returns
    -------
    names
        Those that were missing; none with OpenCV 4, which keeps its own.

    Raises
    ------
    MissingExtraError
        OpenCV is not installed.
    """
    with needed(by="limo_hog.install_into_cv2"):
        import cv2
    names = {"HOGDescriptor": HOGDescriptor} | {name: getattr(functions, name) for name in _FUNCTIONS}
    missing = [name for name in names if not hasattr(cv2, name)]
    for name in missing:
        setattr(cv2, name, names[name])
    return missing
