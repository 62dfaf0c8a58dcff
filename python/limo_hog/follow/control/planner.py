"""Which command costs least? The sampled commands are rolled out, the critics' costs are summed."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from limo_hog.follow.control.critics.change_of_mind import ChangeOfMind
from limo_hog.follow.control.critics.effort import Effort
from limo_hog.follow.control.critics.followed_in_view import FollowedInView
from limo_hog.follow.control.critics.goal_distance import GoalDistance
from limo_hog.follow.control.critics.room_to_followed import RoomToFollowed
from limo_hog.follow.control.critics.room_to_others import RoomToOthers
from limo_hog.follow.control.critics.unseen_ground import UnseenGround
from limo_hog.follow.control.critics.walls import Walls
from limo_hog.follow.control.rollouts import DIRECT, Manoeuvre, Rollouts, Sampling
from limo_hog.follow.control.situation import Goal, Situation
from limo_hog.follow.control.wheels import stoppable_turn
from limo_hog.follow.parameters import param
from limo_hog.follow.robot import Twist
from limo_hog.follow.sense.clearance import Points
from limo_hog.follow.sense.observation import Array


class Critic(Protocol):
    """A part of a rollout's cost."""

    @property
    def weight(self) -> float:
        """What the cost is multiplied by."""
        ...

    def cost(self, rollouts: Rollouts, _: Situation, /) -> Array:
        """Return the cost of each of K rollouts, float64 (K,), never negative."""
        ...


#: Why the robot stands, where none of the commands leads anywhere.
NO_WAY = "no free way"
#: Why the goal's own command is not taken: the first critic that gains at least a quarter of what all gain.
REASONS = {
    "followed": "giving way to a person",
    "others": "giving way to a person",
    "walls": "keeping off an obstacle",
    "unseen_ground": "not backing onto ground where somebody may be",
    "goal_distance": "driving around an obstacle",
    "in_view": "keeping the person in the image",
}


@dataclass(frozen=True, slots=True)
class Move:
    """What was decided, and why."""

    twist: Twist  #: The command, and what it begins or goes on with.
    manoeuvre: Manoeuvre
    reason: str  #: Why it is not the goal's own; "" where it is.
    shares: tuple[tuple[str, float], ...]  #: Name of each critic and its share of the cost.
    rollout: Points  #: float64 (T, 2) [m]: where it leads, base frame; and all that were compared, float64 (K, T, 2).
    rollouts: Array


@dataclass(frozen=True, slots=True)
class Planner:
    """Chooses a command; every field with a method `cost` is a critic."""

    sampling: Sampling = field(default_factory=Sampling)
    goal_distance: GoalDistance = field(default_factory=GoalDistance)
    in_view: FollowedInView = field(default_factory=FollowedInView)
    followed: RoomToFollowed = field(default_factory=RoomToFollowed)
    others: RoomToOthers = field(default_factory=RoomToOthers)
    walls: Walls = field(default_factory=Walls)
    unseen_ground: UnseenGround = field(default_factory=UnseenGround)
    effort: Effort = field(default_factory=Effort)
    change_of_mind: ChangeOfMind = field(default_factory=ChangeOfMind)
    turn_gain: float = param(2.5, "1/s", "Turn rate for each radian to turn.", 0, 10)
    stay: float = param(0.4, "of 1", "Share by which a manoeuvre begun may cost more than another, and is kept.", 0, 5)
    nowhere: float = param(0.02, "m", "A rollout that leads no further beyond the way to stop leads nowhere.", 0, 1)
    max_turn: float = param(3.0, "rad/s", "Limit of the turn rate.", 0, 6)

    def critics(self) -> list[tuple[str, Critic]]:
        """Return the critics and their names."""
        parts = dataclasses.fields(self)
        return [(part.name, critic) for part in parts if hasattr(critic := getattr(self, part.name), "cost")]

    def plan(self, situation: Situation, goal: Goal, kept: Manoeuvre) -> Move:
        """Return the command that costs least; `kept` is the manoeuvre begun."""
        names, critics = zip(*self.critics(), strict=True)
        rollouts = self.sampling.roll_out(situation, goal, kept)
        costs = np.array([critic.weight * critic.cost(rollouts, situation) for critic in critics])
        totals = costs.sum(axis=0)
        if rollouts.begun:
            totals[rollouts.begun] /= 1 + self.stay
        best = int(np.argmin(totals))
        gains = np.maximum(costs[:, 0] - costs[:, best], 0.0)
        gained = dict(zip(names, gains.tolist(), strict=True))
        reason = next((words for name, words in REASONS.items() if 4 * gained.get(name, 0.0) > gains.sum()), "")
        off, speed = float(rollouts.offs[best]), float(rollouts.wanted[best])
        heading, rate = goal.heading + off, goal.rate if off == 0 else 0.0
        stoppable = stoppable_turn(heading, situation.acceleration, situation.robot)
        limit = min(stoppable + abs(rate), self.max_turn, goal.turn_limit)
        angular = min(max(self.turn_gain * heading + rate, -limit), limit)
        # Driving sideways to the person would lose sight of them: turn first, then drive.
        twist = Twist(speed * max(math.cos(heading), 0.0) ** 2, angular)
        manoeuvre = Manoeuvre(
            None if off == 0 else situation.pose.yaw + heading, None if speed == rollouts.wanted[0] else speed
        )
        gone = float(np.abs(rollouts.speeds[best]).sum() * self.sampling.step_s)
        if gone < situation.driven.linear**2 / 2 / situation.acceleration + self.nowhere:
            # What leads nowhere is not gone on with.
            manoeuvre = DIRECT
            if abs(speed) > self.nowhere:
                twist, reason = replace(twist, linear=0.0), NO_WAY
        shares = tuple(zip(names, costs[:, best].tolist(), strict=True))
        return Move(twist, manoeuvre, reason, shares, rollouts.poses[best, :, :2], rollouts.poses[..., :2])
