"""The parameters of a HOG descriptor, as OpenCV names and orders them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from limo_hog import _core


class Geometry(NamedTuple):
    """What `HOGDescriptor` was made with; the defaults are those of OpenCV's people detector. Sizes are (x, y) [px]."""

    winSize: tuple[int, int] = (64, 128)
    blockSize: tuple[int, int] = (16, 16)
    blockStride: tuple[int, int] = (8, 8)
    cellSize: tuple[int, int] = (8, 8)
    nbins: int = 9
    derivAperture: int = 1
    winSigma: float = -1.0
    histogramNormType: int = 0
    L2HysThreshold: float = 0.2
    gammaCorrection: bool = True
    nlevels: int = 64
    signedGradient: bool = False

    @property
    def sigma(self) -> float:
        """Gaussian window of a block in force [px]."""
        return self.winSigma if self.winSigma > 0 else sum(self.blockSize) / 8.0

    def compiled(self, svm: NDArray[np.float32] | None) -> _core.Hog:
        """Make the compiled detector, with an SVM or without.

        Raises
        ------
        GeometryError, DetectorSizeError
            The sizes do not fit together, or the SVM has not one coefficient per descriptor element.
        """
        return _core.Hog(
            self.winSize,
            self.blockSize,
            self.blockStride,
            self.cellSize,
            self.nbins,
            self.winSigma,
            self.L2HysThreshold,
            self.gammaCorrection,
            self.nlevels,
            self.signedGradient,
            svm,
        )


class Attributes:
    """The geometry as the read-only attributes of `cv2.HOGDescriptor`."""

    __slots__ = ("_geometry",)

    _geometry: Geometry

    @property
    def winSize(self) -> tuple[int, int]:
        """Detection window (width, height) [px]."""
        return self._geometry.winSize

    @property
    def blockSize(self) -> tuple[int, int]:
        """Block (width, height) [px]."""
        return self._geometry.blockSize

    @property
    def blockStride(self) -> tuple[int, int]:
        """Distance of neighbouring blocks (x, y) [px]."""
        return self._geometry.blockStride

    @property
    def cellSize(self) -> tuple[int, int]:
        """Cell (width, height) [px]."""
        return self._geometry.cellSize

    @property
    def nbins(self) -> int:
        """Orientation bins of a cell."""
        return self._geometry.nbins

    @property
    def derivAperture(self) -> int:
        """Kept and saved, never used, as in OpenCV."""
        return self._geometry.derivAperture

    @property
    def winSigma(self) -> float:
        """Gaussian window of a block [px]; -1 stands for the default, see `getWinSigma`."""
        return self._geometry.winSigma

    @property
    def histogramNormType(self) -> int:
        """Kept and saved, never used, as in OpenCV: L2-Hys is the only one."""
        return self._geometry.histogramNormType

    @property
    def L2HysThreshold(self) -> float:
        """Clipping value of the block normalisation."""
        return self._geometry.L2HysThreshold

    @property
    def gammaCorrection(self) -> bool:
        """Whether the gradient is taken of the square root of the pixels."""
        return self._geometry.gammaCorrection

    @property
    def nlevels(self) -> int:
        """Most levels of a pyramid."""
        return self._geometry.nlevels

    @property
    def signedGradient(self) -> bool:
        """Whether the bins cover 2π instead of π."""
        return self._geometry.signedGradient
