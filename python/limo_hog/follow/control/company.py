"""Giving way: people are predicted, and of the ways out the robot can drive, one that stays clear of them is taken.

The dynamic window approach (Fox, Burgard and Thrun 1997), with obstacles that move, and with directions in place of
turn rates: a robot that cannot drive sideways turns first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.control.backing import Poses
from limo_hog.follow.control.steer import advanced, all_advanced, stoppable_turn
from limo_hog.follow.parameters import param
from limo_hog.follow.robot import RobotGeometry, Twist
from limo_hog.follow.sense.clearance import Points
from limo_hog.follow.sense.measurement import PERSON_RADIUS
from limo_hog.follow.sense.observation import Odometry
from limo_hog.follow.tracks.kalman import Track


@dataclass(frozen=True, slots=True)
class Walker:
    """A person near the robot.

    Attributes
    ----------
    x, y, vx, vy
        Place and velocity in the base frame as it is now, which is taken to stand still [m, m/s].
    followed
        Whether this is the person followed.
    measured
        Whether they were measured just now; else they are where their velocity leads.
    """

    x: float
    y: float
    vx: float
    vy: float
    followed: bool = False
    measured: bool = True

    def at_least(self, speed: float, slowest: float) -> Walker:
        """Return one who has set out, faster than `slowest`, at the speed at which they are known to walk [m/s].

        The estimate takes half a second to show it.
        """
        now = math.hypot(self.vx, self.vy)
        if not slowest < now < speed:
            return self
        return replace(self, vx=speed / now * self.vx, vy=speed / now * self.vy)


def walker_of(track: Track, pose: Odometry, *, followed: bool = False, measured: bool = True) -> Walker:
    """Return a track in the odometry frame as a walker in the base frame of a robot at `pose`."""
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    x, y, vx, vy = track.mean
    x, y = x - pose.x, y - pose.y
    return Walker(cos * x + sin * y, cos * y - sin * x, cos * vx + sin * vy, cos * vy - sin * vx, followed, measured)


@dataclass(frozen=True, slots=True)
class Way:
    """A way out: turn to a direction, and drive.

    Attributes
    ----------
    turn
        From the robot's present direction [rad].
    speed
        At which to drive once it is turned to, negative to back [m/s].
    age
        How long the robot has been on it [s].
    """

    turn: float
    speed: float
    age: float = 0.0


@dataclass(frozen=True, slots=True)
class Company:
    """Chooses a way that stays clear of people who come near.

    Attributes
    ----------
    step_s
        Ways are compared in these steps [s].
    weights
        Of the distances without, with and against `velocity_error` [1]. Chosen: the prediction counts most.
    wanted, wanted_other
        Of more distance than this nothing is gained: where the person followed comes, and where only others come [m].
        Chosen: `clearance` and `clearance_other`, and half a trunk.
    short
        How often a distance short of `clearance_other` counts besides, where only others come [1]. Chosen with `away`:
        without it, the robot would keep looking at the person followed while another walks into it.
    walls
        Distance kept from everything else [m]. Chosen: `Guard` keeps more ahead and behind, where it can.
    near, person_radius
        What the lidar sees further off than `near`, or nearer than `person_radius` to one who comes, is no wall [m].
        Chosen: what the robot backs in two and a half seconds.
    never
        What a way costs that ends at a wall or backs blindly [m]. Chosen: more than all distances together are worth.
    speeds, turns
        Ways compared [m/s, rad]. Chosen: what the drive can do and `Guard` lets it back at, and `Backing.unseen_speed`;
        directions half a person's width apart after half a metre, none from which a person ahead is out of the lidar's
        sight.
    turn_gain
        Turn rate for each radian to turn [1/s]. Chosen: to a right angle in .8 s.
    ease
        What a change of speed by 1 m/s, and a turn by 2.5 rad, are worth [m]. Chosen: of ways that clear people alike,
        to within the error of their places, the easiest.
    settle_s, stay
        A way is left for another only after so long [s], unless it costs `never` or leads into a person who is not
        followed, and if the other is worth more by so much [m]. Where the command seems clear again, a way before
        people faster than the robot is left only after so long, and if they are measured. Standing is left at once.
        Measured: while the robot turns, which takes .8 s, a person's velocity across their way strays by .4 m/s, and
        the sides would be taken in turns; chosen: less than half of `wanted`.
    away
        What a way costs on which the person followed is out of the image all the time [m], unless it is they who come.
        Chosen: as much as to come as near as .2 m to another's axis; a trunk reaches .15 m. Measured in 63 development
        runs of the crowd: the person is in view in 97 % of the frames; in 94 % with .2 m, without `short`, and with
        `wanted` for others too. People come as near.
    half_view, unseen
        How far to either side the lidar looks [rad], and what a way costs on which nobody who comes is in its sight
        [m]. Chosen: the Limo's; the error of a place that is not measured for a second.
    """

    # Chosen: at 1.5 m/s a person comes from 4 m away.
    notice_s: float = param(2.8, "s", "People who come near within this time are given way to.", 0, 10)
    # Chosen: longer than `notice_s`, since a person walks faster than the robot backs and would catch up with it.
    horizon_s: float = param(4.0, "s", "How far ahead ways are compared.", 0, 10)
    step_s: float = 0.2
    # Chosen: twice what a standing person's estimate strays.
    min_speed: float = param(0.3, "m/s", "People slower than this do not come near.", 0, 2)
    # Measured: up to .4 while the robot turns. Chosen: half.
    velocity_error: float = param(0.2, "m/s", "Error of a person's velocity across their way.", 0, 1)
    weights: tuple[float, float, float] = (0.7, 0.15, 0.15)
    # Chosen: the .3 m of clearance asked for, half a trunk of .15 m, and .2 m for the prediction: with .1 m, people who
    # walked at the robot came up to .16 m nearer.
    clearance: float = param(
        0.65, "m", "Distance wanted between the robot's outline and the axis of the person followed.", 0, 3
    )
    # Chosen: the time to stop or to turn aside; .2 m of clearance.
    notice_other_s: float = param(
        1.5, "s", "Other people who come near within this time are given way to: they pass close by.", 0, 10
    )
    clearance_other: float = param(
        0.35, "m", "Distance wanted between the robot's outline and the axis of another person.", 0, 3
    )
    wanted: float = 0.8
    wanted_other: float = 0.5
    short: float = 2.0
    walls: float = 0.1
    near: float = 1.5
    person_radius: float = PERSON_RADIUS
    never: float = 2.0
    speeds: tuple[float, ...] = (-0.6, -0.2, 0.0, 0.3, 0.6)
    turns: tuple[float, ...] = (-1.6, -1.1, -0.5, 0.0, 0.5, 1.1, 1.6)
    turn_gain: float = 4.0
    max_turn: float = param(3.0, "rad/s", "Limit of the turn rate while giving way.", 0, 6)
    ease: float = 0.06
    settle_s: float = 0.8
    stay: float = 0.35
    away: float = 0.6
    half_view: float = 2.0
    unseen: float = 0.1

    def way_out(
        self,
        wanted: Twist,
        now: Twist,
        walkers: Sequence[Walker],
        points: Points,
        robot: RobotGeometry,
        begun: Way | None = None,
        acceleration: float = 1.0,
        may_back: Callable[[Poses], NDArray[np.bool_]] | None = None,
        blind_speed: float = 0.0,
    ) -> Way | None:
        """Return the way to give way by; None where the wanted command stays clear of everybody.

        Parameters
        ----------
        wanted, now
            What the robot would do, and what its wheels do.
        walkers
            The people near it.
        points
            float64 (N, 2) [m], base frame: what the lidar sees; people in it count as they stand.
        robot
            The robot's outline.
        begun
            The way it is on already.
        acceleration
            Of each wheel [m/s²].
        may_back
            Whether the ground behind the robot at poses in the base frame is known to be free; None where all of it
            counts as free.
        blind_speed
            At most so fast it backs onto other ground [m/s].
        """
        people = np.array([(one.x, one.y, one.vx, one.vy) for one in walkers]).reshape(-1, 4)
        pace = np.hypot(people[:, 2], people[:, 3])
        coming = pace > self.min_speed
        # Those who come no nearer than they are, whatever the robot does, need no way.
        coming &= (people[:, :2] * people[:, 2:]).sum(axis=1) < 0
        if not coming.any():
            return None
        is_followed = np.array([one.followed for one in walkers], bool)
        goal = people[is_followed]
        people, is_followed = people[coming], is_followed[coming]
        straight = self._driven_on(wanted, now, acceleration, robot)
        places = self._places(people)
        gaps = _outline_gap(straight[:, :, None, None], places[None], robot)
        clear = np.where(is_followed, self.clearance, self.clearance_other)
        late = np.arange(gaps.shape[1])[:, None] * self.step_s >= np.where(
            is_followed, self.notice_s, self.notice_other_s
        )
        room = np.where(late[:, None], np.inf, gaps[0]).min(axis=0) - clear
        stays = (
            begun is not None
            and begun.speed != 0
            and pace[coming].max() > max(self.speeds)
            and (begun.age < self.settle_s or not all(one.measured for one in walkers))
        )
        if not stays and (room[0] if begun is None else room).min() > 0:
            return None
        ways = [Way(turn, speed) for turn in self.turns for speed in self.speeds]
        if begun is not None:
            ways.append(begun)
        poses, backs = self._driven(ways, now, acceleration, robot)
        gaps = _outline_gap(poses[:, :, None, None], places[None], robot).min(axis=(1, 3))
        near = points[np.hypot(*points.T) < self.near][::2]
        gap = np.hypot(*(near[:, None] - people[None, :, :2]).transpose(2, 0, 1)).min(axis=1)
        near = near[gap > self.person_radius]
        speeds = np.array([way.speed for way in ways])
        effort = self.ease * (np.abs(speeds - now.linear) + 0.4 * np.abs([way.turn for way in ways]))
        only_others = not is_followed.any()
        worth = np.minimum(gaps, self.wanted_other if only_others else self.wanted) @ self.weights
        if only_others:
            worth += self.short * np.minimum(worth - self.clearance_other, 0.0)
            worth -= self.away * self._away(poses, goal, robot)
        worth -= effort + self.unseen * self._unseen(poses, places[:, 0])
        worth[self._room(poses, near, robot) < self.walls] -= self.never
        if may_back is not None:
            backward = np.flatnonzero(speeds < -blind_speed)
            blind = (backs[backward] & ~may_back(poses[backward])).any(axis=1)
            worth[backward[blind]] -= self.never
        if begun is not None and begun.speed:
            worth[-1] += self.stay if begun.age > self.settle_s else 1.0
        return ways[int(np.argmax(worth))]

    def command(self, way: Way, acceleration: float, robot: RobotGeometry) -> Twist:
        """Return the command that begins a way, with wheels of an acceleration [m/s²]."""
        linear, angular = self._wanted(np.array(way.turn), np.array(way.speed), acceleration, robot)
        return Twist(float(linear), float(angular))

    def _wanted(
        self, turn: NDArray[np.float64], speed: NDArray[np.float64], acceleration: float, robot: RobotGeometry
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the speeds with which ways are driven that are `turn` [rad] off: the turn first."""
        most = np.minimum(stoppable_turn(turn, acceleration, robot), self.max_turn)
        linear = speed * np.maximum(np.cos(turn), 0.0) ** 2
        return np.asarray(linear), np.minimum(np.maximum(self.turn_gain * turn, -most), most)

    def _driven_on(self, wanted: Twist, now: Twist, acceleration: float, robot: RobotGeometry) -> Poses:
        """Return where the wanted command leads in T steps, float64 (1, T, 3): x, y [m], yaw [rad].

        It is taken to turn for half of the time, and to back no faster than `Guard` lets it.
        """
        steps, most = round(self.horizon_s / self.step_s), acceleration * self.step_s
        linear, angular, x, y, yaw = now.linear, now.angular, 0.0, 0.0, 0.0
        drive_to, steady = max(wanted.linear, min(self.speeds)), None
        poses = []
        for step in range(steps):
            begun = linear, angular
            turn_to = wanted.angular if step < steps / 2 else 0.0
            if steady != turn_to:
                linear, angular = advanced(drive_to, turn_to, linear, angular, most, robot)
                # Wheels that have reached their speeds keep them.
                steady = turn_to if (linear, angular) == begun else None
            turn = (begun[1] + angular) / 2 * self.step_s
            far = (begun[0] + linear) / 2 * self.step_s
            x, y = x + far * math.cos(yaw + turn / 2), y + far * math.sin(yaw + turn / 2)
            yaw += turn
            poses.append((x, y, yaw))
        return np.array([poses])

    def _driven(
        self, ways: Sequence[Way], now: Twist, acceleration: float, robot: RobotGeometry
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return where each of K ways leads in T steps, and in which of these it backs.

        float64 (K, T, 3): x, y [m], yaw [rad]; bool (K, T).
        """
        turns, speeds = np.array([way.turn for way in ways]), np.array([way.speed for way in ways])
        count, steps = len(ways), round(self.horizon_s / self.step_s)
        # The speeds and the yaw at the beginning and after each step.
        linear, angular = (np.full((steps + 1, count), speed, np.float64) for speed in (now.linear, now.angular))
        yaw = np.zeros((steps + 1, count))
        for step in range(steps):
            for_linear, for_angular = self._wanted(turns - yaw[step], speeds, acceleration, robot)
            linear[step + 1], angular[step + 1] = all_advanced(
                for_linear, for_angular, linear[step], angular[step], acceleration * self.step_s, robot
            )
            yaw[step + 1] = yaw[step] + (angular[step] + angular[step + 1]) / 2 * self.step_s
        far = (linear[:-1] + linear[1:]) / 2 * self.step_s
        along = yaw[:-1] + (angular[:-1] + angular[1:]) / 4 * self.step_s
        x, y = np.cumsum(far * np.cos(along), axis=0), np.cumsum(far * np.sin(along), axis=0)
        return np.stack([x.T, y.T, yaw[1:].T], axis=2), far.T < 0

    def _places(self, people: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return where N people are in T steps, float64 (T, 3, N, 2) [m]: as predicted, and to either side of that."""
        times = np.arange(1, round(self.horizon_s / self.step_s) + 1) * self.step_s
        velocity = people[:, 2:]
        aside = velocity[:, ::-1] * (-1.0, 1.0) / np.hypot(*velocity.T)[:, None] * self.velocity_error
        velocities = np.stack([velocity, velocity - aside, velocity + aside])
        return np.asarray(people[:, :2] + times[:, None, None, None] * velocities)

    def _unseen(self, poses: NDArray[np.float64], places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return for each of K ways the share of time and people out of the lidar's sight, float64 (K,)."""
        to = places[None] - poses[:, :, None, :2]
        off = np.arctan2(to[..., 1], to[..., 0]) - poses[:, :, None, 2]
        return np.asarray((np.cos(off) < math.cos(self.half_view)).mean(axis=(1, 2)))

    def _away(self, poses: NDArray[np.float64], goal: NDArray[np.float64], robot: RobotGeometry) -> NDArray[np.float64]:
        """Return for each of K ways the share of time the person followed is out of the image, float64 (K,)."""
        if len(goal) == 0:
            return np.zeros(len(poses))
        times = np.arange(1, poses.shape[1] + 1)[:, None] * self.step_s
        to = goal[0, :2] + times * goal[0, 2:] - poses[:, :, :2]
        off = np.arctan2(to[..., 1], to[..., 0]) - poses[:, :, 2]
        return np.asarray((np.cos(off) < math.cos(robot.field_of_view / 2)).mean(axis=1))

    def _room(self, poses: NDArray[np.float64], points: Points, robot: RobotGeometry) -> NDArray[np.float64]:
        """Return for each of K ways the least distance from the outline to a point [m], float64 (K,)."""
        if len(points) == 0:
            return np.full(len(poses), np.inf)
        return np.asarray(_outline_gap(poses[:, ::2, None], points[None, None], robot).min(axis=(1, 2)))


def _outline_gap(poses: NDArray[np.float64], places: NDArray[np.float64], robot: RobotGeometry) -> NDArray[np.float64]:
    """Return the distance from the robot's rectangle at poses (..., 3) to places (..., 2) [m]; negative inside it."""
    dx, dy = places[..., 0] - poses[..., 0], places[..., 1] - poses[..., 1]
    cos, sin = np.cos(poses[..., 2]), np.sin(poses[..., 2])
    ahead = np.abs(cos * dx + sin * dy) - robot.half_length
    beside = np.abs(cos * dy - sin * dx) - robot.half_width
    outside = np.hypot(np.maximum(ahead, 0.0), np.maximum(beside, 0.0))
    return np.asarray(outside + np.minimum(np.maximum(ahead, beside), 0.0))
