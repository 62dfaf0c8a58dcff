"""A class with two timers, in the style of the official publisher tutorial."""

import rclpy
from geometry_msgs.msg import TwistStamped
from rclpy.node import Node
from std_msgs.msg import String


class MinimalPublisher(Node):
    def __init__(self):
        super().__init__("minimal_publisher")
        self.publisher_ = self.create_publisher(String, "topic", 10)
        self.cmd = self.create_publisher(TwistStamped, "cmd_vel", 10)
        self.timer = self.create_timer(0.5, self.timer_callback)
        self.drive_timer = self.create_timer(0.1, self.drive)
        self.i = 0

    def timer_callback(self):
        msg = String()
        msg.data = "Hello World: %d" % self.i
        self.publisher_.publish(msg)
        self.get_logger().info('Publishing: "%s"' % msg.data)
        self.i += 1

    def drive(self):
        msg = TwistStamped()
        msg.header.stamp = self.get_clock().now().to_msg()
        msg.header.frame_id = "base_link"
        msg.twist.linear.x = 0.2
        self.cmd.publish(msg)


def main(args=None):
    with rclpy.init(args=args):
        rclpy.spin(MinimalPublisher())


if __name__ == "__main__":
    main()
