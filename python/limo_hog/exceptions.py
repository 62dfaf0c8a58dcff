"""The named errors of limo-hog. Each message names what came and what is wanted."""

from __future__ import annotations


class LimoHogError(Exception):
    """Base of all errors of limo-hog; the message is one line."""


class HogError(LimoHogError, ValueError):
    """Base of the detector's errors."""


class GeometryError(HogError):
    """Window, block, stride and cell sizes do not fit together, or bins or levels are out of range."""


class DetectorSizeError(HogError):
    """The SVM has not one coefficient per descriptor element (and perhaps a bias after them)."""


class ImageError(HogError):
    """The array is not an image the detector reads: uint8, (H, W), (H, W, 1) or (H, W, 3), not empty."""


class ImageTypeError(ImageError, TypeError):
    """The image is no array, or its elements are not uint8."""


class ParameterError(HogError):
    """A search parameter is out of its range."""


class ParameterTypeError(ParameterError, TypeError):
    """A search parameter is of the wrong type."""


class ModelFormatError(HogError):
    """A model file is not one of OpenCV's HOG files."""


class ModelFileError(OSError, HogError):
    """A model file cannot be read."""


class ModelMissingError(ModelFileError, FileNotFoundError):
    """There is no model file of that name."""


class BackendError(HogError):
    """The instruction set asked for is unknown, or this CPU lacks it."""
