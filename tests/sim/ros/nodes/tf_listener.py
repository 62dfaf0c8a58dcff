"""The official tf2 listener tutorial: a broadcaster names a goal, a listener drives to it."""

import math

import rclpy
from geometry_msgs.msg import PointStamped, TransformStamped, Twist
from rclpy.duration import Duration
from rclpy.node import Node
from tf2_ros import TransformException
from tf2_ros.buffer import Buffer
from tf2_ros.static_transform_broadcaster import StaticTransformBroadcaster
from tf2_ros.transform_listener import TransformListener
from tf_transformations import euler_from_quaternion, quaternion_from_euler


class FrameListener(Node):
    def __init__(self):
        super().__init__("frame_listener")
        self.target_frame = self.declare_parameter("target_frame", "goal").get_parameter_value().string_value
        self.tf_static_broadcaster = StaticTransformBroadcaster(self)
        self.make_transforms()
        self.tf_buffer = Buffer()
        self.tf_listener = TransformListener(self.tf_buffer, self)
        self.publisher = self.create_publisher(Twist, "cmd_vel", 1)
        self.timer = self.create_timer(0.1, self.on_timer)

    def make_transforms(self):
        t = TransformStamped()
        t.header.stamp = self.get_clock().now().to_msg()
        t.header.frame_id = "odom"
        t.child_frame_id = "goal"
        t.transform.translation.x = 1.0
        t.transform.translation.y = 0.5
        quat = quaternion_from_euler(0.0, 0.0, 1.57)
        t.transform.rotation.x, t.transform.rotation.y, t.transform.rotation.z, t.transform.rotation.w = quat
        self.tf_static_broadcaster.sendTransform(t)

    def on_timer(self):
        try:
            t = self.tf_buffer.lookup_transform("base_link", self.target_frame, rclpy.time.Time())
        except TransformException as ex:
            self.get_logger().info(f"Could not transform: {ex}", once=True)
            self.publisher.publish(Twist())
            return
        place = t.transform.translation
        distance = math.hypot(place.x, place.y)
        msg = Twist()
        msg.angular.z = 2.0 * math.atan2(place.y, place.x) if distance > 0.1 else 0.0
        msg.linear.x = min(0.5 * distance, 0.4)
        self.publisher.publish(msg)
        if distance < 0.1:
            point = PointStamped()
            point.header.frame_id = "laser_link"
            point.header.stamp = t.header.stamp
            point.point.x = 1.0
            seen = self.tf_buffer.transform(point, "odom", timeout=Duration(seconds=0.0))
            q = self.tf_buffer.lookup_transform("odom", "base_link", rclpy.time.Time()).transform.rotation
            yaw = euler_from_quaternion([q.x, q.y, q.z, q.w])[2]
            ahead = math.hypot(seen.point.x - 1.0, seen.point.y - 0.5)
            self.get_logger().info(f"arrived; 1 m before the lidar is {ahead:.1f} m away, yaw {yaw:.1f}", once=True)


def main():
    rclpy.init()
    node = FrameListener()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    rclpy.shutdown()


if __name__ == "__main__":
    main()
