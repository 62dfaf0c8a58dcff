"""A scan follower without a class: a thread spins, a rate paces the loop in main."""

import threading

import numpy as np
import rclpy
from geometry_msgs.msg import Twist
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Float32
from visualization_msgs.msg import Marker

latest = None
lock = threading.Lock()


def on_scan(msg):
    global latest
    with lock:
        latest = msg


def main():
    rclpy.init()
    node = rclpy.create_node("scan_follower")
    node.create_subscription(LaserScan, "scan", on_scan, 10)
    cmd = node.create_publisher(Twist, "cmd_vel", 10)
    distance = node.create_publisher(Float32, "distance", 10)
    markers = node.create_publisher(Marker, "marker", 10)
    thread = threading.Thread(target=rclpy.spin, args=(node,), daemon=True)
    thread.start()
    rate = node.create_rate(10)
    try:
        while rclpy.ok():
            with lock:
                scan = latest
            twist = Twist()
            if scan is not None:
                ranges = np.array(scan.ranges)
                ranges[~np.isfinite(ranges)] = np.inf
                nearest = int(np.argmin(ranges))
                angle = scan.angle_min + nearest * scan.angle_increment
                twist.angular.z = 1.5 * angle
                twist.linear.x = 0.2 if ranges[nearest] > 0.8 else 0.0
                distance.publish(Float32(data=float(ranges[nearest])))
                marker = Marker(type=Marker.SPHERE, action=Marker.ADD)
                marker.header = scan.header
                marker.pose.position.x = float(ranges[nearest] * np.cos(angle))
                markers.publish(marker)
            cmd.publish(twist)
            rate.sleep()
    except KeyboardInterrupt:
        pass
    node.destroy_node()
    rclpy.shutdown()
    thread.join()


if __name__ == "__main__":
    main()
