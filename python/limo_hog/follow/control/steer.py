"""From where the followed person is to a command: around what is in the way, and as fast as the wheels follow."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.decision import Mode
from limo_hog.follow.parameters import param
from limo_hog.follow.robot import RobotGeometry, Twist
from limo_hog.follow.sense.clearance import Margin, Points, rooms_ahead
from limo_hog.follow.sense.measurement import PERSON_RADIUS
from limo_hog.follow.sense.observation import Odometry


@dataclass(frozen=True, slots=True)
class Aim:
    """The followed person at the time of the command, seen from the robot's centre.

    Attributes
    ----------
    bearing, distance
        Where the person is [rad, m].
    bearing_rate, range_rate
        How the person's own motion changes that [rad/s, m/s].
    heading
        Direction to drive in [rad]; None where none is free.
    hidden
        Whether something is on the line of sight.
    """

    bearing: float
    distance: float
    bearing_rate: float
    range_rate: float
    heading: float | None
    hidden: bool


@dataclass(frozen=True, slots=True)
class Steering:
    """Two proportional controllers, of bearing and of distance, with the person's motion added."""

    # Chosen: errors halve in .9 and .3 s, slower than the wheels' 1 m/s² and the camera's 10 Hz.
    linear_gain: float = param(0.8, "1/s", "Speed for each metre of error.", 0, 5)
    angular_gain: float = param(2.5, "1/s", "Turn rate for each radian of error.", 0, 10)
    # Chosen: close to the workshop's walker, .75 m/s.
    max_linear: float = param(0.7, "m/s", "Limit of the speed, either way.", 0, 1)
    max_angular: float = param(1.5, "rad/s", "Limit of the turn rate, either way.", 0, 3)
    # Chosen: half a turn a second.
    regain_angular: float = param(3.0, "rad/s", "Limit of the turn rate while the person is out of the image.", 0, 6)
    # Chosen: a little more than one measurement strays.
    distance_tolerance: float = param(0.08, "m", "Smaller errors of the distance are not corrected.", 0, 1)
    bearing_tolerance: float = param(0.02, "rad", "Smaller errors of the bearing are not corrected.", 0, 0.5)
    # Chosen: at 1.5 m both are a walk of less than .1 m/s.
    steady_bearing_rate: float = param(0.05, "rad/s", "A person whose bearing changes more slowly stands.", 0, 1)
    steady_range_rate: float = param(0.1, "m/s", "A person whose range changes more slowly stands.", 0, 1)
    # Chosen: .5 m at .6 m/s, within the margin of an obstacle.
    coast_s: float = param(0.8, "s", "How long to drive by the prediction alone.", 0, 5)
    unconfirmed_speed: float = param(
        0.5, "share", "Share of `max_linear` at which to drive to a person who is not confirmed.", 0, 1
    )

    def command(
        self,
        aim: Aim,
        target_distance: float,
        robot: RobotGeometry,
        *,
        confirmed: bool,
        worth_nearing: bool,
        in_view: bool,
        lost_s: float,
    ) -> tuple[Twist, Mode, str]:
        """Return the command, the mode and the reason.

        Parameters
        ----------
        aim
            Where the person is.
        target_distance
            Distance to hold between camera and person [m].
        robot
            Where the camera sits.
        confirmed, worth_nearing
            Whether the track is known to be a person; if not, whether driving nearer will tell.
        in_view
            Whether HOG found the person in this frame.
        lost_s
            Time since the person was measured, by camera or lidar [s].
        """
        heading = aim.bearing if aim.heading is None else aim.heading
        most = self.max_angular if abs(aim.bearing) < robot.field_of_view / 2 else self.regain_angular
        facing = min(max(self.angular_gain * aim.bearing + aim.bearing_rate, -most), most)
        angular = min(max(self.angular_gain * heading + aim.bearing_rate, -most), most)
        error = aim.distance - robot.camera_x - target_distance
        # Driving sideways to the person would lose sight of them: turn first, then drive.
        linear = (self.linear_gain * error + aim.range_rate) * max(math.cos(heading), 0.0) ** 2
        linear = min(max(linear, -self.max_linear), self.max_linear)
        if lost_s > self.coast_s:
            return Twist(0.0, facing), Mode.LOST, "turning to the predicted position"
        if not confirmed and linear > 0:
            if not worth_nearing:
                return Twist(0.0, angular), Mode.FOLLOW, "turning to a possible person"
            linear = min(linear, self.max_linear * self.unconfirmed_speed)
            return Twist(linear, angular), Mode.FOLLOW, "driving nearer to a possible person"
        if abs(error) < self.distance_tolerance and abs(aim.range_rate) < self.steady_range_rate:
            if abs(aim.bearing) < self.bearing_tolerance and abs(aim.bearing_rate) < self.steady_bearing_rate:
                return Twist(), Mode.HOLD, "at the target distance"
            return Twist(0.0, facing), Mode.HOLD, "turning with the person"
        if aim.heading is None:
            return Twist(0.0, facing), Mode.BLOCKED, "no free way to the person"
        twist = Twist(linear, angular)
        if aim.heading != aim.bearing:
            return twist, Mode.FOLLOW, f"{'driving' if linear >= 0 else 'backing'} around an obstacle"
        if in_view:
            return twist, Mode.FOLLOW, "following a person"
        return twist, Mode.FOLLOW, "following the legs or the predicted position"

    def side_of(self, aim: Aim) -> float:
        """Return the side to which the person is leaving: 1 left, -1 right; of one who stands, the side they are on."""
        moves = abs(aim.bearing_rate) > self.steady_bearing_rate
        return math.copysign(1.0, aim.bearing_rate if moves else aim.bearing)


@dataclass(frozen=True, slots=True)
class Detour:
    """Chooses a direction with enough free space near the direction of the person.

    Attributes
    ----------
    margin
        Ground kept free on the way [m]. Chosen: more than `Guard` wants, so that it need not intervene.
    step, steps
        Directions tried: so far apart [rad], so many to either side [1]. Chosen: at .48 rad to either side the
        person stays in the Limo's image, which ends at .62.
    preference
        Weight of the difference to the preferred detour against that to the direct way [1]. Chosen: a detour is kept
        until one to the other side is less than a third of it.
    look_ahead
        So much of the way must be free [m]. Chosen: two seconds at 0.6 m/s.
    lean_s
        The preferred detour is on the side the person walks to, their bearing rate times this [s]. Chosen.
    steps_near, creep
        Along a planned way, directions tried to either side [1], and how far one must be free [m]. Chosen: 1.2 rad, as
        the corner of a corridor of 1 m needs; almost the robot's length.
    person_radius
        Returns nearer than this to the person are the person's own [m].
    occluder_half_width
        Something so near to the line of sight hides the person [m]. Chosen: a pillar this wide hides half of a body.
    """

    margin: Margin = field(default_factory=lambda: Margin(0.65, 0.25))
    step: float = 0.08
    steps: int = 6
    preference: float = 0.5
    look_ahead: float = 1.2
    lean_s: float = 2.0
    steps_near: int = 15
    creep: float = 0.25
    person_radius: float = PERSON_RADIUS
    occluder_half_width: float = 0.12

    def obstacles(self, points: Points, bearing: float, distance: float) -> Points:
        """Return the points, float64 (N, 2) [m], that are not the person at a bearing [rad] and a distance [m]."""
        here = distance * np.array([math.cos(bearing), math.sin(bearing)])
        others: Points = points.compress(np.hypot(*(points - here).T) > self.person_radius, axis=0)
        return others

    def hides(self, obstacles: Points, bearing: float, distance: float) -> bool:
        """Whether an obstacle is on the line of sight to the person."""
        across = np.abs(obstacles @ [-math.sin(bearing), math.cos(bearing)])
        along = obstacles @ [math.cos(bearing), math.sin(bearing)]
        hidden = (across < self.occluder_half_width) & (along > 0) & (along < distance - self.person_radius)
        return bool(hidden.any())

    def heading(
        self, obstacles: Points, bearing: float, distance: float, preferred: float, robot: RobotGeometry
    ) -> float | None:
        """Return the direction to drive in [rad]; None where none is free.

        Parameters
        ----------
        obstacles
            float64 (N, 2) [m], base frame.
        bearing, distance
            Of the person [rad, m].
        preferred
            The detour liked best, from `bearing` [rad]: the one already begun, or the side the person walks to.
        """
        reach = min(distance - 2 * self.person_radius, self.look_ahead)
        heading = self.free(obstacles, bearing, preferred, reach, robot)
        return heading if heading is not None else self.free(obstacles, bearing, preferred, reach / 2, robot)

    def near(self, obstacles: Points, bearing: float, robot: RobotGeometry) -> float | None:
        """Return the direction nearest to a bearing [rad] in which the robot can drive a little; None for none."""
        for reach in (self.creep, self.creep / 3):
            heading = self.free(obstacles, bearing, 0.0, reach, robot, self.steps_near)
            if heading is not None:
                return heading
        return None

    def free(
        self,
        obstacles: Points,
        bearing: float,
        preferred: float,
        reach: float,
        robot: RobotGeometry,
        steps: int | None = None,
    ) -> float | None:
        """Return the best direction in which the robot can drive at least `reach` [m]."""
        most = self.steps if steps is None else steps
        # What is further off is in no direction's way.
        near = obstacles.compress(np.hypot(*obstacles.T) < reach + robot.half_length + self.margin.ahead, axis=0)
        detours = self.step * np.arange(-most, most + 1)
        costs = np.abs(detours) + self.preference * np.abs(detours - preferred)
        detours = detours[costs.argsort(kind="stable")]
        # Mostly the best is free: to look at it alone takes half of the time of all.
        for some in (detours[:1], detours[1:]):
            rooms = rooms_ahead(near, bearing + some, self.margin, robot)
            free = (rooms >= reach).nonzero()[0]
            if len(free):
                return bearing + float(some[free[0]])
        return None


Array = NDArray[np.float64]
Speeds = TypeVar("Speeds", float, Array)


@dataclass(frozen=True, slots=True)
class Wheels:
    """Learns how fast the wheels change their speeds, and asks for no more.

    Attributes
    ----------
    least
        A lower measured one is not believed [m/s²]: `Guard` may have held the robot. Chosen: half of the weakest drive
        that was tried.
    raise_share, lower_share
        Share by which a measurement above, and one below, moves what is believed [1]. Chosen: a wheel that was slower
        may have been held; one that was faster was able to be.
    reserve
        A command may ask for so much more than the wheels reach before the next [1]. Chosen: the next command may be
        half a period late, and stronger wheels than believed show.
    """

    acceleration: float = param(1.0, "m/s²", "Acceleration of each wheel, until it is measured.", 0.05, 10)
    least: float = 0.15
    raise_share: float = 0.5
    lower_share: float = 0.15
    reserve: float = 1.5

    def learn(self, believed: float, sent: Twist, before: Odometry, after: Odometry, robot: RobotGeometry) -> float:
        """Return the wheels' acceleration [m/s²] after one more period.

        Parameters
        ----------
        believed
            As learnt so far [m/s²].
        sent
            The command between the two readings of the wheels.
        before, after
            The readings.
        robot
            Where the wheels are.
        """
        seconds = after.stamp - before.stamp
        if seconds <= 0:
            return believed
        half = robot.wheel_separation / 2
        for side in (-half, half):
            begun, ended = before.linear + side * before.angular, after.linear + side * after.angular
            asked = sent.linear + side * sent.angular - begun
            measured = abs(ended - begun) / seconds
            if measured > believed:
                believed += self.raise_share * (measured - believed)
            elif abs(asked) > believed * seconds and measured > self.least:
                believed += self.lower_share * (measured - believed)
        return believed

    def within_reach(
        self, wanted: Twist, now: Twist, acceleration: float, period: float, robot: RobotGeometry
    ) -> Twist:
        """Return the command that comes nearest to the wanted one within a period [s], the turn first."""
        most = acceleration * self.reserve * period
        return Twist(*advanced(wanted.linear, wanted.angular, now.linear, now.angular, most, robot))


def stoppable_turn(off: Speeds, acceleration: float, robot: RobotGeometry) -> Speeds:
    """Return the turn rate [rad/s], positive, from which the wheels stop within an angle `off` [rad] of either sign."""
    return np.sqrt(2 * acceleration / (robot.wheel_separation / 2) * np.abs(off))  # type: ignore[no-any-return]


def advanced(
    linear: float, angular: float, now_linear: float, now_angular: float, most: float, robot: RobotGeometry
) -> tuple[float, float]:
    """Return the speeds after each wheel has changed its own by `most` [m/s] at most: the turn first, then the drive.

    `linear`, `angular` are wanted, `now_linear`, `now_angular` the present ones [m/s, rad/s].
    """
    half = robot.wheel_separation / 2
    turn = min(max(angular - now_angular, -most / half), most / half)
    left = most - half * abs(turn)
    return now_linear + min(max(linear - now_linear, -left), left), now_angular + turn


def all_advanced(
    linear: Array, angular: Array, now_linear: Array, now_angular: Array, most: float, robot: RobotGeometry
) -> tuple[Array, Array]:
    """Return what `advanced` does, for many commands at once: float64 (N,) each."""
    half = robot.wheel_separation / 2
    turn = np.minimum(np.maximum(angular - now_angular, -most / half), most / half)
    left = most - half * np.abs(turn)
    return now_linear + np.minimum(np.maximum(linear - now_linear, -left), left), now_angular + turn
