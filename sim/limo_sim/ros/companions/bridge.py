"""cv_bridge: images between messages and numpy arrays."""

from __future__ import annotations

import array
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from limo_hog.extras import needed
from limo_hog.ros2.messages import ENCODINGS, MessageError, decompressed, pixels_of
from limo_sim.ros.interfaces import Message, message_class

with needed(by="cv_bridge"):
    import cv2


class CvBridgeError(TypeError):
    """An image cannot be converted."""


#: Colour conversions, by the order of the channels.
_COLOURS = {"bgr8": "BGR", "rgb8": "RGB", "bgra8": "BGRA", "rgba8": "RGBA", "mono8": "GRAY", "mono16": "GRAY"}


class CvBridge:
    """Converts images."""

    def imgmsg_to_cv2(self, img_msg: Any, desired_encoding: str = "passthrough") -> NDArray[Any]:
        """Return an Image's pixels, (H, W) or (H, W, channels), the caller's own.

        Raises `CvBridgeError` if the message is inconsistent or its encoding cannot become the desired one.
        """
        pixels = _read(pixels_of, img_msg, "sensor_msgs/msg/Image").copy()
        return _converted(pixels, img_msg.encoding, desired_encoding)

    def compressed_imgmsg_to_cv2(self, cmprs_img_msg: Any, desired_encoding: str = "passthrough") -> NDArray[Any]:
        """Return a CompressedImage's pixels, BGR."""
        pixels = _read(decompressed, cmprs_img_msg, "sensor_msgs/msg/CompressedImage")
        return _converted(pixels, "bgr8" if pixels.ndim == 3 else "mono8", desired_encoding)

    def cv2_to_imgmsg(self, cvim: Any, encoding: str = "passthrough", header: Any = None) -> Message:
        """Return an array as an Image."""
        if not isinstance(cvim, np.ndarray):
            raise TypeError(f"want a numpy array, came {type(cvim).__name__}")
        channels = cvim.shape[2] if cvim.ndim == 3 else 1
        depth = {"uint8": "8U", "uint16": "16U", "float32": "32F"}.get(cvim.dtype.name)
        plain = f"{depth}C{channels}"
        if cvim.ndim not in (2, 3) or plain not in ENCODINGS:
            raise CvBridgeError(f"an array of {cvim.dtype} {cvim.shape} is no image that is sent")
        if encoding == "passthrough":
            encoding = plain
        elif ENCODINGS.get(encoding) != ENCODINGS[plain]:
            raise CvBridgeError(f"encoding {encoding} does not hold an array of {plain}")
        cvim = np.ascontiguousarray(cvim)
        message: Any = message_class("sensor_msgs/msg/Image")()
        if header is not None:
            message.header = header
        message.height, message.width = cvim.shape[:2]
        message.encoding = encoding
        message.step = len(cvim.tobytes()) // max(cvim.shape[0], 1)
        message.data = array.array("B", cvim.tobytes())
        return message  # type: ignore[no-any-return]

    def cv2_to_compressed_imgmsg(self, cvim: NDArray[Any], dst_format: str = "jpg") -> Message:
        """Return an array as a CompressedImage."""
        ok, data = cv2.imencode(f".{dst_format}", cvim)
        if not ok:
            raise CvBridgeError(f"{cvim.dtype} {cvim.shape} cannot be written as {dst_format}")
        message: Any = message_class("sensor_msgs/msg/CompressedImage")()
        message.format = dst_format
        message.data = array.array("B", data.tobytes())
        return message  # type: ignore[no-any-return]


def _read(pixels: Callable[[Any], NDArray[Any]], message: Any, type_name: str) -> NDArray[Any]:
    if not isinstance(message, message_class(type_name)):
        raise TypeError(f"want a {type_name}, came {type(message).__name__}")
    try:
        return pixels(message)
    except MessageError as error:
        raise CvBridgeError(str(error)) from error


def _converted(pixels: NDArray[Any], encoding: str, desired: str) -> NDArray[Any]:
    if desired in ("passthrough", "", encoding):
        return pixels
    if desired not in ENCODINGS:
        raise CvBridgeError(f"unknown encoding {desired!r}; known are {', '.join(ENCODINGS)}")
    if ENCODINGS[desired] == ENCODINGS[encoding] and not {encoding, desired} <= set(_COLOURS):
        # as 8UC3 and bgr8: the same bytes under another name
        return pixels
    if encoding not in _COLOURS or desired not in _COLOURS:
        raise CvBridgeError(f"[{encoding}] cannot be converted to [{desired}]")
    if _COLOURS[encoding] != _COLOURS[desired]:
        pixels = cv2.cvtColor(pixels, getattr(cv2, f"COLOR_{_COLOURS[encoding]}2{_COLOURS[desired]}"))
    wanted = ENCODINGS[desired][0]
    if pixels.dtype == wanted:
        return pixels
    return (pixels // 257).astype(wanted) if wanted == np.uint8 else pixels.astype(wanted) * 257
