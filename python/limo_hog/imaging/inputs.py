"""A picture as users have it, the name of a file or a PIL image, as the array that the detector reads."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from limo_hog.cv2_api.arguments import shown
from limo_hog.exceptions import ImageError, ImageTypeError
from limo_hog.extras import MissingExtraError

if TYPE_CHECKING:
    from PIL.Image import Image as PilImage


def as_array(image: Any) -> Any:
    """Return the pixels of a file's name or of a PIL image, uint8 (H, W, 3) BGR or gray (H, W); anything else as it is.

    Files are decoded by OpenCV, or where there is none by Pillow, and turned as their EXIF data say. Raises
    `ImageError` or `ImageTypeError` where the file is no picture, or the PIL image has no 8 bits a channel;
    `MissingExtraError` where neither OpenCV nor Pillow is installed; `OSError` where the file cannot be read.
    """
    if isinstance(image, (str, os.PathLike)):
        if not os.fspath(image):
            raise ImageError("the name of the picture is empty; a file's name is wanted")
        try:
            return _read(Path(image))
        except ValueError as error:
            if isinstance(error, ImageError):
                raise
            raise ImageError(f"{shown(image)} is no file's name: {error}") from error
    # Who has a PIL image has imported PIL.
    pil = sys.modules.get("PIL.Image")
    return _of_pil(image) if pil is not None and isinstance(image, pil.Image) else image


def _read(path: Path) -> NDArray[np.uint8]:
    try:
        from limo_hog.imaging.reading import Kind, Source, read_image
    except MissingExtraError:
        return _read_with_pillow(path)
    return read_image(Source(str(path), path, Kind.IMAGE))


def _read_with_pillow(path: Path) -> NDArray[np.uint8]:
    try:
        from PIL import Image, ImageOps, UnidentifiedImageError
    except ModuleNotFoundError as error:
        raise MissingExtraError("reading pictures needs OpenCV or Pillow: pip install 'limo-hog[cv]'") from error
    try:
        with Image.open(path) as image:
            return _of_pil(ImageOps.exif_transpose(image).convert("RGB"))
    except (UnidentifiedImageError, Image.DecompressionBombError) as error:
        raise ImageError(f"{path}: not an image that Pillow can read") from error


def _of_pil(image: PilImage) -> NDArray[np.uint8]:
    if image.mode.startswith(("I", "F")):
        raise ImageTypeError(f"the PIL image is of mode {image.mode}; 8 bits a channel are wanted, such as RGB or L")
    if image.mode in ("1", "L"):
        return np.array(image.convert("L"))
    # Blue first, as OpenCV reads it.
    return np.ascontiguousarray(np.asarray(image.convert("RGB"))[..., ::-1])
