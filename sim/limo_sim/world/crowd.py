"""The people of a run: those on a timetable, and those who walk by social forces and react to the robot.

Whoever keeps to a timetable is a function of time. The others are moved step by step: each wants a velocity, towards
the next corner of the route, a door or the robot; `social_force` adds what they keep clear of. Each draws from a
random stream of their own, so that nobody's steps depend on the order of the people.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from limo_sim.world.furniture import KINDS, reach
from limo_sim.world.movers import Movers
from limo_sim.world.paths import FloorPlan
from limo_sim.world.people import Person, before_door, door_of
from limo_sim.world.person import STRIDE, Pose, Walk, smooth
from limo_sim.world.scenario import Scenario
from limo_sim.world.social_force import People, SocialForce, acceleration
from limo_sim.world.variants import CROWD_STREAM

F64 = NDArray[np.float64]
Point = tuple[float, float]
RobotPose = tuple[float, float, float]

STEP_S = 0.02
"""Of the arena [s]."""
_AWAY, _ENTERING, _INSIDE, _LEAVING, _GOING_OUT, _GONE = range(6)


@dataclass(frozen=True, slots=True)
class Manners:
    """How people who yield walk; all chosen, by eye where nothing else is said."""

    #: Random acceleration, relative to the speed wanted [s^-1/2]: the paper's fluctuations, which part people who meet
    #: head-on. In free walking speed varies by √(τ / 2) of it, that is 2 %.
    wander: float = 0.04
    reached: float = 0.3  #: a corner without a pause is reached at this distance, in statures [1]
    stopped: float = 0.08  #: a corner with a pause is reached at this distance, in statures [1]
    #: given_up_s, given_up_m: a corner that something stands on is reached as well, when the person has not come on for
    #: so long [s] within this distance [m]
    given_up_s: float = 2.0
    given_up_m: float = 1.0
    notice_m: float = 4.0  #: the robot is approached or blocked from this distance on, where it can be seen [m]
    #: How near a person comes who approaches it [m]: Hall's border between personal and social distance.
    approach_m: float = 1.2
    block_m: float = 1.0  #: how far ahead of it a person stands who blocks it [m]
    look_s: float = 0.2  #: how often people look for the way [s]
    outside_m: float = 0.5  #: how far behind a door people appear and vanish [m]
    #: turn_s, turn_rate: time constant of a turn [s], and its fastest [rad/s]
    turn_s: float = 0.15
    turn_rate: float = 4.0
    ease_s: float = 0.25  #: time in which the limbs start or stop swinging [s]


MODEL, MANNERS = SocialForce(), Manners()


class Walker:
    """One person who yields: where they are, and what they want."""

    def __init__(self, person: Person, scenario: Scenario, plan: FloorPlan, random: np.random.Generator) -> None:
        self.person, self.random, self.speed = person, random, person.speed
        self.position: Point = person.route[0][:2]
        self.velocity: Point = (0.0, 0.0)
        self.yaw = person.facing
        self.stage = _AWAY
        self._plan, self._half = plan, scenario.room.half
        self._door = door_of(person, scenario.surroundings)
        self._corner = 0  # the one that the person walks to, or stands at
        self._pauses_until: float | None = None
        self._stuck_s = 0.0
        self._waypoint, self._looked = self.position, -math.inf
        self._phase = self._swinging = 0.0

    @property
    def pose(self) -> Pose | None:
        """Where the person is now; None where that is not in the arena."""
        if self.stage in (_AWAY, _GONE):
            return None
        return Pose(*self.position, self.yaw, self._phase % math.tau, smooth(self._swinging))

    def progress(self, time: float) -> None:
        """Come, go, and pass doors, as the time [s] and the place ask for."""
        person, half = self.person, self._half
        if self.stage == _AWAY and time >= person.arrives_s:
            if person.walks_in:
                self.stage = _ENTERING
                self.position = before_door(self._door, half, -MANNERS.outside_m)
                self.yaw = self._direction(self._before_door())
            else:
                self.stage = _INSIDE
                self._corner = min(1, len(person.route) - 1)
                if self._corner:
                    self.yaw = self._direction(person.route[1][:2])
        outmost = max(map(abs, self.position))
        if self.stage == _ENTERING and outmost < half - 0.9 * person.way_margin:
            self.stage = _INSIDE
        if self.stage == _INSIDE and time >= person.leaves_s:
            self.stage, self._looked = _LEAVING, -math.inf
        if self.stage == _LEAVING and self._distance(self._before_door()) < MANNERS.reached * person.height:
            self.stage = _GOING_OUT
        if self.stage == _GOING_OUT and outmost > half + 0.9 * MANNERS.outside_m:
            self.stage = _GONE

    def wants(self, time: float, robot: RobotPose) -> tuple[Point, float | None]:
        """Return the velocity that the person wants [m/s], and in which direction they look while standing [rad]."""
        if self.stage == _ENTERING:
            return self._straight(self._before_door(), self.speed), None
        if self.stage == _LEAVING:
            return self._towards(self._before_door(), time, self.speed), None
        if self.stage == _GOING_OUT:
            return self._straight(before_door(self._door, self._half, -2 * MANNERS.outside_m), self.speed), None
        reacts = self._react(time, robot)
        return reacts or (self._walk(time), self.person.facing if len(self.person.route) == 1 else None)

    def move(self, push: F64, wanted: Point, looks: float | None) -> None:
        """Walk one step under an acceleration [m/s²]."""
        top = MODEL.top_speed * self.speed
        vx, vy = self.velocity[0] + STEP_S * float(push[0]), self.velocity[1] + STEP_S * float(push[1])
        speed = math.hypot(vx, vy)
        if speed > top:
            vx, vy, speed = vx * top / speed, vy * top / speed, top
        self.velocity = vx, vy
        self.position = self.position[0] + STEP_S * vx, self.position[1] + STEP_S * vy
        if math.hypot(*wanted) > 0.3 * self.speed:
            looks = math.atan2(vy, vx) if speed > 0.2 * self.speed else math.atan2(wanted[1], wanted[0])
        if looks is not None:
            turn = math.remainder(looks - self.yaw, math.tau) * (1.0 - math.exp(-STEP_S / MANNERS.turn_s))
            self.yaw += min(max(turn, -MANNERS.turn_rate * STEP_S), MANNERS.turn_rate * STEP_S)
        forwards = math.copysign(1.0, math.cos(self.yaw) * vx + math.sin(self.yaw) * vy)
        self._phase += math.tau * forwards * speed * STEP_S / (STRIDE * self.person.height)
        most = STEP_S / MANNERS.ease_s
        self._swinging += min(max(min(1.0, speed / (0.3 * self.speed)) - self._swinging, -most), most)

    def _before_door(self) -> Point:
        return before_door(self._door, self._half, self.person.way_margin)

    def _react(self, time: float, robot: RobotPose) -> tuple[Point, float] | None:
        """Approach the robot or stand in its way, where it is near and in sight."""
        if self.person.reaction not in ("approach", "block"):
            return None
        x, y, yaw = robot
        away = self._distance((x, y))
        if away > MANNERS.notice_m or self._plan.hidden(np.array([self.position]), np.array([(x, y)]))[0]:
            return None
        self._pauses_until = None
        looks = self._direction((x, y))
        if self.person.reaction == "block":
            ahead = x + MANNERS.block_m * math.cos(yaw), y + MANNERS.block_m * math.sin(yaw)
            return self._arriving(ahead, time), looks
        speed = min(self.speed, max(away - MANNERS.approach_m, 0.0) / MODEL.relaxation_s)
        return self._towards((x, y), time, speed), looks

    def _walk(self, time: float) -> Point:
        """Walk the route: on to the next corner, or stay at this one."""
        x, y, pause = self.person.route[self._corner]
        if len(self.person.route) == 1:
            return self._arriving((x, y), time)
        if self._pauses_until is None:
            slow = math.hypot(*self.velocity) < 0.1 * self.speed and self._distance((x, y)) < MANNERS.given_up_m
            self._stuck_s = self._stuck_s + STEP_S if slow else 0.0
            near = (MANNERS.stopped if pause > 0 else MANNERS.reached) * self.person.height
            if self._distance((x, y)) < near or self._stuck_s > MANNERS.given_up_s:
                self._pauses_until, self._stuck_s = time + pause, 0.0
        if self._pauses_until is not None and time >= self._pauses_until:
            self._pauses_until = None
            self._corner = (self._corner + 1) % len(self.person.route)
            self._looked = -math.inf
            x, y, pause = self.person.route[self._corner]
        return self._arriving((x, y), time) if pause > 0 else self._towards((x, y), time, self.speed)

    def _arriving(self, goal: Point, time: float) -> Point:
        """Want to come to rest at a place."""
        return self._towards(goal, time, min(self.speed, self._distance(goal) / (2.0 * MODEL.relaxation_s)))

    def _towards(self, goal: Point, time: float, speed: float) -> Point:
        """Want to walk to a place on the shortest way."""
        if time - self._looked > MANNERS.look_s - 1e-9:
            self._looked = time
            self._waypoint = self._plan.way(self.position, goal)[0]
        return self._straight(self._waypoint, speed)

    def _straight(self, place: Point, speed: float) -> Point:
        (x, y), distance = self.position, max(self._distance(place), 1e-9)
        return speed * (place[0] - x) / distance, speed * (place[1] - y) / distance

    def _distance(self, place: Point) -> float:
        return math.dist(self.position, place)

    def _direction(self, place: Point) -> float:
        return math.atan2(place[1] - self.position[1], place[0] - self.position[0])


class Crowd:
    """All people of a run."""

    def __init__(self, scenario: Scenario, seed: int) -> None:
        self._scenario = scenario
        people, around = scenario.people, scenario.surroundings
        self._walks = {index: Walk(person) for index, person in enumerate(people) if not person.yields}
        self._walkers: dict[int, Walker] = {}
        for index, person in ((index, person) for index, person in enumerate(people) if person.yields):
            random = np.random.default_rng([seed, CROWD_STREAM, index])
            self._walkers[index] = Walker(person, scenario, around.plan(person.way_margin), random)
        self._movers = Movers(scenario.movers)
        self._plan = around.plan(max((person.way_margin for person in people if person.yields), default=0.0))
        #: In the scenario's order, now; None for a person who is not in the arena.
        self.poses: tuple[Pose | None, ...] = ()
        self._time = 0.0
        self._robot: RobotPose | None = None  # where it was a step ago
        self._note(0.0)

    def advance(self, time: float, robot: RobotPose) -> None:
        """Move everybody on to `time` [s], one step of the arena later; `robot`: x, y, yaw now [m, m, rad]."""
        if self._walkers:
            self._step(robot)
        self._note(time)

    def _note(self, time: float) -> None:
        """Let people come and go, and note where they are."""
        self._time = time
        poses: list[Pose | None] = [None] * len(self._scenario.people)
        for index, walk in self._walks.items():
            poses[index] = walk.pose(time)
        for index, walker in self._walkers.items():
            walker.progress(time)
            poses[index] = walker.pose
        self.poses = tuple(poses)

    def _step(self, robot: RobotPose) -> None:
        walkers = [walker for index, walker in self._walkers.items() if self.poses[index] is not None]
        if not walkers:
            return
        wishes = [walker.wants(self._time, robot) for walker in walkers]
        moving = [(*walker.position, *walker.velocity, MODEL.body * walker.person.height) for walker in walkers]
        moving += self._timetables(robot)
        places = np.array(moving)
        people = People(
            places[:, :2],
            places[:, 2:4],
            places[:, 4],
            height=np.array([walker.person.height for walker in walkers]),
            wanted=np.array([wanted for wanted, _ in wishes]),
            ahead=np.array([(math.cos(walker.yaw), math.sin(walker.yaw)) for walker in walkers]),
        )
        ignore = np.array([walker.person.reaction == "ignore" for walker in walkers])
        hidden = self._hidden(people.position, len(walkers))
        hidden[:, -1] |= ignore
        away = self._away(walkers, people)
        away[ignore, -1] = np.inf
        pushes = acceleration(people, away, hidden, MODEL)
        for walker, push, (wanted, looks) in zip(walkers, pushes, wishes, strict=True):
            jolt = MANNERS.wander * math.hypot(*wanted) / math.sqrt(STEP_S)
            walker.move(push + jolt * walker.random.standard_normal(2), wanted, looks)

    def _timetables(self, robot: RobotPose) -> list[tuple[float, float, float, float, float]]:
        """Return place, velocity and radius of what feels no forces: people on timetables, movers, the robot last."""
        there = []
        for index, walk in self._walks.items():
            now, soon = self.poses[index], walk.pose(self._time + STEP_S)
            if now is not None:
                soon = soon or now
                speed = (soon.x - now.x) / STEP_S, (soon.y - now.y) / STEP_S
                there.append((now.x, now.y, *speed, MODEL.body * walk.person.height))
        for piece, soon_piece in zip(self._movers.at(self._time), self._movers.at(self._time + STEP_S), strict=True):
            speed = (soon_piece.x - piece.x) / STEP_S, (soon_piece.y - piece.y) / STEP_S
            there.append((piece.x, piece.y, *speed, reach(KINDS[piece.kind].footprint)))
        before = self._robot or robot
        speed = (robot[0] - before[0]) / STEP_S, (robot[1] - before[1]) / STEP_S
        self._robot = robot
        return [*there, (*robot[:2], *speed, self._scenario.robot.radius)]

    def _away(self, walkers: list[Walker], people: People) -> F64:
        """Return the ways to some people from outer walls, obstacles, movers and the robot, as `acceleration` wants."""
        count, half = len(walkers), self._scenario.room.half
        position = people.position[:count]
        walls = np.zeros((count, 4, 2))
        feels = [walker.stage in (_INSIDE, _LEAVING) for walker in walkers]  # not in the walls' doors
        for side, (axis, sign) in enumerate(((0, 1), (0, -1), (1, 1), (1, -1))):
            walls[:, side, axis] = np.where(feels, position[:, axis] - sign * half, np.inf)
        # Movers and the robot count as discs: before the flat side of a box, left as good as right, people would stop.
        first = -1 - len(self._scenario.movers)
        apart = position[:, None] - people.position[None, first:]
        gap = np.maximum(np.hypot(apart[..., 0], apart[..., 1]), 1e-9)
        moving = apart * np.maximum(1.0 - people.radius[first:] / gap, 1e-9)[..., None]
        return np.concatenate([walls, self._plan.away(position), moving], axis=1)

    def _hidden(self, position: F64, count: int) -> NDArray[np.bool_]:
        """Whether each of the first `count` people cannot see each of all."""
        everyone = len(position)
        start, end = np.repeat(position[:count], everyone, axis=0), np.tile(position, (count, 1))
        return self._plan.hidden(start, end).reshape(count, everyone)
