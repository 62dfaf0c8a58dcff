"""How far a box is, by the depth image: a median, where pixels are unknown and where the image ends."""

from __future__ import annotations

import numpy as np
import pytest
from tests.follow.views import HEIGHT, WIDTH, boxes, flat, look

from limo_hog.follow.robot import LIMO
from limo_hog.follow.sense.measurement import Measurement, measure
from limo_hog.follow.sense.ranging import median, person_depth, top_row
from limo_hog.follow.sense.visibility import Visibility


@pytest.mark.parametrize("count", [1, 2, 3, 4, 7, 100, 399, 400])
def test_the_median_is_numpys(count: int) -> None:
    for seed in range(20):
        values = np.random.default_rng(seed).uniform(0.2, 8.0, count).astype(np.float32)
        assert median(values) == pytest.approx(float(np.median(values)), rel=1e-6)


@pytest.mark.parametrize(
    ("column", "row", "known"),
    [
        *((5, 200, True), (WIDTH - 5, 200, True), (300, 5, True), (300, HEIGHT - 5, True), (5, 5, True)),
        *((-30, 200, False), (WIDTH + 30, 200, False), (300, -30, False), (300, HEIGHT + 30, False)),
    ],
)
def test_a_box_at_the_images_edge_is_as_far_as_what_is_left_of_it_and_one_outside_is_unknown(
    column: int, row: int, known: bool
) -> None:
    box = np.array([column - 30, row - 60, 60, 120], np.int32)
    assert person_depth(flat(2.5), box) == (2.5 if known else None)


@pytest.mark.parametrize("unknown", [0.0, -1.0, np.nan, np.inf])
def test_pixels_that_are_unknown_do_not_end_an_outline(unknown: float) -> None:
    depth = flat(8.0)
    depth[200:330, 290:350] = 2.0
    # Of the head only three columns are known.
    depth[150:200, 290:350] = unknown
    depth[150:200, 318:321] = 2.0
    assert top_row(depth, np.array([260, 120, 120, 240], np.int32), 2.0) == 150


def test_without_depth_a_box_has_no_stature_and_may_be_low() -> None:
    (seen,) = measure(look(boxes((300, 100, 60, 120))), LIMO)
    assert (seen.range, seen.window, seen.middle) == (None, 0.0, 0.0)
    assert Measurement(0.0, 2.0, 120, 0.0, 1.0).is_low(0.1)
    assert Measurement(0.0, None, 120, 0.0, 1.0, window=500.0).is_low(0.1)


@pytest.mark.parametrize(("centre", "low"), [(20.0, True), (10.0, False)])
def test_a_box_is_low_whose_middle_is_below_the_persons(centre: float, low: bool) -> None:
    # The person's middle is 0 px m below the image's; a tenth of the box is 12 px.
    assert Measurement(0.0, 2.0, 120, centre, 1.0, window=240.0, middle=0.0).is_low(0.1) == low


def test_a_window_just_as_high_as_the_models_is_expected() -> None:
    for height, found in ((128.0, True), (127.9, False)):
        assert Visibility().expected(0.0, 4.0, 4.0 * height, 0.0, look(), confirmed=True) == found


def test_the_depth_of_a_box_is_that_of_a_square_of_twenty_pixels_in_its_middle() -> None:
    depth = flat(8.0)
    depth[190:210, 290:310] = 3.0
    # A quarter of the square; it would be all of one half as wide.
    depth[195:205, 295:305] = 1.0
    assert person_depth(depth, np.array([270, 140, 60, 120], np.int32)) == 3.0
