"""Nodes written as students write them, and small arenas to run them in."""

import sys
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from limo_sim.ros.runner import Limits, run_node
from limo_sim.ros.stage import Ended, Stage
from limo_sim.world.scenario import Person, Scenario

#: Somebody stands 2.5 m ahead, to the left.
STANDING = Scenario(name="standing", people=(Person(route=((2.5, 0.5, 3600.0),)),))
NOBODY = Scenario(name="nobody")

HEAD = """
import rclpy
from rclpy.node import Node
from geometry_msgs.msg import Twist
from sensor_msgs.msg import Image

"""

DRIVE = "twist = Twist(); twist.linear.x = 0.2; self.pub.publish(twist)"

FOLLOW = """
import cv2
import numpy as np
from cv_bridge import CvBridge
image = CvBridge().imgmsg_to_cv2(msg, 'bgr8')
if not hasattr(self, 'hog'):
    self.hog = cv2.HOGDescriptor()
    self.hog.setSVMDetector(cv2.HOGDescriptor_getDefaultPeopleDetector())
rects, weights = self.hog.detectMultiScale(image, winStride=(8, 8), padding=(4, 4), scale=1.05)
twist = Twist()
if len(rects):
    x, y, w, h = rects[int(np.argmax(weights))]
    twist.angular.z = 0.005 * (320 - (x + w // 2))
self.pub.publish(twist)
cv2.imshow('camera', image)
cv2.waitKey(1)
"""


@dataclass(frozen=True)
class Ran(Ended):
    """How a run ended, and what the node said meanwhile."""

    logged: list[tuple[float, str, str]]  #: time [s], level, message
    printed: dict[str, str]  #: on "stdout" and "stderr"

    @property
    def said(self) -> list[str]:
        """What it logged, of a run that did not fail."""
        assert self.failure == "", self.traceback
        return [message for _, _, message in self.logged]


Run = Callable[..., Ran]


def run_script(
    script: Path,
    scenario: Scenario = NOBODY,
    seconds: float = 2.0,
    seed: int = 0,
    *,
    arguments: Sequence[str] = (),
    patience: float = 20.0,
    **watching: Any,
) -> Ran:
    logged: list[tuple[float, str, str]] = []
    printed = {"stdout": "", "stderr": ""}

    def hear(name: str, text: str) -> None:
        printed[name] += text
        getattr(sys, name).write(text)

    def log(at: float, level: str, _: object, text: str) -> None:
        logged.append((at, level, text))

    stage = Stage(script, scenario, seconds, seed, log=log, **watching)
    return Ran(**vars(run_node(stage, arguments, limits=Limits(patience), said=hear)), logged=logged, printed=printed)


def node(body: str, make: str = "") -> str:
    """Write a node that subscribes to the camera, with `body` as its callback and `make` in its constructor."""
    return f"""
class Follower(Node):
    def __init__(self):
        super().__init__('follower')
        self.pub = self.create_publisher(Twist, '/cmd_vel', 10)
        self.create_subscription(Image, '/limo_camera/image', self.on_image, 10)
{textwrap.indent(textwrap.dedent(make), " " * 8)}

    def on_image(self, msg):
{textwrap.indent(textwrap.dedent(body), " " * 8)}

def main():
    rclpy.init()
    follower = Follower()
    try:
        rclpy.spin(follower)
    except KeyboardInterrupt:
        pass
    finally:
        follower.destroy_node()
        rclpy.shutdown()

main()
"""
