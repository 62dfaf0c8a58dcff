"""The last stage before the wheels: it checks the senses, then lets a command through, slows it, or stops the robot.

That no person is detected is no proof that none is there, so clearance is kept by the lidar and the depth image,
whatever the boxes say. The lidar does not look behind; what it saw there shortly before is remembered.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from operator import itemgetter
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.decision import Controller, Decision, Mode
from limo_hog.follow.parameters import param
from limo_hog.follow.robot import LIMO, RobotGeometry, Twist
from limo_hog.follow.sense.clearance import (
    NO_POINTS,
    DepthGrid,
    Look,
    Margin,
    Points,
    from_odometry,
    room_seen_behind,
    rooms_ahead,
    scan_points,
    speed_within,
    to_odometry,
)
from limo_hog.follow.sense.observation import Observation, Odometry, Scan, Sensors
from limo_hog.follow.tracks.asking import Whom, ask_of, checked

S = TypeVar("S")

#: One in so many rows and columns of the depth image is looked at first [px].
_STEP = 40

_CAME = itemgetter(1)

CAMERA, DEPTH, SCAN, ODOMETRY = "camera frame", "depth image", "scan", "odometry"


@dataclass(frozen=True, slots=True)
class Arrivals:
    """When each sense's newest reading came: which never did, which stopped, and whose clock is wrong."""

    #: By the sense's name: the reading's stamp on the sensor's clock, and when it came on the robot's own [s].
    newest: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def after(self, now: float, stamps: Mapping[str, float]) -> Arrivals:
        """Add the readings at hand at `now` [s]: a new one has another stamp than the last, NaN is none."""
        newest = dict(self.newest)
        for name, at in stamps.items():
            if math.isfinite(at) and (name not in newest or newest[name][0] != at):
                newest[name] = at, now
        return Arrivals(newest)

    def missing(self, now: float, needed: tuple[str, ...], max_age: float) -> str:
        """Return which senses never came, though needed, or came longer than `max_age` [s] ago; "" if none.

        A reading from the future came before the robot's clock was set back: nobody knows how old it is.
        """
        ages = {name: abs(now - came) for name, (_, came) in self.newest.items()}
        reasons = [f"no {name} has come" for name in needed if name not in ages]
        if ages.get(CAMERA, 0.0) > max_age:
            ages.pop(DEPTH, None)  # it comes with its frame
        reasons += [f"no {name} for {age:.1f} s" for name, age in ages.items() if age > max_age]
        return "; ".join(reasons)

    def oldest(self, now: float) -> float:
        """Return how long ago the sense that is silent for longest was heard [s]; 0 without any."""
        return now - min(map(_CAME, self.newest.values()), default=now)

    def disagreement(self, max_age: float, max_late: float) -> str:
        """Return which sense's stamps do not fit the others': readings may be `max_age`, images `max_late` [s] late."""
        # A depth image has its camera frame's stamp. What the others' clocks showed when the last reading came:
        now = max(map(_CAME, self.newest.values()), default=0.0)
        clocks = {name: stamp + now - came for name, (stamp, came) in self.newest.items() if name != DEPTH}
        ahead = max(clocks, key=clocks.__getitem__, default="")
        old = [name for name in clocks if clocks[ahead] - clocks[name] > (max_late if name == CAMERA else max_age)]
        if not old:
            return ""
        late = {name: clocks[ahead] - clock for name, clock in clocks.items() if name != ahead}
        if len(old) == len(late):
            return f"the {ahead}'s clock is {min(late.values()):.1f} s ahead of the {' and the '.join(late)}'s"
        return "; ".join(f"the {name} is {late[name]:.1f} s old" for name in old)


@dataclass(frozen=True, slots=True)
class GuardState(Generic[S]):
    """What the guard remembers."""

    inner: S  #: The guarded controller's state.
    #: The controller's last decision, before limits; None before the first and after a fault.
    proposed: Decision[S] | None = None
    stamp: float | None = None  #: Stamp of the last frame [s].
    #: The newest reading of each sense, by its stamp and by the robot's own clock.
    arrivals: Arrivals = field(default_factory=Arrivals)
    #: float64 (N, 2) [m], base frame: obstacles in the last depth image.
    depth_points: Points = field(default_factory=lambda: NO_POINTS)
    scan_stamp: float = -math.inf  #: Stamp of the last scan [s].
    #: float64 (N, 2) [m], odometry frame, and float64 (N,) [s]: returns near the robot, and the stamps of their scans.
    scan_points: Points = field(default_factory=lambda: NO_POINTS)
    scan_points_at: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    #: Scans of the last seconds, oldest first: they tell which ground was seen to be free.
    looks: tuple[Look, ...] = ()


@dataclass(frozen=True, slots=True)
class Guard(Generic[S]):
    """A controller behind the safety layer; itself a controller."""

    controller: Controller[S]  #: Whose commands are limited.
    margin: Margin = field(default_factory=Margin)  #: Ground kept free ahead of the robot's outline, and behind it.
    reaction_s: float = param(0.25, "s", "From an obstacle's appearance to braking: periods of scan and command.")
    depth_reach: float = param(1.0, "m", "Depth further than this from the margin's end is not looked at.")
    memory_s: float = param(60.0, "s", "How long what was seen behind counts for the way back.")
    memory_radius: float = param(1.5, "m", "Returns count for the way back if they were this near.")
    look_every_s: float = param(0.5, "s", "How often a scan is kept for the ground it shows to be free.")
    unseen_speed: float = param(0.2, "m/s", "Highest speed backwards onto other ground.")
    max_backward: float = param(0.6, "m/s", "Highest speed backwards: no sensor looks there.")
    max_blind: float = param(0.2, "m/s", "Highest speed without a lidar, and none backwards.")
    max_age_s: float = param(0.5, "s", "The robot stops when a sense brings nothing new for this time.")
    max_late_s: float = param(1.0, "s", "The same for a camera frame's stamp.")
    late_s: float = param(0.15, "s", "A reading older than this is late: every sense is faster.")
    stands_s: float = param(0.9, "s", "When one is late, no wheel turns faster than it can stop this long after it.")
    #: The robot has none: it drives by the depth image alone, slowly. Without depth or odometry no robot drives.
    without_lidar: bool = False
    depth_grid: DepthGrid = field(default_factory=DepthGrid)  #: Which depth pixels are looked at.
    robot: RobotGeometry = LIMO  #: The robot's outline, mounts and limits.
    braking: float = field(init=False)  #: Deceleration counted on [m/s²]: half of what the wheels can do.

    def __post_init__(self) -> None:
        object.__setattr__(self, "braking", self.robot.acceleration / 2)

    def start(self) -> GuardState[S]:
        """Return the state before the first observation."""
        return GuardState(self.controller.start())

    def step(self, observation: Observation, state: GuardState[S]) -> Decision[GuardState[S]]:
        """Ask the controller and let through what is safe; a faulty observation stops the robot."""
        sensors, now = Sensors(observation.scan, observation.odometry), observation.at
        if fault := find_fault(observation, state.stamp):
            # When the clock was set back, what is remembered has stamps of the old clock.
            set_back = state.stamp is not None and observation.stamp < state.stamp
            stamp = observation.stamp if math.isfinite(observation.stamp) else state.stamp
            after = replace(self.start() if set_back else state, stamp=stamp, proposed=None)
            after = self._heard(now, sensors, after, observation)
            return Decision(Twist(), after, Mode.BLOCKED, fault)
        state = self._heard(now, sensors, state, observation)
        if fault := state.arrivals.disagreement(self.max_age_s, self.max_late_s):
            # Neither the controller nor the memory can do anything with times of several clocks.
            after = replace(state, stamp=observation.stamp, proposed=None)
            fault = "; ".join(filter(None, (self._missing(now, after), fault)))
            return Decision(Twist(), after, Mode.BLOCKED, fault)
        state = self._remember(state, sensors)
        if observation.scan is not None and observation.odometry is not None:
            old = state.scan_points[state.scan_points_at < state.scan_stamp]
            observation = replace(observation, remembered=from_odometry(old, observation.odometry))
        proposed = self.controller.step(observation, state.inner)
        state = replace(state, inner=proposed.state, proposed=proposed, stamp=observation.stamp)
        if observation.depth is not None:
            reach = 2 * self.robot.half_length + self.margin.ahead + self.depth_reach
            seen = self.depth_grid.points(observation.depth, observation.focal_px, reach, self.robot)
            state = replace(state, depth_points=seen)
        return self._limited(proposed, state, sensors, now)

    def ask(self, whom: Whom, state: GuardState[S]) -> GuardState[S]:
        """Return the state in which the guarded controller is asked to follow a person; raises `WhomError`."""
        return replace(state, inner=ask_of(self.controller)(checked(whom), state.inner))

    def recheck(self, now: float, sensors: Sensors, state: GuardState[S]) -> Decision[GuardState[S]]:
        """Check the last decision, less target and region, against a newer scan, `now` on the robot's own clock [s]."""
        if fault := scan_fault(sensors.scan) or _odometry(sensors.odometry):
            return Decision(Twist(), state, Mode.BLOCKED, fault)
        state = self._heard(now, sensors, state)
        fault = self._missing(now, state) or state.arrivals.disagreement(self.max_age_s, self.max_late_s)
        if fault or state.proposed is None:
            return Decision(Twist(), state, Mode.BLOCKED, fault or "no usable camera frame")
        proposed = replace(state.proposed, target=None, region=None)
        return self._limited(proposed, self._remember(state, sensors), sensors, now)

    def _heard(
        self, now: float, sensors: Sensors, state: GuardState[S], seen: Observation | None = None
    ) -> GuardState[S]:
        """Note which readings are new at `now` on the robot's own clock [s]."""
        stamps = {} if sensors.scan is None else {SCAN: sensors.scan.stamp}
        if sensors.odometry is not None:
            stamps[ODOMETRY] = sensors.odometry.stamp
        if seen is not None:
            depth = seen.stamp if seen.depth_stamp is None else seen.depth_stamp
            stamps |= {CAMERA: seen.stamp, DEPTH: math.nan if seen.depth is None else depth}
        return replace(state, arrivals=state.arrivals.after(now, stamps))

    def _missing(self, now: float, state: GuardState[S]) -> str:
        needed = (CAMERA, DEPTH, ODOMETRY) if self.without_lidar else (CAMERA, DEPTH, SCAN, ODOMETRY)
        return state.arrivals.missing(now, needed, self.max_age_s)

    def _limited(
        self, proposed: Decision[S], state: GuardState[S], sensors: Sensors, now: float
    ) -> Decision[GuardState[S]]:
        pose = sensors.odometry or Odometry()

        def decision(twist: Twist, mode: Mode, reason: str) -> Decision[GuardState[S]]:
            return Decision(twist, state, mode, reason, proposed.target, proposed.region, proposed.belief)

        if not (math.isfinite(proposed.twist.linear) and math.isfinite(proposed.twist.angular)):
            return decision(Twist(), Mode.BLOCKED, "the controller's command is not a number")
        if fault := self._missing(now, state):
            return decision(Twist(), Mode.BLOCKED, fault)
        around = from_odometry(state.scan_points, pose)
        obstacles, straight = np.concatenate([around, state.depth_points]), np.zeros(1)
        room = float(rooms_ahead(obstacles, straight, self.margin, self.robot)[0])
        room_behind = float(rooms_ahead(-around, straight, self.margin, self.robot)[0])
        ahead = speed_within(room, self.braking, self.reaction_s)
        behind = speed_within(room_behind, self.braking, self.reaction_s)
        fastest, backward = self.robot.max_speed, self.max_backward if self.robot.may_back else 0.0
        if sensors.scan is None or sensors.odometry is None:
            fastest, backward = min(fastest, self.max_blind), 0.0
        elif proposed.twist.linear < 0:
            seen = speed_within(room_seen_behind(state.looks, pose, self.robot), self.braking, self.reaction_s)
            behind = min(behind, max(seen, self.unseen_speed))
        wanted = min(max(proposed.twist.linear, -min(backward, fastest)), fastest)
        linear = min(max(wanted, -behind), ahead)
        twist = Twist(linear, min(max(proposed.twist.angular, -self.robot.max_turn), self.robot.max_turn))
        twist = self._stoppable(twist, state.arrivals.oldest(now))
        if backward == 0 > proposed.twist.linear:
            why = "without sight" if self.robot.may_back else "at all"
            return decision(twist, Mode.BLOCKED, f"the robot does not back {why}")
        if linear == wanted:
            return decision(twist, proposed.mode, proposed.reason)
        where = "ahead" if wanted > 0 else "behind"
        if linear == 0:
            return decision(twist, Mode.BLOCKED, f"an obstacle is too close {where}")
        return decision(twist, proposed.mode, f"slowed by an obstacle {where}")

    def _stoppable(self, twist: Twist, age: float) -> Twist:
        """Slow a command down while a reading is late: if its sense is lost, the wheels must stand in time."""
        if age <= self.late_s:
            return twist
        rim = abs(twist.linear) + self.robot.wheel_separation / 2 * abs(twist.angular)
        most = self.robot.acceleration * max(self.stands_s - age, 0.0)
        return twist if rim <= most else Twist(twist.linear * most / rim, twist.angular * most / rim)

    def _remember(self, state: GuardState[S], sensors: Sensors) -> GuardState[S]:
        """Add a new scan; of earlier returns, keep those that are recent and out of the lidar's field of view now."""
        scan, pose = sensors.scan, sensors.odometry or Odometry()
        if sensors.odometry is None:
            # What is remembered cannot be carried along.
            state = replace(state, scan_points=NO_POINTS, scan_points_at=np.empty(0), scan_stamp=-math.inf, looks=())
        if scan is None or scan.stamp == state.scan_stamp:
            return state
        new = scan_points(scan, self.robot)
        new = to_odometry(new[np.hypot(new[:, 0], new[:, 1]) < self.memory_radius], pose)
        old = from_odometry(state.scan_points, pose)
        out_of_view = ~scan.looks_at(np.arctan2(old[:, 1], old[:, 0] - self.robot.lidar_x))
        age = scan.stamp - state.scan_points_at
        kept = out_of_view & (age >= 0) & (age < self.memory_s)
        points = np.concatenate([state.scan_points[kept], new])
        points_at = np.concatenate([state.scan_points_at[kept], np.full(len(new), scan.stamp)])
        looks = [look for look in state.looks if 0 <= scan.stamp - look.scan.stamp < self.memory_s]
        if not looks or scan.stamp - looks[-1].scan.stamp >= self.look_every_s:
            looks.append(Look(scan, pose))
        return replace(state, scan_stamp=scan.stamp, scan_points=points, scan_points_at=points_at, looks=tuple(looks))


def find_fault(observation: Observation, last_stamp: float | None) -> str:
    """Return what is wrong with an observation, "" if nothing is; `last_stamp` [s] is that of the one before."""
    if observation.fault:
        return observation.fault
    if not math.isfinite(observation.stamp):
        return f"the frame's stamp is {observation.stamp}, not a time"
    if last_stamp is not None and observation.stamp < last_stamp:
        return f"time runs backwards: a frame of {observation.stamp:.3f} s after one of {last_stamp:.3f} s"
    return _boxes(observation) or _depth(observation) or scan_fault(observation.scan) or _odometry(observation.odometry)


def _boxes(observation: Observation) -> str:
    boxes, scores = observation.detections.windows, observation.detections.scores
    if boxes.ndim != 2 or boxes.shape[1] != 4 or len(boxes) != len(scores):
        return f"boxes {boxes.shape} and scores {scores.shape} do not belong together"
    if not all(map(math.isfinite, scores.tolist())):
        return "a box has a score that is not a number"
    clothes = observation.clothes
    if clothes is not None and clothes.shape != (len(boxes), 2, 3):
        return f"clothes {clothes.shape} and boxes {boxes.shape} do not belong together"
    for x, y, w, h in boxes.tolist():
        inside = 0 <= x + w / 2 < observation.width and 0 <= y + h / 2 < observation.height
        if not inside or w <= 0 or h <= 0:
            return f"box ({x}, {y}, {w}, {h}) lies outside the {observation.width}x{observation.height} image"
    return ""


def _depth(observation: Observation) -> str:
    depth = observation.depth
    if depth is None:
        return ""
    if depth.shape != (observation.height, observation.width):
        return f"the depth image is {depth.shape}, the camera's {(observation.height, observation.width)}"
    # Among a few pixels one is nearly always valid; to look at all takes a tenth of the follower's time.
    for some in (depth[::_STEP, ::_STEP], depth):
        if (np.isfinite(some) & (some > 0)).any():
            return ""
    return "the depth image has no valid pixel"


def scan_fault(scan: Scan | None) -> str:
    """Return what is wrong with a scan, "" if nothing: inf is a beam that met nothing (REP-117, LaserScan)."""
    if scan is None:
        return ""
    if scan.ranges.size == 0:
        return "the scan is empty"
    if not math.isfinite(scan.stamp):
        return f"the scan's stamp is {scan.stamp}, not a time"
    if not -math.inf < scan.angle_min < scan.angle_max < math.inf:
        return f"the scan's angles, {scan.angle_min} to {scan.angle_max} rad, do not go from right to left"
    if not scan.range_min < scan.range_max or not (scan.ranges >= scan.range_min).any():
        return f"the scan has no valid range from {scan.range_min} to {scan.range_max} m"
    return ""


def _odometry(odometry: Odometry | None) -> str:
    if odometry is None:
        return ""
    if not math.isfinite(odometry.stamp):
        return f"the odometry's stamp is {odometry.stamp}, not a time"
    values = (odometry.x, odometry.y, odometry.yaw, odometry.linear, odometry.angular)
    return "" if all(map(math.isfinite, values)) else "the odometry is not a number"
