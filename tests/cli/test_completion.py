"""`limo-hog completion` prints a script with which a shell completes commands, options and values."""

import subprocess

import pytest
from tests.answers import AnswerTo

from limo_hog.cli.completion import SHELLS
from limo_hog.cli.main import ARENA, BUILT_IN


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("limo-hog ''", {*ARENA, *BUILT_IN}),
        ("limo-hog det", {"detect"}),
        ("limo-hog detect --min", {"--min-height"}),
        ("limo-hog detect --nms ''", {"overlap", "group"}),
        ("limo-hog follow --controller tr", {"tracking"}),
        ("limo-hog workshop ''", {"new", "check", "grade", "solution"}),
    ],
)
def test_bash_completes(typed: str, offered: set[str], answer_to: AnswerTo) -> None:
    script = answer_to("completion", "bash").out
    script += (
        f"\nCOMP_WORDS=({typed}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1)); _shtab_limo_hog; echo ${{COMPREPLY[*]}}"
    )
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True)
    found = {word for word in done.stdout.split() if word.startswith("--") or not word.startswith("-")}
    assert found == offered


@pytest.mark.parametrize("shell", SHELLS)
def test_each_shell_gets_a_script_that_knows_every_command(shell: str, answer_to: AnswerTo) -> None:
    script = answer_to("completion", shell).out
    assert all(command in script for command in ARENA | BUILT_IN)
