"""The track is a Kalman filter: it agrees with the plain equations, and the robot's own motion drops out."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import trapezoid
from tests.follow.estimates import upper

from limo_hog.follow.sense.observation import Odometry
from limo_hog.follow.tracks.kalman import Noise, bearing_range, initiate, innovation, predict, rates, update

NOISE = Noise()
HERE = Odometry()


def test_a_track_begins_where_the_person_was_seen() -> None:
    pose = Odometry(x=1.0, y=2.0, yaw=0.5)
    track = initiate(0.0, 0.3, 2.0, pose, NOISE)
    assert bearing_range(track, pose) == pytest.approx((0.3, 2.0))


def test_its_first_uncertainty_is_the_measurements() -> None:
    track = initiate(0.0, 0.0, 3.0, HERE, NOISE)
    expected = np.diag([NOISE.range**2, (3.0 * NOISE.bearing) ** 2])
    assert track.matrix[:2, :2] == pytest.approx(expected)


def test_a_person_who_stands_hardly_seems_to_walk_when_the_robot_begins_to_turn() -> None:
    # Its odometry is .02 s ahead of its images: from 1 s on, at 2 rad/s, everything is .04 rad to the left.
    fastest = {}
    for name, noise in (("sure", NOISE), ("turning", NOISE.turning(2.0))):
        track = initiate(0.0, 0.0, 2.0, HERE, NOISE)
        speeds = [0.0]
        for step in range(1, 20):
            track = predict(track, 0.1 * step, NOISE)
            ahead, used = (0.04, noise) if step > 10 else (0.0, NOISE)
            track = update(track, innovation(track, ahead, 2.0, HERE, used))
            speeds.append(abs(track.mean[3]))
        fastest[name] = max(speeds)
    assert fastest["sure"] > 0.25
    assert fastest["turning"] < 0.15
    assert NOISE.turning(0.0) == NOISE


def test_a_walker_is_learnt_and_foreseen() -> None:
    track = initiate(0.0, 0.0, 3.0, HERE, NOISE)
    for step in range(1, 40):
        t = 0.1 * step
        x, y = 3.0, 0.5 * t
        track = predict(track, t, NOISE)
        track = update(track, innovation(track, math.atan2(y, x), math.hypot(x, y), HERE, NOISE))
    assert track.mean[2:] == pytest.approx([0.0, 0.5], abs=0.06)
    bearing_rate, range_rate = rates(track, HERE)
    assert bearing_rate == pytest.approx(3.0 * 0.5 / (9 + 1.95**2), abs=0.02)
    assert range_rate == pytest.approx(0.5 * 1.95 / math.hypot(3.0, 1.95), abs=0.05)
    soon = predict(track, 4.4, NOISE)
    assert soon.mean[1] == pytest.approx(2.2, abs=0.06)


def test_the_robots_own_turn_is_no_motion_of_the_person() -> None:
    track = initiate(0.0, 0.0, 3.0, HERE, NOISE)
    for step in range(1, 20):
        pose = Odometry(yaw=0.1 * step)
        track = predict(track, 0.1 * step, NOISE)
        track = update(track, innovation(track, -0.1 * step, 3.0, pose, NOISE))
    assert np.hypot(*track.mean[2:]) < 0.01


def test_at_an_earlier_stamp_the_person_is_where_they_came_from() -> None:
    track = replace(initiate(5.0, 0.0, 3.0, HERE, NOISE), mean=(3.0, 1.0, -0.2, 0.5))
    before = predict(track, 4.0, NOISE)
    assert before.mean == pytest.approx([3.2, 0.5, -0.2, 0.5])
    assert before.stamp == 4.0


@pytest.mark.parametrize("pose", [HERE, Odometry(x=1.0, y=-2.0, yaw=0.7), Odometry(x=-1.5, y=3.0, yaw=-2.0)])
def test_the_jacobian_is_the_slope_of_bearing_and_range(pose: Odometry) -> None:
    track = replace(initiate(0.0, 0.3, 2.0, pose, NOISE), stamp=0.0)
    fit = innovation(track, 0.3, 2.0, pose, NOISE)
    found = np.array([(*fit.by_bearing, 0.0, 0.0), (*fit.by_range, 0.0, 0.0)])
    for axis in range(4):
        ends = []
        for side in (1e-6, -1e-6):
            x, y, vx, vy = (np.array(track.mean) + side * np.eye(4)[axis]).tolist()
            ends.append(np.array(bearing_range(replace(track, mean=(x, y, vx, vy)), pose)))
        assert found[:, axis] == pytest.approx((ends[0] - ends[1]) / 2e-6, abs=1e-6)


@pytest.mark.parametrize("pose", [Odometry(x=1.0, y=-2.0, yaw=0.7), Odometry(x=-1.5, y=3.0, yaw=-2.0)])
def test_rates_are_how_bearing_and_range_change_with_the_persons_velocity(pose: Odometry) -> None:
    track = replace(initiate(0.0, 0.3, 2.0, pose, NOISE), stamp=0.0)
    x, y, _, _ = track.mean
    track = replace(track, mean=(x, y, 0.4, -0.9))
    ends = []
    for dt in (1e-6, -1e-6):
        moved = x + 0.4 * dt, y - 0.9 * dt, 0.4, -0.9
        ends.append(np.array(bearing_range(replace(track, mean=moved), pose)))
    assert rates(track, pose) == pytest.approx(tuple((ends[0] - ends[1]) / 2e-6), abs=1e-6)


def test_a_prediction_is_the_integral_of_a_fading_velocity_and_white_acceleration() -> None:
    root = np.random.default_rng(4).normal(0.0, 0.5, (4, 4))
    track = replace(initiate(0.0, 0.0, 3.0, HERE, NOISE), mean=(3.0, 1.0, 0.4, -0.8), covariance=upper(root @ root.T))
    for dt in (0.1, 0.7, 2.0):
        later = predict(track, dt, NOISE)
        times = np.linspace(0.0, dt, 20_001)
        fading = np.exp(-times / NOISE.persistence)
        place, velocity = np.array(track.mean).reshape(2, 2)
        assert later.mean[2:] == pytest.approx(velocity * fading[-1])
        assert later.mean[:2] == pytest.approx(place + velocity * trapezoid(fading, times), rel=1e-6)
        # What was uncertain is carried along, and what accelerates meanwhile is added: dt³/3, dt²/2 and dt.
        move = np.eye(4)
        move[[0, 1], [2, 3]], move[[2, 3], [2, 3]] = trapezoid(fading, times), fading[-1]
        added = later.matrix - move @ track.matrix @ move.T
        left = dt - times
        q = NOISE.acceleration**2
        assert added[0, 0] == pytest.approx(q * trapezoid(left**2, times), rel=1e-4)
        assert added[1, 3] == pytest.approx(q * trapezoid(left, times), rel=1e-4)
        assert added[3, 3] == pytest.approx(q * dt)
        assert (added[0, 1], added[0, 3]) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_a_bearing_and_range_equal_the_textbooks_form_for_any_covariance() -> None:
    random = np.random.default_rng(5)
    for _ in range(20):
        root = random.normal(0.0, 0.3, (4, 4))
        pose = Odometry(0.0, *random.uniform(-1, 1, 3).tolist())
        track = replace(initiate(0.0, 0.4, 2.5, pose, NOISE), covariance=upper(root @ root.T))
        for distance in (2.7, None):
            seen = innovation(track, 0.5, distance, pose, NOISE)
            rows = [(*seen.by_bearing, 0.0, 0.0), (*seen.by_range, 0.0, 0.0)][: 2 if distance else 1]
            h, r = np.array(rows), np.diag([0.015**2, 0.06**2])[: len(rows), : len(rows)]
            s = h @ track.matrix @ h.T + r
            gain = track.matrix @ h.T @ np.linalg.inv(s)
            off = np.array([0.1, 0.2][: len(rows)])
            after = update(track, seen)
            assert after.mean == pytest.approx(np.array(track.mean) + gain @ off)
            assert after.matrix == pytest.approx(track.matrix - gain @ s @ gain.T)
            assert seen.distance2 == pytest.approx(float(off @ np.linalg.inv(s) @ off))
            assert seen.log_volume_ratio == pytest.approx(math.log(np.linalg.det(s) / np.linalg.det(r)))
