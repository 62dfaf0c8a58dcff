"""Which command costs least: what each critic is for, and how another is added."""

import math
from dataclasses import dataclass, field, replace
from types import FunctionType

import numpy as np
import pytest
from tests.follow.views import there

from limo_hog.follow.control.planner import NO_WAY, Move, Planner
from limo_hog.follow.control.rollouts import DIRECT, Manoeuvre, Rollouts
from limo_hog.follow.control.situation import Goal, Situation
from limo_hog.follow.robot import LIMO, Twist
from limo_hog.follow.sense.clearance import rooms_ahead
from limo_hog.follow.sense.observation import Array, Odometry
from limo_hog.follow.space.grid import Grid

PLANNER, GRID, POSE = Planner(), Grid(), Odometry(10.0)
TIMES = PLANNER.sampling.times
NOBODY = np.empty((0, 4))


def towards(x: float, y: float = 0.0, speed: float = 0.7, keeps: float = 1.5) -> Goal:
    """To come up to a person who stands."""
    return Goal(math.atan2(y, x), speed=speed, places=np.full((len(TIMES), 2), (x, y)), keeps=keeps)


def situation(
    *people: tuple[float, float, float, float], followed: int | None = None, points: object = (), speed: float = 0.0
) -> Situation:
    """A robot at the origin that drives along x, on ground that was just seen to be free."""
    ground = GRID.start(POSE)
    ground = replace(ground, freed=np.full_like(ground.freed, 10.0), stamp=10.0)
    stands = np.array(points, float).reshape(-1, 2)
    around = np.array(people, float).reshape(-1, 4)
    hiding = np.empty((0, 3))
    return Situation(10.0, POSE, Twist(speed), LIMO, 1.0, 0.1, 0.1, around, followed, stands, GRID, ground, hiding)


def wall(x: float, *, half: float) -> list[tuple[float, float]]:
    return [(x, y) for y in np.arange(-half, half + 0.01, 0.04)]


#: A wall at the robot's back: it cannot give way by backing.
BEHIND = wall(-0.5, half=0.6)
#: A post between the robot and the person followed.
POST = situation((3.5, 0.0, 0.0, 0.0), followed=0, points=wall(1.2, half=0.05), speed=0.5)


def without(critic: str) -> Planner:
    return replace(PLANNER, **{critic: replace(getattr(PLANNER, critic), weight=0.0)})


def test_with_nothing_in_the_way_the_command_is_the_goals_own() -> None:
    plan = PLANNER.plan(situation((3.0, 0.4, 0.0, 0.0), followed=0), towards(3.0, 0.4), DIRECT)
    heading = math.atan2(0.4, 3.0)
    assert plan.twist == Twist(pytest.approx(0.7 * math.cos(heading) ** 2), pytest.approx(2.5 * heading))  # type: ignore[arg-type]
    assert (plan.manoeuvre, plan.reason) == (DIRECT, "")


def test_a_plan_says_what_each_critic_adds_and_where_it_leads() -> None:
    plan = PLANNER.plan(situation(), towards(3.0), DIRECT)
    assert [name for name, _ in plan.shares] == [name for name, _ in PLANNER.critics()]
    assert (len(plan.shares), plan.rollout.shape) == (8, (len(TIMES), 2))
    assert 0.3 < plan.rollout[-1, 0] < 1.5


def test_around_a_post_it_drives_and_says_so() -> None:
    plan = PLANNER.plan(POST, towards(3.5), DIRECT)
    assert abs(plan.twist.angular) > 0.2 and plan.twist.linear > 0.3
    assert plan.reason == "driving around an obstacle"


def test_where_no_command_leads_anywhere_it_stands_and_says_so() -> None:
    ring = [(0.4 * math.cos(a), 0.4 * math.sin(a)) for a in np.arange(-3.1, 3.2, 0.05)]
    plan = PLANNER.plan(situation(points=ring), towards(3.0), DIRECT)
    assert (plan.twist.linear, plan.reason) == (0.0, NO_WAY)


def test_it_backs_slowly_where_somebody_out_of_sight_can_have_come() -> None:
    def backs(seen_s_ago: float, hidden_at: float) -> float:
        seen = replace(situation(speed=-0.6), hiding=np.array([(hidden_at, 0.0, 2.0), (9.0, 0.0, 2.0)]))
        ground = there(seen.ground)
        seen = replace(seen, ground=replace(ground, freed=ground.freed - seen_s_ago))
        return float(PLANNER.sampling.roll_out(seen, Goal(0.0), DIRECT).wanted.min())

    assert (backs(1.5, -1.0), backs(0.5, -1.0), backs(1.5, -4.0)) == (-0.2, -0.3, -0.3)


def test_only_alone_with_the_person_followed_it_backs_at_full_speed() -> None:
    def backs(*people: tuple[float, float, float, float], followed: int | None) -> float:
        seen = situation(*people, followed=followed, speed=-0.6)
        return float(PLANNER.sampling.roll_out(seen, Goal(0.0), DIRECT).wanted.min())

    comes, stands = (1.0, 0.0, -0.8, 0.0), (3.0, 2.0, 0.0, 0.0)
    assert [backs(followed=None), backs(comes, followed=0), backs(comes, stands, followed=0)] == [-0.6, -0.6, -0.3]
    assert backs(stands, followed=None) == -0.3


def test_from_the_person_followed_who_comes_up_it_backs_without_turning_its_camera_off_them() -> None:
    comes = (1.2, 0.2, -0.8, 0.0)
    places = PLANNER.sampling.walked(np.array([comes]))[:, 0]
    goal = Goal(math.atan2(0.2, 1.2), speed=-0.9, speed_later=-0.8, places=places, keeps=1.6)
    plan = PLANNER.plan(situation(comes, (3.0, 2.0, 0.0, 0.0), followed=0, speed=-0.3), goal, DIRECT)
    assert plan.manoeuvre.heading is None
    assert plan.twist.linear == pytest.approx(-0.3, abs=0.02)


def goal_distance(planner: Planner) -> bool:
    """It drives around a post that stands between it and its goal."""
    return planner.plan(POST, towards(3.5), DIRECT).manoeuvre != DIRECT


def in_view(planner: Planner) -> bool:
    """It gives way to somebody without turning its camera off the person followed."""
    seen = situation((3.0, 0.0, 0.0, 0.0), (1.2, 0.3, -0.8, 0.0), followed=0, points=BEHIND)
    return abs(planner.plan(seen, Goal(0.0), DIRECT).manoeuvre.heading or 0.0) < 0.3


def followed(planner: Planner) -> bool:
    """It gives way to the person followed, who walks at it."""
    seen = situation((1.2, 0.0, -0.8, 0.0), followed=0)
    return planner.plan(seen, Goal(0.0, faces=False), DIRECT).manoeuvre != DIRECT


def others(planner: Planner) -> bool:
    """It gives way to somebody else who walks at it."""
    return planner.plan(situation((0.8, 0.1, -0.8, 0.0)), Goal(0.0), DIRECT).manoeuvre != DIRECT


def walls(planner: Planner) -> bool:
    """It turns off a wall that it would drive along too close by."""
    along = [(x, 0.28) for x in np.arange(-0.5, 4.0, 0.04)]
    seen = situation((3.5, 0.0, 0.0, 0.0), followed=0, points=along, speed=0.5)
    return (planner.plan(seen, towards(3.5), DIRECT).manoeuvre.heading or 0.0) < 0


def unseen_ground(planner: Planner) -> bool:
    """It does not back onto ground to which somebody out of sight can have come."""
    seen = situation((1.2, 0.0, 0.0, 0.0), followed=0)
    ground = there(seen.ground)
    seen = replace(seen, ground=replace(ground, freed=ground.freed - 10.0), hiding=np.array([(-1.0, 0.0, 2.0)]))
    return bool(planner.plan(seen, towards(1.2, speed=-0.3), DIRECT).twist.linear == 0)


def effort(planner: Planner) -> bool:
    """Of the ways out of a person's way that are as good it takes the smaller turn."""
    seen = situation((1.4, 0.0, -0.8, 0.0))
    return abs(planner.plan(seen, Goal(0.0), DIRECT).manoeuvre.heading or 0.0) < 0.3


def change_of_mind(planner: Planner) -> bool:
    """It goes on around a post on the side on which it began to."""
    keen = replace(planner, stay=0.0)
    return (keen.plan(POST, towards(3.5), Manoeuvre(0.32)).manoeuvre.heading or 0.0) > 0


@pytest.mark.parametrize(
    "behaves", [goal_distance, in_view, followed, others, walls, unseen_ground, effort, change_of_mind]
)
def test_each_critic_is_needed_for_what_it_is_for(behaves: FunctionType) -> None:
    assert behaves(PLANNER), behaves.__doc__
    assert not behaves(without(behaves.__name__)), f"without {behaves.__name__} it does as well"


@dataclass(frozen=True, slots=True)
class KeepRight:
    """Metres left of where the robot is."""

    weight: float = 5.0

    def cost(self, rollouts: Rollouts, _: Situation) -> Array:
        return np.asarray(np.maximum(rollouts.poses[:, :, 1] + 0.3, 0.0).mean(axis=1))


@dataclass(frozen=True, slots=True)
class Polite(Planner):
    keep_right: KeepRight = field(default_factory=KeepRight)


def test_another_critic_is_one_class_and_one_line() -> None:
    seen = situation((3.0, 0.0, 0.0, 0.0), followed=0)
    assert PLANNER.plan(seen, towards(3.0), DIRECT).twist.angular == 0
    polite = Polite().plan(seen, towards(3.0), DIRECT)
    assert polite.twist.angular < 0
    assert dict(polite.shares)["keep_right"] > 0


def test_what_it_began_is_not_gone_on_with_where_it_leads_nowhere() -> None:
    # It went out of a person's way, lost them, and looks for them to the left.
    plan = PLANNER.plan(situation(speed=0.8), Goal(0.5), Manoeuvre(0.0, 0.8))
    assert plan.twist.linear < 0.1 and plan.twist.angular > 0.5
    # The wall ahead stops it; the person lost is looked for to the left.
    seen = situation(points=[(0.5, y) for y in np.arange(-0.6, 0.61, 0.04)])
    plan = PLANNER.plan(seen, Goal(0.45), Manoeuvre(0.0, 0.8))
    assert plan.manoeuvre == DIRECT
    assert PLANNER.plan(seen, Goal(0.45), plan.manoeuvre).twist.angular > 0.5


def test_a_manoeuvre_begun_is_kept_for_all_that_it_costs_a_little_more() -> None:
    walks = (1.8, 0.06, -0.8, 0.0)
    fresh = PLANNER.plan(situation(walks, followed=0), Goal(0.0), DIRECT).manoeuvre
    assert fresh.heading is not None
    other = replace(fresh, heading=-fresh.heading)
    for stay, kept in ((PLANNER.stay, other), (0.0, fresh)):
        planner = replace(PLANNER, stay=stay, change_of_mind=replace(PLANNER.change_of_mind, weight=0.0))
        assert planner.plan(situation(walks, followed=0), Goal(0.0), other).manoeuvre == kept


def test_people_who_would_be_met_in_two_seconds_hardly_count() -> None:
    # They give way as well; a robot that takes them not to would stand.
    plan: Move = PLANNER.plan(situation((3.2, 0.2, -0.8, 0.0)), towards(6.0), DIRECT)
    assert plan.twist.linear > 0.3


@pytest.mark.parametrize("heading", [2.8, -1.4, 0.6])
def test_what_is_to_be_faced_is_turned_to_no_faster_than_asked_in_mind_too(heading: float) -> None:
    goal = Goal(heading, turn_limit=1.2)
    assert abs(PLANNER.plan(situation(), goal, DIRECT).twist.angular) <= 1.2
    yaws = PLANNER.sampling.roll_out(situation(), goal, DIRECT).poses[0, :, 2]
    assert np.abs(np.diff(yaws, prepend=0.0)).max() <= 1.2 * PLANNER.sampling.step_s
    assert abs(yaws[-1]) > 0.8 * min(abs(heading), 1.2 * TIMES[-1] / 2)


def test_where_to_look_is_in_view_whichever_way_round_the_robot_came_there() -> None:
    rollouts = PLANNER.sampling.roll_out(situation(), Goal(-3.0), DIRECT)
    poses = rollouts.poses.copy()
    poses[:, :, 2] = math.tau - 3.0
    assert PLANNER.in_view.cost(replace(rollouts, poses=poses), situation()) == pytest.approx(0.0)


def test_in_mind_the_robot_brakes_no_faster_than_its_wheels_can() -> None:
    seen = situation(points=wall(0.6, half=0.6), speed=0.8)
    rollouts = PLANNER.sampling.roll_out(seen, towards(3.0), DIRECT)
    v, a = seen.driven.linear, seen.acceleration
    ahead = np.flatnonzero((rollouts.offs == 0) & (rollouts.wanted > 0))
    # Braking distance v² / 2a, in steps of the rollout.
    assert rollouts.poses[ahead, -1, 0].min() == pytest.approx(v**2 / 2 / a, rel=0.05)


def test_each_command_leads_as_far_as_what_stands_in_its_own_direction_lets_it() -> None:
    def gone(rollouts: Rollouts) -> Array:
        return np.asarray(rollouts.speeds.sum(axis=1) * PLANNER.sampling.step_s)

    post, goal, kept = np.array([(1.0, 0.5)]), towards(3.0, speed=0.8), Manoeuvre(0.5)
    held = PLANNER.sampling.roll_out(situation(points=post), goal, kept)
    free, margin = gone(PLANNER.sampling.roll_out(situation(), goal, kept)), PLANNER.sampling.margin
    rooms = np.array([float(rooms_ahead(post, np.array([off]), margin, LIMO)[0]) for off in held.offs])
    ahead = held.wanted > 0
    assert gone(held)[ahead] == pytest.approx(np.minimum(free, np.maximum(rooms, 0.0))[ahead])
    assert 0 < (gone(held)[ahead] < free[ahead] - 0.1).sum() < ahead.sum() / 2
