"""Threads that cannot be had are done without; a count that makes no sense is a named error."""

import os
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from tests.reliability.child import run

import limo_hog


@pytest.mark.skipif(os.name != "posix", reason="resource limits are POSIX")
def test_a_search_finds_the_same_when_no_more_threads_can_be_had() -> None:
    # With such a stack no thread can be made.
    program = """
    os.environ["RUST_MIN_STACK"] = str(1 << 46)
    hog, image = armed(), people(320, 240)
    limo_hog.set_num_threads(1)
    wanted = hog.detectMultiScale(image, -0.5)
    limo_hog.set_num_threads(10**6)
    found = hog.detectMultiScale(image, -0.5)
    print(len(wanted[0]), all(np.array_equal(a, b) for a, b in zip(found, wanted)))
    """
    done = run(program, 120)
    assert (done.returncode, done.stdout.split()[1:]) == (0, ["True"]), done.stdout + done.stderr


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="counts a process's threads as Linux lists them")
def test_a_search_works_on_no_more_threads_than_there_are_cores() -> None:
    program = """
    from pathlib import Path

    limo_hog.set_num_threads(64)
    armed().detectMultiScale(people(320, 240), -0.5)
    names = [task.joinpath("comm").read_text().strip() for task in Path("/proc/self/task").iterdir()]
    print(names.count("limo-hog") + 1 <= len(os.sched_getaffinity(0)))
    """
    done = run(program, 120)
    assert (done.returncode, done.stdout.split()) == (0, ["True"]), done.stdout + done.stderr


def test_the_number_of_threads_is_what_was_set_and_bounded(threads_put_back: None) -> None:
    limo_hog.set_num_threads(3)
    assert limo_hog.get_num_threads() == 3
    for any_number in (0, 10**6):
        limo_hog.set_num_threads(any_number)
        assert 1 <= limo_hog.get_num_threads() <= 1024


@pytest.mark.parametrize(("told", "n"), [*product(["threads"], [10**400, -1]), *product(["integer"], ["2", 2.5, None])])
def test_a_number_of_threads_that_makes_no_sense_is_a_named_error(told: str, n: Any) -> None:
    with pytest.raises(limo_hog.ParameterError, match=told):
        limo_hog.set_num_threads(n)
