"""What a node of the tutorials is told: of topics that nobody publishes, qualities that do not match, and its files."""

from __future__ import annotations

from pathlib import Path

from tests.sim.ros.scripts import DRIVE, Run, node, run_script

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


def test_a_publisher_and_a_subscription_of_other_qualities_exchange_nothing_and_ros_says_so(run: Run) -> None:
    make = """
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
    best = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    late = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    self.pub = self.create_publisher(Twist, '/cmd_vel', best)
    self.create_subscription(Image, '/limo_camera/image', lambda m: self.get_logger().info('late'), late)
    """
    ended = run(node(DRIVE, make), seconds=0.5)
    reader, writer = (said for _, _, said in ended.logged)
    assert reader.endswith("incompatible QoS. No messages will be sent to it. Last incompatible policy: RELIABILITY")
    assert writer.endswith(
        "incompatible QoS. No messages will be received from it. Last incompatible policy: DURABILITY"
    )
    assert reader in ended.failure
    assert not ended.stage.commands


def test_a_node_of_a_package_finds_the_packages_modules_and_files(tmp_path: Path) -> None:
    package = tmp_path / "src" / "amy"
    (package / "amy").mkdir(parents=True)
    (package / "package.xml").write_text("<package/>")
    (package / "amy" / "__init__.py").write_text("")
    (package / "amy" / "helper.py").write_text("WORD = 'there'\n")
    (package / "amy" / "go.py").write_text(
        "import rclpy\nfrom ament_index_python.packages import get_package_share_directory as share\n"
        "from amy.helper import WORD\nrclpy.init()\nlogger = rclpy.create_node('go').get_logger()\n"
        "for word in (WORD, share('amy'), share('unknown')):\n    logger.info(word)\n"
    )
    ended = run_script(package / "amy" / "go.py", seconds=0.2)
    assert [said for _, _, said in ended.logged] == ["there", str(package), str(package / "amy")]
