"""Backing off: only onto ground that was seen to be free lately."""

from __future__ import annotations

import numpy as np

from limo_hog.follow.control.company import Backing
from limo_hog.follow.control.steer import Aim
from limo_hog.follow.robot import LIMO
from limo_hog.follow.sense.clearance import NO_POINTS
from limo_hog.follow.sense.observation import Odometry, Scan
from limo_hog.follow.space.grid import Grid, Ground
from limo_hog.follow.twist import Twist

BACKING, GRID = Backing(), Grid()
NEAR = Aim(bearing=-0.1, distance=1.0, bearing_rate=0.0, range_rate=0.0, heading=-0.1, hidden=False)


def looked(yaws: tuple[float, ...], *, until: float) -> Ground:
    """The ground after scans at directions [rad], one a second, and then one straight ahead; the last is at `until`."""
    ground = None
    for index, yaw in enumerate((*yaws, 0.0)):
        stamp = until if index == len(yaws) else float(index)
        scan = Scan(stamp, np.full(292, np.inf, np.float32), -2.0, 2.0, 0.12, 8.0)
        ground = GRID.update(ground, scan, Odometry(stamp, yaw=yaw), NO_POINTS, NO_POINTS)
    assert ground is not None
    return ground


def test_ground_behind_is_known_for_a_while_after_the_robot_looked_round() -> None:
    here = Odometry()
    for others_at, known in ((0.0, [True, False, False]), (-np.inf, [True, True, False])):
        assert not BACKING.is_known_behind(0.0, here, GRID, looked((), until=0.0), others_at, LIMO)
        grounds = [looked((1.5, -1.5), until=until) for until in (2.0, 8.0, 40.0)]
        # After half a minute the other has not been seen for as long, and counts no more.
        assert [BACKING.is_known_behind(0.0, here, GRID, one, others_at, LIMO) for one in grounds] == known


def test_with_others_about_it_looks_behind_before_it_backs() -> None:
    limit = BACKING.blind_limit(others_at=3.0, now=10.0)
    assert limit == 0
    command, reason = BACKING.blindly(Twist(-0.4, 0.1), limit, NEAR, -0.5, 0.3, "following a person")
    assert command.linear == 0
    # The person is to the right already: it goes on to the left.
    assert command.angular > 1
    assert "behind" in reason


def test_it_does_not_turn_away_from_a_person_who_walks() -> None:
    walks = Aim(-0.1, 1.0, 0.0, -0.6, -0.1, False)
    command, _ = BACKING.blindly(Twist(-0.4, 0.1), 0.0, walks, -0.5, 0.3, "following a person")
    assert command == Twist(0.0, 0.1)


def test_with_nobody_else_about_it_backs_slowly() -> None:
    limit = BACKING.blind_limit(others_at=-np.inf, now=10.0)
    command, reason = BACKING.blindly(Twist(-0.4, 0.1), limit, NEAR, -0.5, 0.3, "following a person")
    assert command == Twist(-0.2, 0.1)
    assert reason == "following a person"
