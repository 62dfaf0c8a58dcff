"""Nodes in the style of the public tutorials run unmodified, and are told of topics and qualities that do not match."""

from pathlib import Path

import pytest
from tests.sim.logs import there
from tests.sim.ros.scripts import DRIVE, NOBODY, STANDING, Ran, Run, node, run_script

from limo_sim.world.scenario import Scenario

ZERO = "self.pub.publish(Twist())"


def test_init_is_a_context_that_shuts_down(run: Run) -> None:
    text = "with rclpy.init():\n    Node('n').create_publisher(Twist, 'cmd_vel', 1).publish(Twist())\n"
    assert run(text + "assert not rclpy.ok()", seconds=0.5).said == []


def test_a_subscription_that_hears_nothing_warns_after_two_seconds_and_names_a_topic(run: Run) -> None:
    like = {
        ("Image", "/limo_camera/imagee"): "/limo_camera/image",
        ("Image", "/camera/image_raw"): "/limo_camera/image",
        ("Image", "/camera/depth_raw"): "/limo_camera/depth/image_raw",
        ("Twist", "/cmd_vel_raw"): "/cmd_vel",
    }
    make = "".join(f"self.create_subscription({kind}, '{topic}', print, 10)\n" for kind, topic in like)
    make += "self.create_subscription(Twist, '/mine', print, 10); self.mine = self.create_publisher(Twist, '/mine', 10)"
    assert [(round(at, 6), level, said) for at, level, said in run(node(ZERO, make), seconds=3.0).logged] == [
        (2.0, "WARN", f"nobody publishes '{topic}', subscribed to at line {13 + k}; did you mean '{meant}'?")
        for k, ((_, topic), meant) in enumerate(like.items())
    ]


def test_a_publisher_and_a_subscription_of_other_qualities_are_told_that_they_differ(run: Run) -> None:
    make = """
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
    best = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    late = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    self.pub = self.create_publisher(Twist, '/cmd_vel', best)
    self.create_subscription(Image, '/limo_camera/image', lambda m: self.get_logger().info('late'), late)
    """
    ended = run(node(DRIVE, make), seconds=0.5)
    reader, writer = (said for _, _, said in ended.logged)
    for said, way, policy in ((reader, "sent to", "RELIABILITY"), (writer, "received from", "DURABILITY")):
        last = f"incompatible QoS. No messages will be {way} it. Last incompatible policy: {policy}"
        assert said.endswith(last)
    assert reader in ended.failure
    assert not ended.stage.commands


def test_a_node_of_a_package_finds_the_packages_modules_and_files(tmp_path: Path) -> None:
    package = tmp_path / "src" / "amy"
    (package / "amy").mkdir(parents=True)
    go = "import rclpy\nfrom ament_index_python.packages import get_package_share_directory as share\n"
    go += "from amy.helper import WORD\nrclpy.init()\nlogger = rclpy.create_node('go').get_logger()\n"
    go += "for word in (WORD, share('amy'), share('unknown')):\n    logger.info(word)\n"
    files = {"package.xml": "<package/>", "amy/__init__.py": "", "amy/helper.py": "WORD = 'there'\n", "amy/go.py": go}
    for name, text in files.items():
        (package / name).write_text(text)
    ended = run_script(package / "amy" / "go.py", seconds=0.2)
    assert [said for _, _, said in ended.logged] == ["there", str(package), str(package / "amy")]


NODES = Path(__file__).parent / "nodes"


def ran(name: str, scenario: Scenario = NOBODY, seconds: float = 4.0) -> Ran:
    return run_script(NODES / f"{name}.py", scenario, seconds)


def commands(run: Ran) -> list[tuple[float, float, float]]:
    return [(round(c.time, 2), c.twist.linear, c.twist.angular) for c in run.stage.commands]


def bearing(run: Ran) -> float:
    """Where the first person is in the end, seen from the robot [rad]."""
    return there(run.stage.arena.truth().people[0]).bearing


def test_a_callback_may_wait_for_a_service_in_a_multi_threaded_executor() -> None:
    run = ran("groups", seconds=4.5)
    assert run.said == ["motor on", "motor off", "motor on", "motor off"]
    speeds = {at: linear for at, linear, _ in commands(run)}
    assert (speeds[0.9], speeds[1.5], speeds[2.5], speeds[3.5]) == (0.0, 0.3, 0.0, 0.3)


def test_message_filters_and_a_camera_model_find_the_nearest_thing() -> None:
    run = ran("filters", STANDING, 3.0)
    assert run.said[0].startswith("bgr8 nearest 2.")
    assert abs(bearing(run)) < 0.05


def test_a_listener_of_frames_drives_to_a_frame() -> None:
    run = ran("tf_listener", seconds=15.0)
    assert run.said[-1].startswith("arrived; 1 m before the lidar is 1.")
    x, y, _ = run.stage.arena.truth().robot[:3]
    assert (x, y) == pytest.approx((1.0, 0.5), abs=0.12)


def test_a_scan_follower_with_a_thread_that_spins_and_a_rate_turns_to_what_is_near() -> None:
    run = ran("scan_follower", STANDING, 4.0)
    assert [at for at, _, _ in commands(run)[1:20]] == pytest.approx([0.1 * k for k in range(1, 20)], abs=0.03)
    assert abs(bearing(run)) < 0.2


@pytest.mark.parametrize("name", ["groups", "scan_follower"])
def test_threads_take_turns_so_that_two_runs_are_the_same(name: str) -> None:
    first, second = (ran(name, STANDING, 3.0) for _ in range(2))
    assert commands(first) == commands(second)
    assert first.said == second.said
