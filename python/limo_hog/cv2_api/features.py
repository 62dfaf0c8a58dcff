"""The half of `cv2.HOGDescriptor` that needs no SVM: geometry in, gradients and descriptors out."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from limo_hog.cv2_api.arguments import Nothing, Pair, Pairs, pair, pixels, places
from limo_hog.cv2_api.geometry import Geometry
from limo_hog.cv2_api.state import State


class Features:
    """Histograms of oriented gradients of one geometry, which is checked at its first use."""

    __slots__ = ("_state",)

    def __init__(self, geometry: Geometry) -> None:
        self._state = State(geometry)

    @property
    def winSize(self) -> tuple[int, int]:
        """Detection window (width, height) [px]."""
        return self._state.geometry.winSize

    @property
    def blockSize(self) -> tuple[int, int]:
        """Block (width, height) [px]."""
        return self._state.geometry.blockSize

    @property
    def blockStride(self) -> tuple[int, int]:
        """Distance of neighbouring blocks (x, y) [px]."""
        return self._state.geometry.blockStride

    @property
    def cellSize(self) -> tuple[int, int]:
        """Cell (width, height) [px]."""
        return self._state.geometry.cellSize

    @property
    def nbins(self) -> int:
        """Orientation bins of a cell."""
        return self._state.geometry.nbins

    @property
    def derivAperture(self) -> int:
        """Kept and saved, never used, as in OpenCV."""
        return self._state.geometry.derivAperture

    @property
    def winSigma(self) -> float:
        """Gaussian window of a block [px]; -1 stands for the default, see `getWinSigma`."""
        return self._state.geometry.winSigma

    @property
    def histogramNormType(self) -> int:
        """Kept and saved, never used, as in OpenCV: L2-Hys is the only one."""
        return self._state.geometry.histogramNormType

    @property
    def L2HysThreshold(self) -> float:
        """Clipping value of the block normalisation."""
        return self._state.geometry.L2HysThreshold

    @property
    def gammaCorrection(self) -> bool:
        """Whether the gradient is taken of the square root of the pixels."""
        return self._state.geometry.gammaCorrection

    @property
    def nlevels(self) -> int:
        """Most levels of a pyramid."""
        return self._state.geometry.nlevels

    @property
    def signedGradient(self) -> bool:
        """Whether the bins cover 2π instead of π."""
        return self._state.geometry.signedGradient

    def getDescriptorSize(self) -> int:
        """Elements of one window's descriptor: bins × cells of a block × blocks of a window."""
        return self._state.bare.descriptor_len

    def getWinSigma(self) -> float:
        """Gaussian window in force [px]: `winSigma`, or (block width + block height) / 8 where that is not positive."""
        return self._state.geometry.sigma

    def computeGradient(
        self,
        img: NDArray[np.uint8],
        grad: NDArray[np.float32] | None = None,
        angleOfs: NDArray[np.uint8] | None = None,
        paddingTL: Pair | None = None,
        paddingBR: Pair | None = None,
    ) -> tuple[NDArray[np.float32], NDArray[np.uint8]] | tuple[Nothing, Nothing]:
        """Gradient magnitudes shared between the two nearest orientation bins.

        Parameters
        ----------
        img
            uint8 (H, W), (H, W, 1) or (H, W, 3).
        grad, angleOfs
            Arrays to fill, of the results' shapes and types; others, and None, are left alone.
        paddingTL, paddingBR
            Columns and rows (x, y) to add (or, if negative, to drop) at the top left and the bottom right [px].

        Returns
        -------
        grad, angleOfs
            float32 (H', W', 2) magnitudes and uint8 (H', W', 2) bins; `((), ())` where no pixel is left.
        """
        image = pixels(img)
        (left, top), (right, bottom) = pair("paddingTL", paddingTL), pair("paddingBR", paddingBR)
        if 0 in (image.shape[0] + top + bottom, image.shape[1] + left + right):
            return (), ()
        shares, bins = self._state.bare.gradient(image, (left, top, right, bottom))
        return _filled(grad, shares), _filled(angleOfs, bins)

    def compute(
        self,
        img: NDArray[np.uint8],
        winStride: Pair | None = None,
        padding: Pair | None = None,
        locations: Pairs | None = None,
    ) -> NDArray[np.float32] | Nothing:
        """Descriptors of the windows of an image.

        Parameters
        ----------
        img
            uint8 (H, W), (H, W, 1) or (H, W, 3).
        winStride
            Distance of neighbouring windows (x, y) [px]; by default the cell size.
        padding
            Border around the image (x, y) [px], mirrored.
        locations
            Top left corners (x, y) of the windows [px]; by default the whole grid, row by row.

        Returns
        -------
        descriptors
            float32 (windows × descriptor size,), blocks column by column; zeros for a location outside. `()` when
            no window fits.
        """
        descriptors = self._state.bare.compute(
            pixels(img),
            pair("winStride", winStride),
            pair("padding", padding),
            places("locations", locations),
        )
        return descriptors if len(descriptors) else ()


def _filled(target: Any, result: Any) -> Any:
    """Return `target` holding `result` where it can, else `result` itself."""
    if isinstance(target, np.ndarray) and target.shape == result.shape and target.dtype == result.dtype:
        target[...] = result
        return target
    return result
