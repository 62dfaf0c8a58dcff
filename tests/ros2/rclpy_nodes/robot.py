"""The arena's robot as rclpy plays it: in a namespace, with names of its own, driven by TwistStamped.

Arguments: seconds. Prints "ready", then the share of frames with the person in view, contacts and commands as JSON.
"""

import faulthandler
import json
import sys
import time

import rclpy
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, Image, LaserScan

from limo_hog.ros2 import messages, names
from limo_sim.ros.outlet import Outlet
from limo_sim.run.arena import Arena
from limo_sim.world.scenario import Scenario

OWN = {
    names.IMAGE: ("camera/color/image_raw", Image),
    names.CAMERA_INFO: ("camera/color/camera_info", CameraInfo),
    names.DEPTH: ("camera/depth/image_raw", Image),
    names.SCAN: ("scan_filtered", LaserScan),
    names.ODOMETRY: ("wheels/odom", Odometry),
}


def main():
    seconds = float(sys.argv[1])
    faulthandler.dump_traceback_later(seconds + 100, exit=True)
    rclpy.init(args=["--ros-args", "-r", "__ns:=/robot1"])
    node = rclpy.create_node("base")
    arena = Arena(Scenario.load("followable"), 3)
    twists, in_view = [], []
    writers = {
        topic: node.create_publisher(kind, name, qos_profile_sensor_data if topic == names.SCAN else 10)
        for topic, (name, kind) in OWN.items()
    }

    def drive(message):
        twists.append(messages.to_twist(message.twist))
        arena.command(twists[-1])

    def publish(outlet):
        for topic, make in outlet.new(arena.passed()):
            if topic in writers:
                writers[topic].publish(messages.serialize(make()))
            if topic == names.IMAGE and twists:
                person = arena.frame().truth.people[0]
                in_view.append(person is not None and person.visible >= 0.5)

    node.create_subscription(TwistStamped, "base/cmd_vel", drive, 10)
    print("ready", flush=True)
    waited = time.monotonic()
    while not twists and time.monotonic() < waited + 60:
        publish(Outlet(arena))
        rclpy.spin_once(node, timeout_sec=0.02)
        # The people stand until the first command: the robot begins when its follower does.
        time.sleep(0.05)
    began, outlet = time.monotonic(), Outlet(arena)
    while arena.time < seconds:
        publish(outlet)
        for _ in range(5):
            rclpy.spin_once(node, timeout_sec=0.0)
        arena.step()
        time.sleep(max(began + arena.time - time.monotonic(), 0.0))
    said = {
        "in_view": sum(in_view) / len(in_view),
        "contacts": arena.contacts.person,
        "fastest": max(abs(one.linear) for one in twists),
        "moved": arena.odometry().x,
    }
    print(json.dumps(said))


main()
