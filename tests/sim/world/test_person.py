"""People keep their timetable, and walk as people do."""

import math
from itertools import pairwise

import numpy as np
import pytest
from tests.sim.logs import there

from limo_sim.world.person import BodyMesh, Pose, Walk, body, legs_at
from limo_sim.world.scenario import Person, Scenario

PATROL = Scenario.load("workshop").people[0]


def lowest(figure: BodyMesh) -> float:
    return float(min((figure.start[:, 2] - figure.start_radius).min(), (figure.end[:, 2] - figure.end_radius).min()))


def highest(figure: BodyMesh) -> float:
    reach = np.sqrt((figure.axes**2).sum(axis=2))[:, 2]
    return float((figure.centre[:, 2] + reach).max())


@pytest.mark.parametrize(
    ("time", "x", "y"),
    [
        *((0.0, -3, -3), (4.0, -3, 0), (8.0, -3, 3), (8.5, -3, 3), (12.5, 0, 3), (16.5, 3, 3), (17.0, 3, 3)),
        *((25.0, 3, -3), (33.5, -3, -3), (34.0, -3, -3), (38.0, -3, 0), (34.0 * 100 + 21.0, 3, 0)),
    ],
)
def test_the_patrol_keeps_the_workshops_times(time: float, x: float, y: float) -> None:
    pose = there(Walk(PATROL).pose(time))
    assert (pose.x, pose.y) == pytest.approx((x, y), abs=1e-6)


def test_nobody_moves_faster_than_they_walk() -> None:
    for name in Scenario.names():
        for person in Scenario.load(name).people:
            walk = Walk(person)
            poses = pairwise(walk.pose(step / 50) for step in range(50 * 120))
            steps = [math.dist((a.x, a.y), (b.x, b.y)) for a, b in poses if a and b]
            assert max(steps) <= person.speed / 50 + 1e-9, name


def test_headings_change_smoothly_and_follow_the_way() -> None:
    walk = Walk(PATROL)
    poses = [walk.pose(step / 50) for step in range(50 * 70)]
    yaws = np.unwrap([pose.yaw for pose in poses if pose])
    assert np.abs(np.diff(yaws)).max() < math.radians(6)
    assert math.remainder(there(walk.pose(20.0)).yaw + math.pi / 2, math.tau) == pytest.approx(0, abs=1e-9)


def test_the_gait_is_tied_to_the_distance_walked_and_limbs_rest_in_a_pause() -> None:
    for speed in (0.2, 0.8):
        walk = Walk(Person(route=((-3, 0, 0), (3, 0, 0)), speed=speed))
        for metres in (0.1, 0.5, 1.3, 2.9):
            assert there(walk.pose(metres / speed)).phase == pytest.approx(math.tau * metres / 0.75 % math.tau)
    pauses = Walk(Scenario.load("followable").people[0])
    assert (there(pauses.pose(1.7 / 0.22 + 2.0)).swing, there(pauses.pose(4.0)).swing) == (0, 1)


def test_a_person_is_there_until_they_leave_and_one_corner_means_standing() -> None:
    walk = Walk(Person(route=((2, 1, 0), (2, -1, 0)), arrives_s=1.0, leaves_s=4.0))
    assert [walk.pose(time) is not None for time in (0.9, 1.0, 3.99, 4.0, 100.0)] == [False, True, True, False, False]
    stands = Walk(Person(route=((2, 1, 0),), facing=1.0))
    assert stands.pose(0.0) == stands.pose(100.0) == Pose(2, 1, 1.0)


@pytest.mark.parametrize("height", [0.8, 0.9, 1.1, 2.0])
def test_the_lowest_foot_touches_the_floor_and_the_head_is_at_full_height(height: float) -> None:
    person = Person(route=((2, 0, 0),), height=height)
    for phase in np.linspace(0, math.tau, 12, endpoint=False):
        figure = body(person, Pose(2, 0, 0.4, float(phase), 1.0))
        assert lowest(figure) == pytest.approx(0.0, abs=1e-9)
        assert 0.93 * height < highest(figure) < 1.03 * height
    assert highest(body(person, Pose(2, 0, 0.4))) == pytest.approx(height, rel=0.025)


def test_the_standing_foot_does_not_slide() -> None:
    walk = Walk(Person(route=((-3, 0, 0), (3, 0, 0)), speed=0.5))
    ankles = [body(walk.person, there(walk.pose(step / 50))).end[[1, 4]].tolist() for step in range(50, 150)]
    held = [min(two, key=lambda ankle: ankle[2])[0] for two in ankles]
    assert np.median(np.abs(np.diff(held)) * 50) < 0.5 * walk.person.speed


def test_a_turned_body_is_the_same_body_turned() -> None:
    straight, turned = body(PATROL, Pose(0, 0, 0, 1.0, 1.0)), body(PATROL, Pose(1, 2, math.pi / 2, 1.0, 1.0))
    expected = np.stack([1 - straight.start[:, 1], 2 + straight.start[:, 0], straight.start[:, 2]], axis=1)
    np.testing.assert_allclose(turned.start, expected, atol=1e-12)


@pytest.mark.parametrize("height", [0.9, 1.8])
def test_a_person_who_sits_is_on_a_stool_and_three_quarters_as_tall(height: float) -> None:
    person = Person(route=((2, 0, 0),), height=height, sits=True)
    figure = body(person, Pose(2, 0, 0.4))
    assert lowest(figure) == pytest.approx(0.0, abs=0.01 * height)
    assert 0.7 * height < highest(figure) < 0.85 * height
    reach = np.hypot(figure.start[:, 0] - 2, figure.start[:, 1]).max()
    assert reach < person.radius
    # The lidar's plane meets two shins and four legs of the stool.
    assert len(legs_at(person, Pose(2, 0, 0.4), 0.111)) == 6
