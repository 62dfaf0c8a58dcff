"""People push each other as the paper of 1995 says, find their way, react to the robot, and furniture moves."""

import dataclasses
import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.sim.logs import drive, poses_of, there
from tests.sim.logs import poses_of as poses

from limo_hog.follow.robot import Twist
from limo_sim.run.arena import Arena
from limo_sim.world.crowd import STEP_S
from limo_sim.world.furniture import Disc, Rectangle, distance_to
from limo_sim.world.movers import Movers
from limo_sim.world.paths import FloorPlan
from limo_sim.world.person import Pose
from limo_sim.world.scenario import Camera, Furniture, Group, Mover, Person, Robot, Room, Scenario, Wall
from limo_sim.world.social_force import F64, People, SocialForce, acceleration
from limo_sim.world.truth import Contacts

YIELDS = Person(route=((-2, 1, 0), (2, 1, 1.0), (2, 3, 0)), behaviour="social_force")
CORNER = Robot(x=-4.5, y=-4.5)


def walked(person: Person, seconds: float, *walls: Wall) -> list[Pose]:
    """Return a person's poses from step to step, alone with a robot that stands in a corner."""
    return [there(one) for (one,) in poses(Scenario(people=(person,), walls=walls, robot=CORNER), seconds)]


def test_a_routes_corners_are_visited_in_order_with_pauses_and_as_people_walk() -> None:
    seen = walked(YIELDS, 25.0)
    near = [[math.dist((pose.x, pose.y), corner[:2]) < 0.3 for pose in seen].index(True) for corner in YIELDS.route[1:]]
    assert near == sorted(near)
    still = sum(math.dist((pose.x, pose.y), (2, 1)) < 0.1 and pose.swing < 0.5 for pose in seen) * STEP_S
    assert 0.8 < still < 2.0
    turns = [math.remainder(b.yaw - a.yaw, math.tau) for a, b in pairwise(seen)]
    assert max(map(abs, turns)) < math.radians(6)
    assert seen[150].swing == 1.0 and abs(seen[150].yaw) < 0.1
    metres = sum(math.dist((a.x, a.y), (b.x, b.y)) for a, b in pairwise(seen[:151]))
    assert seen[150].phase == pytest.approx(math.tau * metres / 0.75 % math.tau, abs=1e-6)


def test_somebody_finds_the_door_between_two_rooms() -> None:
    person = dataclasses.replace(YIELDS, route=((-2, -2, 0), (2, -2, 30)))
    seen = walked(person, 25.0, Wall((0, -4.9), (0, 2.0)), Wall((0, 2.8), (0, 4.9)))
    crossing = next(pose for pose in seen if pose.x > 0)
    assert 2.1 < crossing.y < 2.7
    assert math.dist((seen[-1].x, seen[-1].y), (2, -2)) < 0.1


def test_a_person_who_arrives_walks_in_through_a_door_and_who_leaves_walks_out() -> None:
    person = dataclasses.replace(YIELDS, arrives_s=1.0, leaves_s=14.0, enters=(-4.9, 2.0))
    seen = [one for (one,) in poses(Scenario(people=(person,), robot=CORNER), 30.0)]
    assert seen[49] is None
    assert seen[-1] is None
    inside = [pose for pose in seen if pose is not None]
    for pose, error in ((seen[50], 0.05), (inside[-1], 0.1)):
        assert (there(pose).x, there(pose).y) == pytest.approx((-5.4, 2.0), abs=error)
    assert max(math.dist((a.x, a.y), (b.x, b.y)) for a, b in pairwise(inside)) < 1.3 * 0.75 * STEP_S + 1e-9
    # In the outer wall's plane they are within the door, nowhere else.
    for pose in inside:
        if max(abs(pose.x), abs(pose.y)) > 4.6:
            assert math.hypot(pose.y - 2.0, pose.x + 4.9) < 0.65


def test_people_come_in_by_the_nearest_door_or_their_own() -> None:
    nearest = dataclasses.replace(YIELDS, route=((-3.5, 1, 0), (2, 1, 0)), arrives_s=0.5)
    # A larger room has its doors farther out.
    own = dataclasses.replace(YIELDS, arrives_s=0.5, enters=(0.0, -8.0))
    for person, half, door in ((nearest, 4.9, (-5.4, 1.0)), (own, 8.0, (0.0, -8.5))):
        seen = [one for (one,) in poses(Scenario(people=(person,), room=Room(half), robot=CORNER), 1.0)]
        first = next(pose for pose in seen if pose is not None)
        assert (first.x, first.y) == pytest.approx(door, abs=0.05)


@pytest.mark.parametrize("behaviour", ["social_force", "route"])
def test_a_person_walks_round_somebody_who_comes_towards_them(behaviour: str) -> None:
    walker = dataclasses.replace(YIELDS, route=((-3, 0, 0), (3, 0, 900)))
    other = Person(route=((3, 0.02, 0), (-3, 0.02, 900)), speed=0.5, behaviour=behaviour)
    seen = poses(Scenario(people=(other, walker), robot=CORNER), 14.0)
    assert min(math.dist((there(a).x, there(a).y), (there(b).x, there(b).y)) for a, b in seen) > 0.26 * 0.9
    assert there(seen[-1][1]).x > 2.8 and there(seen[-1][0]).x < -2.8
    if other.behaviour == "route":
        assert max(abs(there(a).y - 0.02) for a, _ in seen) < 1e-9


def test_a_group_steps_aside_for_the_robot_and_comes_back() -> None:
    group = Group(x=1.0, y=0.0, size=4, radius=0.5, behaviour="social_force").members()
    arena = Arena(Scenario(people=group, robot=Robot(x=-1.5)), 0)
    homes = [person.route[0][:2] for person in group]

    def strayed() -> float:
        return max(math.dist((p.x, p.y), home) for p, home in zip(arena.truth().people, homes, strict=True) if p)

    assert strayed() < 0.05
    while arena.truth().robot[0] < 1.0:
        drive(arena, 0.1, Twist(0.3, 0.0))
    assert strayed() > 0.15
    while arena.truth().robot[0] < 4.0:
        drive(arena, 0.1, Twist(0.5, 0.0))
    assert (arena.contacts.person, strayed() < 0.1) == (0, True)


@pytest.mark.parametrize(("reaction", "least", "most"), [("approach", 1.0, 1.35), ("block", 0.85, 1.2)])
def test_some_come_up_to_the_robot_or_stand_in_its_way(reaction: str, least: float, most: float) -> None:
    person = dataclasses.replace(YIELDS, route=((3, -3, 0), (3, 3, 0)), reaction=reaction)
    robot = (0.0, 0.0, 0.3)
    pose = there(poses(Scenario(people=(person,)), 15.0, robot)[-1][0])
    assert least < math.hypot(pose.x, pose.y) < most
    assert abs(math.remainder(pose.yaw - math.atan2(-pose.y, -pose.x), math.tau)) < 0.1
    assert pose.swing < 0.2
    if reaction == "block":
        assert math.atan2(pose.y, pose.x) == pytest.approx(0.3, abs=0.1)


def test_nobody_is_drawn_to_a_robot_behind_a_wall() -> None:
    person = dataclasses.replace(YIELDS, route=((2, 0, 0),), reaction="approach")
    scenario = Scenario(people=(person,), walls=(Wall((1, -2), (1, 2)),))
    pose = there(poses(scenario, 5.0, (0.0, 0.0, 0.0))[-1][0])
    assert math.dist((pose.x, pose.y), (2, 0)) < 0.1


def test_the_same_seed_gives_the_same_walks_and_another_seed_others() -> None:
    people = tuple(dataclasses.replace(YIELDS, route=((-3, 0.8 * n, 0), (3, -0.8 * n, 0))) for n in range(4))
    crowd = Scenario(people=people, robot=CORNER)
    one, again, other = (poses(crowd, 6.0, seed=seed)[-1] for seed in (3, 3, 4))
    assert one == again
    assert one != other


def test_a_crowd_in_a_furnished_room_stays_inside_and_out_of_the_furniture() -> None:
    random, people = np.random.default_rng(5), []
    furniture = tuple(Furniture("pillar", x, y) for x, y in ((-2, -2), (0, 2.5), (2, -1.5), (2.5, 2)))
    corners = [(-3.5, -3.5), (3.5, 3.5), (-3.5, 3.5), (3.5, -3.5), (0, 0.5), (-1, -3.5), (1, 4.0), (-3.5, 0.5)]
    for _ in range(8):
        route = tuple((float(x), float(y), 0.5) for x, y in random.permutation(corners)[:4])
        people.append(Person(route, behaviour="social_force", speed=float(random.uniform(0.4, 1.0))))
    scenario = Scenario(people=tuple(people), furniture=furniture, robot=Robot(x=4.5, y=0.0, yaw=1.0))
    for x, y in ((there(pose).x, there(pose).y) for step in poses(scenario, 30.0, (4.5, 0.0, 1.0)) for pose in step):
        assert max(abs(x), abs(y)) < 4.9 - 0.1
        assert all(math.dist((x, y), (piece.x, piece.y)) > 0.15 + 0.1 for piece in furniture)


def test_a_group_in_a_file_becomes_people_who_look_at_its_middle(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text("[[people]]\nroute = [[3, 1, 0]]\n[[groups]]\nx = -2\ny = 1\nsize = 5\nradius = 0.7\n")
    people = Scenario.load(path).people
    assert len(people) == 6
    for person in people[1:]:
        x, y, _ = person.route[0]
        assert math.dist((x, y), (-2, 1)) == pytest.approx(0.7)
        assert (x + 0.7 * math.cos(person.facing), y + 0.7 * math.sin(person.facing)) == pytest.approx((-2, 1))


TROLLEY = Scenario(movers=(Mover("trolley", ((2.0, -1.0, 0), (2.0, 1.0, 0)), 0.5),))


def test_a_mover_keeps_its_timetable() -> None:
    for time, y in ((0.0, -1.0), (2.0, 0.0), (4.0, 1.0), (6.0, 0.0), (10.0, 0.0)):
        (piece,) = Movers(TROLLEY.movers).at(time)
        assert (piece.x, piece.y) == pytest.approx((2.0, y))


def test_camera_and_lidar_see_a_mover_where_it_was_when_they_looked() -> None:
    arena = drive(Arena(dataclasses.replace(TROLLEY, camera=Camera(latency_s=0.4)), 0), 2.4)
    frame, scan = arena.frame(), arena.scan()
    assert frame.stamp == pytest.approx(2.0)
    # Long side along y: the trolley drives sideways to the camera, 0.17 m deep.
    assert frame.depth[200:280, 320].min() == pytest.approx(2.0 - 0.17 - 0.084, abs=0.03)
    angles = np.linspace(-2.0, 2.0, 292)
    hit = scan.ranges < 2.5
    assert np.median(np.sin(angles[hit]) * scan.ranges[hit]) == pytest.approx(0.5 * (scan.stamp - 2.0), abs=0.1)


def test_a_mover_pushes_the_robot_aside_which_counts_as_a_contact() -> None:
    arena = drive(Arena(Scenario(movers=(Mover("trolley", ((1.0, 0.05, 0), (-1.0, 0.05, 0)), 0.4),)), 0), 4.0)
    assert arena.contacts == Contacts(person=0, wall=1)
    assert arena.truth().robot[0] < -0.3


@pytest.mark.parametrize("heading", [0.0, math.pi / 2, -2.0])
def test_a_mover_has_the_velocity_of_its_way_in_the_physics(heading: float) -> None:
    ahead, left = math.cos(heading), math.sin(heading)
    arena = drive(Arena(Scenario(movers=(Mover("trolley", ((2.0, 0.0, 0), (2.0 + ahead, left, 0)), 0.5),))), 0.5)
    (body,) = arena._moving
    # Half a second at half a metre a second.
    assert tuple(body.velocity) == pytest.approx((0.5 * ahead, 0.5 * left))
    assert tuple(body.position) == pytest.approx((2.0 + 0.25 * ahead, 0.25 * left))


def test_a_person_who_yields_walks_round_a_mover() -> None:
    person = Person(route=((-1.0, 0.03, 0), (4.0, 0.03, 900)), behaviour="social_force", speed=0.7)
    scenario = dataclasses.replace(
        TROLLEY, people=(person,), robot=Robot(x=-4), movers=(Mover("trolley", ((4.2, 0, 0), (-2.0, 0, 0)), 0.4),)
    )
    seen = [there(pose) for (pose,) in poses(scenario, 10.0, (-4.0, 0.0, 0.0))]
    pieces = [piece for step in range(len(seen)) for piece in Movers(scenario.movers).at(step * STEP_S)]
    assert min(math.dist((a.x, a.y), (b.x, b.y)) for a, b in zip(seen, pieces, strict=True)) > 0.17 + 0.1
    assert seen[-1].x > 3.8


def test_the_way_is_straight_where_nothing_stands_and_begins_without_the_margin() -> None:
    place, length = FloorPlan([Rectangle(0, 3, 1, 1)], 5.0, 0.3).way((-2, 0), (2, 1))
    assert place == (2, 1) and length == pytest.approx(math.hypot(4, 1))
    place, length = FloorPlan([Rectangle(0, 0, 1, 1)], 5.0, 0.3).way((-1.1, 0), (1.1, 0))
    assert place[0] == pytest.approx(-1.3, abs=0.01)
    assert length < 2 * math.hypot(1.3, 0.2) + 2.7


def test_the_way_round_a_square_or_disc_is_as_long_as_geometry_says() -> None:
    place, length = FloorPlan([Rectangle(0, 0.2, 1, 1)], 5.0, 0.3).way((-3, 0), (3, 0))
    assert place == pytest.approx((-1.3, -1.1), abs=0.01)
    assert length == pytest.approx(2 * math.hypot(1.7, 1.1) + 2.6, abs=0.01)
    # Tangents and an arc.
    shortest = 2 * math.sqrt(9 - 1) + (math.pi - 2 * math.acos(1.0 / 3.0))
    assert shortest <= FloorPlan([Disc(0, 0, 0.7)], 5.0, 0.3).way((-3, 0), (3, 0))[1] < 1.03 * shortest


def test_a_door_is_found_and_one_too_narrow_is_none() -> None:
    for width, passable in ((0.7, True), (0.5, False)):
        walls = [Rectangle(0, side * (2.5 + width / 2), 0.05, 2.5) for side in (-1, 1)]
        length = FloorPlan(walls, 5.0, 0.3).way((-2, 2), (2, 2))[1]
        assert math.isfinite(length) == passable


def test_a_wall_hides_what_is_behind_it() -> None:
    plan = FloorPlan([Rectangle(0, 0, 0.05, 1.0, 0.3), Disc(3, 0, 0.2)], 5.0, 0.3)
    start, end = np.array([[-1.0, 0], [-1, 2], [2, 0], [2, 0.5]]), np.array([[1.0, 0], [1, 2], [4, 0], [4, 0.5]])
    assert plan.hidden(start, end).tolist() == [True, False, True, False]


def test_the_way_to_the_nearest_point_is_as_long_as_the_distance() -> None:
    shapes: list[Disc | Rectangle] = [Disc(1, 2, 0.4), Rectangle(-1, 0.5, 0.7, 0.2, 0.6)]
    places = np.random.default_rng(0).uniform(-4, 4, (200, 2))
    away = FloorPlan(shapes, 5.0, 0.3).away(places)
    for index, place in enumerate(places.tolist()):
        for column, shape in ((1, shapes[0]), (0, shapes[1])):
            assert math.hypot(*away[index, column]) == pytest.approx(max(distance_to(shape, *place), 0.0), abs=1e-6)


MODEL = SocialForce()
ADULT = MODEL.adult_m
FREE = np.full((1, 1, 2), np.inf)


def felt(at: tuple[float, float], velocity: tuple[float, float] = (0.0, 0.0), *, hidden: bool = False) -> F64:
    """Return what the person at `at`, who walks along x, feels of another at the origin alone: float64 (2,) [m/s²]."""
    along = np.array([[1.0, 0.0]])
    places, radii = np.array([at, (0.0, 0.0)]), np.full(2, 0.13 * ADULT)
    two = People(places, np.array([along[0], velocity]), radii, np.full(1, ADULT), along, along)
    return np.asarray(acceleration(two, FREE, np.array([[False, hidden]]), MODEL)[0])


def potential(at: F64, velocity: F64) -> float:
    """Return V of equation (3), b of equation (4) [m²/s²]."""
    step = velocity * 2.0
    both = math.hypot(*at) + math.hypot(*(at - step))
    return 2.1 * math.exp(-0.5 * math.sqrt(both**2 - step @ step) / 0.3)


@pytest.mark.parametrize("velocity", [(0.0, 0.0), (0.9, 0.0), (-0.3, 1.1)])
@pytest.mark.parametrize("at", [(-0.9, 0.3), (-1.4, -0.6), (-0.6, 0.02)])
def test_the_push_is_the_slope_of_the_papers_potential(at: tuple[float, float], velocity: tuple[float, float]) -> None:
    place, pace, tiny = np.array(at), np.array(velocity), 1e-6
    around = [[potential(place + side * axis, pace) for axis in np.eye(2)] for side in (-tiny, tiny)]
    downhill = -np.diff(around, axis=0)[0] / (2 * tiny)
    in_sight = -downhill[0] >= math.cos(math.radians(100.0)) * math.hypot(*downhill)
    np.testing.assert_allclose(felt(at, velocity), downhill * (1.0 if in_sight else 0.5), rtol=1e-5)


def test_what_is_behind_counts_half_a_wall_hides_and_touching_bodies_part() -> None:
    before = felt((-0.8, 0.0))[0]
    assert before == pytest.approx(-7.0 * math.exp(-0.8 / 0.3))
    assert felt((0.8, 0.0))[0] == pytest.approx(-0.5 * before)
    assert felt((-0.8, 0.0), hidden=True).tolist() == [0.0, 0.0]
    near, touching = (felt((-gap, 0.0))[0] for gap in (0.26 * ADULT + 0.01, 0.26 * ADULT - 0.01))
    assert touching - near == pytest.approx(-15.0, abs=1.0)


def test_a_wall_pushes_with_the_papers_strength_and_a_child_feels_it_in_proportion() -> None:
    rest = np.zeros((1, 2))
    for scale in (1.0, 0.5):
        size = np.array([scale * ADULT])
        alone = People(rest, rest, 0.13 * size, size, rest, np.array([[1.0, 0.0]]))
        pushed = acceleration(alone, np.array([[[0.0, 0.4 * scale]]]), np.zeros((1, 1), bool), MODEL)[0]
        np.testing.assert_allclose(pushed, [0.0, scale * 50.0 * math.exp(-2.0)])


def places_of(scenario: Scenario, seconds: float, robot: tuple[float, float, float], seed: int = 0) -> F64:
    """Return everybody's places, float64 (steps, people, 2)."""
    seen = poses_of(scenario, seconds, robot, seed)
    return np.array([[(pose.x, pose.y) for pose in poses if pose is not None] for poses in seen])


def speeds(places: F64) -> NDArray[np.float64]:
    return np.asarray(np.linalg.norm(np.diff(places, axis=0), axis=2)) / STEP_S


def test_somebody_alone_reaches_the_wanted_speed_in_the_papers_half_second() -> None:
    alone = Person(route=((-3, 0, 0), (4, 0, 900)), speed=1.34, height=ADULT, behaviour="social_force")
    places = places_of(Scenario(people=(alone,), robot=Robot(y=-4)), 3.0, (0.0, -4.0, 0.0))
    times = STEP_S * np.arange(1, 126)
    assert np.abs(speeds(places)[:125, 0] - 1.34 * (1 - np.exp(-times / 0.5))).max() < 0.08
    assert np.abs(places[..., 1]).max() < 0.1


@pytest.mark.parametrize("seed", [0, 1])
def test_two_streams_pass_a_door_by_turns(seed: int) -> None:
    people, side = [], [-1, 1] * 9
    for index, sign in enumerate(side):
        row, beside = index // 6, index // 2 % 3 - 1
        start, through = (sign * (2.5 + 0.9 * row), 0.9 * beside, 0), (-sign * 6.0, 1.5 * beside, 0)
        away = (-sign * 7.5, 1.5 * beside + 0.6 * row, 900)
        people.append(Person(route=(start, through, away), speed=1.34, height=1.75, behaviour="social_force"))
    door = Wall((0, -9), (0, -0.6)), Wall((0, 0.6), (0, 9))
    scenario = Scenario(people=tuple(people), walls=door, room=Room(9.0), robot=Robot(x=-8, y=-8))
    places = places_of(scenario, 45.0, (-8.0, -8.0, 0.0), seed)

    across = places[..., 0] * -np.array(side) > 0
    assert across[-1].all()
    order = [side[index] for index in np.argsort(across.argmax(axis=0))]
    turns = sum(one != other for one, other in pairwise(order))
    # Of 18 people in random order 9 on average follow one from the other side, and 5 or fewer in 3 of 100 orders.
    assert 1 <= turns <= 5
    gaps = np.hypot(*np.moveaxis(places[:, :, None] - places[:, None], 3, 0)) + 9.0 * np.eye(len(people))
    # Shoulders overlap by no more than a tenth of their breadth.
    assert gaps.min() > 0.9 * 0.26 * 1.75
    assert speeds(places).max() < 1.3 * 1.34 + 1e-6
    in_door = np.abs(places[..., 0]) < 0.05
    assert np.abs(places[..., 1][in_door]).max() < 0.6 - 0.13 * 1.75


@pytest.mark.parametrize(("height", "speed"), [(0.9, 0.7), (1.75, 1.34)])
@pytest.mark.parametrize("aside", [0.0, 0.05, -0.2])
def test_a_person_who_meets_a_standing_robot_walks_round_it_and_on(height: float, speed: float, aside: float) -> None:
    person = Person(route=((-3, aside, 0), (3, aside, 900)), speed=speed, height=height, behaviour="social_force")
    places = places_of(Scenario(people=(person,)), 16.0, (0.0, 0.0, 0.0))[:, 0]
    gap = np.hypot(*places.T).min() - person.radius
    assert gap > 0.19 + 0.05
    assert math.dist(places[-1], (3, aside)) < 0.1
    # No farther off the line than there is need for, and at the wanted speed before and behind.
    assert np.abs(places[:, 1]).max() < 1.3
    pace = speeds(places[:, None])[:, 0]
    assert pace[places[:-1, 0] > 1.2][:10].mean() == pytest.approx(speed, rel=0.1)
    # Who ignores the robot walks straight through its place.
    blind = Scenario(people=(dataclasses.replace(person, reaction="ignore"),))
    assert np.hypot(*places_of(blind, 16.0, (0.0, aside, 0.0))[:, 0].T).min() < abs(aside) + 0.1
