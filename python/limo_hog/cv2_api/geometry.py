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

        Raises `GeometryError` or `DetectorSizeError` where the sizes do not fit together, or the SVM has not one
        coefficient per descriptor element.
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
