"""`cv2.HOGDescriptor` as OpenCV 4.14 has it; `docs/parity.md` lists where it differs on purpose."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, ClassVar, SupportsFloat, SupportsIndex

import numpy as np
from numpy.typing import ArrayLike, NDArray

from limo_hog.cv2_api import functions
from limo_hog.cv2_api.arguments import Nothing, Pair, Pairs, coefficients, flag, integer, pair, pixels, places, real
from limo_hog.cv2_api.geometry import Geometry
from limo_hog.cv2_api.state import State, replaced
from limo_hog.exceptions import ParameterTypeError

#: Rectangles or places and their weights.
Found = tuple[NDArray[np.int32], NDArray[np.float64]] | tuple[Nothing, Nothing]
#: What checks each field of `Geometry`.
_CHECKS: tuple[Callable[..., Any], ...]
_CHECKS = (pair, pair, pair, pair, integer, integer, real, integer, real, flag, integer, flag)


class HOGDescriptor:
    """Histograms of oriented gradients, and a linear SVM that finds people by them.

    `HOGDescriptor()` has the geometry of OpenCV's default people detector, gamma correction on. With arguments the
    first five are mandatory and gamma correction is off unless asked for, as in OpenCV 4.14; None stands for a
    default. `HOGDescriptor(filename)` loads a file. Sizes are (width, height) [px]. The geometry is checked at its
    first use: what does not fit raises `GeometryError`. Images are uint8 (H, W), (H, W, 1) or (H, W, 3).

    Of every search, `winStride` is the distance of neighbouring windows (x, y) [px], by default the cell size (in
    `detectMultiScale` the block stride), `padding` a border around the image or level (x, y) [px], mirrored, and
    `locations` are top left corners (x, y) of windows [px], by default the whole grid, row by row.

    Threads may share one: a search is of the geometry and coefficients that were in force together when it began.
    """

    __slots__ = ("_state",)

    def __init__(
        self,
        _winSize: Pair | str | os.PathLike[str] | None = None,
        _blockSize: Pair | None = None,
        _blockStride: Pair | None = None,
        _cellSize: Pair | None = None,
        _nbins: SupportsIndex | None = None,
        _derivAperture: SupportsIndex | None = None,
        _winSigma: SupportsFloat | None = None,
        _histogramNormType: SupportsIndex | None = None,
        _L2HysThreshold: SupportsFloat | None = None,
        _gammaCorrection: bool | None = None,
        _nlevels: SupportsIndex | None = None,
        _signedGradient: bool | None = None,
        *,
        filename: str | os.PathLike[str] | None = None,
    ) -> None:
        if isinstance(_winSize, (str, os.PathLike)):
            filename, _winSize = _winSize, None
        sizes = (_winSize, _blockSize, _blockStride, _cellSize, _nbins)
        missing = [f"_{name}" for name, value in zip(Geometry._fields, sizes, strict=False) if value is None]
        if 0 < len(missing) < len(sizes):
            raise ParameterTypeError(
                f"HOGDescriptor(...) needs its first five arguments; missing: {', '.join(missing)}"
            )
        others = (_derivAperture, _winSigma, _histogramNormType, _L2HysThreshold)
        given = (*sizes, *others, _gammaCorrection, _nlevels, _signedGradient)
        default = Geometry(gammaCorrection=bool(missing))
        each = zip(_CHECKS, Geometry._fields, given, default, strict=True)
        self._state = State(Geometry(*(check(f"_{name}", value, instead) for check, name, value, instead in each)))
        if filename is not None:
            self.load(filename)

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
        return self._state.describing.descriptor_len

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
        shares, bins = self._state.describing.gradient(image, (left, top, right, bottom))
        return _filled(grad, shares), _filled(angleOfs, bins)

    def compute(
        self,
        img: NDArray[np.uint8],
        winStride: Pair | None = None,
        padding: Pair | None = None,
        locations: Pairs | None = None,
    ) -> NDArray[np.float32] | Nothing:
        """Descriptors of the windows of an image.

        Returns
        -------
        descriptors
            float32 (windows × descriptor size,), blocks column by column; zeros for a location outside. `()` when
            no window fits.
        """
        descriptors = self._state.describing.compute(
            pixels(img), pair("winStride", winStride), pair("padding", padding), places("locations", locations)
        )
        return descriptors if len(descriptors) else ()

    @property
    def svmDetector(self) -> NDArray[np.float32] | Nothing:
        """float32 (n,): the coefficients in force, the bias last if there is one; `()` when unset."""
        svm = self._state.svm
        return () if svm is None else svm.copy()

    def checkDetectorSize(self) -> bool:
        """Whether the detector, if any, fits the geometry; false only after `load` of a file without a detector."""
        state = self._state
        return state.svm is None or len(state.svm) - state.describing.descriptor_len in (0, 1)

    def setSVMDetector(self, svmdetector: ArrayLike | None) -> None:
        """Set the coefficients of the SVM: one per descriptor element, and perhaps the bias after them.

        Parameters
        ----------
        svmdetector
            Numbers of shape (n,), (n, 1) or (1, n); None or an empty sequence clears the detector.

        Raises
        ------
        DetectorSizeError
            `n` is neither the descriptor's size nor one more; the detector in force stays.
        """
        svm = coefficients(svmdetector)
        while True:
            before = self._state
            after = State(before.geometry, svm)
            if svm is not None:
                # Compiled first: what does not fit raises here, and changes nothing.
                _ = after.detecting
            if replaced(self, before, after):
                return

    @staticmethod
    def getDefaultPeopleDetector() -> NDArray[np.float32]:
        """float32 (3781,): OpenCV's people detector for the default geometry, bias last."""
        return functions.HOGDescriptor_getDefaultPeopleDetector()

    @staticmethod
    def getDaimlerPeopleDetector() -> NDArray[np.float32]:
        """float32 (1981,): OpenCV's people detector for windows of 48 × 96, bias last."""
        return functions.HOGDescriptor_getDaimlerPeopleDetector()

    def detect(
        self,
        img: NDArray[np.uint8],
        hitThreshold: SupportsFloat | None = 0.0,
        winStride: Pair | None = None,
        padding: Pair | None = None,
        searchLocations: Pairs | None = None,
    ) -> Found:
        """Windows of an image, at its own size, that the SVM takes for a person.

        Parameters
        ----------
        hitThreshold
            Least score of a hit.

        Returns
        -------
        foundLocations, weights
            int32 (n, 2) top left corners (negative inside the padding) and float64 (n,) scores, in search order;
            `((), ())` when there are none, or no detector is set.
        """
        state = self._state
        if state.svm is None:
            return (), ()
        found, weights = state.detecting.detect(
            pixels(img),
            real("hitThreshold", hitThreshold, 0.0),
            pair("winStride", winStride),
            pair("padding", padding),
            places("searchLocations", searchLocations),
        )
        return (found, weights) if len(found) else ((), ())

    #: The guide of a search, by its scale (`_core.Hog.detect_multi_scale`): OpenCV has none.
    _guide: ClassVar[Any] = lambda _self, _scale: None

    def detectMultiScale(
        self,
        img: NDArray[np.uint8],
        hitThreshold: SupportsFloat | None = 0.0,
        winStride: Pair | None = None,
        padding: Pair | None = None,
        scale: SupportsFloat | None = 1.05,
        groupThreshold: SupportsFloat | None = 2.0,
        useMeanshiftGrouping: bool = False,
        *,
        finalThreshold: SupportsFloat | None = None,
    ) -> Found:
        """People of any size in an image.

        Parameters
        ----------
        hitThreshold
            Least score of a hit.
        scale
            How much each level is smaller than the one before; 1 or less searches the image's own size alone.
        groupThreshold, finalThreshold
            Similar rectangles must be more than this to count; below 1 every hit is returned. With
            `useMeanshiftGrouping`, which groups by mean-shift, the least weight of a mode. The second is the old
            name; it counts when given.

        Returns
        -------
        foundLocations, foundWeights
            int32 (n, 4) x, y, width, height, clipped to the image, and float64 (n,) scores, in level order whatever
            the number of threads; `((), ())` when there are none, or no detector is set.
        """
        state = self._state
        if state.svm is None:
            return (), ()
        threshold = real("groupThreshold", groupThreshold if finalThreshold is None else finalThreshold, 2.0)
        modes = flag("useMeanshiftGrouping", useMeanshiftGrouping, False)
        boxes, weights = state.detecting.detect_multi_scale(
            pixels(img),
            hit_threshold=real("hitThreshold", hitThreshold, 0.0),
            win_stride=pair("winStride", winStride),
            padding=pair("padding", padding),
            scale=real("scale", scale, 1.05),
            similar=None if modes else threshold,
            mean_shift=threshold if modes else None,
            guide=self._guide(real("scale", scale, 1.05)),
        )
        return (boxes, weights) if len(boxes) else ((), ())

    def save(self, filename: str | os.PathLike[str], objname: str = "") -> None:
        """Write geometry and detector to a file that OpenCV reads, too.

        Parameters
        ----------
        filename
            .xml, .yml, .yaml or .json, with .gz after it compressed; YAML under any other suffix.
        objname
            Name of the object in the file; by default the file's stem.

        Raises
        ------
        OSError
            The file cannot be written.
        ParameterError
            The object's name is not a letter or `_`, then letters, digits, `-` and `_`.
        """
        # Imported here: what reads and writes files would double the time to import this package.
        from limo_hog.cv2_api import model_files

        state = self._state
        model_files.save(filename, state.geometry, state.svm, objname)

    def load(self, filename: str | os.PathLike[str], objname: str = "") -> bool:
        """Take geometry and detector from a file of OpenCV's or of `save`; true, or an error.

        As in OpenCV a file without a detector keeps the one in force, and what else is missing counts as 0.

        Parameters
        ----------
        filename
            XML, YAML or JSON, plain or gzipped, whatever its suffix.
        objname
            Name of the object in the file; by default the first.

        Raises
        ------
        ModelFileError
            The file cannot be read; `ModelMissingError` where there is none.
        ModelFormatError
            It holds no HOG detector.
        DetectorSizeError
            Its detector does not fit its geometry.
        """
        from limo_hog.cv2_api import model_files

        geometry, numbers = model_files.load(filename, objname)
        loaded = State(geometry, coefficients(numbers))
        # Compiled first: what does not fit raises here, and changes nothing.
        _ = loaded.detecting
        while True:
            before = self._state
            if replaced(self, before, loaded if numbers else State(geometry, before.svm)):
                return True

    def __repr__(self) -> str:
        state = self._state
        held = ", ".join(f"{name}={value}" for name, value in state.geometry._asdict().items())
        svm = "no detector" if state.svm is None else f"a detector of {len(state.svm)} coefficients"
        return f"<{type(self).__name__} {held}; {svm}>"


def _filled(target: Any, result: Any) -> Any:
    """Return `target` holding `result` where it can, else `result` itself."""
    if isinstance(target, np.ndarray) and target.shape == result.shape and target.dtype == result.dtype:
        target[...] = result
        return target
    return result
