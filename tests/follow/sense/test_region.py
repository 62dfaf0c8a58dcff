"""The part of the next image that is searched holds the expected window with room around it, and little more."""

from __future__ import annotations

import math

import pytest
from tests.follow.views import FOCAL, look

from limo_hog.follow.sense.measurement import RegionSize


@pytest.mark.parametrize("distance", [2.5, 3.3, 5.0])
@pytest.mark.parametrize("bearing", [-0.45, -0.1, 0.0, 0.2, 0.5])
def test_a_region_holds_the_window_and_half_a_window_to_either_side(bearing: float, distance: float) -> None:
    region = RegionSize().around(bearing, distance, 536.0, -120.0, look())
    assert region is not None
    height = 536.0 / distance
    x, y = 320 - FOCAL * math.tan(bearing), 240 - 120.0 / distance
    wanted = {
        "left": max(x - height / 2, 0),
        "right": min(x + height / 2, 640),
        "top": max(y - 0.625 * height, 0),
        "bottom": min(y + 0.625 * height, 480),
    }
    spare = {
        "left": wanted["left"] - region.x,
        "right": region.x + region.width - wanted["right"],
        "top": wanted["top"] - region.y,
        "bottom": region.y + region.height - wanted["bottom"],
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
    region = RegionSize().around(0.0, 0.8, 160.0, 0.0, look())
    assert region is not None
    assert region.width * region.height < 0.7 * 640 * 480


@pytest.mark.parametrize(("column", "within"), [(-0.5, False), (0.5, True), (639.5, True), (640.5, False)])
def test_a_person_whose_middle_is_beside_the_image_has_no_region(column: float, within: bool) -> None:
    bearing = math.atan((320 - column) / FOCAL)
    assert (RegionSize().around(bearing, 3.0, 536.0, -120.0, look()) is not None) == within
