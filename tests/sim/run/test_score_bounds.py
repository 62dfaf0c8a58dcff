"""What exactly counts: frames, the time after which a person was lost, and the share in view."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.sim.run.test_score import ON, card, person, step

from limo_sim.run.matching import person_of


def test_frames_are_counted_and_periods_without_one_are_not() -> None:
    steps = [step(k, person()) for k in range(5)]
    steps[2] = replace(steps[2], frame=None)
    assert card(*steps).frames == 4


@pytest.mark.parametrize(("until", "lost"), [(0.5, 0), (0.75, 1)])
def test_a_person_is_lost_who_was_not_the_target_for_longer_than_half_a_second(until: float, lost: int) -> None:
    # Times whose sums are exact.
    followed = replace(step(0, person(), boxes=[ON], target=0), time=0.0)
    without = replace(followed, decision=replace(followed.decision, target=None))
    between = [replace(without, time=float(time)) for time in np.arange(0.25, until, 0.25)]
    assert card(followed, *between, replace(followed, time=until)).lost == lost


@pytest.mark.parametrize(("visible", "share"), [(0.5, 1.0), (0.499, 0.5)])
def test_a_person_is_in_view_of_whom_half_is_visible(visible: float, share: float) -> None:
    assert card(step(0, person()), step(1, person(visible=visible))).in_view == share


def test_of_two_people_at_a_box_it_is_on_the_one_of_whom_half_is_visible() -> None:
    hidden, half = person(visible=0.4), person(visible=0.5, box=(305, 100, 60, 120))
    assert person_of(np.array(ON, np.int32), (hidden, half)) == 1
    # Of two in view it is on the one whose middle is nearer to its own.
    assert person_of(np.array(ON, np.int32), (person(), half)) == 0


def test_the_jerk_is_measured_over_the_whole_run() -> None:
    # Straight on, in pushes that come late in the run.
    along = np.cumsum([0.1] * 8 + [0.1, 0.15, 0.3, 0.3, 0.1, 0.4])
    steps = [step(k, person(), robot=(float(x), 0.0, 0.0)) for k, x in enumerate(along)]
    assert card(*steps).jerk_mean == pytest.approx(np.abs(np.diff(along, 3)).mean() / 0.1**3)
