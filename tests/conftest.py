"""What every test begins with, whatever started the tests."""

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.answers import Answer, AnswerTo

# A shell without job control starts `command &` with SIGINT ignored, and `nohup` ignores SIGHUP. Processes that a test
# starts would inherit that, and tests that send these signals would wait in vain.
for _number, _handler in ((signal.SIGINT, signal.default_int_handler), (signal.SIGHUP, signal.SIG_DFL)):
    if signal.getsignal(_number) is signal.SIG_IGN:
        signal.signal(_number, _handler)


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def threads_put_back() -> Iterator[None]:
    """The number of threads of searches is afterwards what it was."""
    import limo_hog

    before = limo_hog.get_num_threads()
    yield
    limo_hog.set_num_threads(before)


@pytest.fixture
def answer_to(capsys: pytest.CaptureFixture[str]) -> AnswerTo:
    """Run `limo-hog` with some words, and return its code and what it printed."""
    from limo_hog.cli.main import main

    return lambda *words: Answer(main([str(word) for word in words]), *capsys.readouterr())
