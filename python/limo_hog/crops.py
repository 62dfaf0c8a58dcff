"""Descriptors of many crops at once."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from limo_hog import _core
from limo_hog.cv2_api.geometry import Geometry
from limo_hog.exceptions import GeometryError, ImageError, ImageTypeError

_BLOCK_PX = 16


def describe(crops: NDArray[np.uint8]) -> NDArray[np.float32]:
    """HOG descriptors of crops of one size, each of which is a window of `HOGDescriptor`'s other defaults.

    Cells of 8 × 8 px, blocks of 2 × 2 cells, 9 unsigned bins, L2-Hys (Dalal and Triggs, CVPR 2005). By the kernels of
    the search, on as many threads as `set_num_threads` allows: within 1e-6 of `HOGDescriptor.compute`, which gives
    OpenCV's bits.

    Parameters
    ----------
    crops
        uint8 (N, H, W), (N, H, W, 1) or (N, H, W, 3), colours in any order; H and W multiples of 8 from 16 on. Pixels
        outside a crop are mirrored ones (reflect-101).

    Returns
    -------
    descriptors
        float32 (N, D): blocks column by column, D = 36 · (W / 8 - 1) · (H / 8 - 1), 3780 for 64 × 128.

    Raises
    ------
    ImageTypeError, ImageError
        The array is not uint8, or of another shape.
    GeometryError
        The size is no window.
    """
    given: Any = crops
    if not isinstance(given, np.ndarray) or given.dtype != np.uint8:
        kind = given.dtype if isinstance(given, np.ndarray) else type(given).__name__
        raise ImageTypeError(f"crops are one uint8 numpy array; this is {kind}: numpy.stack makes one of many")
    if crops.ndim not in (3, 4) or (crops.ndim == 4 and crops.shape[3] not in (1, 3)):
        raise ImageError(f"the crops' shape is {crops.shape}; (N, H, W), (N, H, W, 1) or (N, H, W, 3) is wanted")
    height, width = crops.shape[1:3]
    if min(width, height) < _BLOCK_PX:
        raise GeometryError(f"the crops are {width} x {height} px; {_BLOCK_PX} x {_BLOCK_PX}, a block, is the least")
    return _compiled(width, height).describe(crops)


@lru_cache(maxsize=16)
def _compiled(width: int, height: int) -> _core.Hog:
    return Geometry(winSize=(width, height)).compiled(None)
