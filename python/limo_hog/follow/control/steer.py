"""From where the followed person is to a command: proportional control with feed-forward."""

from __future__ import annotations

import math
from dataclasses import dataclass

from limo_hog.follow.decision import Mode
from limo_hog.follow.parameters import bounded
from limo_hog.follow.robot import RobotGeometry
from limo_hog.follow.twist import Twist


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
    """Two proportional controllers, of bearing and of distance, with the person's motion added.

    Attributes
    ----------
    linear_gain, angular_gain
        Speed for each metre, turn rate for each radian of error [1/s]. Chosen: errors halve in .9 and .3 s, slower than
        the wheels' 1 m/s² and the camera's 10 Hz.
    max_linear, max_angular
        Limits of the command, either way [m/s, rad/s]. Chosen: .7 m/s is close to the workshop's walker, .75 m/s.
    regain_angular
        Limit of the turn rate while the person is out of the image [rad/s]. Chosen: half a turn a second.
    distance_tolerance, bearing_tolerance
        Smaller errors are not corrected [m, rad]. Chosen: a little more than one measurement strays.
    steady_bearing_rate, steady_range_rate
        A person whose bearing and range change more slowly stands [rad/s, m/s]. Chosen: at 1.5 m both are a walk of
        less than .1 m/s.
    coast_s
        How long to drive by the prediction alone [s]. Chosen: .5 m at .6 m/s, within the margin of an obstacle.
    doubt_speed
        Share of `max_linear` at which to drive to a person who is not confirmed [1]. Chosen.
    """

    linear_gain: float = bounded(0.8, 0, 5)
    angular_gain: float = bounded(2.5, 0, 10)
    max_linear: float = bounded(0.7, 0, 1)
    max_angular: float = bounded(1.5, 0, 3)
    regain_angular: float = bounded(3.0, 0, 6)
    distance_tolerance: float = bounded(0.08, 0, 1)
    bearing_tolerance: float = bounded(0.02, 0, 0.5)
    steady_bearing_rate: float = bounded(0.05, 0, 1)
    steady_range_rate: float = bounded(0.1, 0, 1)
    coast_s: float = bounded(0.8, 0, 5)
    doubt_speed: float = bounded(0.5, 0, 1)

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
        facing, angular = (
            min(max(self.angular_gain * off + aim.bearing_rate, -most), most) for off in (aim.bearing, heading)
        )
        error = aim.distance - robot.camera_x - target_distance
        # Driving sideways to the person would lose sight of them: turn first, then drive.
        linear = (self.linear_gain * error + aim.range_rate) * max(math.cos(heading), 0.0) ** 2
        linear = min(max(linear, -self.max_linear), self.max_linear)
        if lost_s > self.coast_s:
            return Twist(0.0, facing), Mode.LOST, "turning to the predicted position"
        if not confirmed and linear > 0:
            if not worth_nearing:
                return Twist(0.0, angular), Mode.FOLLOW, "turning to a possible person"
            linear = min(linear, self.max_linear * self.doubt_speed)
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
