"""`limo-hog` routes to commands, answers errors in one line and with an exit code."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from limo_hog.cli.main import ARENA, BUILT_IN, main


@pytest.mark.parametrize("command", ARENA | BUILT_IN)
def test_every_command_explains_itself(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([command, "--help"]) == 0
    assert f"limo-hog {command}" in capsys.readouterr().out


def test_the_package_runs_as_a_module() -> None:
    command = [sys.executable, "-m", "limo_hog", "--version"]
    assert subprocess.run(command, check=True, capture_output=True, text=True).stdout.startswith("limo-hog ")


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


def test_wrong_words_are_answered_with_the_usage_and_a_name_that_is_no_file_too(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for arguments in (["nonsense"], ["detect", "a.png", "--json", ""]):
        assert main(arguments) == 2
        shown = capsys.readouterr().err
        assert "usage: limo-hog" in shown
    assert "'' is no file" in shown
