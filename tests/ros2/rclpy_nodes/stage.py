"""The arena in lock step with a node under rclpy that answers each image with one command.

Arguments: the scenario, its seed, seconds. Prints the commands as JSON: time, forward speed, turn rate.
"""

import faulthandler
import json
import sys
import time

import rclpy
from geometry_msgs.msg import Twist
from sensor_msgs.msg import Image

from limo_hog.ros2 import messages, names
from limo_sim.ros.outlet import Outlet
from limo_sim.run.arena import Arena
from limo_sim.world.scenario import Scenario


def main():
    name, seed, seconds = sys.argv[1], int(sys.argv[2]), float(sys.argv[3])
    faulthandler.dump_traceback_later(100, exit=True)
    rclpy.init(args=[])
    node = rclpy.create_node("stage")
    writers = {topic: node.create_publisher(Image, topic, 10) for topic in (names.IMAGE, names.DEPTH)}
    heard, said = [], []
    node.create_subscription(Twist, names.COMMAND, lambda message: heard.append(messages.to_twist(message)), 10)
    while writers[names.IMAGE].get_subscription_count() < 1 or node.count_publishers(names.COMMAND) < 1:
        rclpy.spin_once(node, timeout_sec=0.1)
    time.sleep(1.0)  # (the node's side of the discovery)
    arena = Arena(Scenario.load(name), seed)
    outlet = Outlet(arena)
    while arena.time < seconds:
        shown = False
        for topic, make in outlet.new(arena.passed()):
            if topic in writers:
                writers[topic].publish(messages.serialize(make()))
                shown = shown or topic == names.IMAGE
        while shown and not heard:
            rclpy.spin_once(node, timeout_sec=1.0)
        if heard:
            said.append((round(arena.time, 2), heard[-1].linear, heard[-1].angular))
            arena.command(heard.pop())
        arena.step()
    print(json.dumps(said))


main()
