"""Checks of arguments: what OpenCV's bindings take is taken, anything else is a named error."""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from typing import Any, SupportsFloat, SupportsIndex

import numpy as np
from numpy.typing import ArrayLike, NDArray

from limo_hog.exceptions import ImageError, ImageTypeError, ParameterError, ParameterTypeError

#: Two integers: width and height, or x and y [px].
Pair = Sequence[int] | NDArray[np.integer[Any]]
#: Many of them: (n, 2) integers.
Pairs = Sequence[Pair] | NDArray[np.integer[Any]]
#: The empty tuple that OpenCV returns in place of an empty array.
Nothing = tuple[()]

_UINT8 = np.dtype(np.uint8)
_INT_MAX = 2**31 - 1
_SHOWN = 60


def pixels(image: Any) -> NDArray[np.uint8]:
    """Return `image` as the uint8 array the detector reads.

    Accepts (H, W), (H, W, 1) and (H, W, 3) arrays in any memory layout, 1-D arrays as one column, and `cv2.UMat`.
    Raises `ImageError` where it is anything else, or empty.
    """
    image = _downloaded(image, ImageTypeError)
    if image is None:
        raise ImageTypeError("the image is None: did imread find no file, or is the video over?")
    if not isinstance(image, np.ndarray):
        hint = "; detect_many takes a list" if isinstance(image, (list, tuple)) else ""
        raise ImageTypeError(
            f"an image is a uint8 numpy array, for PeopleDetector also a file's name or a PIL image; this is a "
            f"{type(image).__name__}{hint}"
        )
    if image.size == 0:
        raise ImageError(f"the image is empty: its shape is {image.shape}")
    if image.dtype != _UINT8:
        raise ImageTypeError(
            f"the image's pixels are {image.dtype}; uint8 (0 to 255) is wanted: scale and astype(uint8)"
        )
    if image.ndim == 1:
        return image[:, None]
    if image.ndim not in (2, 3) or (image.ndim == 3 and image.shape[2] not in (1, 3)):
        raise ImageError(f"the image's shape is {image.shape}; (H, W), (H, W, 1) or (H, W, 3) is wanted")
    return image


def coefficients(svm: ArrayLike | None) -> NDArray[np.float32] | None:
    """Return the coefficients of an SVM as float32 (n,); None where there are none.

    Raises `ParameterTypeError` where they are no numbers of shape (n,), (n, 1) or (1, n).
    """
    svm = _downloaded(svm, ParameterTypeError)
    try:
        given = np.asarray(() if svm is None else svm)
    except ValueError:
        raise ParameterTypeError("the detector's coefficients are ragged; one row of numbers is wanted") from None
    if given.size == 0:
        return None
    if given.dtype.kind not in "iuf":
        raise ParameterTypeError(f"the detector's coefficients are {given.dtype}; real numbers are wanted")
    if given.ndim > 2 or (given.ndim == 2 and 1 not in given.shape):
        raise ParameterTypeError(f"the detector's shape is {given.shape}; (n,), (n, 1) or (1, n) is wanted")
    with np.errstate(over="ignore"):
        return given.astype(np.float32).ravel()


def pair(name: str, value: Pair | None, default: tuple[int, int] = (0, 0)) -> tuple[int, int]:
    """Return two integers; None stands for `default`."""
    if value is None:
        return default
    try:
        x, y = map(_index, value)
    except (TypeError, ValueError):
        raise ParameterTypeError(f"{name} is {shown(value)}; two integers (x, y) are wanted") from None
    if abs(x) > _INT_MAX or abs(y) > _INT_MAX:
        raise ParameterError(f"{name} is {shown((x, y))}; at most {_INT_MAX} is allowed")
    return x, y


def places(name: str, value: Pairs | None) -> list[tuple[int, int]] | None:
    """Return (x, y) integers; None or nothing stands for no choice."""
    if value is None:
        return None
    try:
        given = np.asarray(value)
    except ValueError:
        given = np.asarray(None)
    if given.size == 0:
        return None
    if given.dtype.kind not in "iu" or given.ndim != 2 or given.shape[1] != 2:
        raise ParameterTypeError(
            f"{name} has shape {given.shape} and type {given.dtype}; integers of shape (n, 2), each x, y, are wanted"
        )
    return [(x, y) for x, y in given.tolist()]


def rectangles(name: str, value: Sequence[Sequence[int]] | NDArray[np.integer[Any]] | None) -> list[list[int]]:
    """Return [x, y, width, height] integers."""
    try:
        given = np.asarray(() if value is None else value)
    except ValueError:
        given = np.asarray(None)
    if given.ndim and not len(given):
        return []
    if given.dtype.kind not in "iu" or given.ndim != 2 or given.shape[1] != 4:
        raise ParameterTypeError(
            f"{name} has shape {given.shape} and type {given.dtype}; integers of shape (n, 4), each x, y, width, "
            "height, are wanted"
        )
    if max(abs(int(given.min())), abs(int(given.max()))) > _INT_MAX:
        raise ParameterError(f"{name} has a coordinate beyond {_INT_MAX}")
    found: list[list[int]] = given.tolist()
    return found


def real(name: str, value: SupportsFloat | None, default: float) -> float:
    """Return a number; None stands for `default`."""
    if value is None:
        return default
    if not isinstance(value, (SupportsFloat, SupportsIndex)) or _is_truth(value):
        raise ParameterTypeError(f"{name} is {shown(value)}; a number is wanted")
    if isinstance(value, np.complexfloating):
        raise ParameterTypeError(f"{name} is {shown(value)}; a real number is wanted")
    try:
        return float(value)
    except ValueError:  # text in an array, a signalling NaN
        raise ParameterTypeError(f"{name} is {shown(value)}; a number is wanted") from None
    except TypeError:  # an array of more than one number
        raise ParameterTypeError(f"{name} is {shown(value)}; one number is wanted") from None
    except OverflowError:
        raise ParameterError(f"{name} is {shown(value)}; it is larger than any float") from None


def number(name: str, value: Any, low: float = -math.inf, high: float = math.inf) -> float:
    """Return a finite number within bounds, both included; a truth value is none.

    Raises `ParameterError` or `ParameterTypeError` where it is out of its bounds, infinite or NaN, or no number.
    """
    if value is None:
        raise ParameterTypeError(f"{name} is None; a number is wanted")
    found = real(name, value, math.nan)
    if not (math.isfinite(found) and low <= found <= high):
        bounds = f"{low:g} to {high:g}" if high < math.inf else f"{low:g} or more"
        raise ParameterError(f"{name} is {shown(value)}; {'a finite number' if low == -math.inf else bounds} is wanted")
    return found


def integer(name: str, value: SupportsIndex | None, default: int) -> int:
    """Return an integer; None stands for `default`."""
    if value is None:
        return default
    try:
        found = _index(value)
    except TypeError:
        raise ParameterTypeError(f"{name} is {shown(value)}; an integer is wanted") from None
    if abs(found) > _INT_MAX:
        raise ParameterError(f"{name} is {shown(found)}; at most {_INT_MAX} is allowed")
    return found


def flag(name: str, value: Any, default: bool) -> bool:
    """Return a truth value; None stands for `default`."""
    if value is None:
        return default
    try:
        return bool(value) if _is_truth(value) else operator.index(value) != 0
    except (TypeError, ValueError):  # no number; an array of more than one
        raise ParameterTypeError(f"{name} is {shown(value)}; True or False is wanted") from None


def shown(value: object) -> str:
    """Return an argument as an error message shows it: its repr, cut after 60 characters."""
    try:
        text = repr(value)
    except ValueError:  # an integer of more digits than Python prints
        text = f"{type(value).__name__} of thousands of digits"
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}…"


def _is_truth(value: Any) -> bool:
    return isinstance(value, bool) or getattr(value, "dtype", None) == np.bool_


def _index(value: Any) -> int:
    """Return an integer; `TypeError` for anything else, a truth value too, as in OpenCV."""
    if _is_truth(value):
        raise TypeError
    return operator.index(value)


def _downloaded(value: Any, refusal: type[Exception]) -> Any:
    """Return the array inside a `cv2.UMat`, or else `value` itself, without OpenCV; a masked array is refused."""
    if isinstance(value, np.ndarray) and hasattr(value, "mask"):
        raise refusal("a masked array came, whose mask would be lost; give its .filled(0)")
    return value.get() if type(value).__name__ == "UMat" else value
