"""Names, files, pipes and terminals of others: a command names what it cannot use, does the rest, and ends."""

import json
import math
import os
import signal
import struct
import subprocess
import sys
import time
import zlib
from itertools import product
from pathlib import Path
from unittest.mock import Mock

import cv2
import pytest
from pytest import MonkeyPatch
from tests.answers import AnswerTo
from tests.cli.material import LIMO_HOG, PICTURE, film_of, lines_of

from limo_hog.atomic import alone, json_text, whole_file
from limo_hog.cli.main import main
from limo_hog.imaging.writing import write_image

#: A name with a byte that is no UTF-8, as an old camera or archive leaves it.
WRONG_BYTE = os.fsdecode(b"caf\xe9")


def ended(*arguments: object, shell: str = "", cwd: Path | None = None, **env: str) -> subprocess.CompletedProcess[str]:
    """The command in a process of its own; `shell` is what a shell adds, such as >&- or | head -1."""
    command = ["bash", "-c", f'set -o pipefail; "$@" {shell}', "-", str(LIMO_HOG), *map(str, arguments)]
    env = os.environ | env
    return subprocess.run(command, check=False, capture_output=True, text=True, timeout=120, env=env, cwd=cwd)


def test_a_film_whose_name_is_not_utf8_is_searched(tmp_path: Path) -> None:
    film_of(tmp_path / "film.mp4", frames=3)
    (tmp_path / "film.mp4").rename(tmp_path / f"{WRONG_BYTE}.mp4")
    assert ended("detect", tmp_path, "--json", tmp_path / "found").returncode == 0
    assert [line["frame"] for line in lines_of((tmp_path / "found").read_text())] == [0, 1, 2]


@pytest.mark.parametrize("typed", ["detect http://127.0.0.1:9/NAME.avi", "follow --detector onnx:NAME"])
def test_a_name_that_opencv_cannot_take_is_refused_by_name(typed: str, tmp_path: Path) -> None:
    (tmp_path / WRONG_BYTE).write_bytes(b"no network")
    done = ended(*typed.replace("NAME", WRONG_BYTE).split(), cwd=tmp_path)
    line = done.stderr.splitlines()[0]
    assert done.returncode == 1 and "caf\\udce9" in line and "UTF-8" in line


def test_stopping_does_not_wait_for_a_reader_that_never_returns(pictures: Path, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "stalled")
    # A drive that does not answer: opening waits, as a pipe's without a writer does.
    code = (
        "import os, sys\nfrom limo_hog.cli.support import pictures\n"
        f"pictures.read_image = lambda source: os.open({str(tmp_path / 'stalled')!r}, os.O_RDONLY)\n"
        "from limo_hog.cli.main import main\nprint('begun', flush=True)\nsys.exit(main())"
    )
    command = [sys.executable, "-c", code, "detect", str(pictures)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None and child.stdout.readline() == "begun\n"
        time.sleep(1.5)
        child.send_signal(signal.SIGINT)
        try:
            assert child.wait(2.5) == 128 + signal.SIGINT
        finally:
            child.kill()


def test_a_picture_of_too_many_pixels_is_refused_by_its_header(pictures: Path) -> None:
    huge = bytearray((pictures / "a.png").read_bytes())
    huge[16:24] = struct.pack(">II", 30_000, 30_000)
    huge[29:33] = struct.pack(">I", zlib.crc32(huge[12:29]))
    (pictures / "huge.png").write_bytes(huge)
    limited = f"ulimit -v 4000000; exec {LIMO_HOG} detect {pictures} --threads 1 --json -"
    done = subprocess.run(["bash", "-c", limited], check=False, capture_output=True, text=True, timeout=120)
    assert (done.returncode, len(lines_of(done.stdout))) == (1, 3)
    assert "huge.png: too many pixels; at most 268435456 are read" in done.stderr


def test_a_picture_too_large_for_memory_is_named(pictures: Path, answer_to: AnswerTo, monkeypatch: MonkeyPatch) -> None:
    read = Mock(side_effect=[MemoryError("1 GB"), PICTURE, PICTURE])
    monkeypatch.setattr("limo_hog.cli.support.pictures.read_image", read)
    code, out, err = answer_to("detect", pictures, "--threads", 1)
    assert (code, len(out.splitlines())) == (1, 2)
    assert f"limo-hog: {pictures / 'a.png'}: out of memory: 1 GB" in err.splitlines()


def test_copies_in_a_folder_below_the_pictures_are_no_inputs(pictures: Path, answer_to: AnswerTo) -> None:
    typed = ("detect", pictures, "--out", pictures / "found", "--json", pictures / "found.json")
    assert answer_to(*typed).code == 0
    assert "0 pictures, 0 people in 0 of them; 3 done before" in answer_to(*typed, "--resume").err
    assert len(list((pictures / "found").rglob("*.png"))) == 3


def test_control_characters_of_a_name_do_not_reach_the_terminal(tmp_path: Path) -> None:
    write_image(tmp_path / "a\x1b[31m\nb.png", PICTURE)
    (tmp_path / "c\x1b[2J\rd.png").write_bytes(b"no picture")
    done = ended("detect", tmp_path)
    assert len(done.stdout.splitlines()) == 1 and len(done.stderr.splitlines()) == 2
    assert not [letter for letter in done.stdout + done.stderr if letter != "\n" and not letter.isprintable()]
    assert "a\\x1b[31m\\nb.png" in done.stdout and "c\\x1b[2J\\rd.png" in done.stderr


def test_control_characters_and_markup_of_a_file_do_not_reach_the_terminal(tmp_path: Path) -> None:
    (tmp_path / "evil.toml").write_text('name = "[/]\\u001b[2J"\n"\\u001b[2Jx" = 1\n')
    refused = ended("follow", "--scenario", tmp_path / "evil.toml", "--seconds", 1)
    assert refused.returncode == 1 and "\x1b" not in refused.stderr and "\\x1b[2Jx" in refused.stderr
    (tmp_path / "evil.toml").write_text('name = "[/]\\u001b[2J"\n')
    done = ended("follow", "--scenario", tmp_path / "evil.toml", "--seconds", 1)
    assert (done.returncode, done.stderr) == (0, "")
    assert "[/]\\x1b[2J" in done.stdout and "\x1b" not in done.stdout


def test_films_that_are_none_are_named_and_their_bytes_do_not_reach_the_terminal(tmp_path: Path) -> None:
    # OpenCV's own reader of AVI prints what stands where LIST is wanted.
    (tmp_path / "evil.avi").write_bytes(b"RIFF\x10\0\0\0AVI \x1b[2J\x10\0\0\0hdrl" + bytes(99))
    film = cv2.VideoWriter(str(tmp_path / "cut.mkv"), cv2.VideoWriter.fourcc(*"MJPG"), 10, PICTURE.shape[1::-1])
    film.write(PICTURE)
    film.release()
    with (tmp_path / "cut.mkv").open("r+b") as file:
        file.truncate(736)  # its header
    done = ended("detect", tmp_path)
    assert (done.returncode, done.stdout) == (1, "")
    named = [line.rpartition("/")[2] for line in done.stderr.splitlines()[:-1]]
    assert named == ["cut.mkv: no frame of it could be read", "evil.avi: not a video that OpenCV can read"]


#: Commands that end soon, with the lines they print where nothing is closed.
QUICK = ("info", "completion bash", "detect a.png", "detect a.png --json found", "follow --seconds 0.5")


@pytest.mark.parametrize("typed", QUICK)
@pytest.mark.parametrize("shell", [">&-", "2>&-", "<&-", ">&- 2>&-", "| head -1", "2>/dev/full"])
def test_closed_descriptors_and_lost_readers_change_nothing(typed: str, shell: str, tmp_path: Path) -> None:
    write_image(tmp_path / "a.png", PICTURE)
    done = ended(*typed.split(), shell=shell, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert len(done.stderr.splitlines()) <= 1 and "rror" not in done.stderr
    assert "found" not in typed or len(lines_of((tmp_path / "found").read_text())) == 1


@pytest.mark.parametrize("typed", QUICK)
def test_a_terminal_that_knows_ascii_alone_changes_nothing(typed: str, tmp_path: Path) -> None:
    write_image(tmp_path / "café.png", PICTURE)
    words = typed.replace("a.png", "café.png").split()
    done = ended(*words, cwd=tmp_path, LC_ALL="C", PYTHONCOERCECLOCALE="0", PYTHONUTF8="0")
    assert done.returncode == 0 and "rror" not in done.stderr
    assert done.stdout.isascii() and len(done.stderr.splitlines()) <= 1


def test_a_narrow_terminal_changes_nothing() -> None:
    for columns, typed in product(("1", "3", "20"), ("info", "follow --seconds 0.5")):
        assert ended(*typed.split(), COLUMNS=columns).returncode == 0


def test_a_reader_who_leaves_ends_a_run_that_keeps_nothing(tmp_path: Path) -> None:
    for number in range(40):
        write_image(tmp_path / f"{number:02d}.png", PICTURE)
    done = ended("detect", tmp_path, "--threads", 1, shell="| head -1")
    assert done.returncode == 1 and int(done.stderr.split()[0]) < 40
    kept = ended("detect", tmp_path, "--csv", tmp_path / "found.csv", shell="| head -1")
    assert kept.returncode == 0 and len((tmp_path / "found.csv").read_text().splitlines()) > 40
    copied = ended("detect", tmp_path, "--json", "-", "--out", tmp_path / "copies", shell="| head -1")
    assert copied.returncode == 0 and len(list((tmp_path / "copies").iterdir())) == 40


def test_a_terminal_that_is_gone_is_survived_and_a_full_disk_is_told() -> None:
    terminal, gone = os.openpty()
    os.close(terminal)
    assert subprocess.run([LIMO_HOG, "info"], check=False, stdout=gone, timeout=60).returncode == 0
    os.close(gone)
    full = ended("info", shell=">/dev/full")
    assert (full.returncode, full.stderr) == (1, "limo-hog: standard output: No space left on device\n")


def test_two_writers_of_one_file_do_not_share_a_temporary_name(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    with whole_file(path) as first:
        first.write_text("first")
        with whole_file(path) as second:
            second.write_text("second")
        assert path.read_text() == "second"
    assert path.read_text() == "first"


@pytest.mark.parametrize(
    "typed",
    [
        "evaluate opencv labels.json --json labels.json",
        "train labels.json --out labels.json",
        "detect a.png --model m.yml --csv m.yml --overwrite",
        "follow --scenario s.toml --json s.toml",
        *(f"detect a.png --out . {how}" for how in ("", "--resume", "--overwrite")),
    ],
)
def test_an_input_is_never_written_over(typed: str, here: Path, answer_to: AnswerTo) -> None:
    for name in ("labels.json", "m.yml", "s.toml", "a.png"):
        (here / name).write_text("mine")
    code, _, err = answer_to(*typed.split())
    assert code == 2 and "is itself an input: " in err
    assert {path.read_text() for path in here.iterdir()} == {"mine"}


@pytest.mark.parametrize(
    "typed",
    [
        *(f"detect a.png --{kind} there.txt" for kind in ("json", "csv", "coco")),
        "train a.png --out there.yml",
        "evaluate opencv a.png --json there.txt",
        "evaluate opencv a.png --report full",
        "bench --json there.txt",
        "replay r.mcap --json there.txt",
        "replay r.mcap --video there.mp4",
        *(f"{one} --json there.txt" for one in ("follow", "follow --ros2", "run n.py", "score", "workshop check n.py")),
        *(f"{one} --video there.mp4" for one in ("follow", "run n.py", "arena")),
        *(f"{one} --record there.mcap" for one in ("follow", "run n.py", "arena")),
        *(f"{one} --plot there.png" for one in ("follow", "run n.py", "score")),
        "workshop check n.py --html there.png",
        "workshop check n.py --gradescope there.txt",
        "workshop grade full --csv there.csv",
        "score --csv there.csv",
        "export --out full",
    ],
)
def test_no_command_replaces_what_is_there_unless_told_to(typed: str, here: Path, answer_to: AnswerTo) -> None:
    (here / "full").mkdir()
    for name in ("full/mine", *(f"there.{suffix}" for suffix in ("txt", "yml", "mp4", "mcap", "png", "csv"))):
        (here / name).write_text("mine")
    code, _, err = answer_to(*typed.split())
    assert code == 2 and " would be overwritten: --overwrite replaces it" in err
    if "there.txt" in typed:
        err = answer_to(*typed.replace("there.txt", "full").split()).err
        assert "'full' is a folder; wanted is a file's name" in err
    assert {path.read_text() for path in here.rglob("*") if path.is_file()} == {"mine"}


def test_a_command_replaces_what_is_there_where_it_is_told_to(tmp_path: Path) -> None:
    card, film = tmp_path / "card.json", tmp_path / "film.mp4"
    for path in (card, film):
        path.write_text("old")
    typed = ["follow", "--seconds", "0.1", "--json", str(card), "--video", str(film)]
    assert main([*typed, "--overwrite"]) == 0
    assert json.loads(card.read_text()) and film.stat().st_size > 100
    assert not list(tmp_path.glob(".*"))


@pytest.mark.parametrize(
    "typed",
    [
        "train labels.json --overwrite --out m.yml",
        "follow --seconds 1 --overwrite --record m.mcap",
        *(f"detect a.png {how} --json m.json" for how in ("--resume", "--overwrite")),
    ],
)
def test_two_runs_do_not_write_one_file(typed: str, here: Path, answer_to: AnswerTo) -> None:
    target = Path(typed.split()[-1])
    target.write_text("mine")
    with alone(target):
        code, _, err = answer_to(*typed.split())
    assert (code, target.read_text()) == (1, "mine")
    assert err == f"limo-hog: {target}: another run is writing it, and holds .m.lock{target.suffix}\n"
    assert list(here.iterdir()) == [here / target]


def test_json_holds_no_number_that_json_does_not_know() -> None:
    for value in (math.nan, math.inf, -math.inf):
        with pytest.raises(ValueError, match="not JSON compliant"):
            json_text({"ms": [1.0, value]})


def test_an_unknown_backend_is_named_in_one_line() -> None:
    done = ended("detect", "a.png", LIMO_HOG_BACKEND="mmx")
    assert (done.returncode, len(done.stderr.splitlines())) == (1, 1)
    assert "mmx" in done.stderr and "scalar" in done.stderr


def test_pictures_are_searched_while_python_ends(tmp_path: Path) -> None:
    write_image(tmp_path / "a.png", PICTURE)
    code = (
        "import atexit, limo_hog\nfound = limo_hog.PeopleDetector().detect_many\n"
        f"atexit.register(lambda: print(sum(map(len, found([{str(tmp_path / 'a.png')!r}] * 8)))))"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True, timeout=60)
    assert int(done.stdout) >= 8 and not done.stderr
