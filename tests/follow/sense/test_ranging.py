"""How far a box is by the depth image, where pixels are unknown and the image ends; and the part searched next."""

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.follow.views import FOCAL, HEIGHT, WIDTH, boxes, flat, look, there

from limo_hog.follow.robot import LIMO
from limo_hog.follow.sense.measurement import (
    Measurement,
    RegionSize,
    Visibility,
    measure,
    median,
    person_depth,
    stands_out,
    top_row,
)

BOX = np.array([260, 120, 120, 240], np.int32)


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
def test_a_box_at_the_images_edge_is_as_far_as_what_is_left_of_it(column: int, row: int, known: bool) -> None:
    box = np.array([column - 30, row - 60, 60, 120], np.int32)
    assert person_depth(flat(2.5), box) == (2.5 if known else None)


@pytest.mark.parametrize("unknown", [0.0, -1.0, np.nan, np.inf])
def test_pixels_that_are_unknown_do_not_end_an_outline(unknown: float) -> None:
    depth = flat(8.0)
    depth[200:330, 290:350] = 2.0
    # Of the head only three columns are known.
    depth[150:200, 290:350] = unknown
    depth[150:200, 318:321] = 2.0
    assert top_row(depth, BOX, 2.0) == 150


def test_without_depth_a_box_has_no_stature_and_may_be_low() -> None:
    (seen,) = measure(look(boxes((300, 100, 60, 120))), LIMO)
    assert (seen.range, seen.window, seen.middle) == (None, 0.0, 0.0)
    assert Measurement(0.0, 2.0, 120, 0.0, 1.0).is_low(0.1)
    assert Measurement(0.0, None, 120, 0.0, 1.0, window=500.0).is_low(0.1)


@pytest.mark.parametrize(("centre", "low"), [(20.0, True), (10.0, False)])
def test_a_box_is_low_whose_middle_is_below_the_persons(centre: float, low: bool) -> None:
    # The person's middle is 0 px m below the image's; a tenth of the box is 12 px.
    assert Measurement(0.0, 2.0, 120, centre, 1.0, window=240.0, middle=0.0).is_low(0.1) == low


def test_a_window_as_high_as_the_models_is_expected_and_grows_until_three_decimetres() -> None:
    for height, found in ((128.0, True), (127.9, False)):
        assert Visibility().expected(0.0, 4.0, 4.0 * height, 0.0, look(), confirmed=True) == found
    # The model's window is 128 px high: 38.4 px at 1 m.
    for window, found in ((39.0, True), (38.0, False)):
        assert Visibility().expected(0.0, 0.1, window, 0.0, look(), confirmed=False) == found


def test_the_depth_of_a_box_is_that_of_a_square_of_twenty_pixels_in_its_middle() -> None:
    depth = flat(8.0)
    depth[190:210, 290:310] = 3.0
    # A quarter of the square; it would be all of one half as wide.
    depth[195:205, 295:305] = 1.0
    assert person_depth(depth, np.array([270, 140, 60, 120], np.int32)) == 3.0


@pytest.mark.parametrize(
    ("rows", "columns", "depth", "width", "top"),
    [
        # Five rows without the person end the outline, and four do not.
        ((120, 196), (290, 350), 2.0, 120, 120),
        ((120, 195), (290, 350), 2.0, 120, 200),
        # A row is the person's if one in four known pixels is: 5 of the 2 · round(.08 · 120) = 20 px about column 320.
        ((150, 200), (320, 325), 2.0, 120, 150),
        ((150, 200), (320, 324), 2.0, 120, 200),
        # A pixel is the person's within a trunk and an arm.
        *(((150, 200), (290, 350), 2.0 + side * 0.34, 120, 150) for side in (-1, 1)),
        *(((150, 200), (290, 350), 2.0 + side * 0.36, 120, 200) for side in (-1, 1)),
        # A narrow box is looked at four pixels to either side.
        ((150, 200), (316, 324), 2.0, 20, 150),
        ((150, 200), (310, 316), 2.0, 20, 200),
        ((150, 200), (324, 330), 2.0, 20, 200),
    ],
)
def test_an_outline_goes_on_as_far_up_as_rows_are_the_persons(
    rows: tuple[int, int], columns: tuple[int, int], depth: float, width: int, top: int
) -> None:
    image = flat(8.0)
    image[200:330, 290:350] = 2.0
    image[slice(*rows), slice(*columns)] = depth
    assert top_row(image, np.array([320 - width // 2, 120, width, 240], np.int32), 2.0) == top


def before_and_beside(rows: slice, columns: slice, wall: float = 4.0) -> float | None:
    """How far a person at 2 m stands out before a wall of which a part is at 3 m."""
    depth = flat(wall)
    depth[:, 300:340] = 2.0
    depth[rows, columns] = 3.0
    return stands_out(depth, BOX)


def test_a_person_stands_out_from_what_is_beside_the_chest() -> None:
    # Of a window of 240 px the chest is from row 120 + .27 · 240 to 120 + .5 · 240; beside it are the columns .36 to
    # .46 of 120 px from the middle.
    left, right = slice(320 - 55, 320 - 43), slice(320 + 43, 320 + 55)
    all_of_it = slice(0, HEIGHT)
    assert before_and_beside(slice(0, 0), left) == pytest.approx(2.0)
    for outside in (slice(0, 184), slice(241, HEIGHT)):
        assert before_and_beside(outside, left) == pytest.approx(2.0)
    # A plane through both has in the middle the mean of the inverse depths.
    for side in (left, right):
        assert before_and_beside(slice(185, 240), side) == pytest.approx(2 / (1 / 3 + 1 / 4) - 2.0)
    for beside in (slice(0, 264), slice(278, 299), slice(341, 362), slice(376, WIDTH)):
        assert before_and_beside(all_of_it, beside) == pytest.approx(2.0)


def test_the_chest_is_looked_at_where_people_seen_from_the_side_still_are() -> None:
    # .06 of the window's width to either side: 7 px.
    for half, near in ((4, 3.0), (3, 4.0)):
        depth = flat(4.0)
        depth[:, 320 - half : 320 + half] = 3.0
        assert stands_out(depth, BOX) == pytest.approx(4.0 - near)


def test_a_strip_of_which_a_fifth_is_known_is_known() -> None:
    # A strip of 12 columns and 55 rows; unknown, what is beside a person counts as far away.
    for rows, known in ((13, True), (10, False)):
        depth = flat(4.0)
        depth[:, 300:340] = 2.0
        depth[185:240, 265:277] = np.nan
        depth[185 : 185 + rows, 265:277] = 4.0
        assert (there(stands_out(depth, BOX)) == pytest.approx(2.0)) == known


def test_an_outline_at_one_edge_of_the_image_stands_out_from_the_other_side_alone() -> None:
    depth = flat(4.0)
    depth[:, :40] = 2.0
    assert stands_out(depth, np.array([-40, 120, 120, 240], np.int32)) == pytest.approx(2.0)
    assert stands_out(depth, np.array([-400, 120, 120, 240], np.int32)) is None
    assert stands_out(np.empty((0, 0), np.float32), BOX) is None


def seen_at(box: tuple[int, int, int, int], depth: float, top: int) -> Measurement:
    """Measure a box on a person whose outline begins at a row."""
    x, y, w, h = box
    image = flat(8.0)
    image[top : y + h, x + w // 4 : x + w - w // 4] = depth
    (seen,) = measure(replace(look(boxes(box)), depth=image), LIMO)
    return seen


@pytest.mark.parametrize(("depth", "top"), [(2.0, 150), (2.0, 170), (3.0, 130)])
def test_the_stature_is_from_the_floor_to_the_top_of_the_outline(depth: float, top: int) -> None:
    seen = seen_at((260, 120, 120, 240), depth, top)
    # The camera looks level from .175 m above the floor; HOG's window is 128 px where a person is 96.
    stature = 0.175 + (240 - top) / FOCAL * depth
    assert seen.window == pytest.approx(stature * FOCAL * 128 / 96)
    assert seen.middle == pytest.approx((0.175 - stature / 2) * FOCAL)
    assert seen.whole
    assert seen.stands_out == pytest.approx(8.0 - depth)


def test_a_person_whose_outline_ends_within_a_gap_of_the_images_edge_is_not_whole() -> None:
    assert seen_at((260, 20, 120, 240), 2.0, 5).whole
    assert not seen_at((260, 20, 120, 240), 2.0, 4).whole


def test_a_person_is_hidden_by_what_is_before_their_window_s_middle_and_not_below_it() -> None:
    # Their middle is 60 px above the image's.
    for row, found in ((180, False), (300, True)):
        depth = flat(8.0)
        depth[row - 20 : row + 20, 300:340] = 1.0
        view = replace(look(), depth=depth)
        assert Visibility().expected(0.0, 2.0, 536.0, -120.0, view, confirmed=True) == found


def test_what_the_images_edge_leaves_of_a_strip_counts_for_relief_and_outline() -> None:
    # Of 120 px the left strip is from -.46 to -.36 about column 50: its first five columns are out of the image.
    depth = flat(4.0)
    depth[:, :20] = 3.0
    depth[:, 43:57] = 2.0
    for image, left in ((depth, -10), (depth[:, ::-1], WIDTH - 110)):
        box = np.array([left, 120, 120, 240], np.int32)
        assert stands_out(image, box) == pytest.approx(2 / (1 / 3 + 1 / 4) - 2.0)
    # The strip is ten pixels to either side of column 8.
    depth = flat(8.0)
    depth[150:330, :40] = 2.0
    assert top_row(depth, np.array([-52, 120, 120, 240], np.int32), 2.0) == 150
    assert top_row(depth[:, ::-1], np.array([WIDTH - 68, 120, 120, 240], np.int32), 2.0) == 150


@pytest.mark.parametrize("unknown", [0.0, -0.5, np.nan, np.inf])
def test_unknown_pixels_change_no_relief_as_long_as_a_fifth_is_known(unknown: float) -> None:
    depth = flat(4.0)
    depth[:, 300:340] = 2.0
    depth[185:225] = unknown
    assert stands_out(depth, BOX) == pytest.approx(2.0)


@pytest.mark.parametrize("distance", [2.5, 3.3, 5.0])
@pytest.mark.parametrize("bearing", [-0.45, -0.1, 0.0, 0.2, 0.5])
def test_a_region_holds_the_window_and_half_a_window_to_either_side(bearing: float, distance: float) -> None:
    region, height = there(RegionSize().around(bearing, distance, 536.0, -120.0, look())), 536.0 / distance
    x, y = 320 - FOCAL * math.tan(bearing), 240 - 120.0 / distance
    spare = {
        "left": max(x - height / 2, 0) - region.x,
        "right": region.x + region.width - min(x + height / 2, 640),
        "top": max(y - 0.625 * height, 0) - region.y,
        "bottom": region.y + region.height - min(y + 0.625 * height, 480),
    }
    # No less, and less than one step of the grid more.
    assert all(0 <= room < 16 for room in spare.values()), spare
    assert all(side % 16 == 0 for side in (region.x, region.y, region.width, region.height))
    assert region.window_height == pytest.approx(height)


@pytest.mark.parametrize(
    ("bearing", "distance"), [(1.21, 3.0), (-1.21, 3.0), (0.0, 0.29), (0.0, 0.9), (0.63, 3.0), (-0.63, 3.0)]
)
def test_where_the_person_is_out_of_the_image_or_fills_it_all_of_it_is_searched(
    bearing: float, distance: float
) -> None:
    assert RegionSize().around(bearing, distance, 536.0, -120.0, look()) is None


def test_a_small_person_near_by_has_a_region_for_it_is_not_most_of_the_image() -> None:
    region = there(RegionSize().around(0.0, 0.8, 160.0, 0.0, look()))
    assert region.width * region.height < 0.7 * 640 * 480


@pytest.mark.parametrize(("column", "within"), [(-0.5, False), (0.5, True), (639.5, True), (640.5, False)])
def test_a_person_whose_middle_is_beside_the_image_has_no_region(column: float, within: bool) -> None:
    bearing = math.atan((320 - column) / FOCAL)
    assert (RegionSize().around(bearing, 3.0, 536.0, -120.0, look()) is not None) == within
