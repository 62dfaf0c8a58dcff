"""Wrong command lines: each is answered at once, by one line that says what is wrong and what is wanted."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from pytest import MonkeyPatch
from tests.answers import AnswerTo
from tests.cli.material import LIMO_HOG


def test_a_wrong_option_is_answered_in_two_lines(answer_to: AnswerTo) -> None:
    usage, error = answer_to("follow", "--bogus").err.splitlines()
    assert usage == "usage: limo-hog follow [options], as limo-hog follow --help lists them"
    assert error == "limo-hog follow: error: unrecognized arguments: --bogus"


@pytest.mark.parametrize("command", ["run", "score", "workshop"])
def test_help_breaks_no_address(command: str, answer_to: AnswerTo, monkeypatch: MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    address = r"https://github\.com/limo-hog/limo-hog/blob/main/docs/\S+\.md$"
    assert re.search(address, answer_to(command, "--help").out, re.MULTILINE)
    assert "--plot" not in answer_to("arena", "--help").out  # which refuses it


CONTROLLERS = "approach, proxemic, tracking, pursuit, ppo, policy:FILE.npz"
#: Wrong arguments, which end with 2: what is typed, and a part of the last line of the answer.
WRONG_ARGUMENTS = [
    ("", "usage: limo-hog"),
    ("detct a.jpg", "did you mean detect?"),
    ("--verison", "did you mean --version?"),
    ("detect", "the following arguments are required: INPUT"),
    ("detect a.jpg --threshold high", "'high' is no score; wanted is a number from -100 to 100"),
    ("detect a.jpg --min-height 0", "'0' is no height in pixels; wanted is a number from 8 to 10000"),
    ("detect a.jpg --nms best", "invalid choice: 'best' (choose from"),
    ("detect a.jpg --nms group --overlap 0.5", "overlap has no meaning for nms"),
    ("detect a.jpg --overlap 2", "'2' is no overlap; wanted is a number from 0 to 1"),
    ("detect a.jpg --threads -1", "'-1' is no number of threads"),
    ("detect a.jpg --every 0", "'0' is no count; wanted is a whole number from 1 on"),
    ("detect a.jpg --format gif", "invalid choice: 'gif' (choose from"),
    ("detect a.jpg --resume", "give one of them"),
    ("detect a.jpg --resume --overwrite --json x", "not allowed with argument --resume"),
    ("detect a.jpg --csv -", "standard output is for --json -"),
    ("detect a.jpg --json ''", "'' is no file"),
    ("detect a.jpg --mot a.txt", "add --track"),
    ("detect a.jpg --track --mot -", "want a file's name"),
    ("detect a.jpg rtsp://camera/live --track --mot a.txt", "--mot is for one film, or for pictures that are one"),
    ("detect a.jpg --view here", "'here' is no [HOST:]PORT such as 8488"),
    ("detect a.jpg --csv t --coco ./t", "t is named twice, as a file to write: give each a name of its own"),
    ("detect a.jpg --coco c --out o --resume", "takes the earlier results from --json FILE"),
    ("detect a.jpg --min-height none --max-height 50", "max_height is 50; at least 74.88"),
    ("bench --size 99999x99999", "at most 64 megapixels"),
    (f"bench --size {'9' * 5000}x1", "at most 64 megapixels"),
    (f"bench --threads {'9' * 5000}", "is no number of threads"),
    ("bench --sizes=640x480", "unrecognized arguments: --sizes=640x480; did you mean --size?"),
    ("info more", "unrecognized arguments: more"),
    ("xyz", "no command 'xyz'; limo-hog --help lists them all"),
    ("detect a.jpg --jsn b", "did you mean --json?"),
    ("detect a.jpg --model nobody.yml", "model is 'nobody.yml': no such file, and none of the names opencv,"),
    ("bench --size 640", "'640' is no size; wanted is WIDTHxHEIGHT such as 640x480"),
    ("bench --size 200x60", "a picture of 200x60 is smaller than the detector's window; 64x128 or more is wanted"),
    ("bench --image a.jpg --size 64x127", "a picture of 64x127 is smaller than the detector's window"),
    ("bench --image tiny.png", "a picture of 200x60 is smaller than the detector's window"),
    ("bench --channels rgb", "invalid choice: 'rgb' (choose from"),
    ("train crops --out m.yml --held-out 1", "'1' is no share; wanted is a number from 0 to 0.99"),
    ("follow --controller fast", "invalid choice: 'fast' (choose from"),
    ("follow --target 100", "'100' is no distance in metres; wanted is a number from 0.1 to 8"),
    ("follow --seconds -5", "'-5' is no duration in seconds"),
    ("follow --seed 1.5", "'1.5' is no seed; wanted is a whole number from 0 on"),
    ("follow --view 99999", "'99999' is no [HOST:]PORT such as 8488"),
    ("follow --video film.avi", "'film.avi': wanted is a name that ends in .mp4"),
    ("follow --record run.bag", "'run.bag': wanted is a name that ends in .mcap"),
    ("follow --plot run.gif", "'run.gif': wanted is a name that ends in .png or .svg or .pdf"),
    ("score --plot compared.txt", "'compared.txt': wanted is a name that ends in .png or .svg or .pdf"),
    ("score --seeds 0", "'0' is no count"),
    ("score --csv score.txt", "wanted is a name that ends in .csv"),
    ("score --seed-start -1", "no seed"),
    ("score --suite v1 --scenario empty", "not allowed with"),
    ("score --suite v1 --seconds 60", "a run of this suite takes 40 s"),
    ("score --controller approach --against ppo", "--against ppo: is none of the controllers"),
    ("score --controller zigzag", f"'zigzag' is no controller; wanted is one of {CONTROLLERS}"),
    ("score --scenario a/own.toml b/own.toml", "b/own.toml: is called 'own', as a/own.toml is; give it another name"),
    ("score --scenario named.toml empty", "empty: is called 'empty', as named.toml is; give it another name"),
    ("arena", "give --ros2, --view, --video or --record"),
    ("arena --view 0 --seconds 1 --plot a.png", "--plot a.png: an arena has no run to draw; use it with follow or run"),
    ("run", "the following arguments are required: NODE.py"),
    ("workshop", "the following arguments are required: new|check|solution"),
    ("workshop check node.py --hint -1", "'-1' is no count; wanted is a whole number from 1 on"),
    ("workshop grade nofolder", "nofolder: no such folder"),
    ("workshop grade node.py", "node.py: no such folder"),
    ("workshop grade folder", "folder: no Python file in it"),
    ("workshop grade folder --csv folder", "'folder' is a folder"),
    ("workshop grade folder --seconds -1", "'-1' is no duration in seconds"),
    ("workshop grade folder --memory 0", "'0' is no count"),
    ("workshop new there.txt", "there.txt is there already; give another name"),
    ("replay", "the following arguments are required: FILE"),
    ("topic", "the following arguments are required"),
    ("completion fish", "invalid choice: 'fish' (choose from"),
]
#: What cannot be done, which ends with 1: what is typed, and a part of the only line of the answer.
IMPOSSIBLE = [
    ("detect a.jpg --model there.txt", "there.txt"),
    ("bench --image there.txt", "there.txt: not an image that OpenCV can read (4 bytes)"),
    ("follow --scenario nowhere", "unknown scenario nowhere: want one of bollards, crossing,"),
    ("follow --scenario nowhere.toml", "nowhere.toml: cannot be read: No such file or directory"),
    ("follow --controller approach --target 1", "the approach controller holds no distance: use proxemic or tracking"),
    ("follow --detector yolo", "no detector 'yolo': want one of hog,"),
    ("follow --detector onnx:none.onnx", "none.onnx: no such file; --detector onnx:FILE wants an ONNX network"),
    ("score --suite v0", "unknown suite v0: want one of v1"),
    ("score --controller policy:none.npz", "none.npz: cannot be read as a policy"),
    ("score --detector yolo", "no detector 'yolo': want one of hog,"),
    ("score --controller approach --target 2", "the approach controller holds no distance"),
    *((f"score {option} there.txt/a.csv", "there.txt/a.csv: Not a directory") for option in ("--json", "--csv")),
    ("run none.py", "none.py: no such file"),
    ("workshop check none.py", "none.py: no such file"),
    ("replay none.mcap", "none.mcap"),
    ("replay there.txt", "there.txt"),
    ("replay .", ".: no ROS 2 recording that can be read, or cut off: "),
]


@pytest.fixture(autouse=True)
def folder(here: Path) -> None:
    """A working directory with two pictures, some texts and a folder."""
    cv2.imwrite("a.jpg", np.zeros((200, 200, 3), np.uint8))
    cv2.imwrite("tiny.png", np.zeros((60, 200, 3), np.uint8))
    for place in ("folder", "a", "b"):
        Path(place).mkdir()
    texts = {"there.txt": "text", "node.py": "", "named.toml": "name = 'empty'", "a/own.toml": "", "b/own.toml": ""}
    for name, text in texts.items():
        Path(name).write_text(text)


@pytest.mark.parametrize(("typed", "told"), WRONG_ARGUMENTS)
def test_wrong_arguments_are_answered_by_one_line_and_2(typed: str, told: str, answer_to: AnswerTo) -> None:
    before = sorted(Path().rglob("*"))
    code, out, err = answer_to(*shlex.split(typed))
    assert (code, out, sorted(Path().rglob("*"))) == (2, "", before)
    told_lines = [line for line in err.splitlines() if told in line]
    assert len(told_lines) == 1 and len(told_lines[0]) < 300
    # Before it, argparse's usage; after it nothing, but for the bare command, which is answered by its help.
    assert told_lines[0] == err.splitlines()[-1] or not typed


@pytest.mark.parametrize(("typed", "told"), IMPOSSIBLE)
def test_what_cannot_be_done_is_told_by_one_line_and_1(typed: str, told: str, answer_to: AnswerTo) -> None:
    code, out, err = answer_to(*typed.split())
    assert (code, out) == (1, "")
    (line,) = err.splitlines()
    assert line.startswith("limo-hog: ") and told in line and len(line) < 400


#: What needs OpenCV, and what Cyclone DDS.
OPENCVS = "detect a.jpg|bench --image a.jpg|follow|arena --view|run node.py|workshop check node.py|score --seeds 1"
DDS = ("follow --ros2", "arena --ros2", "topic list")
#: Libraries that are not installed, what is typed then, and the end of the only line of the answer.
MISSING = [
    *(("cv2", typed, "needs OpenCV: pip install 'limo-hog[cv]'") for typed in OPENCVS.split("|")),
    ("cv2", "replay a.mcap --detector cv2", "needs OpenCV: pip install 'limo-hog[cv]'"),
    ("av", "follow --video a.mp4", "writing H.264 video needs PyAV: pip install 'limo-hog[video]'"),
    ("matplotlib", "follow --plot a.png", "--plot needs matplotlib: pip install 'limo-hog[plot]'"),
    ("limo_sim", "follow", "limo-hog follow needs the arena: pip install 'limo-hog[sim]'"),
    ("rosbags", "follow --record a.mcap", "limo-hog follow needs rosbags: pip install 'limo-hog[record]'"),
    ("rosbags", "run node.py", "limo-hog run needs rosbags: pip install 'limo-hog[record]'"),
    ("rosbags", "workshop check node.py", "limo-hog workshop needs rosbags: pip install 'limo-hog[record]'"),
    ("rosbags", "replay a.mcap", "limo-hog replay needs rosbags: pip install 'limo-hog[record]'"),
    *(("cyclonedds", typed, "ROS 2 over the network needs Cyclone DDS: pip install 'limo-hog[ros2]'") for typed in DDS),
    ("shtab", "completion bash", "limo-hog completion needs shtab: pip install 'limo-hog[completion]'"),
    ("aiohttp", "follow --view", "the live page needs aiohttp: pip install 'limo-hog[view]'"),
]


def limo_hog_without(library: str, typed: str) -> subprocess.CompletedProcess[str]:
    code = f"import sys; sys.modules[{library!r}] = None; from limo_hog.cli.main import main; sys.exit(main())"
    command = [sys.executable, "-c", code, *typed.split()]
    return subprocess.run(command, check=False, capture_output=True, text=True, timeout=240)


@pytest.mark.parametrize(("library", "typed", "told"), MISSING)
def test_a_missing_library_is_told_by_the_line_that_installs_it(library: str, typed: str, told: str) -> None:
    done = limo_hog_without(library, typed)
    assert (done.returncode, done.stdout) == (1, "")
    (line,) = done.stderr.splitlines()
    assert line.startswith("limo-hog: ") and line.endswith(told)


@pytest.mark.parametrize("library", ["cyclonedds", "rosbags"])
def test_an_arena_that_is_only_filmed_needs_no_ros(library: str) -> None:
    done = limo_hog_without(library, "arena --video a.mp4 --seconds 0.5")
    assert done.returncode == 0, done.stderr
    assert Path("a.mp4").stat().st_size > 1000


@pytest.mark.parametrize("command", ["follow", "score"])
def test_a_detector_that_opencv_lacks_is_refused(command: str, monkeypatch: MonkeyPatch, answer_to: AnswerTo) -> None:
    monkeypatch.delattr(cv2, "HOGDescriptor")
    code, _, err = answer_to(command, "--detector", "cv2")
    assert code == 1 and err.endswith("has no HOGDescriptor: use the detector hog, or OpenCV 4\n")


@pytest.mark.parametrize("typed", ["detect a.jpg", "follow"])
def test_a_library_that_does_not_load_is_told_with_its_reason(typed: str, tmp_path: Path) -> None:
    reason = "libGL.so.1: cannot open shared object file"
    (tmp_path / "cv2.py").write_text(f"raise ImportError({reason!r}, name='cv2')")
    env = os.environ | {"PYTHONPATH": str(tmp_path)}
    done = subprocess.run([LIMO_HOG, *typed.split()], check=False, capture_output=True, text=True, env=env)
    (line,) = done.stderr.splitlines()
    assert done.returncode == 1 and line.endswith(f"needs OpenCV, which is installed but does not load: {reason}")
