"""A box is on a person of its place and size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.sim.run.steps import person

from limo_sim.run.matching import on_person, person_of
from limo_sim.world.truth import PersonTruth


@pytest.mark.parametrize(
    ("column", "row", "height", "on"),
    [
        (330, 160, 160, True),
        # the silhouette is 60 px wide from 300 on: a quarter of it more on either side
        (285, 160, 160, True),
        (284, 160, 160, False),
        (375, 160, 160, True),
        (376, 160, 160, False),
        # 120 px high from 100 on
        (330, 100, 160, True),
        (330, 99, 160, False),
        (330, 220, 160, True),
        (330, 221, 160, False),
        (330, 160, 72, True),
        (330, 160, 70, False),
        (330, 160, 300, True),
        (330, 160, 302, False),
    ],
)
def test_the_middle_of_a_box_and_its_height_decide_whom_it_is_on(column: int, row: int, height: int, on: bool) -> None:
    box = np.array([column - 40, row - height // 2, 80, height], np.int32)
    assert on_person(box, person()) is on
    assert not on_person(box, person(box=None))


def test_a_box_on_two_people_is_on_the_one_in_view_then_on_the_nearer_one() -> None:
    left, right = person(box=(300, 100, 60, 120)), person(box=(320, 100, 60, 120))

    def on(one: PersonTruth, other: PersonTruth, middle: int) -> int | None:
        return person_of(np.array([middle - 40, 90, 80, 160], np.int32), (one, other))

    # Their middles are at 330 and 350.
    assert (on(left, right, 336), on(left, right, 344)) == (0, 1)
    for visible, number in ((0.499, 1), (0.5, 0)):
        assert on(replace(left, visible=visible), replace(right, visible=0.5), 336) == number
    assert on(left, replace(right, visible=0.3), 344) == 0
