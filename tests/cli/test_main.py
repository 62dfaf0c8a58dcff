"""`limo-hog` routes to commands, answers errors in one line and with an exit code."""

import subprocess
import sys
from pathlib import Path
from unittest.mock import Mock

import pytest
from tests.answers import AnswerTo

from limo_hog.cli.main import ARENA, BUILT_IN, main


@pytest.mark.parametrize("command", ARENA | BUILT_IN)
def test_every_command_explains_itself(command: str, answer_to: AnswerTo) -> None:
    code, out, _ = answer_to(command, "--help")
    assert code == 0 and f"limo-hog {command}" in out


def test_the_package_runs_as_a_module() -> None:
    command = [sys.executable, "-m", "limo_hog", "--version"]
    assert subprocess.run(command, check=True, capture_output=True, text=True).stdout.startswith("limo-hog ")


def test_too_little_memory_is_one_line(monkeypatch: pytest.MonkeyPatch, answer_to: AnswerTo) -> None:
    monkeypatch.setattr("limo_hog.cli.info.run", Mock(side_effect=MemoryError("Unable to allocate 3 TiB")))
    assert answer_to("info") == (1, "", "limo-hog: out of memory: Unable to allocate 3 TiB\n")


def test_a_named_error_is_one_line_and_with_debug_a_traceback(answer_to: AnswerTo) -> None:
    arguments = ["bench", "--image", "no-such-file.jpg"]
    assert answer_to(*arguments) == (1, "", "limo-hog: no-such-file.jpg: No such file or directory\n")
    for typed in ([*arguments, "--debug"], ["--debug", *arguments]):
        with pytest.raises(FileNotFoundError):
            main(typed)


@pytest.mark.parametrize(("typed", "imported"), [("--help", set()), ("detect --json - broken.jpg", {"cv2"})])
def test_a_command_imports_the_libraries_that_it_needs(typed: str, imported: set[str], here: Path) -> None:
    (here / "broken.jpg").write_bytes(b"no picture")
    code = "import sys; from limo_hog.cli.main import main; main(); print(*sys.modules, sep='\\n')"
    done = subprocess.run([sys.executable, "-c", code, *typed.split()], check=True, capture_output=True, text=True)
    assert {"cv2", "rich", "av", "limo_sim", "aiohttp"} & {*done.stdout.splitlines()} == imported
