"""The workshop's checker: it passes the model solutions, and fails mistakes for the right reason."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from limo_hog.cli.main import main
from limo_sim.workshop import solution, template
from limo_sim.workshop.check import Verdict, examine
from limo_sim.workshop.report import by_task, total

#: The workshop's two nodes: the follower of tasks 1 to 4, and the sequel that keeps a distance.
NODES = ("follower", "proxemic")

SHOW = "cv2.imshow('Camera', picture)"
DETECT = "boxes, weights = self.hog.detectMultiScale(image, winStride=(8, 8), padding=(4, 4), scale=1.05)"
HALF = DETECT.replace("(image,", "(cv2.resize(image, (0, 0), fx=0.5, fy=0.5),")

#: What is replaced in the model solution, by what, and which checkpoint must fail first with which words.
MISTAKES = {
    "no stop": (
        "            self.commands.publish(Twist())\n            self.show",
        "            self.show",
        "the robot stands while no person is found",
        "no box, and no command",
    ),
    "drives on": (
        "            self.commands.publish(Twist())\n            self.show",
        "            twist = Twist(); twist.linear.x = 0.2; self.commands.publish(twist)\n            self.show",
        "the robot stands while no person is found",
        "no box, yet the command is linear.x 0.20",
    ),
    "sign of the turn": ("middle - cx", "cx - middle", "the robot turns towards the person", "px to the left"),
    "half size not scaled back": (DETECT, HALF, "boxes are in the camera's pixels", "320 px wide copy"),
    "first instead of best": (
        "int(np.argmax(weights))",
        "0",
        "the surest box is chosen and drawn",
        "the red box is number 0",
    ),
    "no dead-band": (
        "if abs(error) >= self.dead_band:",
        "if True:",
        "a person in the middle does not turn it",
        "px off the middle",
    ),
    "float image": (DETECT, DETECT.replace("(image,", "(image / 255.0,"), "people are found", "given float64"),
    "silence": (
        "        self.commands.publish(twist)\n",
        "        self.n = getattr(self, 'n', -1) + 1\n        if self.n % 8 == 0:\n"
        "            self.commands.publish(twist)\n",
        "a command comes at least every 0.5 s",
        "no command for 0.8 s",
    ),
    "blocking callback": (
        "        error = middle - cx\n",
        "        import time; time.sleep(0.8)\n        error = middle - cx\n",
        "callbacks return in time",
        "slept for 0.8 s",
    ),
}


def checked(tmp_path: Path, text: str, node: str = "follower") -> list[Verdict]:
    script = tmp_path / "node.py"
    script.write_text(text, encoding="utf-8")
    return examine(script, node).verdicts


@pytest.mark.parametrize("node", NODES)
def test_the_model_solution_holds_every_checkpoint(tmp_path: Path, node: str) -> None:
    verdicts = checked(tmp_path, solution(node), node)
    assert [verdict for verdict in verdicts if verdict.holds is not True] == []
    assert total(verdicts) == (100, 100)


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_fails_for_the_right_reason(tmp_path: Path, name: str) -> None:
    right, wrong, checkpoint, reason = MISTAKES[name]
    assert right in solution("follower")
    failed = [
        verdict for verdict in checked(tmp_path, solution("follower").replace(right, wrong)) if verdict.holds is False
    ]
    assert failed[0].checkpoint == checkpoint
    assert reason in failed[0].evidence
    assert len(failed) == 1 or name not in ("sign of the turn", "blocking callback")


def test_a_half_size_image_scaled_back_is_right(tmp_path: Path) -> None:
    text = solution("follower").replace(DETECT, HALF + "\n        boxes = [2 * box for box in boxes]")
    verdicts = checked(tmp_path, text)
    assert [v.checkpoint for v in verdicts if v.holds is False] in ([], ["the robot follows a walking person"])


@pytest.mark.parametrize("node", NODES)
def test_the_template_runs_and_is_told_what_to_do_first(tmp_path: Path, node: str) -> None:
    verdicts = checked(tmp_path, template(node), node)
    assert verdicts[0].checkpoint != "the node runs"
    assert any(verdict.holds is False for verdict in verdicts)
    assert total(verdicts) == (0, 100)


EMPTY = """
import rclpy
from geometry_msgs.msg import Twist
from rclpy.node import Node
rclpy.init()
node = Node('empty')
pub = node.create_publisher(Twist, '/cmd_vel', 10)
rclpy.spin(node)
"""


@pytest.mark.parametrize("more", ["", "node.create_timer(0.1, lambda: pub.publish(Twist()))\n"])
@pytest.mark.parametrize("name", NODES)
def test_a_node_that_does_nothing_gets_no_points(tmp_path: Path, name: str, more: str) -> None:
    verdicts = checked(tmp_path, EMPTY.replace("rclpy.spin", more + "rclpy.spin"), name)
    assert total(verdicts) == (0, 100)
    assert verdicts[0].evidence.startswith("the node has no subscription")


#: The same node, written in other ways; None where the model solution is changed, a text where it is not.
SHOW_BY_TIMER = (
    solution("follower")
    .replace(
        "    def show(self, picture):\n",
        "    def show(self, picture):\n        self.kept = picture\n\n    def tick(self):\n",
    )
    .replace(SHOW, "cv2.imshow('Camera', self.kept)")
    .replace(
        "        self.bridge = CvBridge()\n",
        "        self.bridge = CvBridge()\n        self.kept = np.zeros((480, 640, 3), np.uint8)\n"
        "        self.create_timer(0.2, self.tick)\n",
    )
)
THIRTIETH = solution("follower").replace(
    "        self.get_logger()",
    "        self.n = getattr(self, 'n', -1) + 1\n        if self.n % 30 == 0:\n            self.get_logger()",
)
FLAT = """
import cv2, rclpy
from cv_bridge import CvBridge
from geometry_msgs.msg import Twist
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Image

rclpy.init()
node = rclpy.create_node('flat')
pub = node.create_publisher(Twist, 'cmd_vel', 1)
hog = cv2.HOGDescriptor()
hog.setSVMDetector(cv2.HOGDescriptor_getDefaultPeopleDetector())


def drive(speed, turn):
    twist = Twist()
    twist.linear.x, twist.angular.z = float(speed), float(turn)
    pub.publish(twist)


def on_image(message):
    frame = CvBridge().imgmsg_to_cv2(message, desired_encoding='bgr8')
    boxes, weights = hog.detectMultiScale(frame, winStride=(8, 8), scale=1.1)
    cv2.imshow('raw', frame)
    canvas = frame.copy()
    print_count = 'I see %d people in %d pixels'
    node.get_logger().info('people: %d' % len(boxes))
    pairs = sorted(zip(weights, boxes.tolist() if len(boxes) else []), key=lambda pair: float(pair[0]))
    for i, (_, (x, y, w, h)) in enumerate(pairs):
        last = i == len(pairs) - 1
        cv2.rectangle(canvas, (x, y), (x + w, y + h), (0, 0, 255) if last else (0, 255, 0), 2)
        if last:
            cv2.circle(canvas, (x + w // 2, y + h // 2), 5, (255, 0, 0), cv2.FILLED)
            offset = (frame.shape[1] / 2 - (x + w / 2)) / (frame.shape[1] / 2)
            drive(0.15, 0.0 if abs(offset) < 0.08 else 1.2 * offset)
    if not pairs:
        drive(0, 0)
    cv2.imshow('people', canvas)
    cv2.waitKey(1)


node.create_subscription(Image, 'limo_camera/image', on_image, qos_profile_sensor_data)
while rclpy.ok():
    rclpy.spin_once(node, timeout_sec=0.1)
"""


@pytest.mark.parametrize("text", [SHOW_BY_TIMER, THIRTIETH, FLAT], ids=["timer", "thirtieth", "flat"])
def test_a_correct_node_written_otherwise_gets_all_points(tmp_path: Path, text: str) -> None:
    verdicts = checked(tmp_path, text)
    assert [(v.checkpoint, v.evidence) for v in verdicts if v.holds is not True] == []
    assert total(verdicts) == (100, 100)


#: What is replaced in the model solution, by what; the words of the first finding, and the line it names.
NAMED = {
    "image topic": ("'/limo_camera/image'", "'/camera/image_raw'", "the topic '/camera/image_raw' is not published"),
    "image topic misspelt": ("'/limo_camera/image'", "'/limo_camera/imagee'", "did you mean '/limo_camera/image'?"),
    "another image": ("'/limo_camera/image'", "'/limo_camera/depth/image_raw'", "subscribes to '/limo_camera/depth"),
    "no subscription": (
        "        self.create_subscription(Image, '/limo_camera/image', self.on_image, 10)\n",
        "",
        "the node has no subscription",
    ),
    "no spin": ("rclpy.spin(node)", "pass", "never spun"),
    "main never called": ("if __name__ == '__main__':\n    main()", "", "main() is never called"),
    "main in a wrong guard": ("'__main__'", "'main'", "the script makes no node"),
    "no svm": (
        "self.hog.setSVMDetector(cv2.HOGDescriptor_getDefaultPeopleDetector())",
        "pass",
        "before setSVMDetector",
    ),
    "command topic": ("'/cmd_vel'", "'/cmdvel'", "publishes on '/cmdvel'; the robot listens to '/cmd_vel'"),
    "never published": ("self.commands.publish(twist)", "pass", "no command with a speed"),
    "sign": ("middle - cx", "cx - middle", "the sign is swapped"),
    "shows without boxes": (SHOW, "cv2.imshow('Camera', self.raw)", "nothing drawn on it"),
    "shows grey": (
        SHOW,
        "cv2.imshow('Camera', cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY))",
        "a grey or depth picture",
    ),
    "swapped colours": (SHOW, "cv2.imshow('Camera', picture[..., ::-1])", "red and blue swapped"),
    "half the window": (
        SHOW,
        SHOW.replace("picture", "cv2.resize(picture, (320, 240))"),
        "wanted is the camera's size",
    ),
    "shown once": (
        f"        {SHOW}",
        f"        if not hasattr(self, 'once'):\n            self.once = 1\n            {SHOW}",
        "call cv2.imshow for every image",
    ),
    "no window": (f"        {SHOW}\n", "", "no window"),
    "no log": ("        self.get_logger().info(f'Detections: {len(boxes)}')\n", "", "no log line has their number"),
    "constant log": ("{len(boxes)}", "1", "logged: 'Detections: 1'"),
    "red is rgb": ("(0, 0, 255), 3", "(255, 0, 0), 3", "red is (0, 0, 255)"),
    "no dot": ("cv2.circle(picture, (cx, y + h // 2), 6, (255, 0, 0), -1)", "pass", "no blue dot"),
    "others not green": ("(0, 255, 0), 2", "(0, 255, 255), 2", "not every other box"),
    "never drives": ("twist.linear.x = self.speed", "pass", "wanted is linear.x > 0; the command is linear.x 0.00"),
    "stride too wide": ("winStride=(8, 8)", "hitThreshold=9.0, winStride=(8, 8)", "finds no box in images of"),
    "never searched": (DETECT, "boxes, weights = [], []", "detectMultiScale was never called"),
}


@pytest.mark.parametrize("name", NAMED)
def test_a_mistake_is_named_with_its_line(tmp_path: Path, name: str) -> None:
    right, wrong, said = NAMED[name]
    text = solution("follower")
    assert right in text
    if name == "shows without boxes":
        text = text.replace(
            "        picture = image.copy()\n", "        picture = image.copy()\n        self.raw = image\n"
        )
    text = text.replace(right, wrong)
    verdicts = checked(tmp_path, text)
    first = next(verdict for verdict in verdicts if not verdict.holds)
    assert said in first.evidence
    assert total(verdicts)[0] < 100
    if first.line is not None:
        told = text.splitlines()[first.line - 1]
        calls = ["create_", "publish", "imshow", "detectMultiScale", "def", "main", "Follower()", "super()"]
        assert any(word in told for word in calls), told


def test_a_distance_held_the_wrong_way_round_fails(tmp_path: Path) -> None:
    text = solution("proxemic").replace("(distance - self.target)", "(self.target - distance)")
    failed = [verdict for verdict in checked(tmp_path, text, "proxemic") if verdict.holds is False]
    assert failed[0].checkpoint == "it keeps its distance"
    assert "wanted is to drive back" in failed[0].evidence


def test_a_node_that_raises_is_shown_its_traceback(tmp_path: Path) -> None:
    verdict, *rest = checked(tmp_path, "import rclpy\nrclpy.init()\nraise RuntimeError('oh')\n")
    assert verdict.holds is False
    assert verdict.line == 3
    assert "RuntimeError: oh" in verdict.evidence
    assert {other.holds for other in rest} == {None}
    assert total([verdict, *rest]) == (0, 100)


def test_the_command_line_writes_checks_and_refuses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["workshop", "new"]) == 0
    assert Path("follower.py").read_text() == template("follower")
    assert main(["workshop", "new"]) == 2
    assert main(["workshop", "solution", "--sequel", "-"]) == 0
    assert capsys.readouterr().out == solution("proxemic")
    monkeypatch.setenv("COLUMNS", "200")
    arguments = ["--hint", "--json", "points.json", "--gradescope", "results.json"]
    assert main(["workshop", "check", "follower.py", *arguments]) == 1
    captured = capsys.readouterr()
    assert "✗" in captured.out
    assert "0 of 100 points" in captured.out
    assert "One more: --hint 2" in captured.out
    assert max(len(line) for line in captured.out.splitlines()) <= 80
    assert "checkpoints do not hold" in captured.err
    data = json.loads(Path("points.json").read_text())
    assert (data["points"], data["max_points"]) == (0, 100)
    assert sum(task["max_points"] for task in data["tasks"]) == 100
    results = json.loads(Path("results.json").read_text())
    assert (results["score"], results["max_score"]) == (0, 100)
    assert sum(test["max_score"] for test in results["tests"]) == 100
    assert {test["status"] for test in results["tests"]} == {"failed"}


@pytest.mark.skipif(os.name == "nt", reason="Windows limits no file's size")
def test_a_template_that_does_not_fit_on_the_disk_leaves_no_file(tmp_path: Path) -> None:
    code = (
        "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100)); "
        "from limo_hog.cli.main import main; sys.exit(main(['workshop', 'new']))"
    )
    command = [sys.executable, "-B", "-c", code]
    done = subprocess.run(command, check=False, capture_output=True, text=True, cwd=tmp_path, timeout=60)
    assert (done.returncode, done.stderr) == (1, "limo-hog: follower.py: File too large\n")
    assert list(tmp_path.iterdir()) == []


def test_points_add_up_by_task(tmp_path: Path) -> None:
    verdicts = checked(tmp_path, solution("follower").replace("middle - cx", "cx - middle"))
    assert by_task(verdicts) == {1: (10, 10), 2: (25, 25), 3: (25, 25), 4: (20, 40)}
