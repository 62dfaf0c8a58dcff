"""The third controller: follow one person by a track, look where they should be, and turn after them when lost."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from limo_hog.follow.body import LIMO, Body
from limo_hog.follow.decision import Decision, Mode
from limo_hog.follow.kalman import Noise, bearing_range, predicted, rates
from limo_hog.follow.legs import felt
from limo_hog.follow.observation import Observation, Odometry
from limo_hog.follow.people import (
    Person,
    associate,
    begin,
    is_new,
    measure,
    moved_on,
    not_seen,
    pose_at,
    seen_again,
    should_be_seen,
)
from limo_hog.follow.region import Region, region_around
from limo_hog.follow.twist import Twist

#: How far back the robot's poses are remembered: older frames are not waited for [s].
_POSES_FOR = 2.0


@dataclass(frozen=True, slots=True)
class TrackingState:
    """What the controller remembers.

    Attributes
    ----------
    people
        Everybody tracked.
    followed
        Number of the person who is followed; None while nobody is.
    next_number
        Number of the next new person.
    poses
        Where the robot was lately, oldest first.
    stamp, period
        Stamp of the last frame and the time between the last two [s].
    since_full
        Frames since the whole image was searched.
    turn
        Which way to search: 1 left, -1 right.
    ever
        Whether anybody was followed before.
    """

    people: tuple[Person, ...] = ()
    followed: int | None = None
    next_number: int = 1
    poses: tuple[Odometry, ...] = ()
    stamp: float | None = None
    period: float = 0.1
    since_full: int = 0
    turn: float = 1.0
    ever: bool = False


@dataclass(frozen=True, slots=True)
class TrackingController:
    """Kalman tracks in bearing and range, feed-forward, region search, coasting and a search turn.

    Attributes
    ----------
    target_distance
        Distance to hold, as the depth image measures it [m].
    linear_gain, angular_gain
        Speed for each metre, turn rate for each radian of error [1/s].
    max_linear, max_angular
        Limits of the command, either way [m/s, rad/s].
    near_enough, straight_enough
        Errors that are not worth a move [m, rad].
    noise
        How far people and sensors stray from the model.
    gate
        Chi-squared beyond which a box is somebody else's; 2 numbers, so 1 in 10 000 of one's own is beyond 18.
    trusted, doubted
        Trust from which a person is driven towards, and below which not any more.
    coast
        How long to drive by the prediction alone [s].
    chase
        How long to turn where the prediction says before searching all around [s].
    forget
        How long somebody not seen is remembered [s].
    search_rate
        Turn rate of a search [rad/s].
    full_every
        Every so many frames the whole image is searched.
    body
        Where the camera sits.
    """

    target_distance: float = 1.5
    linear_gain: float = 0.8
    angular_gain: float = 2.5
    max_linear: float = 0.5
    max_angular: float = 1.5
    near_enough: float = 0.08
    straight_enough: float = 0.02
    noise: Noise = field(default_factory=Noise)
    gate: float = 18.0
    trusted: float = 0.8
    doubted: float = 0.5
    coast: float = 0.8
    chase: float = 3.0
    forget: float = 8.0
    search_rate: float = 0.7
    full_every: int = 10
    body: Body = LIMO

    def start(self) -> TrackingState:
        """Nobody is known yet."""
        return TrackingState()

    def step(self, observation: Observation, state: TrackingState) -> Decision[TrackingState]:
        """Bring the tracks up to the frame, choose whom to follow, and steer by where they are now."""
        now = observation.now
        state = self._remember(observation, state)
        state, boxes = self._track(observation, state)
        state = self._choose(state)
        person = next((one for one in state.people if one.number == state.followed), None)
        if person is None:
            turn = Twist(0.0, state.turn * self.search_rate)
            if state.ever:
                return Decision(turn, state, Mode.LOST, "looking all around for the person")
            return Decision(turn, state, Mode.SEARCH, "looking all around for somebody")
        unseen = observation.stamp - person.seen
        person, state = self._feel(person, state, observation, unseen)
        twist, mode, reason = self._steer(person, state, now, unseen)
        bearing, _ = bearing_range(predicted(person.track, now, self.noise), pose_at(state.poses, now))
        region = self._region(person, state, observation) if unseen == 0 else None
        state = replace(
            state,
            since_full=0 if region is None else state.since_full + 1,
            turn=math.copysign(1.0, bearing) if abs(bearing) > self.straight_enough else state.turn,
        )
        return Decision(twist, state, mode, reason, boxes.get(person.number), region)

    def _remember(self, observation: Observation, state: TrackingState) -> TrackingState:
        poses = state.poses
        if observation.odometry is not None:
            young = (pose for pose in poses if observation.odometry.stamp - pose.stamp < _POSES_FOR)
            poses = (*young, observation.odometry)
        period = state.period if state.stamp is None else observation.stamp - state.stamp
        return replace(state, poses=poses, stamp=observation.stamp, period=min(max(period, 0.02), 0.5))

    def _track(self, observation: Observation, state: TrackingState) -> tuple[TrackingState, dict[int, int]]:
        """Pair boxes with people; returns the new state and each found person's box, number -> index."""
        stamp, pose = observation.stamp, pose_at(state.poses, observation.stamp)
        known = tuple(
            moved_on(one, stamp, self.noise) for one in state.people if stamp - max(one.seen, one.felt) < self.forget
        )
        seen = measure(observation, self.body)
        pairs = associate(known, seen, pose, self.noise, self.gate)
        people: list[Person] = []
        for who, person in enumerate(known):
            if who in pairs:
                people.append(seen_again(person, seen[pairs[who]], pose, self.noise, self.gate))
            elif should_be_seen(person, pose, observation):
                people.append(not_seen(person))
            else:
                people.append(person)
        boxes = {people[who].number: which for who, which in pairs.items()}
        number = state.next_number
        for which, one in enumerate(seen):
            if which not in boxes.values() and is_new(one, people, pose):
                people.append(begin(number, one, stamp, pose, self.noise))
                boxes[number] = which
                number += 1
        return replace(state, people=tuple(people), next_number=number), boxes

    def _feel(
        self, person: Person, state: TrackingState, observation: Observation, unseen: float
    ) -> tuple[Person, TrackingState]:
        """Bring the followed person up to the newest scan, if their legs are in it."""
        scan = observation.scan
        if scan is None or scan.stamp <= person.felt:
            return person, state
        track = felt(person.track, scan, pose_at(state.poses, scan.stamp), self.body, self.noise)
        if track is None:
            return person, state
        now = replace(person, track=track, felt=scan.stamp)
        # What the camera follows stays at the camera's time, which may be earlier, as long as it does.
        kept = replace(person, felt=scan.stamp) if unseen == 0 else now
        people = tuple(kept if one.number == person.number else one for one in state.people)
        return now, replace(state, people=people)

    def _choose(self, state: TrackingState) -> TrackingState:
        """Stay with the person who is followed while they are remembered; else take the most trusted."""
        if any(one.number == state.followed for one in state.people):
            return state
        hopeful = [one for one in state.people if one.seen == state.stamp]
        if not hopeful:
            return replace(state, followed=None)
        best = max(hopeful, key=lambda one: one.trust)
        return replace(state, followed=best.number, ever=True)

    def _steer(self, person: Person, state: TrackingState, now: float, unseen: float) -> tuple[Twist, Mode, str]:
        pose = pose_at(state.poses, now)
        track = predicted(person.track, now, self.noise)
        bearing, distance = bearing_range(track, pose)
        bearing_rate, range_rate = rates(track, pose)
        angular = self.angular_gain * bearing + bearing_rate
        angular = min(max(angular, -self.max_angular), self.max_angular)
        error = distance - self.body.camera_x - self.target_distance
        # Sideways the robot would only lose sight: turn first, then drive.
        linear = (self.linear_gain * error + range_rate) * max(math.cos(2 * bearing), 0.0)
        linear = min(max(linear, -self.max_linear), self.max_linear)
        if min(unseen, now - person.felt) > self.coast:
            return Twist(0.0, angular), Mode.LOST, "turning where the person went"
        if person.trust < self.trusted and linear > 0:
            return Twist(0.0, angular), Mode.FOLLOW, "facing somebody, not sure yet"
        if abs(error) < self.near_enough and abs(range_rate) < 0.1:
            if abs(bearing) < self.straight_enough and abs(bearing_rate) < 0.05:
                return Twist(), Mode.HOLD, "the person is where they should be"
            return Twist(0.0, angular), Mode.HOLD, "turning with the person"
        if unseen == 0:
            return Twist(linear, angular), Mode.FOLLOW, "following a person"
        return Twist(linear, angular), Mode.FOLLOW, "following legs, or where the person should be"

    def _region(self, person: Person, state: TrackingState, observation: Observation) -> Region | None:
        """Where the person should be in the next frame."""
        if state.since_full + 1 >= self.full_every or person.trust < self.doubted:
            return None
        stamp = observation.stamp + state.period
        pose = pose_at(state.poses, stamp)
        bearing, distance = bearing_range(predicted(person.track, stamp, self.noise), pose)
        return region_around(
            bearing,
            distance,
            person.window,
            person.centre,
            observation.focal_px,
            observation.width,
            observation.height,
        )
