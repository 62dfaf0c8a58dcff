"""The workshop's two controllers do what the workshop says, number for number."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.follow.views import NOBODY, boxes, flat, look

from limo_hog.exceptions import LimoHogError
from limo_hog.follow import (
    ApproachController,
    Controller,
    Mode,
    ProxemicController,
    Twist,
    Zone,
    controller_named,
    zone_of,
)
from limo_hog.follow.sense.measurement import person_depth


@pytest.mark.parametrize("controller", [ApproachController(), ProxemicController()])
def test_both_stop_when_nobody_is_seen_and_a_person_who_is_gone_is_lost(controller: Controller[Any]) -> None:
    decision = controller.step(look(NOBODY), controller.start())
    assert (decision.twist, decision.mode, decision.target) == (Twist(), Mode.SEARCH, None)
    for depth in (None, flat(2.0)):
        seen = controller.step(replace(look(boxes((300, 100, 60, 120))), depth=depth), controller.start())
        assert controller.step(look(NOBODY), seen.state).mode is Mode.LOST


@pytest.mark.parametrize(("cx", "angular"), [(320, 0.0), (301, 0.0), (300, 0.1), (340, -0.1), (120, 1.0), (520, -1.0)])
def test_approach_turns_by_gain_times_error_outside_the_dead_band(cx: int, angular: float) -> None:
    decision = ApproachController().step(look(boxes((cx - 30, 100, 60, 120))), False)
    assert decision.twist.linear == 0.2
    assert decision.twist.angular == pytest.approx(angular)


def test_the_surest_box_is_followed_not_the_first() -> None:
    detections = boxes((0, 100, 60, 120), (400, 100, 60, 120), scores=(0.3, 1.2))
    assert ApproachController().step(look(detections), False).target == 1


@pytest.mark.parametrize(("depth", "linear"), [(1.5, 0.0), (1.7, 0.1), (1.3, -0.1), (4.0, 0.3), (0.5, -0.3)])
def test_proxemic_holds_its_distance_within_its_limits(depth: float, linear: float) -> None:
    view = replace(look(boxes((290, 100, 60, 120))), depth=flat(depth))
    assert ProxemicController().step(view, False).twist.linear == pytest.approx(linear, abs=1e-6)


@pytest.mark.parametrize(("cx", "angular"), [(320, 0.0), (319, 0.005), (280, 0.2), (360, -0.2), (520, -0.8), (30, 0.8)])
def test_proxemic_turns_by_gain_times_error_within_its_limit(cx: int, angular: float) -> None:
    view = replace(look(boxes((cx - 30, 100, 60, 120))), depth=flat(2.0))
    assert ProxemicController().step(view, False).twist.angular == pytest.approx(angular)


def test_proxemic_stops_without_a_depth_at_the_person() -> None:
    view = replace(look(boxes((290, 100, 60, 120))), depth=flat(np.nan))
    decision = ProxemicController().step(view, False)
    assert decision.twist == Twist()
    assert "no depth" in decision.reason


def test_the_distance_is_the_median_of_valid_depths_in_a_small_square() -> None:
    depth = flat(5.0)
    depth[150:170, 310:330] = 2.0
    depth[150:158] = np.nan
    depth[158:160] = 0.0
    assert person_depth(depth, np.array([290, 100, 60, 120], np.int32)) == 2.0


@pytest.mark.parametrize(
    ("distance", "zone"),
    [(0.45, Zone.INTIMATE), (0.46, Zone.PERSONAL), (1.2, Zone.PERSONAL), (3.6, Zone.SOCIAL), (3.7, Zone.PUBLIC)],
)
def test_zones_end_where_hall_says(distance: float, zone: Zone) -> None:
    assert zone_of(distance) is zone


def test_a_controller_is_had_by_name_with_another_distance() -> None:
    assert controller_named("proxemic", 0.3) == ProxemicController(target_distance=0.3)
    with pytest.raises(LimoHogError, match="holds no distance"):
        controller_named("approach", 1.0)
    with pytest.raises(LimoHogError, match="want one of approach, proxemic, tracking"):
        controller_named("pursuit")
