"""Launch files of the simple kind start their nodes in one run; what they may not hold is refused by name."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.sim.ros.scripts import NOBODY

from limo_hog.cli.main import main
from limo_sim.ros.script import Outcome, run_script

TALKER = """
import rclpy
from rclpy.node import Node
from std_msgs.msg import String
from .words import word

class Talker(Node):
    def __init__(self):
        super().__init__('talker')
        self.pub = self.create_publisher(String, 'chatter', 10)
        self.every = self.declare_parameter('every', 1.0).value
        self.create_timer(self.every, lambda: self.pub.publish(String(data=f'{word} {self.get_name()}')))

def main():
    rclpy.init()
    rclpy.spin(Talker())
"""
LISTENER = """
import rclpy
from geometry_msgs.msg import Twist
from std_msgs.msg import String

rclpy.init()
node = rclpy.create_node('listener')
pub = node.create_publisher(Twist, 'cmd_vel', 10)
def heard(msg):
    gain = '' if node.has_parameter('gain') else node.declare_parameter('gain', 0.5).value
    node.get_logger().info(f'{msg.data} {gain}')
    pub.publish(Twist())
node.create_subscription(String, 'words', heard, 10)
try:
    rclpy.spin(node)
except KeyboardInterrupt:
    pass
"""
LAUNCH = """
import os
from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import UnlessCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

def generate_launch_description():
    config = os.path.join(get_package_share_directory('talk'), 'config', 'listener.yaml')
    every = LaunchConfiguration('every')
    return LaunchDescription([
        DeclareLaunchArgument('every', default_value='1.0', description='seconds'),
        DeclareLaunchArgument('quiet', default_value='false'),
        Node(package='talk', executable='talker', name='anna', parameters=[{'every': every}], output='screen',
             remappings=[('chatter', 'words')], condition=UnlessCondition(LaunchConfiguration('quiet'))),
        Node(package='talk', executable='listener', parameters=[config]),
    ])
"""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """Lay out a package as `ros2 pkg create --build-type ament_python` does; returns its launch file."""
    root = tmp_path / "src" / "talk"
    for name, text in {
        "launch/talk.launch.py": LAUNCH,
        "talk/__init__.py": "",
        "talk/words.py": "word = 'hello from'",
        "talk/talker.py": TALKER,
        "scripts/listener.py": LISTENER,
        "config/listener.yaml": "listener:\n  ros__parameters:\n    gain: 0.25\n",
        "setup.py": "from setuptools import setup\n"
        "setup(name='talk', entry_points={'console_scripts': ['talker = talk.talker:main']})\n",
    }.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text, encoding="utf-8")
    return root / "launch" / "talk.launch.py"


def launched(file: Path, *arguments: str, seconds: float = 2.5) -> tuple[Outcome, list[str]]:
    said: list[str] = []
    outcome = run_script(
        file, NOBODY, seconds, arguments=arguments, log=lambda _t, _l, name, text: said.append(f"{name}: {text}")
    )
    return outcome, said


def test_two_nodes_talk_with_parameters_remaps_and_a_launch_argument(package: Path) -> None:
    outcome, said = launched(package)
    assert outcome.failure == "", outcome.traceback
    assert said == ["listener: hello from anna 0.25", "listener: hello from anna "]
    assert len(launched(package, "every:=0.5")[1]) == 4
    assert "never published" in launched(package, "quiet:=true")[0].failure


def test_the_command_line_takes_a_launch_file(package: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", str(package), "every:=0.5", "--seconds", "1.2"]) == 0
    assert "talk.launch.py" in capsys.readouterr().out
    assert main(["run", str(package.parents[1] / "talk" / "talker.py"), "every:=0.5"]) == 2


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("executable='talker'", "executable='speaker'", "starts talk/speaker, but speaker.py is in none of"),
        (
            "from launch.actions import D",
            "from launch.actions import ExecuteProcess, D",
            "launch.actions.ExecuteProcess",
        ),
        ("def generate", "def make", "has no generate_launch_description()"),
        ("default_value='false'", "default_value='maybe'", "a condition is 'maybe': want true or false"),
        ("DeclareLaunchArgument('every', default_value='1.0', description='seconds'),", "", "'every' has no value"),
    ],
)
def test_what_a_launch_file_may_not_hold_is_named(package: Path, old: str, new: str, named: str) -> None:
    package.write_text(LAUNCH.replace(old, new), encoding="utf-8")
    assert named in launched(package)[0].failure


def test_a_node_that_fails_ends_the_run_with_its_traceback(package: Path) -> None:
    talker = package.parents[1] / "talk" / "talker.py"
    talker.write_text(TALKER.replace("word}", "wrod}"), encoding="utf-8")
    outcome, _ = launched(package)
    assert "failed with NameError at 1.00 s" in outcome.failure
    assert 'talker.py", line 12' in outcome.traceback
