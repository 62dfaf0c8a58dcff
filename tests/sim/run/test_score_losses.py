"""When the subject of a run counts as lost, and as found again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.sim.run.test_score import OFF, ON, card, person, step


@pytest.mark.parametrize(("searched", "found_again"), [(3.0, 1.0), (3.25, 0.0)])
def test_a_search_of_up_to_three_seconds_counts_as_found_again(searched: float, found_again: float) -> None:
    # Times whose sums are exact.
    times = [0.0, *np.arange(0.25, searched, 0.25), searched]
    steps = [replace(step(0, person(), boxes=[ON], target=0), time=time) for time in times]
    empty = [replace(one, decision=replace(one.decision, target=None)) for one in steps[1:-1]]
    result = card(steps[0], *empty, steps[-1])
    assert (result.lost, result.found_again) == (1, found_again)


def test_the_longest_gap_is_between_two_detections_of_the_subject() -> None:
    seen = {0, 1, 5, 7}
    steps = [step(k, person(), boxes=[ON] if k in seen else [OFF], target=0 if k in seen else None) for k in range(9)]
    assert card(*steps).longest_gap_s == pytest.approx(0.4)


@pytest.mark.parametrize(("missed", "lost"), [(4, 0), (6, 1)])
def test_a_subject_who_is_missed_for_half_a_second_is_lost(missed: int, lost: int) -> None:
    followed = [step(k, person(), boxes=[ON], target=0) for k in range(3)]
    # one period passes anyway between two frames
    gone = [step(k, person()) for k in range(3, 3 + missed - 1)]
    again = [step(k, person(), boxes=[ON], target=0) for k in range(2 + missed, 6 + missed)]
    assert card(*followed, *gone, *again).lost == lost


def test_a_subject_who_is_never_found_again_is_lost_once() -> None:
    followed = [step(k, person(), boxes=[ON], target=0) for k in range(3)]
    result = card(*followed, *(step(k, person()) for k in range(3, 50)))
    assert (result.lost, result.found_again) == (1, 0.0)


def test_a_loss_is_counted_without_the_time_behind_a_pillar() -> None:
    followed = [step(k, person(), boxes=[ON], target=0) for k in range(3)]
    hidden = [step(k, person(visible=0.0)) for k in range(3, 50)]
    again = [step(50, person(), boxes=[ON], target=0)]
    result = card(*followed, *hidden, *again)
    assert result.lost == 1
    assert result.found_again == 1.0
    away = [step(k, person(visible=0.0, box=None)) for k in range(3, 50)]
    assert card(*followed, *away, *again).found_again == 0.0


def test_the_time_to_find_the_subject_again_is_the_mean_over_the_losses() -> None:
    steps, number = [], 0
    for gone in (10, 20):
        steps += [step(number + k, person(), boxes=[ON], target=0) for k in range(3)]
        steps += [step(number + 3 + k, person()) for k in range(gone - 1)]
        number += 2 + gone
    steps += [step(number + k, person(), boxes=[ON], target=0) for k in range(3)]
    assert card(*steps).time_to_find_again_s == pytest.approx((1.0 + 2.0) / 2)
    never = [step(k, person(), boxes=[ON], target=0) for k in range(3)]
    assert card(*never).time_to_find_again_s is None
    assert card(*never, *(step(k, person()) for k in range(3, 53))).time_to_find_again_s == pytest.approx(5.0)
