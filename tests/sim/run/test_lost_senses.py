"""A robot that lacks or loses a sense stands; the long form, with every case, is `tests.sim.run.lost_senses`."""

from __future__ import annotations

import pytest
from tests.sim.run.lost_senses import CASES, Case, wrong


@pytest.mark.parametrize(
    ("case", "seed"),
    [
        (Case(("scan",), 0.0), 3),
        (Case(("depth", "camera_info"), 0.0), 0),
        (Case(("scan", "odometry"), 2.0), 1),
        (Case(("depth",), 2.0), 2),
        (Case(("camera",), 2.0, "odometry", 100.0), 0),
        (Case(("scan",), 2.0, "scan", 0.3), 1),
    ],
    ids=str,
)
def test_without_a_sense_the_robot_stands_and_says_which(case: Case, seed: int) -> None:
    assert wrong(case, seed, case.at + 2.0) == []


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=str)
def test_whatever_is_lost_and_whosever_clock_is_wrong_it_stands(case: Case) -> None:
    assert wrong(case, 0) == []
