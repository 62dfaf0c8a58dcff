"""The workshop's topics: names and types."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from limo_hog.ros2.arguments import NodeNames

IMAGE = "/limo_camera/image"
IMAGE_COMPRESSED = "/limo_camera/image/compressed"
DEPTH = "/limo_camera/depth/image_raw"
#: The name the LCAS/limo_ros2 model gives to the same depth image.
DEPTH_LCAS = "/limo_camera/depth/camera_image_depth"
CAMERA_INFO = "/limo_camera/camera_info"
DEPTH_INFO = "/limo_camera/depth/camera_info"
ANNOTATED = "/limo_camera/image_annotated"
SCAN = "/scan"
ODOMETRY = "/odom"
IMU = "/imu"
COMMAND = "/cmd_vel"
CLOCK = "/clock"
TF = "/tf"
TF_STATIC = "/tf_static"

TYPES = {
    IMAGE: "sensor_msgs/msg/Image",
    IMAGE_COMPRESSED: "sensor_msgs/msg/CompressedImage",
    DEPTH: "sensor_msgs/msg/Image",
    DEPTH_LCAS: "sensor_msgs/msg/Image",
    CAMERA_INFO: "sensor_msgs/msg/CameraInfo",
    DEPTH_INFO: "sensor_msgs/msg/CameraInfo",
    ANNOTATED: "sensor_msgs/msg/Image",
    SCAN: "sensor_msgs/msg/LaserScan",
    ODOMETRY: "nav_msgs/msg/Odometry",
    IMU: "sensor_msgs/msg/Imu",
    COMMAND: "geometry_msgs/msg/Twist",
    CLOCK: "rosgraph_msgs/msg/Clock",
    TF: "tf2_msgs/msg/TFMessage",
    TF_STATIC: "tf2_msgs/msg/TFMessage",
}

#: Whom to follow, as `Follower.follow` takes it: "left", or the number that `PEOPLE` has as a name.
ASKED = "/follow_person"
ASKED_TYPE = "std_msgs/msg/String"

PERSON = "/followed_person"
DETECTIONS = "/detections"
PEOPLE = "/people"
DETECTIONS_TYPE = "vision_msgs/msg/Detection2DArray"

#: What the follower finds, beside its commands.
FINDINGS = {
    PERSON: "geometry_msgs/msg/PoseStamped",
    DETECTIONS: DETECTIONS_TYPE,
    PEOPLE: "people_msgs/msg/People",
}

#: What else drives a robot by `COMMAND`: from ROS 2 Jazzy on many expect a stamp.
STAMPED_COMMAND_TYPE = "geometry_msgs/msg/TwistStamped"

#: Topics that ROS 2 keeps outside of namespaces.
_ABSOLUTE = (CLOCK, TF, TF_STATIC)


def resolved(node: NodeNames, topic: str) -> str:
    """Return the name that one of the workshop's topics has for a node.

    As by image_transport's convention, compressed images are below the raw ones, and the camera's calibration beside
    them, unless they are renamed themselves.
    """
    own = topic if topic in _ABSOLUTE else topic.lstrip("/")
    moved = node.remap(own)
    if moved is None and topic == IMAGE_COMPRESSED:
        return f"{resolved(node, IMAGE)}/compressed"
    if moved is None and topic == CAMERA_INFO:
        return f"{resolved(node, IMAGE).rpartition('/')[0]}/camera_info"
    return moved or node.expand(own)
