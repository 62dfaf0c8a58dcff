"""Follow a person with ROS 2's own rclpy: topics, quality of service and limits are yours to change.

python rclpy_follower.py --ros-args -p robot:=robot.toml -r scan:=scan_filtered -p reliable:=true
"""

import re
import time

import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, Image, LaserScan

from limo_hog import PeopleDetector
from limo_hog.follow import Follower, TrackingController, load_robot
from limo_hog.ros2.senses import Senses, picture_of, stamp_of

rclpy.init(signal_handler_options=rclpy.SignalHandlerOptions.NO)
node = rclpy.create_node("person_follower")
robot = load_robot(node.declare_parameter("robot", "robot.toml").value)
senses, follower = Senses(robot), Follower(TrackingController(), PeopleDetector(), robot)
commands, frames, reason = node.create_publisher(Twist, "cmd_vel", 10), [None], ""
quality = 10 if node.declare_parameter("reliable", False).value else qos_profile_sensor_data
for topic, kind in {"camera_info": CameraInfo, "depth": Image, "scan": LaserScan, "odom": Odometry}.items():
    node.create_subscription(kind, topic, senses.take, quality)
see = lambda message: frames.append(senses.frame(stamp_of(message), picture_of(message)))  # noqa: E731
node.create_subscription(Image, "image", see, quality)
try:
    while True:
        rclpy.spin_once(node, timeout_sec=0.05)
        del frames[:-1]
        if log := follower.tick(time.monotonic(), frames[-1], senses.sensors):
            command = Twist()
            command.linear.x, command.angular.z = log.decision.twist.linear, log.decision.twist.angular
            commands.publish(command)
            told = re.sub(r"[\d.]+", "", log.decision.reason)
            if told != reason:  # apart from its numbers
                node.get_logger().info(log.decision.reason)
            reason = told
finally:  # Ctrl-C: the last command is to stand
    commands.publish(Twist())
    rclpy.shutdown()
