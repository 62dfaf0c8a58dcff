"""The workshop's checker: it passes the model solutions, and fails mistakes for the right reason."""

from __future__ import annotations

from pathlib import Path

import cv2
import pytest

import limo_hog
from limo_hog.cli.main import main
from limo_sim.workshop import NODES, solution, template
from limo_sim.workshop.check import Verdict, check

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


@pytest.fixture(autouse=True)
def fast_detector(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same boxes, many times faster."""
    monkeypatch.setattr(cv2, "HOGDescriptor", limo_hog.HOGDescriptor, raising=False)


def checked(tmp_path: Path, text: str, node: str = "follower") -> list[Verdict]:
    script = tmp_path / "node.py"
    script.write_text(text, encoding="utf-8")
    return check(script, node)


@pytest.mark.parametrize("node", NODES)
def test_the_model_solution_holds_every_checkpoint(tmp_path: Path, node: str) -> None:
    verdicts = checked(tmp_path, solution(node), node)
    assert [verdict for verdict in verdicts if verdict.holds is not True] == []
    assert len(verdicts) >= 12


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_fails_for_the_right_reason(tmp_path: Path, name: str) -> None:
    right, wrong, checkpoint, reason = MISTAKES[name]
    assert right in solution("follower")
    failed = [
        verdict for verdict in checked(tmp_path, solution("follower").replace(right, wrong)) if verdict.holds is False
    ]
    assert failed[0].checkpoint == checkpoint
    assert reason in failed[0].evidence


def test_one_mistake_fails_one_checkpoint(tmp_path: Path) -> None:
    for name in ("sign of the turn", "blocking callback"):
        right, wrong, *_ = MISTAKES[name]
        verdicts = checked(tmp_path, solution("follower").replace(right, wrong))
        assert sum(verdict.holds is False for verdict in verdicts) == 1, name


def test_a_half_size_image_scaled_back_is_right(tmp_path: Path) -> None:
    text = solution("follower").replace(DETECT, HALF + "\n        boxes = [2 * box for box in boxes]")
    verdicts = checked(tmp_path, text)
    assert [v.checkpoint for v in verdicts if v.holds is False] in ([], ["the robot follows a walking person"])


@pytest.mark.parametrize("node", NODES)
def test_the_template_runs_and_is_told_what_to_do_first(tmp_path: Path, node: str) -> None:
    verdicts = checked(tmp_path, template(node), node)
    assert verdicts[0].checkpoint != "the node runs"
    assert any(verdict.holds is False for verdict in verdicts)


def test_a_distance_held_the_wrong_way_round_fails(tmp_path: Path) -> None:
    text = solution("proxemic").replace("(distance - self.target)", "(self.target - distance)")
    failed = [verdict for verdict in checked(tmp_path, text, "proxemic") if verdict.holds is False]
    assert failed[0].checkpoint == "it keeps its distance"
    assert "wanted is to drive back" in failed[0].evidence


def test_a_node_that_raises_is_shown_its_traceback(tmp_path: Path) -> None:
    (verdict,) = checked(tmp_path, "import rclpy\nrclpy.init()\nraise RuntimeError('oh')\n")
    assert verdict.holds is False
    assert "RuntimeError: oh" in verdict.evidence


def test_the_command_line_writes_checks_and_refuses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["workshop", "new"]) == 0
    assert Path("follower.py").read_text() == template("follower")
    assert main(["workshop", "new"]) == 2
    assert main(["workshop", "solution", "--sequel", "-"]) == 0
    assert capsys.readouterr().out == solution("proxemic")
    assert main(["workshop", "check", "follower.py"]) == 1
    captured = capsys.readouterr()
    assert "✗" in captured.out
    assert "checkpoints do not hold" in captured.err
