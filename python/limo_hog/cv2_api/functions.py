"""The functions and constants beside `cv2.HOGDescriptor`, as OpenCV 4.14 has them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, SupportsFloat, SupportsIndex

import numpy as np
from numpy.typing import NDArray

from limo_hog import _core
from limo_hog.cv2_api.arguments import Nothing, integer, real, rectangles

HOGDescriptor_L2Hys = HOGDESCRIPTOR_L2HYS = 0
HOGDescriptor_DEFAULT_NLEVELS = HOGDESCRIPTOR_DEFAULT_NLEVELS = 64
HOGDescriptor_DESCR_FORMAT_COL_BY_COL = HOGDESCRIPTOR_DESCR_FORMAT_COL_BY_COL = 0
HOGDescriptor_DESCR_FORMAT_ROW_BY_ROW = HOGDESCRIPTOR_DESCR_FORMAT_ROW_BY_ROW = 1


def HOGDescriptor_getDefaultPeopleDetector() -> NDArray[np.float32]:
    """float32 (3781,): OpenCV's people detector for the default geometry, bias last."""
    return _core.default_people_detector()


def HOGDescriptor_getDaimlerPeopleDetector() -> NDArray[np.float32]:
    """float32 (1981,): OpenCV's people detector for windows of 48 × 96, bias last."""
    return _core.daimler_people_detector()


def groupRectangles(
    rectList: Sequence[Sequence[int]] | NDArray[np.integer[Any]],
    groupThreshold: SupportsIndex | None,
    eps: SupportsFloat | None = 0.2,
) -> tuple[NDArray[np.int32], NDArray[np.int32]] | tuple[Nothing, Nothing]:
    """Mean rectangles of groups of similar ones.

    Parameters
    ----------
    rectList
        (n, 4) integers: x, y, width, height [px].
    groupThreshold
        A group must have more members than this to be kept; 0 or less returns all rectangles.
    eps
        How far apart edges of similar rectangles may lie, relative to their size.

    Returns
    -------
    rectList, weights
        int32 (m, 4) rectangles and int32 (m,) numbers of members; `((), ())` when none are left.
    """
    found, counts = _core.group_rectangles(
        rectangles("rectList", rectList), integer("groupThreshold", groupThreshold, 0), real("eps", eps, 0.2)
    )
    return (found, counts) if len(found) else ((), ())
