"""A signal stops a command once, between two writes, and is not lost."""

import signal
from concurrent.futures import ThreadPoolExecutor

import pytest

from limo_hog import signals
from limo_hog.signals import Stopped, held, stopping


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_stops_a_command_and_handlers_are_put_back(number: signal.Signals) -> None:
    before = signal.getsignal(number)
    with pytest.raises(Stopped) as stopped, stopping():
        signal.raise_signal(number)
    assert stopped.value.signal == number and signal.getsignal(number) is before


def test_a_write_is_finished_before_a_signal_stops_the_command() -> None:
    done = []
    with pytest.raises(Stopped), stopping():
        with held(), held():
            signal.raise_signal(signal.SIGTERM)
            done.append("written")
        done.append("not reached")
    assert done == ["written"]


def test_a_signal_that_a_library_swallows_stops_the_command_at_the_next_write() -> None:
    done = []
    with pytest.raises(Stopped), stopping():
        try:
            signal.raise_signal(signal.SIGTERM)
        except KeyboardInterrupt:
            done.append("swallowed")
        with held():
            done.append("written")
        done.append("not reached")
    assert done == ["swallowed", "written"]


def test_the_signals_of_one_closing_terminal_do_not_interrupt_the_closing(monkeypatch: pytest.MonkeyPatch) -> None:
    closed = []
    with pytest.raises(Stopped), stopping():
        try:
            signal.raise_signal(signal.SIGHUP)
        finally:
            signal.raise_signal(signal.SIGTERM)
            closed.append("whole")
            monkeypatch.setattr(signals, "IMPATIENT_S", 0.0)
            signal.raise_signal(signal.SIGTERM)
            closed.append("not reached")
    assert closed == ["whole"]


def test_an_ignored_signal_stays_ignored_and_a_thread_may_run_a_command() -> None:
    def run() -> str:
        with stopping(), held():
            signal.raise_signal(signal.SIGHUP)
            return "run"

    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with ThreadPoolExecutor(1) as pool:
            assert [run(), pool.submit(run).result()] == ["run", "run"]
    finally:
        signal.signal(signal.SIGHUP, before)
