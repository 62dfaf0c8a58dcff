"""Colour and depth together, with image_geometry: how far away, and at what angle, is the middle of the picture?"""

import math

import message_filters
import numpy as np
import rclpy
from cv_bridge import CvBridge
from geometry_msgs.msg import TwistStamped
from image_geometry import PinholeCameraModel
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, Image


class Synchronised(Node):
    def __init__(self):
        super().__init__("synchronised")
        self.bridge = CvBridge()
        self.model = PinholeCameraModel()
        rgb = message_filters.Subscriber(self, Image, "/limo_camera/image", qos_profile=qos_profile_sensor_data)
        depth = message_filters.Subscriber(self, Image, "/limo_camera/depth/image_raw")
        info = message_filters.Subscriber(self, CameraInfo, "/limo_camera/depth/camera_info")
        self.sync = message_filters.ApproximateTimeSynchronizer([rgb, depth, info], queue_size=10, slop=0.05)
        self.sync.registerCallback(self.on_images)
        self.pub = self.create_publisher(TwistStamped, "/cmd_vel", 10)

    def on_images(self, rgb, depth, info):
        self.model.fromCameraInfo(info)
        metres = self.bridge.imgmsg_to_cv2(depth, desired_encoding="passthrough")
        near = np.unravel_index(np.nanargmin(metres[:200]), metres[:200].shape)
        ray = self.model.projectPixelTo3dRay((float(near[1]), float(near[0])))
        bearing = -math.atan2(ray[0], ray[2])
        self.get_logger().info(f"{rgb.encoding} nearest {metres[near]:.1f} m at {bearing:+.2f} rad", once=True)
        twist = TwistStamped(header=rgb.header)
        twist.twist.angular.z = 1.0 * bearing
        self.pub.publish(twist)


def main():
    with rclpy.init():
        rclpy.spin(Synchronised())


if __name__ == "__main__":
    main()
