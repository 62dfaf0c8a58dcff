"""`cv2.HOGDescriptor` as OpenCV 4.14 has it: a program moves by writing `limo_hog.` for `cv2.`.

`docs/parity.md` lists where it differs on purpose.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import Any, SupportsFloat, SupportsIndex

import numpy as np
from numpy.typing import ArrayLike, NDArray

from limo_hog import _core
from limo_hog.cv2_api.arguments import (
    Nothing,
    Pair,
    Pairs,
    coefficients,
    flag,
    integer,
    pair,
    pixels,
    places,
    real,
    rectangles,
)
from limo_hog.cv2_api.features import Features
from limo_hog.cv2_api.geometry import Geometry
from limo_hog.cv2_api.state import State, replaced
from limo_hog.exceptions import ParameterTypeError

#: Rectangles or places and their weights.
Found = tuple[NDArray[np.int32], NDArray[np.float64]] | tuple[Nothing, Nothing]


class HOGDescriptor(Features):
    """Histograms of oriented gradients, and a linear SVM that finds people by them.

    `HOGDescriptor()` has the geometry of OpenCV's default people detector, gamma correction on. With arguments the
    first five are mandatory and gamma correction is off unless asked for, as in OpenCV 4.14; None stands for a
    default. `HOGDescriptor(filename)` loads a file. Sizes are (width, height) [px]. The geometry is checked at its
    first use: what does not fit raises `GeometryError`.

    Threads may share one: a search is of the geometry and coefficients that were in force together when it began.
    """

    __slots__ = ()

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
        sizes = {
            "_winSize": _winSize,
            "_blockSize": _blockSize,
            "_blockStride": _blockStride,
            "_cellSize": _cellSize,
            "_nbins": _nbins,
        }
        missing = [name for name, value in sizes.items() if value is None]
        if 0 < len(missing) < len(sizes):
            raise ParameterTypeError(f"HOGDescriptor(...) needs {', '.join(sizes)}; missing: {', '.join(missing)}")
        default = Geometry()
        super().__init__(
            Geometry(
                pair("_winSize", _winSize, default.winSize),
                pair("_blockSize", _blockSize, default.blockSize),
                pair("_blockStride", _blockStride, default.blockStride),
                pair("_cellSize", _cellSize, default.cellSize),
                integer("_nbins", _nbins, default.nbins),
                integer("_derivAperture", _derivAperture, default.derivAperture),
                real("_winSigma", _winSigma, default.winSigma),
                integer("_histogramNormType", _histogramNormType, default.histogramNormType),
                real("_L2HysThreshold", _L2HysThreshold, default.L2HysThreshold),
                flag("_gammaCorrection", _gammaCorrection, bool(missing)),
                integer("_nlevels", _nlevels, default.nlevels),
                flag("_signedGradient", _signedGradient, False),
            )
        )
        if filename is not None:
            self.load(filename)

    @property
    def svmDetector(self) -> NDArray[np.float32] | Nothing:
        """float32 (n,): the coefficients in force, the bias last if there is one; `()` when unset."""
        svm = self._state.svm
        return () if svm is None else svm.copy()

    def checkDetectorSize(self) -> bool:
        """Whether the detector, if any, fits the geometry; false only after `load` of a file without a detector."""
        state = self._state
        size = state.bare.descriptor_len
        return state.svm is None or len(state.svm) in (size, size + 1)

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
        svm = coefficients(svmdetector)
        while True:
            before = self._state
            after = before.with_svm(svm)
            if svm is not None:
                # Compiled first: what does not fit raises here, and changes nothing.
                _ = after.armed
            if replaced(self, before, after):
                return

    @staticmethod
    def getDefaultPeopleDetector() -> NDArray[np.float32]:
        """float32 (3781,): OpenCV's people detector for the default geometry, bias last."""
        return _core.default_people_detector()

    @staticmethod
    def getDaimlerPeopleDetector() -> NDArray[np.float32]:
        """float32 (1981,): OpenCV's people detector for windows of 48 × 96, bias last."""
        return _core.daimler_people_detector()

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
        state = self._state
        if state.svm is None:
            return (), ()
        found, weights = state.armed.detect(
            pixels(img),
            real("hitThreshold", hitThreshold, 0.0),
            pair("winStride", winStride),
            pair("padding", padding),
            places("searchLocations", searchLocations),
        )
        return (found, weights) if len(found) else ((), ())

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
        finalThreshold
            The old name of `groupThreshold`; used in its place when given.

        Returns
        -------
        foundLocations, foundWeights
            int32 (n, 4) x, y, width, height, clipped to the image, and float64 (n,) scores, in level order whatever
            the number of threads; `((), ())` when there are none, or no detector is set.
        """
        state = self._state
        if state.svm is None:
            return (), ()
        boxes, weights = state.armed.detect_multi_scale(
            pixels(img),
            real("hitThreshold", hitThreshold, 0.0),
            pair("winStride", winStride),
            pair("padding", padding),
            real("scale", scale, 1.05),
            real("groupThreshold", groupThreshold if finalThreshold is None else finalThreshold, 2.0),
            flag("useMeanshiftGrouping", useMeanshiftGrouping, False),
        )
        return (boxes, weights) if len(boxes) else ((), ())

    def detectROI(
        self,
        img: NDArray[np.uint8],
        regions: Sequence[Sequence[int]] | NDArray[np.integer[Any]],
        hitThreshold: SupportsFloat | None = 0.0,
        **options: Any,
    ) -> Found:
        """People of any size in regions of an image, each searched as if it were an image of its own.

        (For single windows at given places, as OpenCV's C++ method of this name has it, use `detect` with
        `searchLocations`.)

        Parameters
        ----------
        img
            uint8 (H, W), (H, W, 1) or (H, W, 3).
        regions
            (n, 4) integers: x, y, width, height [px]; what lies outside the image is passed over.
        hitThreshold
            Least score of a hit.
        **options
            The other arguments of `detectMultiScale`, by name.

        Returns
        -------
        foundLocations, foundWeights
            As of `detectMultiScale`, in pixels of the whole image, region by region.
        """
        image = pixels(img)
        boxes, weights = [np.empty((0, 4), np.int32)], [np.empty(0)]
        for x, y, width, height in rectangles("regions", regions):
            left, top = max(x, 0), max(y, 0)
            region = image[top : max(y + height, 0), left : max(x + width, 0)]
            if region.size:
                found, scores = self.detectMultiScale(region, hitThreshold, **options)
                boxes.append(np.reshape(np.asarray(found, np.int32), (-1, 4)) + np.array([left, top, 0, 0], np.int32))
                weights.append(np.asarray(scores, np.float64))
        all_boxes = np.concatenate(boxes)
        return (all_boxes, np.concatenate(weights)) if len(all_boxes) else ((), ())

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
        OSError
            The file cannot be read.
        ModelFormatError
            It holds no HOG detector.
        DetectorSizeError
            Its detector does not fit its geometry.
        """
        from limo_hog.cv2_api import model_files

        geometry, numbers = model_files.load(filename, objname)
        loaded = State(geometry, coefficients(numbers))
        # Compiled first: what does not fit raises here, and changes nothing.
        _ = loaded.bare if loaded.svm is None else loaded.armed
        while True:
            before = self._state
            if replaced(self, before, loaded if numbers else loaded.with_svm(before.svm)):
                return True

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, HOGDescriptor):
            return NotImplemented
        mine, theirs = self._state, other._state
        if mine.svm is None or theirs.svm is None:
            return mine.geometry == theirs.geometry and mine.svm is theirs.svm
        return mine.geometry == theirs.geometry and np.array_equal(mine.svm, theirs.svm)

    def __hash__(self) -> int:
        # It may change while it is a key, so nothing it holds may go in.
        return hash(HOGDescriptor)

    def __repr__(self) -> str:
        state = self._state
        held = ", ".join(f"{name}={value}" for name, value in state.geometry._asdict().items())
        svm = "no detector" if state.svm is None else f"a detector of {len(state.svm)} coefficients"
        return f"<{type(self).__name__} {held}; {svm}>"

    def __reduce__(self) -> tuple[Callable[..., HOGDescriptor], tuple[Any, ...]]:
        state = self._state
        return _restored, (type(self), tuple(state.geometry), state.svm)


def _restored(kind: type[HOGDescriptor], geometry: tuple[Any, ...], svm: NDArray[np.float32] | None) -> HOGDescriptor:
    hog = kind(*geometry)
    hog._state = hog._state.with_svm(svm)
    return hog
