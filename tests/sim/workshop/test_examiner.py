"""The examiner is fair: a fault ends its scene alone, evidence is true, and an exercise can be a lecturer's own."""

import gc
import weakref
from pathlib import Path

import pytest
from tests.sim.workshop.strangers import FOLLOWER, FUNCTIONS, SEQUEL, checked, exchanged, table_of, written

from limo_hog.cli.main import main
from limo_sim.workshop.check import Verdict, examine
from limo_sim.workshop.exercises import exercise, scene_named
from limo_sim.workshop.report import by_task, total
from limo_sim.workshop.takes import play
from limo_sim.world.schema import ScenarioError

TURNS_AWAY = exchanged(FOLLOWER, "self.gain * float → -self.gain * float")

QUICK = """
title = "a lecturer's own: one scene, two checkpoints"
scenes = ["left", "corner"]

[scene.corner]
words = "a person stands far to the right, with a chair beside"
people = [[2.6, -1.1]]
arena.furniture = [{ kind = "chair", x = 3.0, y = 0.6 }]
seconds = 1.5

[checkpoints]
turns = 60

[checkpoints.touches]
check = "figures"
contacts_person = [0, 0]
points = 40
name = "nobody is touched"
"""


def named(verdicts: list[Verdict], words: str) -> Verdict:
    return next(verdict for verdict in verdicts if words in verdict.checkpoint)


def test_a_fault_in_task_4_leaves_the_points_of_tasks_1_to_3(tmp_path: Path) -> None:
    verdicts = checked(tmp_path, exchanged(FOLLOWER, "= self.speed → = 1"))
    assert {task: won for task, (won, _) in by_task(verdicts).items()} == {1: 10, 2: 25, 3: 25, 4: 0}
    assert verdicts[0].holds is False
    assert verdicts[0].evidence.startswith("a person stands on the left: node.py failed with AssertionError at 0.00 s")
    assert verdicts[0].line == 1 + FOLLOWER[: FOLLOWER.index("= self.speed")].count("\n")


def test_a_fault_in_one_scene_is_told_with_that_scene(tmp_path: Path) -> None:
    verdicts = checked(tmp_path, exchanged(FOLLOWER, "self.commands.publish(Twist()) → [][1]"))
    assert verdicts[0].evidence.startswith("the room is empty: node.py failed with IndexError at 0.00 s")
    assert "so it does in 1 other scene" in verdicts[0].evidence
    assert (named(verdicts, "stands while").holds, named(verdicts, "turns towards").points) == (False, 10)


def test_a_walk_that_fails_tells_why_and_what_was_wanted(tmp_path: Path) -> None:
    in_the_walk = "= self.speed → = 0.2 if self.get_clock().now().nanoseconds < 5e9 else [][1]"
    fails = named(checked(tmp_path, exchanged(FOLLOWER, in_the_walk)), "follows")
    assert "a person walks for 20 s: node.py failed with IndexError" in fails.evidence and fails.line is not None
    loses = named(checked(tmp_path, exchanged(FOLLOWER, "self.gain * float → 0.0002 * float")), "follows")
    assert "in_view is 0." in loses.evidence and "wanted 0.7 to 1" in loses.evidence


def test_a_crop_that_cannot_be_placed_is_judged_by_the_red_box(tmp_path: Path) -> None:
    turned = "detectMultiScale(image → detectMultiScale(cv2.rotate(image, cv2.ROTATE_180)"
    found = named(checked(tmp_path, exchanged(FOLLOWER, turned)), "people are found")
    assert "no part of a camera image" not in found.evidence or found.holds is not True
    wide = """
        detectMultiScale(image → detectMultiScale(cv2.copyMakeBorder(image, 60, 60, 20, 20, cv2.BORDER_REFLECT)
        scale=1.05) → scale=1.05)⏎boxes = [(x - 20, y - 60, w, h) for x, y, w, h in boxes]
    """
    verdicts = checked(tmp_path, exchanged(FOLLOWER, wide))
    assert "(600, 680, 3)" in named(verdicts, "people are found").evidence
    assert [verdict.checkpoint for verdict in verdicts if verdict.holds is False] == []


def test_a_forged_box_gains_nothing(tmp_path: Path) -> None:
    forged = """
        boxes, weights = self.hog.detect → boxes, weights = [(300, 100, 64, 128)], [9.0]
            ⏎link = self.commands._context.world.link
            ⏎link.tell('found', [480, 640, 3], [boxes[0]], weights, 1.0, True, data=image.tobytes())⏎dict
    """
    verdicts = checked(tmp_path, exchanged(FOLLOWER, forged))
    assert "is on nobody" in named(verdicts, "people are found").evidence
    assert by_task(verdicts)[2][0] == by_task(verdicts)[3][0] == 0


def test_an_exercise_can_be_a_lecturers_own(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mine.toml").write_text(QUICK)
    folder, own = written(tmp_path / "class", amy=FOLLOWER, bob=TURNS_AWAY), ["--exercise", str(tmp_path / "mine.toml")]
    assert main(["workshop", "check", str(folder / "amy.py"), *own, "--html", str(tmp_path / "amy.html")]) == 0
    assert "100 of 100 points" in capsys.readouterr().out
    assert "a lecturer&#x27;s own" in (tmp_path / "amy.html").read_text()
    assert [row["points"] for row in table_of(folder, *own).values()] == ["100", "40"]


@pytest.mark.parametrize(
    ("exchange", "said"),
    [
        ('scenes = ["left", "corner"] → scenes = ["lefft"]', "unknown scene 'lefft', want one of left, right"),
        ("title → titel", "titel: unknown key"),
        ('check = "figures" → check = "figur"', "unknown check 'figur', want one of shown, found"),
        ("contacts_p → contact_p", "contact_person: unknown key; bounds of 'figures' are: scenario, "),
        ("[[2.6, -1.1]] → [[9.0, 0.0]]", "want x and y in"),
        ("title = → title", "cannot be read as TOML"),
    ],
)
def test_an_exercise_that_cannot_be_is_refused_by_its_key(tmp_path: Path, exchange: str, said: str) -> None:
    (tmp_path / "mine.toml").write_text(exchanged(QUICK, exchange))
    with pytest.raises(ScenarioError, match=said):
        exercise(str(tmp_path / "mine.toml"))


def test_a_scene_of_the_checker_is_played_by_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "node.py").write_text(SEQUEL)
    arguments = ["--scenario", "check:proxemic/near", "--json", str(tmp_path / "card.json")]
    assert main(["run", str(tmp_path / "node.py"), *arguments]) == 0
    assert '"target_m": 2.5' in (tmp_path / "card.json").read_text()
    assert main(["run", str(tmp_path / "node.py"), "--scenario", "check:lefft"]) == 1
    assert "unknown scene 'lefft', want one of left" in capsys.readouterr().err
    assert scene_named("left").seconds == 1.0


PACKAGE = {
    "package.xml": "<package/>",
    "setup.py": "setup(entry_points={'console_scripts': ['go = amy_pkg.human_detector:main']})",
    "amy_pkg/__init__.py": "",
    "amy_pkg/human_detector.py": "from amy_pkg.helper import WORD\n" + FUNCTIONS,
    "amy_pkg/helper.py": "WORD = 'cmd_vel'\n",
    "test/test_flake8.py": "import rclpy\n",
    "launch/go.launch.py": "import launch\n",
}


def test_a_class_is_one_row_and_page_a_student(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "class"
    for name, text in PACKAGE.items():
        path = folder / "amy" / "amy_pkg" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    copy = "# mine\n" + FOLLOWER.replace("twist", "command")
    written(folder, bob=copy, eve="import rclpy\nraise ValueError('=1+1 \\x1b[2J')\n")
    (folder / "=ian.ipynb").write_text("{}")
    rows = table_of(folder, "--html", str(tmp_path / "pages"))
    assert {name: row["points"] for name, row in rows.items()} == {
        "'=ian.ipynb": "0",
        "amy/amy_pkg/amy_pkg/human_detector.py": "100",
        "bob.py": "100",
        "eve.py": "0",
    }
    assert [row["copy_of"] for row in rows.values()] == ["", "", "the model solution", ""]
    assert [rows["bob.py"][f"task_{task}"] for task in (1, 2, 3, 4)] == ["10", "25", "25", "40"]
    assert "4 files" in capsys.readouterr().err
    assert "wanted is a .py file" in rows["'=ian.ipynb"]["first_mistake"]
    assert "\x1b" not in (tmp_path / "class.csv").read_text()
    pages = {path.name for path in (tmp_path / "pages").iterdir()}
    assert pages == {"amy.amy_pkg.amy_pkg.human_detector.py.html", "bob.py.html", "eve.py.html"}
    assert "<svg" in (tmp_path / "pages" / "bob.py.html").read_text()


def test_the_report_cites_a_frame_and_is_short(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    script = tmp_path / "my node.py"
    script.write_text(TURNS_AWAY)
    assert main(["workshop", "check", str(script), "--html", str(tmp_path / "page.html")]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) < 24 and max(map(len, lines)) <= 80
    cited = "A person stands on the left<span>at 0.0 s: window “Camera”; 1 box found"
    assert (tmp_path / "page.html").read_text().count(cited) == 1
    script.write_text("import rclpy\n")
    assert main(["workshop", "check", str(script)]) == 1
    assert "– 11 checkpoints of task 2 to 4" in capsys.readouterr().out
    assert main(["workshop", "check", str(script), "--html", str(script)]) == 2
    assert script.read_text() == "import rclpy\n"


def test_a_model_solution_can_be_hidden(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["workshop", "new", "a b.py"]) == 0
    assert "limo-hog run 'a b.py'" in capsys.readouterr().err
    monkeypatch.setenv("LIMO_HOG_HIDE_SOLUTION", "1")
    assert main(["workshop", "solution", "-"]) == 2


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (b"# \xe9t\xe9\nimport rclpy\n", "invalid or missing encoding declaration"),
        (b"import rclpy\n" * 9 + b"# \xe9\n", "byte 0xe9 is no utf-8: save the file as UTF-8"),
        (b"import rclpy\ninput()\n", "a node has no keyboard here"),
        (b"import cv2, numpy\ncv2.imshow(5, numpy.zeros((9, 9)))\n", "imshow: want a title"),
        (b"import cv2, numpy\ncv2.imshow('a', numpy.zeros((70000, 2)))\n", "at most 16384 px a side"),
        (b"import cv2, numpy\ncv2.imshow('a', numpy.zeros((9, 9, 2)))\n", "1, 3 or 4 channels"),
        (b"raise ValueError('\\x1b[2J' + 'long' * 100000)\n", "\\x1b[2J"),
    ],
)
def test_what_python_or_opencv_refuse_is_told(tmp_path: Path, text: bytes, said: str) -> None:
    (tmp_path / "node.py").write_bytes(text)
    verdicts = examine(tmp_path / "node.py").verdicts
    assert said in verdicts[0].evidence
    assert len(verdicts[0].evidence) < 20_000
    assert total(verdicts) == (0, 100)


def test_a_take_is_freed_with_its_last_user_and_not_by_the_collector_of_cycles(tmp_path: Path) -> None:
    (tmp_path / "node.py").write_text("raise SystemExit(3)\n")
    gc.disable()
    try:
        take = weakref.ref(play(tmp_path / "node.py", scene_named("left")))
        assert take() is None
    finally:
        gc.enable()
