"""`limo-hog` routes to commands, answers errors in one line and with an exit code."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from limo_hog.cli.main import ARENA, BUILT_IN, main

LIMO_HOG = Path(sys.executable).with_name("limo-hog")


@pytest.mark.parametrize("command", ARENA | BUILT_IN)
def test_every_command_explains_itself(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([command, "--help"]) == 0
    assert f"limo-hog {command}" in capsys.readouterr().out


@pytest.mark.parametrize("arguments", [[], ["nonsense"], ["detect"], ["bench", "--size", "large"]])
def test_wrong_arguments_end_with_2(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments) == 2
    assert "usage: limo-hog" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["dtect", "a.png"], "no command 'dtect'; did you mean detect?"),
        (["folow"], "no command 'folow'; did you mean follow?"),
        (["xyz"], "no command 'xyz'; limo-hog --help lists them all"),
        (["detect", "a.png", "--treshold", "1"], "unrecognized arguments: --treshold 1; did you mean --threshold?"),
        (["bench", "--sizes=640x480"], "unrecognized arguments: --sizes=640x480; did you mean --size?"),
        (["info", "more"], "unrecognized arguments: more"),
    ],
)
def test_a_misspelt_word_is_answered_with_the_likely_one(
    arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    shown = capsys.readouterr().err
    assert shown.splitlines()[-1].endswith(told)
    assert "usage: limo-hog" in shown


def test_the_package_runs_as_a_module() -> None:
    command = [sys.executable, "-m", "limo_hog", "--version"]
    assert subprocess.run(command, check=True, capture_output=True, text=True).stdout.startswith("limo-hog ")


@pytest.mark.parametrize("command", [["detect", "a.png"], ["bench", "--image", "a.png"]])
def test_a_command_that_needs_opencv_says_how_to_get_it(command: list[str], tmp_path: Path) -> None:
    code = "import sys; sys.modules['cv2'] = None; from limo_hog.cli.main import main; sys.exit(main(sys.argv[1:]))"
    done = subprocess.run([sys.executable, "-c", code, *command], check=False, capture_output=True, text=True)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith("limo-hog: ") and line.endswith("needs OpenCV: pip install 'limo-hog[cv]'")


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["detect", "a.png", "--json", "."], "'.' is a folder"),
        (["detect", "a.png", "--json", "/"], "'/' is a folder"),
        (["detect", "a.png", "--json", ""], "'' is no file"),
        (["bench", "--json", ".."], "'..' is a folder"),
        (["bench", "--size", "99999x99999"], "at most 64 megapixels"),
        (["bench", "--size", f"{'9' * 5000}x1"], "at most 64 megapixels"),
        (["bench", "--threads", "9" * 5000], "is no number of threads"),
    ],
)
def test_an_argument_that_could_only_fail_later_is_refused_at_once(
    arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    shown = capsys.readouterr().err
    assert told in shown
    assert len(shown.splitlines()[-1]) < 300


def test_too_little_memory_is_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def starve(_: object) -> int:
        raise MemoryError("Unable to allocate 3 TiB")

    monkeypatch.setattr("limo_hog.cli.info.run", starve)
    assert main(["info"]) == 1
    assert capsys.readouterr().err == "limo-hog: out of memory: Unable to allocate 3 TiB\n"


def test_a_named_error_is_one_line_and_with_debug_a_traceback(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["bench", "--image", "no-such-file.jpg"]
    assert main(arguments) == 1
    assert capsys.readouterr().err == "limo-hog: no-such-file.jpg: No such file or directory\n"
    with pytest.raises(FileNotFoundError):
        main([*arguments, "--debug"])
    with pytest.raises(FileNotFoundError):
        main(["--debug", *arguments])


def test_help_imports_no_library() -> None:
    code = (
        "import sys; from limo_hog.cli.main import main; main(['--help']);"
        "sys.exit(any(name in sys.modules for name in ('cv2', 'rich', 'av', 'limo_sim', 'aiohttp')))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False, capture_output=True).returncode == 0


def test_detect_imports_rich_only_where_a_terminal_shows_its_progress(tmp_path: Path) -> None:
    code = "import sys; from limo_hog.cli.main import main; main(sys.argv[1:]); sys.exit('rich' in sys.modules)"
    (tmp_path / "broken.jpg").write_bytes(b"no picture")
    command = [sys.executable, "-c", code, "detect", "--json", "-", str(tmp_path / "broken.jpg")]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0
    assert "limo-hog: " in done.stderr and "broken.jpg" in done.stderr


def test_a_reader_that_has_seen_enough_is_no_error() -> None:
    command = f"{LIMO_HOG} --help | true; echo ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", command], check=True, capture_output=True, text=True)
    assert done.stderr == ""
    assert done.stdout.strip() in ("0", "1")
