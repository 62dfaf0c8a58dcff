"""The commands that are compared, each driven on for some seconds in mind."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from limo_hog.follow.control.situation import Goal, Situation
from limo_hog.follow.control.wheels import turn_acceleration
from limo_hog.follow.parameters import param
from limo_hog.follow.sense.clearance import Margin, rooms_ahead
from limo_hog.follow.sense.observation import Array


@dataclass(frozen=True, slots=True)
class Manoeuvre:
    """To face a direction in the odometry frame [rad], and to drive at a speed [m/s]; None for the goal's own."""

    heading: float | None = None
    speed: float | None = None


#: What the goal asks for, with nothing in the way.
DIRECT = Manoeuvre()


@dataclass(frozen=True, slots=True)
class Rollouts:
    """K commands, each driven on for T steps; the first is the goal's own."""

    goal: Goal  #: What they were made for.
    begun: int  #: Which of them goes on with the manoeuvre begun.
    times: Array  #: float64 (T,) [s].
    poses: Array  #: float64 (K, T, 3): x, y [m], yaw [rad], base frame as of now; float64 (K, T) [m/s].
    speeds: Array
    offs: Array  #: float64 (K,): direction faced, from the goal's [rad], and the speed driven to [m/s].
    wanted: Array
    free: Array  #: float64 (T, 2) [m]: where the first would be with nothing in its way.
    places: Array  #: float64 (T, N, 2) [m]: where the people are.


@dataclass(frozen=True, slots=True)
class Sampling:
    """Which commands are compared, and how the robot and the people move on.

    The robot turns as a critically damped controller would, drives the faster the less it has yet to turn, and stops
    where `Guard` would stop it: a closed formula, so all rollouts together are a few operations on arrays.
    """

    offsets: tuple[float, ...] = param((0.08, 0.18, 0.3, 0.44, 0.6, 0.8, 1.1, 1.6), "rad", "Either side of the goal.")
    speeds: tuple[float, ...] = param((-0.6, 0.0, 0.3, 0.8), "m/s", "Speeds compared with the goal's own.")
    steps: int = param(15, "1", "Steps of a rollout.")
    step_s: float = param(0.2, "s", "How long a step is.")
    gain: float = param(0.8, "1/s", "Rate at which an error of distance decays.", 0, 5)
    turn_gain: float = param(4.0, "1/s", "Rate at which an error of direction decays, with strong wheels.", 0.1, 20)
    margin: Margin = field(default_factory=lambda: Margin(0.62, 0.22))
    blind_speed: float = param(0.2, "m/s", "Highest speed backwards onto ground that is not known.", 0, 1)
    company_speed: float = param(0.3, "m/s", "Highest speed backwards while other people are about.", 0, 1)
    fresh_s: float = param(1.0, "s", "How long nobody can have come to ground seen free, to back faster.", 0, 60)

    times: Array = field(init=False, repr=False, compare=False)  #: When the steps end, float64 (T,) [s].

    def __post_init__(self) -> None:
        object.__setattr__(self, "times", np.arange(1.0, self.steps + 1) * self.step_s)

    def roll_out(self, situation: Situation, goal: Goal, kept: Manoeuvre) -> Rollouts:
        """Return the rollouts of all commands; `kept` is the manoeuvre begun."""
        offs, wanted = self._commands(situation, goal, kept)
        left, yaw = self._turned(situation, goal, offs)
        own = goal.speed_later + (goal.speed - goal.speed_later) * np.exp(-self.gain * self.times)
        target = np.where(np.isnan(wanted)[:, None], own, wanted[:, None])
        known, _ = situation.is_known_behind(np.zeros(3), self.fresh_s)
        slow = math.inf if situation.is_alone else self.company_speed
        least = -(slow if known else self.blind_speed) if situation.robot.may_back else 0.0
        target = np.maximum(target, least) * np.maximum(np.cos(left), 0.0) ** 2
        reach = situation.acceleration * self.times
        speed = np.clip(target, situation.driven.linear - reach, situation.driven.linear + reach)
        before = np.concatenate([np.full((len(offs), 1), situation.driven.linear), speed[:, :-1]], axis=1)
        far = np.cumsum((before + speed) / 2 * self.step_s, axis=1)
        headings, which = np.unique(goal.heading + offs, return_inverse=True)
        near = np.hypot(*situation.points.T) < np.abs(far).max() + self.margin.ahead + situation.robot.half_length
        points = situation.points[near]
        ahead = np.maximum(rooms_ahead(points, headings, self.margin, situation.robot), 0.0)[which, None]
        behind = np.maximum(rooms_ahead(-points, headings, self.margin, situation.robot), 0.0)[which, None]
        # It brakes no faster than its wheels can.
        driven, braking = situation.driven.linear, np.minimum(reach, abs(situation.driven.linear))
        stops = math.copysign(1.0, driven) * braking * (abs(driven) - braking / 2) / situation.acceleration
        stride = np.diff(np.clip(far, np.minimum(-behind, stops), np.maximum(ahead, stops)), axis=1, prepend=0.0)
        along = (np.concatenate([np.zeros((len(offs), 1)), yaw[:, :-1]], axis=1) + yaw) / 2
        x, y = np.cumsum(stride * np.cos(along), axis=1), np.cumsum(stride * np.sin(along), axis=1)
        unheld = np.diff(far[0], prepend=0.0)
        free = np.stack([np.cumsum(unheld * np.cos(along[0])), np.cumsum(unheld * np.sin(along[0]))], axis=1)
        poses, speeds = np.stack([x, y, yaw], axis=2), stride / self.step_s
        wanted = np.maximum(np.where(np.isnan(wanted), goal.speed, wanted), least)
        begun, people = 0 if kept == DIRECT else len(offs) - 1, self.walked(situation.people)
        return Rollouts(goal, begun, self.times, poses, speeds, offs, wanted, free, people)

    def walked(self, people: Array) -> Array:
        """Return where people (N, 4) are after each step, float64 (T, N, 2) [m]."""
        return np.asarray(people[None, :, :2] + self.times[:, None, None] * people[None, :, 2:])

    def _commands(self, situation: Situation, goal: Goal, kept: Manoeuvre) -> tuple[Array, Array]:
        """Return each command's direction from the goal's [rad] and its speed, NaN for the goal's own, (K,) each."""
        offsets = np.append(0.0, np.outer(self.offsets, (1, -1)))
        speeds = np.array([math.nan, *self.speeds])
        offs, wanted = np.repeat(offsets, len(speeds)), np.tile(speeds, len(offsets))
        if kept == DIRECT:
            return offs, wanted
        off = 0.0
        if kept.heading is not None:
            off = math.remainder(kept.heading - situation.pose.yaw - goal.heading, math.tau)
        return np.append(offs, off), np.append(wanted, math.nan if kept.speed is None else kept.speed)

    def _turned(self, situation: Situation, goal: Goal, offs: Array) -> tuple[Array, Array]:
        """Return what is left to turn, and the yaw, after each step, float64 (K, T) [rad]."""
        headings, own = (goal.heading + offs)[:, None], (offs == 0)[:, None]
        most = turn_acceleration(situation.acceleration, situation.robot)
        far = np.maximum(np.abs(headings), 1e-3)  # A critically damped turn is no faster than far * gain / e.
        gain = np.minimum(np.minimum(self.turn_gain, np.sqrt(most / far)), math.e * goal.turn_limit / far)
        rate, moved = np.where(own, goal.rate, 0.0), np.where(own, goal.rate, 0.0) * self.times
        if goal.places is not None:
            bearings = np.arctan2(goal.places[:, 1], goal.places[:, 0])
            moved = np.where(own, np.unwrap(np.concatenate([[goal.heading], bearings]))[1:] - goal.heading, 0.0)
        left = (-headings + (-headings * gain + situation.driven.angular - rate) * self.times) * np.exp(
            -gain * self.times
        )
        return left, headings + moved + left
