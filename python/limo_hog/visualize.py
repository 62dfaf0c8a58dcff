"""Pictures of descriptors and of detectors' coefficients."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from limo_hog.cv2_api.arguments import coefficients, integer
from limo_hog.cv2_api.hog import HOGDescriptor
from limo_hog.exceptions import DetectorSizeError, ParameterError

#: Colours (B, G, R) of positive and negative numbers; descriptors have only positive ones.
_POSITIVE, _NEGATIVE = np.array([150.0, 215.0, 255.0]), np.array([255.0, 120.0, 20.0])


def visualize(hog: HOGDescriptor, values: ArrayLike, *, zoom: int = 4) -> NDArray[np.uint8]:
    """Draw one window: in each cell a stroke per orientation bin, along the edge it stands for, as strong as its value.

    A cell that several blocks share shows their mean.

    Parameters
    ----------
    hog
        The geometry.
    values
        Numbers of one window's descriptor, or the coefficients of a detector (a bias is left out).
    zoom
        Pixels of the picture for one of the window.

    Returns
    -------
    picture
        uint8 (zoom × window height, zoom × window width, 3), BGR: warm strokes are positive, blue ones negative.

    Raises
    ------
    DetectorSizeError
        `values` are not as many as this geometry's descriptor has.
    """
    size = hog.getDescriptorSize()
    numbers = coefficients(values)
    if numbers is None or len(numbers) not in (size, size + 1):
        came = 0 if numbers is None else len(numbers)
        raise DetectorSizeError(
            f"there are {came} values; a window of this geometry has {size}, or {size + 1} with bias"
        )
    zoom = integer("zoom", zoom, 4)
    if not 1 <= zoom <= 64:
        raise ParameterError(f"zoom is {zoom}; 1 to 64 is wanted")
    histograms = _histograms(hog, numbers[:size])
    strokes = _strokes(hog, zoom)
    (width, height), (cell_width, cell_height) = hog.winSize, hog.cellSize
    light = np.zeros((2, height * zoom, width * zoom))  # positive, negative
    shared = np.zeros(light.shape[1:])
    for bx, by, cx, cy in np.ndindex(*histograms.shape[:4]):
        x = (bx * hog.blockStride[0] + cx * cell_width) * zoom
        y = (by * hog.blockStride[1] + cy * cell_height) * zoom
        part = np.s_[y : y + cell_height * zoom, x : x + cell_width * zoom]
        histogram = histograms[bx, by, cx, cy]
        light[0][part] += np.tensordot(np.maximum(histogram, 0), strokes, 1)
        light[1][part] += np.tensordot(np.maximum(-histogram, 0), strokes, 1)
        shared[part] += 1
    light /= np.maximum(shared, 1)
    light /= max(np.percentile(light[light > 0], 99), np.finfo(float).tiny) if light.any() else 1.0
    picture = light[0][..., None] * _POSITIVE + light[1][..., None] * _NEGATIVE
    return np.asarray(np.rint(np.clip(picture, 0, 255)), np.uint8)


def _histograms(hog: HOGDescriptor, numbers: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return a descriptor as (blocks x, blocks y, cells x, cells y, bins)."""
    blocks = [(hog.winSize[axis] - hog.blockSize[axis]) // hog.blockStride[axis] + 1 for axis in (0, 1)]
    cells = [hog.blockSize[axis] // hog.cellSize[axis] for axis in (0, 1)]
    return np.nan_to_num(numbers.astype(np.float64)).reshape(*blocks, *cells, hog.nbins)


def _strokes(hog: HOGDescriptor, zoom: int) -> NDArray[np.float64]:
    """Return (bins, h, w): for each bin a stroke through the cell's centre, at right angles to its gradient."""
    width, height = (side * zoom for side in hog.cellSize)
    x, y = np.meshgrid(np.arange(width) - (width - 1) / 2, np.arange(height) - (height - 1) / 2)
    turn = 2 * np.pi if hog.signedGradient else np.pi
    angle = (np.arange(hog.nbins)[:, None, None] + 0.5) * turn / hog.nbins
    off_axis = np.abs(x * np.cos(angle) + y * np.sin(angle))
    off_middle = np.abs(y * np.cos(angle) - x * np.sin(angle))
    thickness, length = max(width, height) / 32, min(width, height) / 2
    strokes: NDArray[np.float64] = np.clip(thickness + 0.5 - off_axis, 0, 1) * np.clip(length - off_middle, 0, 1)
    return strokes
