"""Nodes written as students write them, run against small arenas."""

from __future__ import annotations

import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from limo_sim.ros.script import Outcome, run_script
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

Run = Callable[..., Outcome]


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """Run a script's text against the arena; returns how it ended, with its log lines in `said`."""

    def run_text(text: str, scenario: Scenario = NOBODY, seconds: float = 2.0, **options: Any) -> Outcome:
        script = tmp_path / "node.py"
        script.write_text(HEAD + textwrap.dedent(text), encoding="utf-8")
        return run_script(script, scenario, seconds, **options)

    return run_text


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
