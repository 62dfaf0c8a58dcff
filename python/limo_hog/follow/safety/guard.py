"""The layer no controller can pass: it lets a command through, slows it, or stops the robot and says why.

Not seeing anybody is no proof that nobody is there, so clearance is kept by the lidar and the depth image,
whatever the boxes say. The lidar does not look behind; what it saw there shortly before is remembered.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.decision import Controller, Decision, Mode
from limo_hog.follow.robot import LIMO, RobotGeometry
from limo_hog.follow.safety.faults import find_fault
from limo_hog.follow.sense.clearance import (
    NO_POINTS,
    Margin,
    Points,
    depth_points,
    from_odometry,
    room_ahead,
    room_behind,
    scan_points,
    speed_within,
    to_odometry,
)
from limo_hog.follow.sense.observation import Observation, Odometry, Scan
from limo_hog.follow.twist import Twist

S = TypeVar("S")

#: Points further away than this are not remembered [m].
_REMEMBERED_WITHIN = 1.5


@dataclass(frozen=True, slots=True)
class GuardState(Generic[S]):
    """What the guard remembers.

    Attributes
    ----------
    inner
        The guarded controller's state.
    wish
        What the controller wanted last; None where there is nothing to want.
    stamp, heard
        Stamp of the last frame, and the newest stamp known when it was worked on [s].
    near
        float64 (N, 2) [m], base frame: what the depth camera saw near the robot in that frame.
    scanned
        Stamp of the last scan [s].
    seen, seen_at
        float64 (N, 2) [m], odometry frame, and float64 (N,) [s]: what the lidar saw near the robot, and when.
    """

    inner: S
    wish: Decision[S] | None = None
    stamp: float | None = None
    heard: float = -math.inf
    near: Points = field(default_factory=lambda: NO_POINTS)
    scanned: float = -math.inf
    seen: Points = field(default_factory=lambda: NO_POINTS)
    seen_at: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))


@dataclass(frozen=True, slots=True)
class Guard(Generic[S]):
    """A controller behind the safety layer; itself a controller.

    Attributes
    ----------
    controller
        Whose wishes are guarded.
    margin
        Ground kept free ahead of the robot's outline, and behind it.
    braking
        Deceleration counted on [m/s²]: half of what the wheels can do.
    reaction
        Time between something being there and the robot braking [s]: a scan's, a frame's and a command's age.
    remember
        How long what was seen around the robot counts for what is behind it [s].
    backwards
        Highest speed backwards [m/s]: whoever has come up from behind since is in no sensor's sight.
    patience
        After so long without a camera frame, or with a scan so old, the robot stops [s].
    body
        The robot's outline.
    """

    controller: Controller[S]
    margin: Margin = field(default_factory=Margin)
    braking: float = 0.5
    reaction: float = 0.25
    remember: float = 10.0
    backwards: float = 0.4
    patience: float = 0.5
    body: RobotGeometry = LIMO

    def start(self) -> GuardState[S]:
        """Return the state before the first observation."""
        return GuardState(self.controller.start())

    def step(self, observation: Observation, state: GuardState[S]) -> Decision[GuardState[S]]:
        """Ask the controller and let through what is safe; a faulty observation stops the robot."""
        fault = find_fault(observation, state.stamp)
        if fault:
            # A clock that was set back starts a new story: what is remembered belongs to the old one.
            backwards = state.stamp is not None and observation.stamp < state.stamp
            stamp = observation.stamp if math.isfinite(observation.stamp) else state.stamp
            after = replace(self.start() if backwards else state, stamp=stamp, wish=None)
            return Decision(Twist(), after, Mode.BLOCKED, fault)
        wish = self.controller.step(observation, state.inner)
        reach = 2 * self.body.half_length + self.margin.ahead + 1.0
        near = NO_POINTS
        if observation.depth is not None:
            near = depth_points(observation.depth, observation.focal_px, reach, self.body)
        state = replace(state, inner=wish.state, wish=wish, stamp=observation.stamp, heard=observation.now, near=near)
        return self._allowed(wish, state, observation.scan, observation.odometry, observation.now)

    def recheck(
        self, now: float, scan: Scan | None, odometry: Odometry | None, state: GuardState[S]
    ) -> Decision[GuardState[S]]:
        """Check the last wish against a newer scan, for a control period without a camera frame.

        The decision has no target and no region: these belong to a frame.
        """
        if state.wish is None:
            return Decision(Twist(), state, Mode.BLOCKED, "no camera frame to go by")
        if now - state.heard > self.patience:
            return Decision(Twist(), state, Mode.BLOCKED, f"no camera frame for {now - state.heard:.1f} s")
        wish = replace(state.wish, target=None, region=None)
        return self._allowed(wish, state, scan, odometry, now)

    def _allowed(
        self,
        wish: Decision[S],
        state: GuardState[S],
        scan: Scan | None,
        odometry: Odometry | None,
        now: float,
    ) -> Decision[GuardState[S]]:
        # Without wheels to tell how the robot moved, what was seen before cannot be carried along.
        pose = odometry or Odometry()
        if odometry is None:
            state = replace(state, seen=NO_POINTS, seen_at=np.empty(0), scanned=-math.inf)
        if scan is not None and scan.stamp != state.scanned:
            state = self._remembering(state, scan, pose)

        def decided(twist: Twist, mode: Mode, reason: str) -> Decision[GuardState[S]]:
            return Decision(twist, state, mode, reason, wish.target, wish.region)

        if not wish.twist.is_finite:
            return decided(Twist(), Mode.BLOCKED, "the controller's command is not a number")
        if scan is not None and now - scan.stamp > self.patience:
            return decided(Twist(), Mode.BLOCKED, f"the scan is {now - scan.stamp:.1f} s old")
        around = from_odometry(state.seen, pose)
        ahead = self._speed(room_ahead(np.concatenate([around, state.near]), self.margin, self.body))
        behind = self._speed(room_behind(around, self.margin, self.body))
        wanted = max(wish.twist.linear, -self.backwards)
        linear = min(max(wanted, -behind), ahead)
        twist = Twist(linear, wish.twist.angular)
        if linear == wanted:
            return decided(twist, wish.mode, wish.reason)
        where = "ahead" if wanted > 0 else "behind"
        if linear == 0:
            return decided(twist, Mode.BLOCKED, f"something is too near {where}")
        return decided(twist, wish.mode, f"slowed by something {where}")

    def _speed(self, room: float) -> float:
        return speed_within(room, self.braking, self.reaction)

    def _remembering(self, state: GuardState[S], scan: Scan, pose: Odometry) -> GuardState[S]:
        """Add a scan; of what was seen before, keep what is young and out of the lidar's sight now."""
        new = scan_points(scan, self.body)
        new = to_odometry(new[np.hypot(new[:, 0], new[:, 1]) < _REMEMBERED_WITHIN], pose)
        old = from_odometry(state.seen, pose)
        angle = np.arctan2(old[:, 1], old[:, 0] - self.body.lidar_x)
        out_of_sight = (angle < scan.angle_min) | (angle > scan.angle_max)
        age = scan.stamp - state.seen_at
        kept = out_of_sight & (age >= 0) & (age < self.remember)
        return replace(
            state,
            scanned=scan.stamp,
            seen=np.concatenate([state.seen[kept], new]),
            seen_at=np.concatenate([state.seen_at[kept], np.full(len(new), scan.stamp)]),
        )
