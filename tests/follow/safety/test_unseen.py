"""Ground behind the robot that was seen: compared place by place with plain geometry."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest
from tests.follow.safety.headstrong import ahead
from tests.follow.views import look, scan

from limo_hog.follow.robot import LIMO
from limo_hog.follow.sense.clearance import Look, room_seen_behind
from limo_hog.follow.sense.observation import Odometry, Scan

#: The documented steps behind the outline [m].
DEPTHS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)


def shows_free(look: Look, place: complex) -> bool:
    """Whether the robot stood on a place, odometry frame, or a beam went 5 cm beyond it."""
    here = (place - complex(look.pose.x, look.pose.y)) * cmath.rect(1.0, -look.pose.yaw)
    if abs(here.real) < LIMO.half_length + 0.05 and abs(here.imag) < LIMO.half_width + 0.05:
        return True
    scan, (distance, angle) = look.scan, cmath.polar(here - LIMO.lidar_x)
    gaps = max(len(scan.ranges) - 1, 1)
    beam = round((angle - scan.angle_min) / ((scan.angle_max - scan.angle_min) / gaps))
    if not 0 <= beam < len(scan.ranges) or not scan.ranges[beam] >= scan.range_min:
        return False
    return min(float(scan.ranges[beam]), scan.range_max) > distance + 0.05


def room(looks: list[Look], pose: Odometry) -> float:
    """The same answer as `room_seen_behind`, by asking for one place after the other."""
    free = 0.0
    for depth in DEPTHS:
        corners = [complex(-LIMO.half_length - depth, side * LIMO.half_width) for side in (-1, 0, 1)]
        places = [complex(pose.x, pose.y) + corner * cmath.rect(1.0, pose.yaw) for corner in corners]
        if not all(any(shows_free(look, place) for look in looks) for place in places):
            break
        free = depth
    return free


def test_the_room_is_that_of_plain_geometry_for_random_looks() -> None:
    random = np.random.default_rng(7)
    rooms = []
    for _ in range(400):
        looks = []
        for _ in range(random.integers(1, 4)):
            count = int(random.choice([1, 7, 91, 240]))
            ranges = random.choice(
                [0.05, 0.4, 0.9, 3.0, math.inf, math.nan], count, p=[0.02, 0.03, 0.05, 0.5, 0.35, 0.05]
            )
            reach = float(random.uniform(1.5, math.pi))
            scan = Scan(0.0, ranges.astype(np.float32), -reach, reach, 0.12, float(random.choice([0.7, 8.0])))
            x, y, yaw = random.uniform((-0.8, -0.8, -4), (0.8, 0.8, 4)).tolist()
            looks.append(Look(scan, Odometry(0.0, x, y, yaw)))
        x, y, yaw = random.uniform((-0.3, -0.3, -4), (0.3, 0.3, 4)).tolist()
        pose = Odometry(1.0, x, y, yaw)
        found = room_seen_behind(looks, pose, LIMO)
        assert found == pytest.approx(room(looks, pose))
        rooms.append(round(found, 1))
    assert {0.0, 0.1, 0.3, 0.6} <= set(rooms)
    assert room_seen_behind([], Odometry(), LIMO) == 0.0


@pytest.mark.parametrize(("driven", "seen"), [(0.0, 0.0), (0.12, 0.1), (0.33, 0.3), (0.95, 0.6)])
def test_the_ground_that_the_robot_left_straight_on_was_free(driven: float, seen: float) -> None:
    blind = Scan(0.0, np.zeros(3, np.float32), -1.0, 1.0, 0.12, 8.0)
    way = [Look(blind, Odometry(0.0, x)) for x in np.arange(0.0, driven, 0.1)] or [Look(blind, Odometry())]
    assert room_seen_behind(way, Odometry(1.0, x=driven), LIMO) == pytest.approx(seen)


def looks_after(*stamps: float) -> list[float]:
    """Return the stamps of the scans that are kept for the ground they show to be free."""
    guard = ahead()
    state = guard.start()
    for stamp in stamps:
        view = replace(look(stamp=stamp), scan=scan(stamp=stamp), odometry=Odometry(stamp))
        state = guard.step(view, state).state
    return [one.scan.stamp for one in state.looks]


def test_a_scan_every_half_second_is_kept_for_a_minute() -> None:
    assert looks_after(*(0.125 * step for step in range(12))) == [0.0, 0.5, 1.0]
    assert looks_after(0.0, 10.0, 59.75) == [0.0, 10.0, 59.75]
    assert looks_after(0.0, 10.0, 60.0) == [10.0, 60.0]
    assert looks_after(0.0, 100.0) == [100.0]


def test_a_scan_that_is_older_than_those_kept_begins_anew() -> None:
    guard = ahead()
    state = guard.step(replace(look(stamp=5.0), scan=scan(stamp=5.0), odometry=Odometry(5.0)), guard.start()).state
    late = replace(look(stamp=5.1), scan=scan(stamp=4.8), odometry=Odometry(5.1))
    assert [one.scan.stamp for one in guard.step(late, state).state.looks] == [4.8]
