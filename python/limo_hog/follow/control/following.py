"""Where the robot should be to follow a person who is known to be somewhere: how near, and by which way."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from limo_hog.follow.control.rollouts import Sampling
from limo_hog.follow.control.selection import TrackingState
from limo_hog.follow.control.situation import Goal, Situation, carried, goal_along
from limo_hog.follow.decision import Mode
from limo_hog.follow.parameters import param
from limo_hog.follow.sense.clearance import NO_POINTS, Margin, rooms_ahead, to_odometry
from limo_hog.follow.sense.measurement import PERSON_RADIUS
from limo_hog.follow.space.routes import Router
from limo_hog.follow.tracks.kalman import Track, rates
from limo_hog.follow.tracks.person import Person


class Followed(NamedTuple):
    """The person followed."""

    person: Person
    track: Track  #: At the newest stamp; from there bearing and distance from the robot [rad, m].
    bearing: float
    distance: float
    keeps: float  #: The distance to hold [m].
    worth_nearing: bool  #: Whether nearing them shows if it is a person.


class Aimed(NamedTuple):
    """A goal, the mode and the reason, and what is remembered."""

    goal: Goal
    mode: Mode
    reason: str
    state: TrackingState


@dataclass(frozen=True, slots=True)
class Following:
    """Keeps a distance that lets the camera show the whole person and lets the robot turn aside in time."""

    max_speed: float = param(0.9, "m/s", "Limit of the speed, either way.", 0, 1)
    distance_tolerance: float = param(0.08, "m", "Smaller errors of distance are not corrected.", 0, 1)
    bearing_tolerance: float = param(0.02, "rad", "Smaller errors of direction are not corrected.", 0, 0.5)
    steady_bearing_rate: float = param(0.05, "rad/s", "A person whose bearing changes more slowly stands.", 0, 1)
    steady_range_rate: float = param(0.1, "m/s", "And whose range changes more slowly.", 0, 1)
    coast_s: float = param(2.0, "s", "How long to drive by the prediction alone.", 0, 5)
    waits_s: float = param(2.0, "s", "How long to face the predicted place before the person is looked for.", 0, 30)
    doubt_speed: float = param(0.5, "of 1", "Share of `max_speed` at which to drive to who may be a person.", 0, 1)
    headway_s: float = param(1.9, "s", "A person who walks fast is kept off by this part of their way.", 0, 5)
    most_headway: float = param(3.0, "m", "But no further: further off HOG soon finds nobody.", 0.5, 8)
    rise: float = param(0.15, "of 1", "Share by which a faster frame moves the speed they are known to walk at.", 0, 1)
    fall: float = param(0.01, "of 1", "Share by which a slower frame, in which they walk, moves it.", 0, 1)
    prompt_s: float = param(0.1, "s", "An image this late costs no distance.", 0, 5)
    near_hiding: float = param(1.2, "m", "Distance to hold to a person who will soon be out of sight.", 0.5, 8)
    foresight_s: float = param(1.0, "s", "How soon that is, in their way.", 0, 5)
    margin: Margin = field(default_factory=lambda: Margin(0.65, 0.25))
    look_ahead: float = param(1.2, "m", "So much of the direct way must be free, else one is planned.")
    replan_s: float = param(0.8, "s", "A way is planned anew after this time.")
    router: Router = field(default_factory=Router)

    def keeps(self, asked: float, least: float, brisk: float, soon: tuple[float, float], situation: Situation) -> float:
        """Return the distance to hold from the camera [m]: as asked, but none from which a person is cut off.

        From `least` [m] the camera shows all of the person, who walks at most at `brisk` [m/s] and will be at the place
        `soon` after `foresight_s`, odometry frame [m].
        """
        late_s = situation.late_s
        least += 2 * brisk * max(late_s - self.prompt_s, 0.0)
        headway = (late_s + self.headway_s / math.sqrt(situation.acceleration)) * brisk
        keeps = max(asked, least, min(headway, self.most_headway))
        return self.near_hiding if keeps > self.near_hiding and situation.is_behind(soon) else keeps

    def aim(self, followed: Followed, situation: Situation, state: TrackingState, sampling: Sampling) -> Aimed:
        """Return the goal that holds the distance to a person."""
        person, track, bearing, distance, keeps, worth_nearing = followed
        now, stamp = situation.now, state.tracks.stamp or 0.0
        bearing_rate, range_rate = rates(track, situation.pose)
        error = distance - situation.robot.camera_x - keeps
        speed = min(max(sampling.gain * error + range_rate, -self.max_speed), self.max_speed)
        later = min(max(range_rate, -self.max_speed), self.max_speed)
        places = sampling.walked(carried(np.array([track.mean]), situation.pose))[:, 0]
        goal = Goal(bearing, bearing_rate, speed, later, places, keeps + situation.robot.camera_x)
        standing = replace(goal, speed=0.0, speed_later=0.0, keeps=distance)
        if min(stamp - person.seen, now - person.felt) > self.coast_s:
            return Aimed(standing, Mode.LOST, "turning to the predicted position", state)
        if not person.confirmed and speed > 0:
            if not worth_nearing:
                return Aimed(standing, Mode.FOLLOW, "turning to a possible person", state)
            goal = replace(goal, speed=min(speed, self.max_speed * self.doubt_speed))
            return Aimed(goal, Mode.FOLLOW, "driving nearer to a possible person", state)
        if abs(error) < self.distance_tolerance and abs(range_rate) < self.steady_range_rate:
            if abs(bearing) < self.bearing_tolerance and abs(bearing_rate) < self.steady_bearing_rate:
                return Aimed(replace(standing, heading=0.0, rate=0.0), Mode.HOLD, "at the target distance", state)
            return Aimed(standing, Mode.HOLD, "turning with the person", state)
        reason = "following a person" if person.seen == stamp else "following the legs or the predicted position"
        if speed > 0 and person.confirmed:
            state = self._routed(track, bearing, distance, situation, state)
            if len(state.way):
                goal = goal_along(state.way, situation, self.router.ahead, speed, sampling.times)
                reason = "driving around an obstacle"
        return Aimed(goal, Mode.FOLLOW, reason, state)

    def _routed(
        self, track: Track, bearing: float, distance: float, situation: Situation, state: TrackingState
    ) -> TrackingState:
        """Plan a way to the person where something that lasts is in the direct one: what passes goes away as well."""
        ground, grid, pose = situation.ground, situation.grid, situation.pose
        if ground is None:
            return state
        points = situation.points
        lasting = points[grid.is_blocked(ground, to_odometry(points, pose), lasting=True)]
        reach = min(distance - 2 * PERSON_RADIUS, self.look_ahead)
        if rooms_ahead(lasting, np.array([bearing]), self.margin, situation.robot)[0] >= reach:
            return replace(state, way=NO_POINTS, way_at=-math.inf)
        if situation.now - state.way_at < self.replan_s:
            return state
        way = self.router.way_towards(grid, ground, pose, np.array(track.place))
        return replace(state, way=way if len(way) > 1 else NO_POINTS, way_at=situation.now)
