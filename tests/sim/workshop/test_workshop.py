"""The workshop's checker: it passes the model solutions, and fails mistakes for the right reason."""

import json
import os
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import pytest
from tests.sim.workshop.strangers import FOLLOWER, RIGHT, WRONG, checked, exchanged, nodes

from limo_hog.cli.main import main
from limo_sim.workshop import solution, template
from limo_sim.workshop.report import by_task, total

#: The workshop's two nodes: the follower of tasks 1 to 4, and the sequel that keeps a distance.
NODES = ("follower", "proxemic")

#: The same node with a mistake: the checkpoint and words of the first finding, and what is exchanged for it.
MISTAKES = nodes(
    "follower",
    FOLLOWER,
    """
the robot stands while no person is found | no box, and no command
    self.commands.publish(Twist()) → pass
the robot stands while no person is found | no box, yet the command is linear.x 0.20
    self.commands.publish(Twist()) → twist = Twist(); twist.linear.x = 0.2; self.commands.publish(twist)
the robot turns towards the person | px to the left | the sign is swapped
    middle - cx → cx - middle
boxes are in the camera's pixels | 320 px wide copy
    detectMultiScale(image, → detectMultiScale(cv2.resize(image, (0, 0), fx=0.5, fy=0.5),
the surest box is chosen and drawn | the red box is number 0
    int(np.argmax(weights)) → 0
a person in the middle does not turn it | px off the middle
    if abs(error) >= self.dead_band: → if True:
people are found | given float64
    detectMultiScale(image, → detectMultiScale(image / 255.0,
a command comes at least every 0.5 s | no command for 0.8 s
    self.commands.publish(twist) → self.n = getattr(self, 'n', -1) + 1; self.n % 8 or self.commands.publish(twist)
callbacks return in time | slept for 0.8 s
    error = middle - cx → import time; time.sleep(0.8); error = middle - cx
the topic '/camera/image_raw' is not published
    '/limo_camera/image' → '/camera/image_raw'
did you mean '/limo_camera/image'?
    '/limo_camera/image' → '/limo_camera/imagee'
subscribes to '/limo_camera/depth
    '/limo_camera/image' → '/limo_camera/depth/image_raw'
the node has no subscription
    self.create_subscription(Image, '/limo_camera/image', self.on_image, 10) → pass
never spun
    rclpy.spin(node) → pass
main() is never called
    if __name__ == '__main__':⏎    main() → pass
the script makes no node
    '__main__' → 'main'
before setSVMDetector
    self.hog.setSVMDetector(cv2.HOGDescriptor_getDefaultPeopleDetector()) → pass
publishes on '/cmdvel'; the robot listens to '/cmd_vel'
    '/cmd_vel' → '/cmdvel'
requesting incompatible QoS. No messages will be sent to it. Last incompatible policy: RELIABILITY
    from rclpy.node → from rclpy.qos import QoSProfile, ReliabilityPolicy⏎from rclpy.node
    '/cmd_vel', 10) → '/cmd_vel', QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT))
no command with a speed
    self.commands.publish(twist) → pass
nothing drawn on it
    picture = image.copy() → picture = image.copy(); self.raw = image
    cv2.imshow('Camera', picture) → cv2.imshow('Camera', self.raw)
a grey or depth picture
    cv2.imshow('Camera', picture) → cv2.imshow('Camera', cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY))
red and blue swapped
    cv2.imshow('Camera', picture) → cv2.imshow('Camera', picture[..., ::-1])
wanted is the camera's size
    cv2.imshow('Camera', picture) → cv2.imshow('Camera', cv2.resize(picture, (320, 240)))
call cv2.imshow for every image
    cv2.imshow('Camera', picture) → hasattr(self, 'once') or cv2.imshow('Camera', picture); self.once = 1
no window
    cv2.imshow('Camera', picture) → pass
no log line has their number
    self.get_logger().info(f'Detections: {len(boxes)}') → pass
logged: 'Detections: 1'
    {len(boxes)} → 1
red is (0, 0, 255)
    (0, 0, 255), 3 → (255, 0, 0), 3
no blue dot
    cv2.circle(picture, (cx, y + h // 2), 6, (255, 0, 0), -1) → pass
not every other box
    (0, 255, 0), 2 → (0, 255, 255), 2
wanted is linear.x > 0; the command is linear.x 0.00
    twist.linear.x = self.speed → pass
finds no box in images of
    winStride=(8, 8) → hitThreshold=9.0, winStride=(8, 8)
detectMultiScale was never called
    self.hog.detectMultiScale(image, winStride=(8, 8), padding=(4, 4), scale=1.05) → [], []
""",
) | nodes(
    "proxemic",
    solution("proxemic"),
    """
it keeps its distance | wanted is to drive back
    (distance - self.target) → (self.target - distance)
""",
)


@pytest.mark.parametrize("said", MISTAKES)
def test_a_mistake_is_named_with_its_line(tmp_path: Path, said: str) -> None:
    exercise, text = MISTAKES[said]
    verdicts = checked(tmp_path, text, exercise)
    first = next(verdict for verdict in verdicts if not verdict.holds)
    assert all(words in f"{first.checkpoint}: {first.evidence}" for words in said.split(" | "))
    assert total(verdicts)[0] < 100
    if first.line is not None:
        told = text.splitlines()[first.line - 1]
        calls = ["create_", "publish", "imshow", "detectMultiScale", "def", "main", "Follower()", "super()"]
        assert any(word in told for word in calls), told


@pytest.mark.parametrize("node", NODES)
def test_the_template_runs_and_is_told_what_to_do_first(tmp_path: Path, node: str) -> None:
    verdicts = checked(tmp_path, template(node), node)
    assert verdicts[0].checkpoint != "the node runs"
    assert any(verdict.holds is False for verdict in verdicts)
    assert total(verdicts) == (0, 100)


@pytest.mark.parametrize("more", ["", "node.create_timer(0.1, lambda: pub.publish(Twist()))"])
@pytest.mark.parametrize("name", NODES)
def test_a_node_that_does_nothing_gets_no_points(tmp_path: Path, name: str, more: str) -> None:
    lines = ["import rclpy", "from geometry_msgs.msg import Twist", "rclpy.init()", "node = rclpy.create_node('empty')"]
    lines += ["pub = node.create_publisher(Twist, '/cmd_vel', 10)", more, "rclpy.spin(node)"]
    verdicts = checked(tmp_path, "\n".join(lines), name)
    assert total(verdicts) == (0, 100)
    assert verdicts[0].evidence.startswith("the node has no subscription")


def test_a_window_may_be_shown_by_a_timer(tmp_path: Path) -> None:
    otherwise = """
        self.bridge = CvBridge() → self.bridge = CvBridge()⏎self.kept = np.zeros((480, 640, 3), np.uint8)
            ⏎self.create_timer(0.2, self.tick)
        def show(self, picture): → def show(self, picture):⏎    self.kept = picture⏎⏎def tick(self):
        cv2.imshow('Camera', picture) → cv2.imshow('Camera', self.kept)
    """
    verdicts = checked(tmp_path, exchanged(FOLLOWER, otherwise))
    assert [(v.checkpoint, v.evidence) for v in verdicts if v.holds is not True] == []


def test_a_node_that_raises_is_shown_its_traceback(tmp_path: Path) -> None:
    verdict, *rest = checked(tmp_path, "import rclpy\nrclpy.init()\nraise RuntimeError('oh')\n")
    assert (verdict.holds, verdict.line) == (False, 3)
    assert "RuntimeError: oh" in verdict.evidence
    assert ({other.holds for other in rest}, total([verdict, *rest])) == ({None}, (0, 100))


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
    assert all(words in captured.out for words in ("✗", "0 of 100 points", "One more: --hint 2"))
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
    code = "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100)); "
    code += "from limo_hog.cli.main import main; sys.exit(main(['workshop', 'new']))"
    command = [sys.executable, "-B", "-c", code]
    done = subprocess.run(command, check=False, capture_output=True, text=True, cwd=tmp_path, timeout=60)
    assert (done.returncode, done.stderr) == (1, "limo-hog: follower.py: File too large\n")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("reason", "points"), [("the sign is swapped", 20), ("slept for 0.8 s", 25)])
def test_a_mistake_of_task_4_costs_no_points_of_another(tmp_path: Path, reason: str, points: int) -> None:
    (text,) = (text for said, (_, text) in MISTAKES.items() if reason in said)
    verdicts = checked(tmp_path, text)
    assert len([verdict for verdict in verdicts if verdict.holds is False]) == 1
    assert by_task(verdicts) == {1: (10, 10), 2: (25, 25), 3: (25, 25), 4: (points, 40)}


#: Those that are checked with every change; the others are marked slow.
QUICK = (
    *("timer of 3 Hz", "functions and spin_once", "threads", "crop of the rows", "enlarged copy"),
    *("logs every tenth image", "the follower solution", "the proxemic solution"),
    *("2 a number that was made up", "3 a timer that always drives", "3 largest", "4 steers by the blue shirt"),
    *("any the model solution, read", "5 one pixel, unknown is nine metres"),
)


def listed(nodes: Iterable[str]) -> list[object]:
    return [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow, id=name) for name in nodes]


ALL_RIGHT = RIGHT | {f"the {node} solution": (node, solution(node)) for node in NODES}


@pytest.mark.parametrize("name", listed(ALL_RIGHT))
def test_a_right_node_gets_all_points(tmp_path: Path, name: str) -> None:
    exercise, text = ALL_RIGHT[name]
    verdicts = checked(tmp_path, text, exercise)
    assert [(verdict.checkpoint, verdict.evidence) for verdict in verdicts if verdict.holds is not True] == []
    assert total(verdicts) == (100, 100)


@pytest.mark.parametrize("name", listed(WRONG))
def test_a_wrong_node_loses_points_of_its_task(tmp_path: Path, name: str) -> None:
    exercise, text = WRONG[name]
    verdicts = checked(tmp_path, text, exercise)
    lost = {str(verdict.task) for verdict in verdicts if verdict.holds is False}
    assert lost if name.startswith("any") else name[0] in lost
    assert total(verdicts)[0] < 100
