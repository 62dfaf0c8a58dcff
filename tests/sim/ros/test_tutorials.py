"""rclpy as its tutorials write it: it runs, or what is absent is named."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.sim.ros.scripts import DRIVE, NOBODY, STANDING, Run, node, run_script, said

from limo_sim.cli.card import picture
from limo_sim.ros.stage import score_of

SAY = "self.get_logger().info(str(%s))"
ZERO = "self.pub.publish(Twist())"


@pytest.mark.parametrize(
    ("default", "field", "shown"),
    [
        ("'earth'", "string_value", "earth"),
        ("True", "bool_value", "True"),
        ("3", "integer_value", "3"),
        ("2.5", "double_value", "2.5"),
        ("[1.0, 2.0]", "double_array_value", "[1.0, 2.0]"),
        ("['a']", "string_array_value", "['a']"),
        ("2.5", "string_value", ""),
    ],
)
def test_a_parameters_value_is_read_as_the_tutorials_do(run: Run, default: str, field: str, shown: str) -> None:
    make = f"self.declare_parameter('x', {default})\n" + SAY % f"self.get_parameter('x').get_parameter_value().{field}"
    assert said(run, node(ZERO, make), seconds=0.2) == [shown]


def test_init_is_a_context_that_shuts_down(run: Run) -> None:
    text = """
    with rclpy.init(args=None):
        n = Node('n')
        pub = n.create_publisher(Twist, 'cmd_vel', 1)
        n.create_timer(0.1, lambda: pub.publish(Twist()))
        rclpy.spin_once(n)
    assert not rclpy.ok()
    """
    assert run(text, seconds=0.5).failure == ""


@pytest.mark.parametrize(
    ("option", "arguments", "gain"),
    [
        ("automatically_declare_parameters_from_overrides", ["--ros-args", "-p", "gain:=2.5"], "2.5"),
        ("allow_undeclared_parameters", [], "None"),
    ],
)
def test_a_node_may_ask_for_parameters_it_has_not_declared(
    run: Run, option: str, arguments: list[str], gain: str
) -> None:
    text = node(ZERO, SAY % "self.get_parameter('gain').value").replace("('follower')", f"('follower', {option}=True)")
    assert said(run, text, arguments=arguments, seconds=0.2) == [gain]


def test_a_subscription_that_hears_nothing_warns_after_two_seconds(run: Run) -> None:
    lines: list[tuple[float, str, str]] = []
    make = (
        "self.create_subscription(Image, '/limo_camera/imagee', print, 10)\n"
        "self.create_subscription(Twist, '/mine', print, 10)\n"
        "self.mine = self.create_publisher(Twist, '/mine', 10)"
    )
    run(node(ZERO, make), seconds=3.0, log=lambda t, level, _n, m: lines.append((t, level, m)))
    assert [(round(at, 6), level, message) for at, level, message in lines] == [
        (
            2.0,
            "WARN",
            "nobody publishes '/limo_camera/imagee', subscribed to at line 13; did you mean '/limo_camera/image'?",
        )
    ]


@pytest.mark.parametrize(
    ("line", "named"),
    [
        ("self.get_parameter('use_sim_time').wrong_name", "no attribute 'wrong_name'"),
        ("self.pub.assert_liveliness()", "does not offer Publisher.assert_liveliness"),
        ("self.get_clock().create_jump_callback()", "does not offer Clock.create_jump_callback"),
        ("self.create_timer(1.0, print).handle", "does not offer Timer.handle"),
        ("self.list_parameters([], 0)", "does not offer Node.list_parameters"),
        ("self.get_logger().get_logger_name()", "does not offer Logger.get_logger_name"),
        ("Node('other', start_parameter_service=True)", "no option 'start_parameter_service'"),
        ("import sensor_msgs_py.point_cloud2", "does not offer sensor_msgs_py"),
        ("input()", "a node has no keyboard here"),
        ("import sys, termios; termios.tcgetattr(sys.stdin)", "a node has no keyboard here"),
    ],
)
def test_what_is_absent_is_named(run: Run, line: str, named: str) -> None:
    assert named in run(node(ZERO, line), seconds=0.2).failure


def test_the_depth_cameras_info_is_that_of_the_camera(run: Run) -> None:
    make = (
        "from sensor_msgs.msg import CameraInfo\n"
        "self.create_subscription(CameraInfo, '/limo_camera/depth/camera_info',"
        " lambda m: self.get_logger().info(f'{m.width} {m.k[0] > 100}'), 10)"
    )
    assert said(run, node(ZERO, make), seconds=0.2) == ["640 True", "640 True"]


def test_a_node_with_its_own_detector_is_shown_by_what_it_does_not_by_a_search(run: Run) -> None:
    drive = "twist = Twist(); twist.linear.x = 0.2 if self.get_clock().now().nanoseconds < 1e9 else 0.0\n"
    outcome = run(node(drive + "self.pub.publish(twist)"), STANDING)
    card = score_of(outcome)
    assert set(card.modes) == {"drive", "stand"}
    assert card.modes["drive"] == pytest.approx(0.5, abs=0.1)
    assert picture(card) is not None


HINTS = {
    "image": ("Image, '/camera/image_raw'", "did you mean '/limo_camera/image'?"),
    "depth": ("Image, '/camera/depth_raw'", "did you mean '/limo_camera/depth/image_raw'?"),
    "command": ("Twist, '/cmd_vel_raw'", "did you mean '/cmd_vel'?"),
}


@pytest.mark.parametrize("name", HINTS)
def test_a_topic_is_hinted_at_by_the_type_of_its_messages(run: Run, name: str) -> None:
    make = f"self.create_subscription({HINTS[name][0]}, print, 10)"
    assert HINTS[name][1] in "".join(said(run, node(ZERO, make), seconds=2.2))


def test_a_publisher_and_a_subscription_of_other_qualities_exchange_nothing_and_ros_says_so(run: Run) -> None:
    lines: list[str] = []
    make = """
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
    best = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    late = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    self.pub = self.create_publisher(Twist, '/cmd_vel', best)
    self.mine = self.create_publisher(Twist, '/mine', best)
    self.create_subscription(Twist, '/mine', lambda m: self.get_logger().info('reliable'), 10)
    self.create_subscription(Twist, '/mine', lambda m: self.get_logger().info('best effort'), best)
    self.create_subscription(Image, '/limo_camera/image', lambda m: self.get_logger().info('late'), late)
    """
    ended = run(
        node("self.mine.publish(Twist()); " + DRIVE, make),
        seconds=0.5,
        log=lambda _t, _l, _n, message: lines.append(message),
    )
    warned = [line.rpartition(": ")[2] for line in lines if "incompatible QoS" in line]
    assert warned == ["RELIABILITY", "DURABILITY"]
    assert {line for line in lines if "QoS" not in line} == {"best effort"}
    assert "incompatible QoS. No messages will be sent to it. Last incompatible policy: RELIABILITY" in ended.failure
    assert ended.episode.scorer is not None
    assert not ended.stage.commands


def test_a_node_without_a_call_of_main_is_told_so(run: Run) -> None:
    assert "is main() called" in run(node(ZERO).rpartition("main()")[0], seconds=0.2).failure


def test_a_node_of_a_package_finds_the_packages_modules(tmp_path: Path) -> None:
    package = tmp_path / "src" / "amy"
    (package / "amy").mkdir(parents=True)
    (package / "package.xml").write_text("<package/>")
    (package / "amy" / "__init__.py").write_text("")
    (package / "amy" / "helper.py").write_text("WORD = 'there'\n")
    (package / "amy" / "go.py").write_text(
        "import rclpy\nfrom amy.helper import WORD\nrclpy.init()\nrclpy.create_node('go').get_logger().info(WORD)\n"
    )
    lines: list[str] = []
    run_script(package / "amy" / "go.py", NOBODY, 0.2, log=lambda _t, _l, _n, message: lines.append(message))
    assert lines == ["there"]
