"""ROS 2 messages from the follower's own types, and back; definitions and CDR bytes are rosbags'.

The messages built here have not changed between ROS 2 Humble and Jazzy. Stamps are seconds since the arena's start
or since 1970, as the clock that took them; frames are the Limo's: x forward, y left, z up, metres and radians, but
`depth_link`, which Gazebo's camera uses for images, carries optical data (X right, Y down, Z forward).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore
from rosbags.typesys.stores.ros2_humble import builtin_interfaces__msg__Time as Time

from limo_hog.exceptions import LimoHogError
from limo_hog.extras import needed
from limo_hog.follow.robot import Twist
from limo_hog.follow.sense.observation import Odometry, Scan
from limo_hog.imaging.headers import picture_size

CAMERA_FRAME = "depth_link"
#: Compressed images of more are not decoded: 8 bytes for each are taken meanwhile. Chosen: twice a camera of 8K.
MOST_PIXELS = 2**26
LIDAR_FRAME = "laser_link"
IMU_FRAME = "imu_link"
ODOMETRY_FRAME = "odom"
BASE_FRAME = "base_link"

#: Encodings of sensor_msgs/Image that are read and written: element type and channels.
ENCODINGS: dict[str, tuple[type[np.generic], int]] = {
    "mono8": (np.uint8, 1),
    "8UC1": (np.uint8, 1),
    "bgr8": (np.uint8, 3),
    "rgb8": (np.uint8, 3),
    "8UC3": (np.uint8, 3),
    "bgra8": (np.uint8, 4),
    "rgba8": (np.uint8, 4),
    "8UC4": (np.uint8, 4),
    "mono16": (np.uint16, 1),
    "16UC1": (np.uint16, 1),
    "32FC1": (np.float32, 1),
    # Brightness, then blue or red in turn; one of its names is new.
    "yuv422_yuy2": (np.uint8, 2),
    "yuyv": (np.uint8, 2),
}


class MessageError(LimoHogError):
    """A message does not hold what its fields say."""


@cache
def typestore() -> Typestore:
    """Return the message definitions."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    # What rosbags does not bring along, written as recordings hold it.
    text = Path(__file__).with_name("definitions.msg").read_text(encoding="utf-8")
    for definition in text.split(f"{'=' * 80}\nMSG: ")[1:]:
        name, _, fields = definition.partition("\n")
        store.register(get_types_from_msg(fields, name.replace("/", "/msg/")))
    return store


def serialize(message: Any) -> bytes:
    """Return a message's CDR bytes, little endian, with the four bytes that say so in front."""
    return bytes(typestore().serialize_cdr(message, message.__msgtype__))


def deserialize(data: bytes | memoryview, type_name: str) -> Any:
    """Read a message from its CDR bytes; raises `MessageError` where the bytes are no such message."""
    try:
        return typestore().deserialize_cdr(data, type_name)
    except Exception as error:  # rosbags raises whatever struct, numpy or its own checks raise
        raise MessageError(f"{len(data)} bytes are no {type_name}: {error}") from error


@dataclass(frozen=True, slots=True)
class Field:
    """A field of a message, as its definition says."""

    name: str
    item: str  #: What it holds, alone or several times: "float64", "string", or a type as "geometry_msgs/msg/Point".
    is_message: bool  #: Whether `item` is a message.
    length: int | None  #: Of an array of fixed length; 0 for a sequence, None for a single item.
    zero: Any  #: What a single item is by default; None for a message.
    is_numeric: bool  #: Whether the items are numbers, which lie in one numpy array.


@cache
def fields_of(type_name: str) -> tuple[Field, ...]:
    """Return the fields of a message type."""
    fields = []
    definition: Any = typestore().fielddefs[type_name][1]
    for name, (kind, of) in definition:
        length = {Nodetype.ARRAY: of[1], Nodetype.SEQUENCE: 0}.get(kind)
        item_kind, item = (kind, of) if length is None else of[0]
        if item_kind == Nodetype.NAME:
            fields.append(Field(name, item, True, length, None, False))
            continue
        zero = {"string": "", "wstring": "", "bool": False}.get(item[0], 0.0 if item[0].startswith("float") else 0)
        if (type_name, name) == ("geometry_msgs/msg/Quaternion", "w"):
            zero = 1.0
        fields.append(Field(name, item[0], False, length, zero, item[0] not in ("string", "wstring", "bool")))
    return tuple(fields)


def default_message(type_name: str) -> Any:
    """Return a message with ROS's defaults: zeros, empty strings and sequences, and a quaternion's w of 1."""
    values = {}
    for field in fields_of(type_name):
        # Most fields are plain: a call for each would be 11 more a frame.
        plain = field.length is None and not field.is_message
        values[field.name] = field.zero if plain else _default(field)
    return typestore().types[type_name](**values)


def _default(field: Field) -> Any:
    if field.length is None:
        return default_message(field.item)
    if field.is_message:
        return [default_message(field.item) for _ in range(field.length)]
    return [""] * field.length if field.zero == "" else np.zeros(field.length, element_type(field.item))


def element_type(base: str) -> np.dtype[Any]:
    """Return the numpy type of a message's elementary number; ROS's char and byte are octets."""
    return np.dtype(np.uint8 if base in ("char", "byte", "octet") else base)


def to_time(stamp: float) -> Time:
    """Split seconds into whole seconds and nanoseconds."""
    nanoseconds = round(stamp * 1e9)
    return Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)


def type_of(message: Any) -> str:
    """Return the ROS type of a message, one of ours or of rclpy's."""
    kind = type(message)
    return getattr(message, "__msgtype__", None) or f"{kind.__module__.partition('.')[0]}/msg/{kind.__name__}"


def to_seconds(time: Any) -> float:
    """Return a stamp in seconds."""
    return cast(float, time.sec + time.nanosec * 1e-9)


def stamped(type_name: str, stamp: float, frame: str) -> Any:
    """Return a message with ROS's defaults, but for the time [s] and the frame in its header."""
    message = default_message(type_name)
    message.header.stamp, message.header.frame_id = to_time(stamp), frame
    return message


def image(stamp: float, pixels: NDArray[Any], frame: str = CAMERA_FRAME) -> Any:
    """Return an image: uint8 (H, W, 3) is bgr8, uint8 (H, W) mono8, uint16 (H, W) 16UC1 [mm], float32 (H, W) 32FC1 [m].

    Raises `MessageError` where the array is none of these.
    """
    kinds = {("uint8", 3): "bgr8", ("uint8", 2): "mono8", ("uint16", 2): "16UC1", ("float32", 2): "32FC1"}
    encoding = kinds.get((pixels.dtype.name, pixels.ndim))
    if encoding is None or (encoding == "bgr8" and pixels.shape[2] != 3):
        raise MessageError(
            f"an image of {pixels.dtype} {pixels.shape} has no encoding: give uint8 (H, W, 3) or (H, W), "
            "uint16 (H, W) or float32 (H, W)"
        )
    pixels = np.ascontiguousarray(pixels)
    message = stamped("sensor_msgs/msg/Image", stamp, frame)
    message.height, message.width, message.encoding = *pixels.shape[:2], encoding
    message.step = math.prod(pixels.shape[1:]) * pixels.itemsize
    message.data = pixels.view(np.uint8).reshape(-1)
    return message


def pixels_of(message: Any) -> NDArray[Any]:
    """Return an Image's pixels as its encoding says: (H, W) or (H, W, channels), a view where that can be.

    Raises `MessageError` where the encoding is unknown, or `step` or `data` do not fit the size.
    """
    if message.encoding not in ENCODINGS:
        raise MessageError(f"image encoding {message.encoding!r} is not read; known are {', '.join(ENCODINGS)}")
    kind, channels = ENCODINGS[message.encoding]
    dtype = np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<")
    row = message.width * channels * dtype.itemsize
    data = np.frombuffer(message.data, np.uint8)
    if message.step < row or len(data) < message.step * message.height:
        raise MessageError(
            f"an image of {message.width}x{message.height} {message.encoding} needs rows of {row} bytes; "
            f"came step {message.step} and {len(data)} bytes"
        )
    rows = data[: message.step * message.height].reshape(message.height, message.step)[:, :row]
    shape = (message.height, message.width) + ((channels,) if channels > 1 else ())
    # A padded row cannot be viewed as wider elements.
    pixels: NDArray[Any] = np.ascontiguousarray(rows).view(dtype).reshape(shape)
    return pixels


def compressed_image(stamp: float, pixels: NDArray[np.uint8]) -> Any:
    """Return a JPEG of uint8 (H, W, 3) BGR, as image_transport's "compressed" topics carry; needs OpenCV."""
    from limo_hog.imaging.writing import jpeg  # imported here: other messages need no OpenCV

    message = stamped("sensor_msgs/msg/CompressedImage", stamp, CAMERA_FRAME)
    message.format, message.data = "bgr8; jpeg compressed bgr8", np.frombuffer(jpeg(pixels, 90), np.uint8)
    return message


def decompressed(message: Any) -> NDArray[np.uint8]:
    """Return a CompressedImage's pixels, uint8 (H, W, 3) BGR or (H, W) gray; needs OpenCV.

    Raises `MessageError` where the data are no JPEG or PNG, or one of more than `MOST_PIXELS`.
    """
    with needed(by="a compressed image"):
        import cv2
    data = np.frombuffer(message.data, np.uint8)
    width, height = picture_size(data.tobytes()) or (0, 0)
    if width * height > MOST_PIXELS:
        raise MessageError(f"a compressed image of {width}x{height}: want {MOST_PIXELS} pixels at most")
    try:
        pixels = cv2.imdecode(data, cv2.IMREAD_ANYCOLOR) if width * height else None
    except cv2.error:  # OpenCV refuses some by raising, most by None
        pixels = None
    if pixels is None:
        raise MessageError(f"{data.size} bytes of {message.format!r} are no picture: want a JPEG or PNG")
    return pixels.astype(np.uint8, copy=False)


def camera_info(
    stamp: float, width: int, height: int, focal_px: float, distortion: tuple[float, float] = (0.0, 0.0)
) -> Any:
    """Return the calibration of a camera whose principal point is the image centre; `distortion`: k1 and k2."""
    cx, cy = (width - 1) / 2, (height - 1) / 2
    message = stamped("sensor_msgs/msg/CameraInfo", stamp, CAMERA_FRAME)
    message.height, message.width, message.distortion_model = height, width, "plumb_bob"
    message.d = np.array([*distortion, 0.0, 0.0, 0.0])
    message.k = np.array([focal_px, 0, cx, 0, focal_px, cy, 0, 0, 1.0])
    message.r = np.eye(3).reshape(-1)
    message.p = np.array([focal_px, 0, cx, 0, 0, focal_px, cy, 0, 0, 0, 1.0, 0])
    return message


def laser_scan(scan: Scan, period: float = 0.125) -> Any:
    """Return a scan; `period` is the time between two of them [s]."""
    message = stamped("sensor_msgs/msg/LaserScan", scan.stamp, LIDAR_FRAME)
    message.angle_min, message.angle_max = scan.angle_min, scan.angle_max
    message.angle_increment = (scan.angle_max - scan.angle_min) / max(len(scan.ranges) - 1, 1)
    message.scan_time, message.range_min, message.range_max = period, scan.range_min, scan.range_max
    message.ranges = np.ascontiguousarray(scan.ranges, np.float32)
    return message


def to_scan(message: Any) -> Scan:
    """Read a LaserScan."""
    ranges = np.asarray(message.ranges, np.float32)
    return Scan(
        stamp=to_seconds(message.header.stamp),
        ranges=ranges,
        angle_min=float(message.angle_min),
        angle_max=float(message.angle_min + message.angle_increment * max(len(ranges) - 1, 0)),
        range_min=float(message.range_min),
        range_max=float(message.range_max),
    )


def odometry(reading: Odometry) -> Any:
    """Return an odometry message: pose in `odom`, speeds in `base_link`, covariances unknown (zero)."""
    message = stamped("nav_msgs/msg/Odometry", reading.stamp, ODOMETRY_FRAME)
    message.child_frame_id = BASE_FRAME
    pose = message.pose.pose
    pose.position.x, pose.position.y = reading.x, reading.y
    pose.orientation.z, pose.orientation.w = math.sin(reading.yaw / 2), math.cos(reading.yaw / 2)
    message.twist.twist = twist(Twist(reading.linear, reading.angular))
    return message


def to_odometry(message: Any) -> Odometry:
    """Read an Odometry: the yaw of its orientation, -pi … pi."""
    pose, speed = message.pose.pose, message.twist.twist
    q = pose.orientation
    return Odometry(
        stamp=to_seconds(message.header.stamp),
        x=float(pose.position.x),
        y=float(pose.position.y),
        yaw=math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z)),
        linear=float(speed.linear.x),
        angular=float(speed.angular.z),
    )


def imu(stamp: float, angular_velocity: tuple[float, float, float], acceleration: tuple[float, float, float]) -> Any:
    """Return an IMU sample: rates [rad/s], accelerations with gravity's reaction [m/s²], no orientation."""
    message = stamped("sensor_msgs/msg/Imu", stamp, IMU_FRAME)
    # ROS's way to say that there is none
    message.orientation_covariance[0] = -1.0
    rates, accelerations = message.angular_velocity, message.linear_acceleration
    rates.x, rates.y, rates.z = angular_velocity
    accelerations.x, accelerations.y, accelerations.z = acceleration
    return message


def twist(command: Twist) -> Any:
    """Return a velocity command."""
    message = default_message("geometry_msgs/msg/Twist")
    message.linear.x, message.angular.z = float(command.linear), float(command.angular)
    return message


def to_twist(message: Any) -> Twist:
    """Read a velocity command, with a stamp or without: a differential drive knows x and yaw alone."""
    command = getattr(message, "twist", message)
    return Twist(float(command.linear.x), float(command.angular.z))


def clock(stamp: float) -> Any:
    """Return the arena's time."""
    message = default_message("rosgraph_msgs/msg/Clock")
    message.clock = to_time(stamp)
    return message
