"""`limo-hog run`: ordinary nodes in lock step with the arena, and what happens to bad ones."""

import dataclasses
import json
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from tests.sim.logs import kept_in, there
from tests.sim.ros.scripts import DRIVE, FOLLOW, NOBODY, STANDING, Run, node, run_script

from limo_hog.cli.main import main
from limo_hog.ros2 import names
from limo_sim.cli.card import picture
from limo_sim.ros.lockstep.records import StubError
from limo_sim.ros.stage import score_of
from limo_sim.run.log import Step
from limo_sim.view.server import View
from limo_sim.world.scenario import Person


def test_a_node_that_drives_moves_the_robot(run: Run) -> None:
    outcome = run(node(DRIVE))
    assert outcome.failure == ""
    assert outcome.stage.arena.truth().robot[0] == pytest.approx(0.2 * 2.0, abs=0.05)
    assert [round(command.time, 2) for command in outcome.stage.commands[:3]] == [0.0, 0.1, 0.2]


def test_the_workshops_node_turns_to_the_person_and_is_scored_and_shown(run: Run) -> None:
    steps: list[Step] = []
    outcome = run(node(FOLLOW), STANDING, 3.0, watch=steps.append)
    card = score_of(outcome)
    assert outcome.failure == ""
    assert (card.first_detection_s, card.detected, card.frames) == (0.0, 1.0, 30)
    assert abs(there(steps[-1].truth.people[0]).bearing) < 0.05
    shown = [(step.windows["camera"], step.log.frame.image) for step in steps if step.log.frame is not None]
    assert len(shown) == 30
    for window, image in shown:
        np.testing.assert_array_equal(window, image)
    with View(STANDING) as view:
        name, _, jpeg = view._pictures(steps[-1])[-1].partition(b"\n")
    drawn = there(cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR))
    assert (name, drawn.shape) == (b"wcamera", (480, 640, 3))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (node("raise ValueError('boom')"), "failed with ValueError"),
        (node("1 / 0").replace("except KeyboardInterrupt", "except Exception"), "ZeroDivisionError"),
        (node("pass"), "never published on /cmd_vel"),
        (node(DRIVE).replace("'/cmd_vel'", "'/cmd_vell'"), "never published on /cmd_vel (it published /cmd_vell)"),
        (node(DRIVE).rpartition("main()")[0], "is main() called"),
        (node("self.pub.publish(Twist())"), "never moved the robot"),
    ],
    ids=["crashes", "hides its fault", "only spins", "publishes elsewhere", "calls no main", "as the template stands"],
)
def test_a_node_that_fails_has_no_success(text: str, said: str, run: Run) -> None:
    card = score_of(run(text, STANDING, 1.0))
    assert card.success is False
    assert said in str(card.to_json()["failure"])


def test_a_half_size_image_is_scored_in_the_cameras_pixels(run: Run) -> None:
    half = FOLLOW.replace("detectMultiScale(image,", "detectMultiScale(cv2.resize(image, (0, 0), fx=0.5, fy=0.5),")
    near = dataclasses.replace(STANDING, people=(Person(route=((1.9, 0.0, 3600.0),)),))
    assert score_of(run(node(half), near, 0.5)).detected == 1.0


def test_a_node_with_its_own_detector_is_shown_by_what_it_does_not_by_a_search(run: Run) -> None:
    drive = "twist = Twist(); twist.linear.x = 0.2 if self.get_clock().now().nanoseconds < 1e9 else 0.0\n"
    card = score_of(run(node(drive + "self.pub.publish(twist)"), STANDING))
    assert (card.detected, card.first_detection_s, card.detect_ms_p50) == (None, None, None)
    assert (card.follows_first, card.identity_switches) == (None, None)
    assert (card.in_view, card.success) == (1.0, True)
    assert card.modes == pytest.approx({"drive": 0.5, "stand": 0.5}, abs=0.1)
    assert picture(card) is not None


@pytest.mark.parametrize(
    ("declared", "then", "target"),
    [
        ("", "", None),
        ("1.8", "", 1.8),
        ("'near'", "", None),
        ("float('nan')", "", None),
        ("1.8", "self.set_parameters([rclpy.Parameter('target_distance', value=2.2)])", 2.2),
    ],
)
def test_a_nodes_parameter_target_distance_is_what_the_card_measures_against(
    run: Run, declared: str, then: str, target: float | None
) -> None:
    make = f"self.declare_parameter('target_distance', {declared})\n" if declared else ""
    card = score_of(run(node(DRIVE, make + then), STANDING, 0.5))
    assert card.target_m == target
    assert (card.distance_rms_error_m is None) == (target is None)


@pytest.mark.parametrize(
    ("body", "said", "line"),
    [
        ("1 / 0", "ZeroDivisionError", "1 / 0"),
        ("twist = Twist(); twist.linear.x = 1", "must be 'float', came int 1", "twist.linear.x = 1"),
        ("twist = Twist(); twist.linear.x = float('nan'); self.pub.publish(twist)", "linear.x is nan", "publish"),
        ("twist = Twist(); twist.angular.z = float('inf'); self.pub.publish(twist)", "angular.z is inf", "publish"),
        ("self.pub.publish(msg)", "came Image", "self.pub.publish(msg)"),
        ("self.pub.publish('go')", "came str", "self.pub.publish('go')"),
        ("raise KeyboardInterrupt", "failed with KeyboardInterrupt", "raise KeyboardInterrupt"),
        ("raise SystemExit(3)", "sys.exit(3)", ""),
        ("while True: pass", "hung", "while True: pass"),
        ("import threading; threading.Event().wait()", "hung", "wait()"),
        ("try:\n    1 / 0\nfinally:\n    self.pub.publish(Twist())", "ZeroDivisionError", "1 / 0"),
    ],
)
def test_a_bad_callback_ends_in_its_own_traceback_and_a_robot_that_stands(
    run: Run, body: str, said: str, line: str
) -> None:
    later = f"self.n = getattr(self, 'n', 0) + 1\nif self.n < 10:\n    {DRIVE}\n    return\n" + body
    # (Patience is wall time: a busy machine may take half a second for the ten images.)
    outcome = run(node(later), patience=2.0 if said == "hung" else 20.0)
    assert said in outcome.failure
    assert "the watchdog stopped the robot" in outcome.failure
    assert line in outcome.traceback
    assert "limo_sim/ros" not in outcome.traceback
    assert outcome.stage.arena.odometry().linear == 0.0


def test_a_script_that_waits_without_spinning_is_stopped(run: Run) -> None:
    assert "hung" in run("rclpy.init()\nwhile rclpy.ok(): pass", patience=0.5).failure


def test_the_watchdog_stops_a_robot_whose_node_falls_silent(run: Run) -> None:
    body = f"self.n = getattr(self, 'n', 0) + 1\nif self.n <= 5:\n    {DRIVE}"
    steps: list[Step] = []
    outcome = run(node(body), watch=kept_in(steps))
    places = {step.log.time: step.truth.robot[0] for step in steps}
    assert outcome.stage.arena.watchdog_stops == 1
    assert places[1.9] == pytest.approx(places[1.5], abs=1e-6)


def test_sleep_in_a_callback_lets_the_arenas_time_pass_not_the_walls(run: Run) -> None:
    began = time.perf_counter()
    outcome = run(node("import time; time.sleep(5.0); " + DRIVE), seconds=20.0)
    assert [round(c.time, 2) for c in outcome.stage.commands] == [5.0, 10.0, 15.0, 20.0]
    assert outcome.stage.arena.watchdog_stops >= 3
    assert time.perf_counter() - began < 15.0


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("from rclpy.action import ActionClient", "does not offer rclpy.action"),
        ("from rclpy.node import LifecycleNode", "does not offer rclpy.node.LifecycleNode"),
        ("rclpy.spin_some()", "does not offer rclpy.spin_some"),
        ("import laser_geometry", "does not offer laser_geometry"),
        ("from std_srvs.srv import Emty", "does not offer std_srvs.srv.Emty"),
        ("from sensor_msgs.msg import Imagee", "does not offer sensor_msgs.msg.Imagee"),
        ("import sensor_msgs_py.point_cloud2", "does not offer sensor_msgs_py"),
        ("self.get_logger().get_logger_name()", "does not offer Logger.get_logger_name"),
        ("self.immage", "no attribute 'immage'"),
        ("self.get_parameter('use_sim_time').wrong_name", "no attribute 'wrong_name'"),
        ("Node('other', start_parameter_service=True)", "no option 'start_parameter_service'"),
        ("input()", "a node has no keyboard here"),
        ("import sys, termios; termios.tcgetattr(sys.stdin)", "a node has no keyboard here"),
    ],
)
def test_what_is_not_offered_is_named_and_mistakes_stay_the_scripts_own(run: Run, line: str, said: str) -> None:
    assert said in run(node(line)).failure


def test_ros_arguments_set_parameters_and_names(run: Run, tmp_path: Path) -> None:
    parameters = tmp_path / "p.yaml"
    parameters.write_text("follower:\n  ros__parameters:\n    speed: 0.1\n    nested: {a: 2}\n")
    make = """
    given = [self.declare_parameter(*one).value for one in (('speed', 0.3), ('nested.a', 1), ('gain', 1.0))]
    self.get_logger().info(f'{given} {self.pub.topic_name} {self.get_name()}')
    """
    arguments = ["--ros-args", "--params-file", str(parameters), "-p", "gain:=2.5", "-r", "/cmd_vel:=/other"]
    logged = run(node(DRIVE, make), arguments=arguments, seconds=0.2).logged
    assert logged == [(0.0, "INFO", "[0.1, 2, 2.5] /other follower")]


@pytest.mark.parametrize(
    ("argument", "said"),
    [("speed:=2", "is DOUBLE, came INTEGER 2 from the command line: write speed:=2.0"), ("speed", "name:=value")],
)
def test_wrong_ros_arguments_say_what_is_wanted(run: Run, argument: str, said: str) -> None:
    make = "self.declare_parameter('speed', 1.0)"
    assert said in run(node(DRIVE, make), arguments=["--ros-args", "-p", argument]).failure


def test_timers_keep_their_period_in_the_arenas_time_and_polling_lets_it_pass(run: Run) -> None:
    make = "self.create_timer(0.25, lambda: self.get_logger().info('tick'))"
    at = [at for at, _, _ in run(node("pass", make)).logged]
    assert at == pytest.approx([0.26, 0.5, 0.76, 1.0, 1.26, 1.5, 1.76], abs=1e-9)
    text = "rclpy.init()\nn = Node('n')\npub = n.create_publisher(Twist, 'cmd_vel', 1)\nwhile rclpy.ok():\n"
    text += "    rclpy.spin_once(n, timeout_sec=0)\n    pub.publish(Twist())"
    assert len(run(text).stage.commands) == 101


def test_colour_and_depth_are_paired_by_their_stamps(run: Run) -> None:
    make = """
    import message_filters
    self.subs = [message_filters.Subscriber(self, Image, t) for t in
                 ('/limo_camera/image', '/limo_camera/depth/image_raw')]
    self.sync = message_filters.ApproximateTimeSynchronizer(self.subs, queue_size=10, slop=0.1)
    self.sync.registerCallback(lambda a, b: self.get_logger().info(
        f'{a.encoding} {b.encoding} {a.header.stamp == b.header.stamp}'))
    """
    assert run(node(DRIVE, make), seconds=1.0).said == ["bgr8 32FC1 True"] * 10


def test_every_topic_of_the_workshop_arrives_at_its_rate(run: Run) -> None:
    rates = dict.fromkeys(names.TYPES, 10) | dict.fromkeys((names.ODOMETRY, names.CLOCK, names.TF), 50)
    rates |= {names.SCAN: 8, names.IMU: 100, names.TF_STATIC: 0}
    del rates[names.COMMAND], rates[names.ANNOTATED]
    text = "import importlib\nrclpy.init()\nn = Node('n')\n"
    for topic in rates:
        package, _, name = names.TYPES[topic].split("/")
        text += f"T = getattr(importlib.import_module('{package}.msg'), '{name}')\n"
        text += f"n.create_subscription(T, '{topic}', lambda m: n.get_logger().info('{topic}'), 100)\n"
    counts = Counter(topic for _, _, topic in run(text + "rclpy.spin(n)").logged)
    assert {topic: round(n / 2) for topic, n in counts.items()} == rates


def test_a_callback_may_draw_on_its_picture_without_touching_anybody_elses(run: Run) -> None:
    body = """
    from cv_bridge import CvBridge
    image = CvBridge().imgmsg_to_cv2(msg)
    image[:] = 0
    msg.data[0] = 7
    """
    outcome = run(node(body + DRIVE), STANDING, 0.3)
    assert outcome.failure == ""
    assert outcome.stage.arena.frame().image.mean() > 50


def test_a_script_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(StubError, match="no such file"):
        run_script(tmp_path / "none.py", NOBODY, 1.0)


def test_the_command_line_prints_json_alone_and_of_a_fault_the_students_traceback(
    script: Callable[[str], Path], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", str(script("print('hello')\n" + node(DRIVE))), "--seconds", "1", "--json", "-"]) == 0
    assert json.loads(capfd.readouterr().out)["seconds"] == 1.0
    bad, card = tmp_path / "bad.py", tmp_path / "card.json"
    bad.write_text("import rclpy\nrclpy.init()\nraise RuntimeError('no camera')\n")
    assert main(["run", str(bad), "--seconds", "1", "--json", str(card), "--scenario", "followable"]) == 1
    assert json.loads(card.read_text())["controller"] == "bad.py"
    out, err = capfd.readouterr()
    assert "followable" in out
    assert 'bad.py", line 3' in err
    assert err.rstrip().splitlines()[-1].startswith("limo-hog: bad.py failed with RuntimeError at 0.00 s: no camera")


def test_images_go_through_cv_bridge_and_back(run: Run) -> None:
    body = """
    import numpy as np
    from cv_bridge import CvBridge, CvBridgeError
    bridge = CvBridge()
    image = bridge.imgmsg_to_cv2(msg, 'bgr8')
    for encoding, picture in (('bgr8', image), ('mono8', image[..., 0]), ('32FC1', image[..., 0].astype(np.float32))):
        back = bridge.imgmsg_to_cv2(bridge.cv2_to_imgmsg(picture, encoding, msg.header))
        assert back.dtype == picture.dtype and np.array_equal(back, picture)
    assert np.array_equal(bridge.imgmsg_to_cv2(msg, 'rgb8'), image[..., ::-1])
    assert bridge.imgmsg_to_cv2(msg, 'mono8').shape == (480, 640)
    assert bridge.compressed_imgmsg_to_cv2(bridge.cv2_to_compressed_imgmsg(image)).shape == image.shape
    try:
        bridge.cv2_to_imgmsg(image.astype(float), 'bgr8')
    except CvBridgeError:
        self.pub.publish(Twist())
    """
    assert run(node(body), STANDING, 0.2).failure == ""
