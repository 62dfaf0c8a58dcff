"""rclpy as its tutorials write it: it runs, or what is absent is named."""

from __future__ import annotations

import pytest
from tests.sim.ros.scripts import STANDING, Run, node, said

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
