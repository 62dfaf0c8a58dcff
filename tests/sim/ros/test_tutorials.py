"""rclpy as its tutorials write it: it runs, or what is absent is named."""

from __future__ import annotations

import pytest
from tests.sim.ros.conftest import STANDING, Run, node

from limo_hog.ros2 import names
from limo_sim.cli.card import picture
from limo_sim.ros.script import score_of

SAY = "self.get_logger().info(str(%s))"
ZERO = "self.pub.publish(Twist())"


def said(run: Run, make: str, *arguments: str, seconds: float = 0.2, **options: object) -> list[str]:
    """Run a node with `make` in its constructor and return its log."""
    lines: list[str] = []
    outcome = run(
        node(ZERO, make),
        seconds=seconds,
        arguments=["--ros-args", *arguments],
        log=lambda _t, _l, _n, message: lines.append(message),
        **options,
    )
    assert outcome.failure == ""
    return lines


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
    assert said(run, make) == [shown]


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


def test_overrides_are_declared_where_a_node_asks_for_it(run: Run) -> None:
    options = "super().__init__('follower', automatically_declare_parameters_from_overrides=True)"
    text = node(ZERO, SAY % "self.get_parameter('gain').value").replace("super().__init__('follower')", options)
    lines: list[str] = []
    arguments = ["--ros-args", "-p", "gain:=2.5"]
    assert run(text, arguments=arguments, log=lambda _t, _l, _n, m: lines.append(m), seconds=0.2).failure == ""
    assert lines == ["2.5"]


def test_undeclared_parameters_are_allowed_where_a_node_asks_for_it(run: Run) -> None:
    options = "super().__init__('follower', allow_undeclared_parameters=True)"
    text = node(ZERO, SAY % "self.get_parameter('gain').value").replace("super().__init__('follower')", options)
    lines: list[str] = []
    assert run(text, log=lambda _t, _l, _n, m: lines.append(m), seconds=0.2).failure == ""
    assert lines == ["None"]


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
    assert said(run, make) == ["640 True", "640 True"]
    assert names.DEPTH_INFO == "/limo_camera/depth/camera_info"


def test_a_node_with_its_own_detector_is_shown_by_what_it_does_not_by_a_search(run: Run) -> None:
    drive = "twist = Twist(); twist.linear.x = 0.2 if self.get_clock().now().nanoseconds < 1e9 else 0.0\n"
    outcome = run(node(drive + "self.pub.publish(twist)"), STANDING)
    card = score_of(outcome)
    assert set(card.modes) == {"drive", "stand"}
    assert card.modes["drive"] == pytest.approx(0.5, abs=0.1)
    assert picture(card) is not None
