"""The compiled detector. Use `limo_hog.HOGDescriptor` or `limo_hog.PeopleDetector`; this is what they call.

The method is that of Dalal and Triggs, "Histograms of Oriented Gradients for Human Detection" (CVPR 2005), with the
roundings and the order of sums of OpenCV 4.14, so that its trained models mean the same here.

Sizes, strides, paddings and places are (x, y) [px]. Images are uint8, (H, W), (H, W, 1) or (H, W, 3), in any memory
layout and order of colours; pixels outside the array are mirrored ones (reflect-101). Calls release the GIL.

Every call raises MemoryError, with the bytes, where the memory that its arguments ask for cannot be had. Ctrl-C ends a
search or a grouping within a second.
"""

from collections.abc import Sequence
from typing import Any, TypeAlias, final

import numpy as np
from numpy.typing import NDArray
from typing_extensions import Self

__all__ = [
    "Canvas",
    "Hog",
    "SecondLook",
    "available_backends",
    "backend",
    "daimler_people_detector",
    "default_people_detector",
    "get_num_threads",
    "group_rectangles",
    "resize",
    "set_num_threads",
    "skimage_hog",
]

_Pair: TypeAlias = tuple[int, int]
_Window: TypeAlias = tuple[int, int, int, int]
_Light: TypeAlias = tuple[float, float, float, float, float]

@final
class Hog:
    """A geometry with or without an SVM: immutable, so that threads may share it."""

    def __new__(
        cls,
        win_size: _Pair,
        block_size: _Pair,
        block_stride: _Pair,
        cell_size: _Pair,
        nbins: int,
        win_sigma: float,
        l2_hys_threshold: float,
        gamma_correction: bool,
        nlevels: int,
        signed_gradient: bool,
        detector: NDArray[np.float32] | None,
    ) -> Self:
        """Check a geometry and take the coefficients of a linear SVM for it.

        Parameters
        ----------
        win_size, block_size, block_stride, cell_size
            1 to 32768 [px]. A block is a whole number of cells, a window one block and a whole number of strides.
        nbins
            Orientation bins of a cell, 1 to 256.
        win_sigma
            Gaussian of a block's pixels [px], centred on (block width, block height) / 2; where it is not positive,
            (block width + block height) / 8.
        l2_hys_threshold
            Where block histograms of unit length are clipped before they are scaled to unit length again (L2-Hys).
        gamma_correction
            Take the gradient of the square root of the pixels.
        nlevels
            Most levels of a pyramid, at least 1.
        signed_gradient
            Bins over 2π instead of π.
        detector
            float32 (n,): one weight per element of a descriptor, and perhaps a bias after them; None for none.

        Raises
        ------
        GeometryError
            The sizes do not fit together, or a number is out of its range.
        DetectorSizeError
            There are other than `descriptor_len` or one more coefficients.
        BackendError
            The environment asks for an instruction set that is unknown or that this CPU lacks.
        """

    @property
    def descriptor_len(self) -> int:
        """Elements of one window's descriptor: bins × cells of a block × blocks of a window."""

    def gradient(
        self, image: NDArray[np.uint8], padding: tuple[int, int, int, int]
    ) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
        """Magnitude of each pixel's gradient, shared linearly between the two bins whose centres are nearest.

        Central differences without the factor ½, of the colour channel with the largest magnitude. Angles are those
        of OpenCV's polynomial, within 0.02° of the arctangent; bin i is centred on (i + ½) / nbins of the range.

        Parameters
        ----------
        padding
            Columns and rows to add (or, if negative, to drop): left, top, right, bottom [px].

        Returns
        -------
        shares, bins
            float32 (H', W', 2) and uint8 (H', W', 2).

        Raises
        ------
        ImageError, ParameterError
            The image is none of those above; no pixel is left, or far too many.
        """

    def compute(
        self, image: NDArray[np.uint8], win_stride: _Pair, padding: _Pair, locations: Sequence[_Pair] | None
    ) -> NDArray[np.float32]:
        """Descriptors of windows, one after the other.

        A block's histograms are sums of `gradient`'s shares, weighted by the Gaussian and linearly between the
        centres of the cells, then normalised: v / (‖v‖ + 0.1 n), clipped, v / (‖v‖ + 0.001), n being its elements.

        Parameters
        ----------
        win_stride
            Distance of neighbouring windows [px]; (0, 0) stands for the cell size.
        padding
            Mirrored border [px], rounded up to (p + g - 1) & -g, g being gcd(window stride, block stride).
        locations
            Top left corners of the windows, in image pixels; None for the whole grid, row by row.

        Returns
        -------
        descriptors
            float32 (windows × `descriptor_len`,): blocks column by column, in them cells column by column, in them
            the bins. Zeros for a location whose window leaves the padded image.

        Raises
        ------
        ImageError, ParameterError
            The image is none of those above; a stride is not positive, the padding or the result too large.
        """

    def describe(self, crops: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Descriptors of crops of the window's size, on all threads, within 1e-6 of those that `compute` gives.

        Parameters
        ----------
        crops
            (N, H, W), (N, H, W, 1) or (N, H, W, 3).

        Returns
        -------
        descriptors
            float32 (N, `descriptor_len`), each as of `compute`.

        Raises
        ------
        ImageError
            The crops are none of those above.
        """

    def detect(
        self,
        image: NDArray[np.uint8],
        hit_threshold: float,
        win_stride: _Pair,
        padding: _Pair,
        locations: Sequence[_Pair] | None,
    ) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
        """Windows whose score, bias + weights · descriptor, is at least `hit_threshold`.

        Parameters
        ----------
        win_stride, padding, locations
            As of `compute`; locations whose window leaves the padded image are passed over.

        Returns
        -------
        places, scores
            int32 (n, 2) top left corners in image pixels and float64 (n,), in the order of the windows.

        Raises
        ------
        ImageError, ParameterError
            As `compute`.
        """

    def detect_multi_scale(
        self,
        image: NDArray[np.uint8],
        *,
        hit_threshold: float = 0.0,
        win_stride: _Pair = ...,
        padding: _Pair = ...,
        scale: float = 1.05,
        similar: float | None = None,
        mean_shift: float | None = None,
        searched_size: _Pair | None = None,
        guide: tuple[int, float, tuple[float, float]] | None = None,
        threads: int | None = None,
    ) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
        """Hits on all levels of a pyramid, grouped, and clipped to the image.

        Level i is the image shrunk by scaleⁱ with OpenCV's INTER_LINEAR_EXACT, as long as the window fits.

        Parameters
        ----------
        win_stride
            As of `compute`, in pixels of each level; (0, 0) stands for the block stride.
        padding
            As of `compute`, in pixels of each level.
        scale
            1 or less, and what is no number, leaves the image's own size alone.
        similar
            Group: similar rectangles must be more than this, truncated to an integer; below 1 every hit is returned.
        mean_shift
            Group by the modes of the hits' density over place and scale (Dalal's thesis, 2006, chapter 5): the least
            density of a mode. With neither of the two every hit is returned.
        searched_size
            Width and height [px]: the image is resized to this before all else, as `resize` does; boxes are in its
            pixels.
        guide
            (halvings, margin, reach): search one level in 2 to the power of `halvings` whole, and those between only
            within `reach` (x, y) [window strides] of what was found on the levels d before and behind, with the
            threshold lowered by √d · `margin`, d being halved each time: faster, and some hits may be missed. None:
            search all levels whole.
        threads
            How many share the work, at least 1; None: as `set_num_threads` says.

        Returns
        -------
        boxes, scores
            int32 (n, 4) x, y, width, height [px] and float64 (n,): a group's best score or a mode's density. In the
            order of levels and windows, whatever the number of threads.

        Raises
        ------
        ImageError, ParameterError
            As `compute`; both ways to group are asked for.
        """

@final
class SecondLook:
    """A network of three convolutions (kernels 5, 3, 3; stride 2) and two dense layers: immutable, as `Hog` is."""

    def __new__(cls, channels: tuple[int, int, int], hidden: int, weights: NDArray[np.float32]) -> Self:
        """Take the network's weights.

        Parameters
        ----------
        channels, hidden
            Channels of the convolutions and units of the first dense layer, 1 to 1024 each.
        weights
            float32 (n,), finite: layer by layer the weights [row][column][input][output], then the biases.

        Raises
        ------
        ModelFormatError
            These are no weights of such a network.
        """

    def answers(
        self, image: NDArray[np.uint8], windows: NDArray[np.float64], *, threads: int | None = None
    ) -> NDArray[np.float32]:
        """Answer to each window: float32 (N, 5).

        First a logit, above 0 where the window rather shows a person. Then how the person's box differs from that which
        every window of the model has: right and down by these shares of the window's sides, and the logarithms by how
        much it is wider and higher.

        A window is averaged to 32 × 64 grey pixels (a colour is its channels' mean), less their mean, over their
        deviation and 8. Its answer does not depend on the others, nor on the number of threads.

        Parameters
        ----------
        windows
            float64 (N, 4): x, y, w, h [px]; what lies beyond the image is mirrored.
        threads
            None: as many as `set_num_threads` allows.

        Raises
        ------
        ImageError, ParameterError
            The image is none of those above; a window has no area, or is far away or far too large.
        """

@final
class Canvas:
    """What the arena's camera (`limo_sim`) sees of one object: a z-buffer over a window of its image.

    It is here because numpy is the limit there: a person is 23 solids, each some thirty passes over its pixels. All in
    single precision, in the order of numpy's elementwise sums: the same picture on every CPU.

    A window is the first column, the first row, the last column + 1 and the last row + 1 [px]. Light is a unit vector
    towards the sun (x right, y down, z forward), then base and gain: a surface's brightness is base + gain × cosine.
    Arrays are in C order and of the image's size, (height, width).

    Solids are cast half a pixel too wide, and how much of a pixel is covered falls from 1 to 0 over the last pixel.
    The tone of a pixel is 4 times the number of the solid, `part`, plus its brightness.
    """

    def __new__(cls, height: int, width: int, focal: float) -> Self:
        """Make an empty canvas for images of a size and a focal length [px], whose principal point is their middle.

        Raises
        ------
        ParameterError
            A side is less than 1 or more than 16384. The other calls raise it for a window or an array that does not
            fit the image.
        """

    def begin(self, window: _Window) -> None:
        """Empty the canvas for another object within a window."""

    def strips(self, rows: NDArray[np.float64], light: _Light) -> None:
        """Cast tapered capsules, which are small against their distance.

        `rows`: float64 (N, 12): part, u, v, axis u, axis v, length, radius [px], taper, depth [m], depth per px, m per
        px, sine of the angle between axis and image.
        """

    def ellipses(self, rows: NDArray[np.float64], light: _Light) -> None:
        """Cast ellipsoids, which are small against their distance.

        `rows`: float64 (N, 12): part, u, v, the three entries of the lower-triangular whitening matrix, half height
        and half width [px], depth [m], depth per canonical x and y, bulge [m].
        """

    def frustum(self, row: Sequence[float], light: _Light) -> None:
        """Cast an upright cone or cylinder.

        `row`: part; left, top, right, bottom [px]; x and z of the axis [m]; radius per metre of height; radius at the
        camera's height; half a pixel there [m]; x² + z² - radius² [m²]; how far the top is above and the foot below the
        camera [m].
        """

    def slab(self, row: Sequence[float]) -> None:
        """Cast an upright box.

        `row`: left, top, right, bottom [px]; for each axis of the box where its two sides are, from the camera [m]; the
        optical axis and the image's rows along the first axis, then along the second; the tones of the three faces.
        """

    def draw(
        self,
        image: NDArray[np.uint32] | None,
        depth: NDArray[np.float32],
        palette: NDArray[np.uint32],
        owners: NDArray[np.int16] | None = None,
        owner: int = 0,
    ) -> int:
        """Draw the object wherever it is nearer than what is there; return the number of its pixels, seen or not.

        Parameters
        ----------
        image
            Blue, green, red, 0; None to draw depth alone.
        depth
            Of what has been drawn [m]; changed.
        palette
            The colour of every tone, in steps of 1/128.
        owners, owner
            Whose each pixel is, and whose the object's pixels are.
        """

    def seen(self, depth: NDArray[np.float32]) -> tuple[int, int, _Window | None]:
        """Return the number of the object's pixels, of those that nothing is nearer than, and the window they fill."""

    def shade_floor(
        self,
        grey: NDArray[np.uint8],
        depth: NDArray[np.float32],
        floor: NDArray[np.float32],
        columns: NDArray[np.float32],
        window: _Window,
        at: tuple[float, float],
        radius: float,
        strength: float,
    ) -> None:
        """Darken the floor of a grey picture softly around what stands on it.

        Parameters
        ----------
        floor, columns
            float32 (height,): depth of the floor in every row [m]; (width,): how far to the right a column's ray goes
            for every metre ahead.
        at, radius
            Of the shadow: to the right of and ahead of the camera [m].
        strength
            Share of the brightness that its middle loses.
        """

def group_rectangles(
    rects: Sequence[Sequence[int]], threshold: int, eps: float
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Mean rectangles of the connected components of similarity, as `cv2.groupRectangles`.

    Two rectangles are similar where each edge lies within eps · (smaller width + smaller height) / 2.

    Parameters
    ----------
    rects
        n times x, y, width, height [px], each of 32 bits.
    threshold
        A component must have more members; below 1 the rectangles are returned as they came.

    Returns
    -------
    rects, counts
        int32 (m, 4) and int32 (m,) numbers of members.
    """

def resize(image: NDArray[np.uint8], width: int, height: int) -> NDArray[np.uint8]:
    """Resize with linear interpolation, bit for bit as OpenCV's INTER_LINEAR_EXACT: the resize of the pyramid's levels.

    Parameters
    ----------
    image
        uint8 (H, W), (H, W, 1) or (H, W, 3), not empty.
    width, height
        The new size [px], at least 1 × 1. Enlarging is smooth; shrinking takes single pixels, without a mean.

    Returns
    -------
    uint8 (height, width) or (height, width, C).

    Raises
    ------
    ImageError
        No such image, or no size of an image.
    """

def default_people_detector() -> NDArray[np.float32]:
    """float32 (3781,): OpenCV's people detector for windows of 64 × 128, bias last."""

def daimler_people_detector() -> NDArray[np.float32]:
    """float32 (1981,): OpenCV's people detector for windows of 48 × 96, bias last."""

def skimage_hog(
    images: NDArray[Any],
    parameters: tuple[int, tuple[int, int], tuple[int, int], int],
    directions: list[tuple[float, float]] | None,
) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    """Compute scikit-image's HOG of images, and with `directions` a drawing of the first.

    `limo_hog.skimage` checks all and names it: images are uint8, float32 or float64 (N, channels, rows, columns) in C
    order; parameters the orientations, the cell [px], the block [cells] and the norm, 0 to 3; directions the way from
    a cell's middle along each bin's gradient [px]. Returned are (N, D) and (rows, columns) or None.
    """

def set_num_threads(count: int) -> None:
    """Let pyramids be searched by this many threads; 0 for one per core.

    No call uses more than the process has cores (as counted when they are first needed) or more than 256, and threads
    that the system does not give are done without.

    Raises
    ------
    ParameterError
        The number is negative, or larger than a machine word.
    ParameterTypeError
        It is no integer.
    """

def get_num_threads() -> int:
    """How many threads were chosen; a call uses no more than there are cores."""

def backend() -> str:
    """Instruction set that new detectors use."""

def available_backends() -> list[str]:
    """Instruction sets that this CPU has kernels for."""
