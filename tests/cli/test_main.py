"""`limo-hog` routes to commands, answers errors in one line and with an exit code."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from tests.cli.material import AnswerTo

from limo_hog.cli.main import ARENA, BUILT_IN, main


@pytest.mark.parametrize("command", ARENA | BUILT_IN)
def test_every_command_explains_itself(command: str, answer_to: AnswerTo) -> None:
    code, out, _ = answer_to(command, "--help")
    assert code == 0 and f"limo-hog {command}" in out


def test_the_package_runs_as_a_module() -> None:
    command = [sys.executable, "-m", "limo_hog", "--version"]
    assert subprocess.run(command, check=True, capture_output=True, text=True).stdout.startswith("limo-hog ")


def test_too_little_memory_is_one_line(monkeypatch: pytest.MonkeyPatch, answer_to: AnswerTo) -> None:
    def starve(_: object) -> int:
        raise MemoryError("Unable to allocate 3 TiB")

    monkeypatch.setattr("limo_hog.cli.info.run", starve)
    assert answer_to("info") == (1, "", "limo-hog: out of memory: Unable to allocate 3 TiB\n")


def test_a_named_error_is_one_line_and_with_debug_a_traceback(answer_to: AnswerTo) -> None:
    arguments = ["bench", "--image", "no-such-file.jpg"]
    assert answer_to(*arguments) == (1, "", "limo-hog: no-such-file.jpg: No such file or directory\n")
    for typed in ([*arguments, "--debug"], ["--debug", *arguments]):
        with pytest.raises(FileNotFoundError):
            main(typed)


def modules_of(*words: object) -> set[str]:
    """Run a command in a process of its own; return its lines and the modules it imported."""
    code = "import sys; from limo_hog.cli.main import main; main(); print(*sys.modules, sep='\\n')"
    command = [sys.executable, "-c", code, *map(str, words)]
    return set(subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines())


def test_help_imports_no_library_and_rich_is_for_a_terminals_progress(tmp_path: Path) -> None:
    assert modules_of("--help").isdisjoint({"cv2", "rich", "av", "limo_sim", "aiohttp"})
    (tmp_path / "broken.jpg").write_bytes(b"no picture")
    assert modules_of("detect", "--json", "-", tmp_path / "broken.jpg") & {"cv2", "rich"} == {"cv2"}


def test_wrong_words_are_answered_with_the_usage_and_a_name_that_is_no_file_too(answer_to: AnswerTo) -> None:
    for typed, told in ((["nonsense"], "nonsense"), (["detect", "a.png", "--json", ""], "'' is no file")):
        code, _, err = answer_to(*typed)
        assert code == 2 and err.startswith("usage: limo-hog") and told in err
