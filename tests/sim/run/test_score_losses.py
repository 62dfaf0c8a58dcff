"""When the subject of a run counts as lost, and as found again."""

from __future__ import annotations

import numpy as np
import pytest
from tests.sim.run.steps import OFF, ON, card, followed, person, step


@pytest.mark.parametrize(
    ("until", "lost", "found_again"), [(0.5, 0, None), (0.75, 1, 1.0), (3.0, 1, 1.0), (3.25, 1, 0.0)]
)
def test_a_person_is_lost_after_half_a_second_and_found_again_within_three(
    until: float, lost: int, found_again: float | None
) -> None:
    # Times whose sums are exact.
    without = [step(0, person(), boxes=[ON], time=float(time)) for time in np.arange(0.25, until, 0.25)]
    result = card(followed(0), *without, followed(0, until))
    assert (result.lost, result.found_again) == (lost, found_again)


def test_the_longest_gap_is_between_two_detections_of_the_subject() -> None:
    seen = {0, 1, 5, 7}
    steps = [step(k, person(), boxes=[ON] if k in seen else [OFF], target=0 if k in seen else None) for k in range(9)]
    assert card(*steps).longest_gap_s == pytest.approx(0.4)


def test_a_subject_who_is_never_found_again_is_lost_once() -> None:
    before = [followed(k) for k in range(3)]
    result = card(*before, *(step(k, person()) for k in range(3, 50)))
    assert (result.lost, result.found_again) == (1, 0.0)


def test_a_loss_is_counted_without_the_time_behind_a_pillar() -> None:
    before = [followed(k) for k in range(3)]
    hidden = [step(k, person(visible=0.0)) for k in range(3, 50)]
    again = [followed(50)]
    result = card(*before, *hidden, *again)
    assert result.lost == 1
    assert result.found_again == 1.0
    away = [step(k, person(visible=0.0, box=None)) for k in range(3, 50)]
    assert card(*before, *away, *again).found_again == 0.0


def test_the_time_to_find_the_subject_again_is_the_mean_over_the_losses() -> None:
    steps, number = [], 0
    for gone in (10, 20):
        steps += [followed(number + k) for k in range(3)]
        steps += [step(number + 3 + k, person()) for k in range(gone - 1)]
        number += 2 + gone
    steps += [followed(number + k) for k in range(3)]
    assert card(*steps).time_to_find_again_s == pytest.approx((1.0 + 2.0) / 2)
    never = [followed(k) for k in range(3)]
    assert card(*never).time_to_find_again_s is None
    assert card(*never, *(step(k, person()) for k in range(3, 53))).time_to_find_again_s == pytest.approx(5.0)
