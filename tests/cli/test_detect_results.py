"""What `detect` writes is whole, replaced only when asked, and gone on from."""

import errno
import json
import os
import signal
import stat
import subprocess
import time
from pathlib import Path

import cv2
import pytest
from tests.answers import AnswerTo
from tests.cli.material import LIMO_HOG, film_of, lines_of, on_a_full_disk

from limo_hog.cli.main import main


def test_resuming_does_only_what_is_left(pictures: Path, tmp_path: Path) -> None:
    file, film = tmp_path / "out.json", tmp_path / "film.mp4"
    film_of(film)
    arguments = ["detect", str(pictures), str(film), "--json", str(file), "--resume"]
    assert main(arguments[:-1]) == 0
    whole = file.read_text().splitlines()
    assert len(whole) == 3 + 12
    # As a killed run leaves it: beside, with half a line.
    file.unlink()
    (tmp_path / ".out.part.json").write_text("\n".join([whole[0], *whole[3:8], whole[8][:20]]))
    assert main(arguments) == 0
    key = [(r["source"], r["frame"]) for r in lines_of("\n".join(whole))]
    again = lines_of(file.read_text())
    assert sorted((r["source"], r["frame"]) for r in again) == sorted(key)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["film.mp4", "in", "out.json"]


def test_copies_and_lines_that_are_there_are_not_made_again(pictures: Path, tmp_path: Path) -> None:
    film, out, file = tmp_path / "film.mp4", tmp_path / "out", tmp_path / "found.json"
    film_of(film)
    arguments = ["detect", str(pictures), str(film), "--out", str(out), "--json", str(file), "--resume"]
    assert main(arguments) == 0
    before = file.read_text()
    made = {path: path.stat().st_mtime_ns for path in out.rglob("*") if path.is_file()}
    assert len(made) == 4
    gone = out / "in" / "deep" / "b.png"
    gone.unlink()
    assert main(arguments) == 0
    again = {path: path.stat().st_mtime_ns for path in out.rglob("*") if path.is_file()}
    assert [path for path in made if made[path] != again.pop(path)] == [gone] and not again
    assert file.read_text() == before
    # Lines that a killed run lacks are added, and the film's copy stays.
    file.write_text("".join(before.splitlines(keepends=True)[:8]))
    assert main(arguments) == 0
    now, then = ([(r["source"], r["frame"]) for r in lines_of(text)] for text in (file.read_text(), before))
    assert now == then and (out / "film.mp4").stat().st_mtime_ns == made[out / "film.mp4"]


def test_results_go_through_a_pipe_which_keeps_nothing(pictures: Path, tmp_path: Path, answer_to: AnswerTo) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with subprocess.Popen(["cat", pipe], stdout=subprocess.PIPE, text=True) as reader:
        assert main(["detect", str(pictures), "--json", str(pipe)]) == 0
        came = reader.communicate(timeout=10)[0]
    assert [Path(r["source"]).name for r in lines_of(came)] == ["a.png", "c.png", "b.png"]
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["in", "pipe"]
    code, _, err = answer_to("detect", pictures, "--json", pipe, "--resume")
    assert code == 2 and "--json FILE or --out DIR" in err


def test_results_to_the_null_device_leave_it_a_device(pictures: Path, tmp_path: Path) -> None:
    null = tmp_path / "null"
    null.symlink_to("/dev/null")
    for table in ("--json", "--csv", "--coco"):
        assert main(["detect", str(pictures), table, str(null)]) == 0
        assert stat.S_ISCHR(null.stat().st_mode)


def test_the_files_of_an_earlier_run_are_kept_unless_asked(pictures: Path, tmp_path: Path, answer_to: AnswerTo) -> None:
    for option, name, told in (("--json", "found.json", "found.json"), ("--out", "out", "a.png")):
        arguments = ("detect", pictures, option, tmp_path / name)
        assert answer_to(*arguments).code == 0
        before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
        code, _, err = answer_to(*arguments)
        assert code == 2 and told in err and "--overwrite" in err
        assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")} == before
        assert answer_to(*arguments, "--overwrite").code == 0
    assert len(lines_of((tmp_path / "found.json").read_text())) == 3

    # What a killed run left is not lost unasked, either.
    (tmp_path / ".killed.part.json").write_text("{}\n")
    code, _, err = answer_to("detect", pictures, "--json", tmp_path / "killed.json")
    assert code == 2 and "--resume goes on from it" in err


@pytest.mark.parametrize(("option", "was", "now"), [("--threshold", "0.5", "None"), ("--search", "guided", "exact")])
def test_resuming_with_other_parameters_is_refused(
    option: str, was: str, now: str, pictures: Path, tmp_path: Path, answer_to: AnswerTo
) -> None:
    file = tmp_path / "found.json"
    arguments = ("detect", pictures, "--json", file)
    assert answer_to(*arguments, option, was).code == 0
    before = file.read_bytes()
    code, _, err = answer_to(*arguments, "--resume")
    assert code == 1 and f"found.json was made with other parameters: {option[2:]} {was}, now {now}" in err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["found.json", "in"]
    assert answer_to(*arguments, "--resume", option, was).code == 0
    assert file.read_bytes() == before


#: Names of a line, and values of another kind.
WRONG: list[tuple[str, object]] = [
    *(("boxes", value) for value in (5, [5], [[1, 2, 3]], [["1", 2, 3, 4]])),
    *(("scores", ["high"]), ("scores", []), ("source", []), ("frame", "0"), ("width", None), ("parameters", 7)),
]


def test_a_line_with_values_of_another_kind_is_not_gone_on_from(
    pictures: Path, here: Path, answer_to: AnswerTo
) -> None:
    arguments = ("detect", pictures / "a.png", "--json", "found.json", "--csv", "found.csv")
    assert answer_to(*arguments).code == 0
    file = here / "found.json"
    whole = lines_of(file.read_text())[0] | {"boxes": [[1, 2, 3, 4]], "windows": [[0, 0, 9, 9]]}
    whole |= {"scores": [0.5], "probabilities": [0.9]}
    for damaged in ("my notes\n", *(json.dumps(whole | {name: value}) + "\n" for name, value in WRONG)):
        file.write_text(damaged)
        code, _, err = answer_to(*arguments, "--resume")
        assert code == 1 and "found.json: not the JSON lines of an earlier run" in err, damaged
        assert file.read_text() == damaged
    file.write_text(json.dumps(whole) + "\n")
    assert answer_to(*arguments, "--resume").code == 0


def test_ctrl_c_keeps_what_is_done(tmp_path: Path) -> None:
    film, file, out = tmp_path / "film.mp4", tmp_path / "out.json", tmp_path / "out"
    film_of(film, frames=2000)
    command = [str(LIMO_HOG), "detect", str(film), "--json", str(file), "--out", str(out)]
    process, part = subprocess.Popen(command, stderr=subprocess.PIPE, text=True), tmp_path / ".out.part.json"
    deadline = time.monotonic() + 30
    while not (part.exists() and part.stat().st_size) and time.monotonic() < deadline:
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=30)
    assert process.returncode == 130 and said.splitlines()[-1] == "limo-hog: stopped"
    assert "Traceback" not in said
    frames = [r["frame"] for r in lines_of(file.read_text())]
    assert frames == list(range(len(frames))) and 0 < len(frames) < 2000
    assert list(out.iterdir()) == [] and not part.exists()


def test_a_full_disk_is_one_line_and_leaves_nothing_half_written(pictures: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    typed = ["detect", str(pictures), "--out", str(out), "--json", str(out / "o.json")]
    done = on_a_full_disk(64_000, *typed)
    assert done.returncode == 1 and os.strerror(errno.EFBIG) in done.stderr and "Traceback" not in done.stderr
    for path in out.rglob("*.png"):
        assert cv2.imread(str(path)) is not None
    assert lines_of((out / "o.json").read_text()) is not None
    assert not list(out.rglob(".*"))
