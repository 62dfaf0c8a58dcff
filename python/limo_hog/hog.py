"""`cv2.HOGDescriptor` as OpenCV 4.14 has it: a program moves by writing `limo_hog.` for `cv2.`."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from limo_hog import _core
from limo_hog.exceptions import ImageError, ImageTypeError, ParameterTypeError

#: Two integers: width and height, or x and y [px].
Pair = Sequence[int] | NDArray[np.integer[Any]]
#: OpenCV's way to say "nothing": an empty tuple where an array would stand.
Nothing = tuple[()]

HOGDescriptor_L2Hys = HOGDESCRIPTOR_L2HYS = 0
HOGDescriptor_DEFAULT_NLEVELS = HOGDESCRIPTOR_DEFAULT_NLEVELS = 64
HOGDescriptor_DESCR_FORMAT_COL_BY_COL = HOGDESCRIPTOR_DESCR_FORMAT_COL_BY_COL = 0
HOGDescriptor_DESCR_FORMAT_ROW_BY_ROW = HOGDESCRIPTOR_DESCR_FORMAT_ROW_BY_ROW = 1

_DEFAULT_STRIDE = (0, 0)


def pixels(image: Any) -> NDArray[np.uint8]:
    """`image` as the uint8 array the detector reads, or an `ImageError` that says what came instead.

    Accepts (H, W), (H, W, 1) and (H, W, 3) arrays in any memory layout, 1-D arrays as one column, and `cv2.UMat`.
    """
    if type(image).__name__ == "UMat":
        image = image.get()
    if not isinstance(image, np.ndarray):
        raise ImageTypeError(f"an image is a uint8 numpy array; this is a {type(image).__name__}")
    if image.size == 0:
        raise ImageError(f"the image is empty: its shape is {image.shape}")
    if image.dtype != np.uint8:
        raise ImageTypeError(f"the image's pixels are {image.dtype}; uint8 (0 to 255) is wanted")
    if image.ndim == 1:
        return image[:, None]
    if image.ndim not in (2, 3) or (image.ndim == 3 and image.shape[2] not in (1, 3)):
        raise ImageError(f"the image's shape is {image.shape}; (H, W), (H, W, 1) or (H, W, 3) is wanted")
    return image


def _pair(name: str, value: Pair) -> tuple[int, int]:
    try:
        x, y = value
        return operator.index(x), operator.index(y)
    except (TypeError, ValueError):
        raise ParameterTypeError(f"{name} is {value!r}; two integers (x, y) are wanted") from None


def _pair_or(name: str, value: Pair | None, default: tuple[int, int]) -> tuple[int, int]:
    return default if value is None or len(value) == 0 else _pair(name, value)


def _places(name: str, value: Sequence[Pair] | NDArray[np.integer[Any]] | None) -> list[tuple[int, int]] | None:
    if value is None or len(value) == 0:
        return None
    return [_pair(f"{name}[{i}]", place) for i, place in enumerate(value)]


class HOGDescriptor:
    """Histograms of oriented gradients, and a linear SVM that finds people by them.

    `HOGDescriptor()` has the geometry of OpenCV's default people detector, gamma correction on. With arguments the
    first five are mandatory and gamma correction is off unless asked for, as in OpenCV 4.14.
    """

    def __init__(
        self,
        _winSize: Pair | None = None,
        _blockSize: Pair | None = None,
        _blockStride: Pair | None = None,
        _cellSize: Pair | None = None,
        _nbins: int | None = None,
        _derivAperture: int = 1,
        _winSigma: float = -1.0,
        _histogramNormType: int = HOGDescriptor_L2Hys,
        _L2HysThreshold: float = 0.2,
        _gammaCorrection: bool | None = None,
        _nlevels: int = HOGDescriptor_DEFAULT_NLEVELS,
        _signedGradient: bool = False,
    ) -> None:
        given = {
            "_winSize": _winSize,
            "_blockSize": _blockSize,
            "_blockStride": _blockStride,
            "_cellSize": _cellSize,
            "_nbins": _nbins,
        }
        missing = [name for name, value in given.items() if value is None]
        if 0 < len(missing) < len(given):
            raise ParameterTypeError(f"HOGDescriptor(...) needs {', '.join(given)}; missing: {', '.join(missing)}")
        self._win_size = _pair_or("_winSize", _winSize, (64, 128))
        self._block_size = _pair_or("_blockSize", _blockSize, (16, 16))
        self._block_stride = _pair_or("_blockStride", _blockStride, (8, 8))
        self._cell_size = _pair_or("_cellSize", _cellSize, (8, 8))
        self._nbins = 9 if _nbins is None else operator.index(_nbins)
        self._deriv_aperture = operator.index(_derivAperture)
        self._win_sigma = float(_winSigma)
        self._histogram_norm_type = operator.index(_histogramNormType)
        self._l2_hys_threshold = float(_L2HysThreshold)
        self._gamma_correction = bool(missing) if _gammaCorrection is None else bool(_gammaCorrection)
        self._nlevels = operator.index(_nlevels)
        self._signed_gradient = bool(_signedGradient)
        self._svm: NDArray[np.float32] | None = None
        self._built: _core.Hog | None = None

    @property
    def winSize(self) -> tuple[int, int]:
        """Detection window (width, height) [px]."""
        return self._win_size

    @property
    def blockSize(self) -> tuple[int, int]:
        """Block (width, height) [px]."""
        return self._block_size

    @property
    def blockStride(self) -> tuple[int, int]:
        """Distance of neighbouring blocks (x, y) [px]."""
        return self._block_stride

    @property
    def cellSize(self) -> tuple[int, int]:
        """Cell (width, height) [px]."""
        return self._cell_size

    @property
    def nbins(self) -> int:
        """Orientation bins of a cell."""
        return self._nbins

    @property
    def derivAperture(self) -> int:
        """Kept and saved, never used, as in OpenCV."""
        return self._deriv_aperture

    @property
    def winSigma(self) -> float:
        """Gaussian window of a block [px]; -1 stands for the default, see `getWinSigma`."""
        return self._win_sigma

    @property
    def histogramNormType(self) -> int:
        """Kept and saved, never used, as in OpenCV: L2-Hys is the only one."""
        return self._histogram_norm_type

    @property
    def L2HysThreshold(self) -> float:
        """Clipping value of the block normalisation."""
        return self._l2_hys_threshold

    @property
    def gammaCorrection(self) -> bool:
        """Whether the gradient is taken of the square root of the pixels."""
        return self._gamma_correction

    @property
    def nlevels(self) -> int:
        """Most levels of a pyramid."""
        return self._nlevels

    @property
    def signedGradient(self) -> bool:
        """Whether the bins cover 2π instead of π."""
        return self._signed_gradient

    @property
    def svmDetector(self) -> NDArray[np.float32] | Nothing:
        """float32 (n,): the coefficients in force, the bias last if there is one; `()` when unset."""
        return () if self._svm is None else self._svm.copy()

    def getDescriptorSize(self) -> int:
        """Elements of one window's descriptor: bins × cells of a block × blocks of a window."""
        return self._hog.descriptor_len

    def getWinSigma(self) -> float:
        """Gaussian window in force [px]: `winSigma`, or (block width + block height) / 8 where that is not positive."""
        width, height = self._block_size
        return self._win_sigma if self._win_sigma > 0 else (width + height) / 8.0

    def checkDetectorSize(self) -> bool:
        """Whether the detector, if any, fits the geometry; always true here, where a wrong one is refused."""
        self.getDescriptorSize()
        return True

    def setSVMDetector(self, svmdetector: ArrayLike | None) -> None:
        """Set the coefficients of the SVM: one per descriptor element, and perhaps the bias after them.

        Parameters
        ----------
        svmdetector
            Numbers of shape (n,), (n, 1) or (1, n); None or nothing clears the detector.

        Raises
        ------
        DetectorSizeError
            `n` is neither the descriptor's size nor one more; the detector in force stays.
        """
        if type(svmdetector).__name__ == "UMat":
            svmdetector = svmdetector.get()  # type: ignore[union-attr]
        svm = np.asarray(() if svmdetector is None else svmdetector)
        if svm.ndim > 2 or (svm.ndim == 2 and 1 not in svm.shape and svm.size):
            raise ParameterTypeError(f"the detector's shape is {svm.shape}; (n,), (n, 1) or (1, n) is wanted")
        coefficients = svm.astype(np.float32).ravel() if svm.size else None
        self._built = self._build(coefficients)
        self._svm = coefficients

    @staticmethod
    def getDefaultPeopleDetector() -> NDArray[np.float32]:
        """float32 (3781,): OpenCV's people detector for the default geometry, bias last."""
        return _core.default_people_detector()

    @staticmethod
    def getDaimlerPeopleDetector() -> NDArray[np.float32]:
        """float32 (1981,): OpenCV's people detector for windows of 48 × 96, bias last."""
        return _core.daimler_people_detector()

    def computeGradient(
        self,
        img: NDArray[np.uint8],
        grad: None = None,
        angleOfs: None = None,
        paddingTL: Pair | None = None,
        paddingBR: Pair | None = None,
    ) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
        """Gradient magnitudes shared between the two nearest orientation bins.

        Parameters
        ----------
        img
            uint8 (H, W), (H, W, 1) or (H, W, 3).
        grad, angleOfs
            None; they stand where OpenCV takes output arrays.
        paddingTL, paddingBR
            Columns and rows (x, y) to add (or, if negative, to drop) at the top left and the bottom right [px].

        Returns
        -------
        grad, angleOfs
            float32 (H', W', 2) magnitudes and uint8 (H', W', 2) bins.
        """
        del grad, angleOfs
        left, top = _pair_or("paddingTL", paddingTL, (0, 0))
        right, bottom = _pair_or("paddingBR", paddingBR, (0, 0))
        return self._hog.gradient(pixels(img), (left, top, right, bottom))

    def compute(
        self,
        img: NDArray[np.uint8],
        winStride: Pair | None = None,
        padding: Pair | None = None,
        locations: Sequence[Pair] | NDArray[np.integer[Any]] | None = None,
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
        descriptors = self._hog.compute(
            pixels(img),
            _pair_or("winStride", winStride, _DEFAULT_STRIDE),
            _pair_or("padding", padding, (0, 0)),
            _places("locations", locations),
        )
        return descriptors if len(descriptors) else ()

    def detect(
        self,
        img: NDArray[np.uint8],
        hitThreshold: float = 0.0,
        winStride: Pair | None = None,
        padding: Pair | None = None,
        searchLocations: Sequence[Pair] | NDArray[np.integer[Any]] | None = None,
    ) -> tuple[NDArray[np.int32], NDArray[np.float64]] | tuple[Nothing, Nothing]:
        """Windows of an image, at its own size, that the SVM takes for a person.

        Parameters
        ----------
        img
            uint8 (H, W), (H, W, 1) or (H, W, 3).
        hitThreshold
            Least score of a hit.
        winStride
            Distance of neighbouring windows (x, y) [px]; by default the cell size.
        padding
            Border around the image (x, y) [px], mirrored.
        searchLocations
            Top left corners (x, y) of the windows to look at [px]; by default the whole grid.

        Returns
        -------
        foundLocations, weights
            int32 (n, 2) top left corners (negative inside the padding) and float64 (n,) scores, in search order;
            `((), ())` when there are none, or no detector is set.
        """
        if self._svm is None:
            return (), ()
        places, weights = self._hog.detect(
            pixels(img),
            float(hitThreshold),
            _pair_or("winStride", winStride, _DEFAULT_STRIDE),
            _pair_or("padding", padding, (0, 0)),
            _places("searchLocations", searchLocations),
        )
        return (places, weights) if len(places) else ((), ())

    def detectMultiScale(
        self,
        img: NDArray[np.uint8],
        hitThreshold: float = 0.0,
        winStride: Pair | None = None,
        padding: Pair | None = None,
        scale: float = 1.05,
        groupThreshold: float = 2.0,
        useMeanshiftGrouping: bool = False,
    ) -> tuple[NDArray[np.int32], NDArray[np.float64]] | tuple[Nothing, Nothing]:
        """People of any size in an image.

        Parameters
        ----------
        img
            uint8 (H, W), (H, W, 1) or (H, W, 3).
        hitThreshold
            Least score of a hit.
        winStride
            Distance of neighbouring windows (x, y) [px of each level]; by default the block stride.
        padding
            Border around each level (x, y) [px], mirrored.
        scale
            How much each level is smaller than the one before; 1 or less searches the image's own size alone.
        groupThreshold
            Similar rectangles must be more than this to count; below 1 every hit is returned. With
            `useMeanshiftGrouping`, the least weight of a mode.
        useMeanshiftGrouping
            Group by mean-shift instead.

        Returns
        -------
        foundLocations, foundWeights
            int32 (n, 4) x, y, width, height, clipped to the image, and float64 (n,) scores, in level order whatever
            the number of threads; `((), ())` when there are none, or no detector is set.
        """
        if self._svm is None:
            return (), ()
        boxes, weights = self._hog.detect_multi_scale(
            pixels(img),
            float(hitThreshold),
            _pair_or("winStride", winStride, _DEFAULT_STRIDE),
            _pair_or("padding", padding, (0, 0)),
            float(scale),
            float(groupThreshold),
            bool(useMeanshiftGrouping),
        )
        return (boxes, weights) if len(boxes) else ((), ())

    @property
    def _hog(self) -> _core.Hog:
        if self._built is None:
            self._built = self._build(self._svm)
        return self._built

    def _build(self, svm: NDArray[np.float32] | None) -> _core.Hog:
        return _core.Hog(
            self._win_size,
            self._block_size,
            self._block_stride,
            self._cell_size,
            self._nbins,
            self._win_sigma,
            self._l2_hys_threshold,
            self._gamma_correction,
            self._nlevels,
            self._signed_gradient,
            svm,
        )


def HOGDescriptor_getDefaultPeopleDetector() -> NDArray[np.float32]:
    """float32 (3781,): OpenCV's people detector for the default geometry, bias last."""
    return _core.default_people_detector()


def HOGDescriptor_getDaimlerPeopleDetector() -> NDArray[np.float32]:
    """float32 (1981,): OpenCV's people detector for windows of 48 × 96, bias last."""
    return _core.daimler_people_detector()


def groupRectangles(
    rectList: Sequence[Sequence[int]] | NDArray[np.integer[Any]], groupThreshold: int, eps: float = 0.2
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
    rects = [[operator.index(side) for side in rect] for rect in rectList]
    grouped, counts = _core.group_rectangles(rects, operator.index(groupThreshold), float(eps))
    return (grouped, counts) if len(grouped) else ((), ())
