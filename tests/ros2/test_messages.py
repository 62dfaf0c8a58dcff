"""ROS 2 messages built from arena data, compared with bytes and hashes that ROS 2 itself publishes."""

import io
import math
import struct
from typing import Any

import numpy as np
import pytest

from limo_hog.follow.robot import Twist
from limo_hog.follow.sense.observation import Odometry, Scan
from limo_hog.ros2 import messages
from limo_hog.ros2.senses import Senses, picture_of


def sent(message: Any) -> Any:
    """Return a message as it comes out of its bytes."""
    return messages.deserialize(messages.serialize(message), message.__msgtype__)


def xyz(vector: Any) -> tuple[float, float, float]:
    return vector.x, vector.y, vector.z


def test_a_twist_is_a_header_and_six_little_endian_doubles() -> None:
    message = messages.twist(Twist(0.2, -0.5))
    assert messages.serialize(message) == b"\x00\x01\x00\x00" + struct.pack("<6d", 0.2, 0, 0, 0, 0, -0.5)
    assert messages.to_twist(sent(message)) == Twist(0.2, -0.5)


def test_an_image_is_laid_out_as_cdr_says_and_half_of_one_refused() -> None:
    pixels = np.arange(12, dtype=np.uint8).reshape(2, 2, 3)
    data = messages.serialize(messages.image(1.5, pixels))
    frame, encoding = b"depth_link\0", b"bgr8\0"
    expected = struct.pack("<4xiII", 1, 500_000_000, len(frame)) + frame + b"\0"
    expected += struct.pack("<III", 2, 2, len(encoding)) + encoding + b"\0" + b"\0\0" + struct.pack("<II", 6, 12)
    assert data[4:] == expected[4:] + pixels.tobytes()
    with pytest.raises(messages.MessageError, match="sensor_msgs/msg/Image"):
        messages.deserialize(data[:40], "sensor_msgs/msg/Image")


@pytest.mark.parametrize(
    ("dtype", "shape", "encoding"),
    [
        ("uint8", (4, 5, 3), "bgr8"),
        ("uint8", (4, 5), "mono8"),
        ("uint16", (4, 5), "16UC1"),
        ("float32", (4, 5), "32FC1"),
        *(("float32", shape, "32FC1") for shape in ((0, 4), (4, 0), (0, 0))),
    ],
)
def test_pixels_come_back_as_they_went(dtype: str, shape: tuple[int, ...], encoding: str) -> None:
    pixels = np.random.default_rng(0).integers(0, 255, shape).astype(dtype)
    message = sent(messages.image(0.0, pixels))
    assert message.encoding == encoding
    np.testing.assert_array_equal(messages.pixels_of(message), pixels, strict=True)


def test_strided_views_padded_rows_and_big_endian_depth_are_read() -> None:
    pixels = np.random.default_rng(0).integers(0, 255, (6, 8, 3)).astype(np.uint8)[::2, ::-1]
    np.testing.assert_array_equal(messages.pixels_of(messages.image(0.0, pixels)), pixels)
    depth = np.array([[1.0, 2.5], [3.5, np.inf]], ">f4")
    message = messages.default_message("sensor_msgs/msg/Image")
    message.height, message.width, message.encoding, message.is_bigendian, message.step = 2, 2, "32FC1", 1, 11
    message.data = np.frombuffer(b"".join(row.tobytes() + b"pad" for row in depth), np.uint8)
    np.testing.assert_array_equal(messages.pixels_of(message), depth)


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [("encoding", "yuv422", "yuv422"), ("step", 3, "step 3"), ("height", 9, "bytes"), ("width", 10**9, "rows")],
)
def test_an_image_that_contradicts_itself_is_refused(field: str, value: object, said: str) -> None:
    message = messages.image(0.0, np.zeros((2, 4, 3), np.uint8))
    setattr(message, field, value)
    with pytest.raises(messages.MessageError, match=said):
        messages.pixels_of(message)


@pytest.mark.parametrize("pixels", [np.zeros((2, 2)), np.zeros((2, 2, 4), np.uint8), np.zeros(5, np.float32)])
def test_an_array_without_an_encoding_is_refused(pixels: np.ndarray) -> None:
    with pytest.raises(messages.MessageError, match="no encoding"):
        messages.image(0.0, pixels)


def test_a_scan_is_of_one_moment_and_comes_back_with_its_angles() -> None:
    message = messages.laser_scan(Scan(2.0, np.array([1.0, np.inf, 3.0], np.float32), -2.0, 2.0, 0.12, 8.0))
    assert (message.time_increment, message.scan_time, message.angle_increment) == (0.0, 0.125, 2.0)
    assert len(message.intensities) == 0
    back = messages.to_scan(sent(message))
    np.testing.assert_array_equal(back.ranges, message.ranges)
    assert (back.stamp, back.angle_min) == (2.0, -2.0)
    assert (back.angle_max, back.range_max) == pytest.approx((2.0, 8.0))


@pytest.mark.parametrize("yaw", [0.0, 0.4, -3.1, math.pi / 2])
def test_odometry_keeps_its_yaw_through_the_quaternion(yaw: float) -> None:
    message = sent(messages.odometry(Odometry(3.25, 1.0, -2.0, yaw, 0.2, -0.4)))
    back = messages.to_odometry(message)
    assert back.yaw == pytest.approx(yaw)
    assert (back.stamp, back.x, back.y, back.linear, back.angular) == (3.25, 1.0, -2.0, 0.2, -0.4)


def test_an_odometry_message_is_flat_on_the_floor_and_without_covariance() -> None:
    message = messages.odometry(Odometry(3.25, 1.0, -2.0, 0.4, 0.2, -0.4))
    pose, speed = message.pose.pose, message.twist.twist
    assert (xyz(pose.position), xyz(pose.orientation)[:2]) == ((1.0, -2.0, 0.0), (0.0, 0.0))
    assert (pose.orientation.z, pose.orientation.w) == pytest.approx((math.sin(0.2), math.cos(0.2)))
    assert (xyz(speed.linear), xyz(speed.angular)) == ((0.2, 0.0, 0.0), (0.0, 0.0, -0.4))
    assert not message.pose.covariance.any() and not message.twist.covariance.any()


def test_camera_info_is_the_pinhole_of_rep_104() -> None:
    info = messages.camera_info(1.0, 640, 480, 448.6)
    pinhole = np.array([[448.6, 0, 319.5], [0, 448.6, 239.5], [0, 0, 1]])
    np.testing.assert_array_equal(info.k.reshape(3, 3), pinhole)
    np.testing.assert_array_equal(info.r.reshape(3, 3), np.eye(3))
    np.testing.assert_array_equal(info.p.reshape(3, 4), np.column_stack([pinhole, np.zeros(3)]))
    assert (info.width, info.height, info.distortion_model, info.d.any()) == (640, 480, "plumb_bob", False)
    assert sent(info).roi == messages.default_message("sensor_msgs/msg/RegionOfInterest")


def test_a_jpeg_of_quality_90_looks_like_its_picture() -> None:
    pytest.importorskip("cv2")
    from PIL import Image
    from PIL.JpegImagePlugin import JpegImageFile

    message = messages.compressed_image(0.0, np.full((32, 48, 3), (200, 100, 50), np.uint8))
    assert "jpeg" in message.format
    with Image.open(io.BytesIO(message.data.tobytes())) as picture:
        assert isinstance(picture, JpegImageFile)
        # libjpeg divides the standard's table (ITU T.81, K.1), whose greatest number is 121, by 5 at quality 90.
        assert max(picture.quantization[0]) == (121 * (200 - 2 * 90) + 50) // 100
        assert np.abs(np.asarray(picture).astype(int) - (50, 100, 200)).max() < 6


def test_stamps_round_to_the_nearest_nanosecond() -> None:
    time = messages.to_time(0.1 + 0.2)
    assert (time.sec, time.nanosec) == (0, 300_000_000) and messages.to_time(1.9999999999).sec == 2


def test_every_message_has_the_hash_ros_2_jazzy_gives_it() -> None:
    # from the .json files of ROS 2 Jazzy's packages
    string, twist = map(messages.typestore().hash_rihs01, ("std_msgs/msg/String", "geometry_msgs/msg/Twist"))
    assert string == "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
    assert twist == "RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a"


def test_defaults_are_ros_defaults() -> None:
    message = messages.default_message("sensor_msgs/msg/Imu")
    assert (message.orientation.w, message.orientation.x) == (1.0, 0.0)
    assert message.orientation_covariance.shape == (9,)
    assert messages.default_message("sensor_msgs/msg/Image").encoding == ""
    assert messages.default_message("sensor_msgs/msg/JointState").name == []
    for name in messages.typestore().fielddefs:
        messages.serialize(messages.default_message(name))


PNG = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR"
JPEG = b"\xff\xd8\xff\xe0\0\4ab\xff\xff\xc0\0\x11\x08"
#: What else OpenCV would read, and refuses by raising: OpenEXR's magic number.
EXR = b"\x76\x2f\x31\x01\2\0\0\0"
NO_PICTURES = (b"", b"no picture", b"\xff\xd8\xff", EXR, PNG + struct.pack(">II", 9, 9))
TOO_BIG = "^a compressed image of {0}x{0}: want 67108864 pixels at most$"


@pytest.mark.parametrize(
    ("data", "told"),
    [
        *((PNG + struct.pack(">II105x", side, side), TOO_BIG.format(side)) for side in (65536, 30000)),
        *((JPEG + struct.pack(">HH100x", side, side), TOO_BIG.format(side)) for side in (65535, 30000)),
        *((data, f"^{len(data)} bytes of 'jpeg' are no picture: want a JPEG or PNG$") for data in NO_PICTURES),
    ],
)
def test_compressed_data_too_big_for_a_camera_or_no_picture_are_refused(data: bytes, told: str) -> None:
    pytest.importorskip("cv2")
    message = messages.default_message("sensor_msgs/msg/CompressedImage")
    message.format, message.data = "jpeg", np.frombuffer(data, np.uint8)
    with pytest.raises(messages.MessageError, match=told):
        messages.decompressed(message)


def test_an_imu_sample_says_that_it_has_no_orientation() -> None:
    message = messages.imu(2.5, (0.1, 0.2, 0.3), (1.0, 2.0, 9.8))
    # REP 145: -1 in the first element of the covariance
    assert message.orientation_covariance.tolist() == [-1.0] + 8 * [0.0]
    assert (xyz(message.angular_velocity), xyz(message.linear_acceleration)) == ((0.1, 0.2, 0.3), (1.0, 2.0, 9.8))
    assert (message.header.frame_id, *xyz(message.orientation), message.orientation.w) == ("imu_link", 0, 0, 0, 1)
    assert sent(message).header.stamp.sec == 2


@pytest.mark.parametrize("encoding", "bgr8 rgb8 8UC3 bgra8 rgba8 8UC4 mono8 8UC1 mono16 yuv422_yuy2 yuyv".split())
def test_a_camera_image_is_read_in_every_encoding_of_drivers(encoding: str) -> None:
    colour = np.full((4, 6, 3), (200, 100, 50), np.uint8)
    gray = np.full((4, 6), 180, np.uint8)
    wanted = gray[..., None] if encoding in ("mono8", "8UC1", "mono16") else colour
    # By ITU-R BT.601, as cameras have it: brightness, then blue or red.
    yuyv = np.tile(np.array([[99, 179], [99, 99]], np.uint8), (4, 3, 1))
    pixels = {
        **dict.fromkeys(("bgr8", "8UC3"), colour),
        "rgb8": colour[..., ::-1],
        **dict.fromkeys(("bgra8", "8UC4"), np.dstack([colour, gray])),
        "rgba8": np.dstack([colour[..., ::-1], gray]),
        **dict.fromkeys(("mono8", "8UC1"), gray),
        "mono16": gray.astype(np.uint16) * 257,
    }.get(encoding, yuyv)
    message = messages.image(0.0, colour)
    message.encoding, message.data = encoding, np.ascontiguousarray(pixels).view(np.uint8).reshape(-1)
    message.step = len(message.data) // 4
    picture = picture_of(message)
    assert (str(picture.dtype), picture.shape, picture.flags.c_contiguous) == ("uint8", (4, 6, 3), True)
    assert np.abs(picture.astype(int) - wanted).max() <= 3


def test_an_encoding_that_no_camera_or_depth_image_has_is_named() -> None:
    with pytest.raises(messages.MessageError, match="camera image in '32FC1' is not read: want bgr8, rgb8, bgra8"):
        picture_of(messages.image(0.0, np.zeros((4, 6), np.float32)))
    with pytest.raises(messages.MessageError, match="depth image of 'bgr8' is not read: want 32FC1 or 16UC1"):
        Senses().take(messages.image(0.0, np.zeros((4, 6, 3), np.uint8)))
