"""The third controller: follow one person by a track, look where they should be, and turn after them when lost."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from limo_hog.follow.decision import Decision, Mode
from limo_hog.follow.robot import LIMO, RobotGeometry
from limo_hog.follow.sense.appearance import OTHER_CLOTHES, Clothes, unlikeness
from limo_hog.follow.sense.clearance import Margin, free_heading, scan_points
from limo_hog.follow.sense.observation import Observation, Odometry
from limo_hog.follow.sense.region import Region, region_around
from limo_hog.follow.tracks.association import (
    SMALLEST_WINDOW,
    Person,
    associate,
    begin,
    between,
    is_new,
    judged,
    measure,
    moved_on,
    pose_at,
    seen_again,
    should_be_seen,
)
from limo_hog.follow.tracks.kalman import Noise, bearing_range, predicted, rates
from limo_hog.follow.tracks.legs import Returns, felt, returns_of
from limo_hog.follow.twist import Twist

#: Scan points nearer than this to a person are theirs; nearer ones on the way to them hide them [m].
_PERSONS_OWN = 0.45
#: Half the width of what hides a person [m].
_HIDES = 0.12
#: Slower than this a person's direction does not change [rad/s].
_STEADY = 0.05
#: How much the side somebody walks to is preferred in going around something [s].
_LEAN = 2.0
#: How far ahead the way must be free [m].
_LOOK_AHEAD = 1.2
#: Boxes nearer than this, and so much more for each second, may be a person who was lost [m, m/s].
_SAME_PERSON, _HASTE = 0.5, 1.0
#: Legs are believed for so many frames in which the camera should see the person and does not.
_MISSES = 3
#: How far back the robot's poses are remembered: older frames are not waited for [s].
_POSES_FOR = 2.0
#: How long scans are: more than a camera frame may be late [s].
_SCANS_FOR = 1.0
#: A scan may be so much older than the frame it is used with [s].
_SCAN_PERIOD = 0.13


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
    poses, scans
        Where the robot was and what the lidar hit lately, oldest first.
    stamp, period
        Stamp of the last frame and the time between the last two [s].
    since_full
        Frames since the whole image was searched.
    turn
        Which way to search: 1 left, -1 right.
    clothes, parted
        What the person followed last wears, None where no camera tells; and when they were last seen or felt [s],
        None where nobody was followed yet.
    detour
        How far off the straight way to the person the robot goes around something [rad].
    """

    people: tuple[Person, ...] = ()
    followed: int | None = None
    next_number: int = 1
    poses: tuple[Odometry, ...] = ()
    scans: tuple[Returns, ...] = ()
    stamp: float | None = None
    period: float = 0.1
    since_full: int = 0
    turn: float = 1.0
    clothes: Clothes | None = None
    parted: float | None = None
    detour: float = 0.0


@dataclass(frozen=True, slots=True)
class _Aim:
    """The followed person now, seen from the robot: where, how that changes, and which way to go there."""

    bearing: float
    distance: float
    bearing_rate: float
    range_rate: float
    heading: float | None
    hidden: bool


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
    hint
        Trust from which somebody too far away for HOG is worth going nearer, and waiting for.
    doubt
        Somebody not confirmed after so many frames, and trusted less than `hint`, is given up.
    coast
        How long to drive by the prediction alone [s].
    blind
        How long legs in the scan alone are followed [s].
    chase
        How long to face where an unseen person should be before searching all around [s].
    forget
        How long somebody unseen is remembered, and waited for where something hides them [s].
    faithful
        How long to look for a person who was lost before somebody in other clothes will do [s].
    search_rate
        Turn rate of a search [rad/s].
    full_every
        Every so many frames the whole image is searched.
    back_off
        Speed backwards where there is no way around something [m/s].
    margin
        Ground kept free on the way; more than the safety layer wants, so that it need not step in.
    body
        Where the camera sits.
    """

    target_distance: float = 1.5
    linear_gain: float = 0.8
    angular_gain: float = 2.5
    max_linear: float = 0.7
    max_angular: float = 1.5
    near_enough: float = 0.08
    straight_enough: float = 0.02
    noise: Noise = field(default_factory=Noise)
    gate: float = 18.0
    hint: float = 0.4
    doubt: int = 30
    coast: float = 0.8
    blind: float = 4.0
    chase: float = 2.0
    forget: float = 8.0
    faithful: float = 20.0
    search_rate: float = 0.7
    full_every: int = 15
    back_off: float = 0.15
    margin: Margin = field(default_factory=lambda: Margin(0.65, 0.25))
    body: RobotGeometry = LIMO

    def start(self) -> TrackingState:
        """Nobody is known yet."""
        return TrackingState()

    def step(self, observation: Observation, state: TrackingState) -> Decision[TrackingState]:
        """Bring the tracks up to the frame, choose whom to follow, and steer by where they are now."""
        state = self._remember(observation, state)
        state, boxes = self._track(observation, state)
        state = self._choose(state)
        person = next((one for one in state.people if one.number == state.followed), None)
        if person is None:
            return self._search(state)
        unseen = observation.stamp - person.seen
        person, state = self._feel(person, state, unseen)
        aim = self._aim(person, state, observation)
        motion = aim.bearing_rate if abs(aim.bearing_rate) > _STEADY else aim.bearing
        state = replace(state, turn=math.copysign(1.0, motion))
        lost = min(unseen, observation.now - person.felt)
        if lost > (self.forget if aim.hidden else self.chase):
            return self._search(state)
        twist, mode, reason = self._steer(person, aim, unseen, lost)
        if _is_other(person, state):
            reason = "turning to somebody else: the person did not come back"
        region = self._region(person, state, observation) if unseen == 0 else None
        state = replace(
            state,
            since_full=0 if region is None else state.since_full + 1,
            detour=0.0 if aim.heading is None else aim.heading - aim.bearing,
        )
        return Decision(twist, state, mode, reason, boxes.get(person.number), region)

    def _search(self, state: TrackingState) -> Decision[TrackingState]:
        turn = Twist(0.0, state.turn * self.search_rate)
        if any(one.seen == state.stamp and self._is_stranger(one, state) for one in state.people):
            return Decision(turn, state, Mode.LOST, "looking all around for the person: here is somebody else")
        if state.parted is not None:
            return Decision(turn, state, Mode.LOST, "looking all around for the person")
        return Decision(turn, state, Mode.SEARCH, "looking all around for somebody")

    def _remember(self, observation: Observation, state: TrackingState) -> TrackingState:
        poses = state.poses
        if observation.odometry is not None:
            recent = (pose for pose in poses if observation.odometry.stamp - pose.stamp < _POSES_FOR)
            poses = (*recent, observation.odometry)
        scans, scan = state.scans, observation.scan
        if scan is not None and (not scans or scan.stamp > scans[-1].stamp):
            young = tuple(one for one in scans if scan.stamp - one.stamp < _SCANS_FOR)
            scans = (*young, returns_of(scan, pose_at(poses, scan.stamp), self.body))
        period = state.period if state.stamp is None else observation.stamp - state.stamp
        return replace(state, poses=poses, scans=scans, stamp=observation.stamp, period=min(max(period, 0.02), 0.5))

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
                people.append(judged(person, 0.0))
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

    def _feel(self, person: Person, state: TrackingState, unseen: float) -> tuple[Person, TrackingState]:
        """Bring the followed person up to the newest scan, if their legs are in it."""
        # Legs that the camera should see a person on, and does not, are a chair's; so may be all after a while.
        if not person.confirmed or person.misses > _MISSES or unseen > self.blind:
            return person, state
        now = person
        for returns in state.scans:
            # What is unseen was brought here by earlier scans; each may tell only once.
            told = -math.inf if unseen == 0 else person.felt
            if returns.stamp > max(told, now.track.stamp - _SCAN_PERIOD):
                track = felt(now.track, returns, self.noise)
                now = now if track is None else replace(now, track=track, felt=returns.stamp)
        # Who is seen stays in the state at the camera's time, which may be well before the scans'.
        kept = now if unseen > 0 else replace(person, felt=now.felt)
        people = tuple(kept if one.number == person.number else one for one in state.people)
        return now, replace(state, people=people)

    def _choose(self, state: TrackingState) -> TrackingState:
        """Stay with a person once confirmed, while they are remembered; else take the most trusted."""
        followed = next((one for one in state.people if one.number == state.followed), None)
        if followed is not None and followed.confirmed:
            state = replace(state, clothes=followed.clothes, parted=max(followed.seen, followed.felt))
        seen = [one for one in state.people if one.seen == state.stamp]
        hopeful = [one for one in seen if self._worth(one) and not self._is_stranger(one, state)]
        if followed is not None and followed.confirmed:
            lost = followed.track.stamp - max(followed.seen, followed.felt)
            if lost <= self.chase:
                return state
            # Whoever turns up where the lost person can have got to is them.
            hopeful = [one for one in hopeful if between(one, followed) < _SAME_PERSON + _HASTE * lost]
            if not hopeful:
                return state
        elif followed is not None and self._worth(followed) and not self._is_stranger(followed, state):
            hopeful.append(followed)
        if not hopeful:
            return replace(state, followed=None)
        # Whoever is faced already keeps a small lead.
        best = max(hopeful, key=lambda one: one.trust + 0.1 * (one is followed))
        return replace(state, followed=best.number)

    def _is_stranger(self, person: Person, state: TrackingState) -> bool:
        """Whether somebody wears what the person who was lost does not, and it is too early to take anybody."""
        if state.parted is None or state.stamp is None:
            return False
        return state.stamp - state.parted <= self.faithful and _is_other(person, state)

    def _worth(self, person: Person) -> bool:
        """Whether somebody is, or may yet turn out to be, a person."""
        return person.confirmed or person.age < self.doubt or person.trust > self.hint

    def _aim(self, person: Person, state: TrackingState, observation: Observation) -> _Aim:
        """Work out where the person is now, and which way leads there."""
        now = observation.now
        pose, track = pose_at(state.poses, now), predicted(person.track, now, self.noise)
        bearing, distance = bearing_range(track, pose)
        aim = _Aim(bearing, distance, *rates(track, pose), heading=bearing, hidden=False)
        if observation.scan is None or not person.confirmed:
            return aim
        around = scan_points(observation.scan, self.body)
        here = distance * np.array([math.cos(bearing), math.sin(bearing)])
        around = around[np.hypot(*(around - here).T) > _PERSONS_OWN]
        if distance - self.body.camera_x > self.target_distance - self.near_enough:
            leaning = state.detour or _LEAN * aim.bearing_rate
            reach = min(distance - 2 * _PERSONS_OWN, _LOOK_AHEAD)
            heading = free_heading(around, bearing, leaning, reach, self.margin, self.body)
            if heading is None:
                heading = free_heading(around, bearing, leaning, reach / 2, self.margin, self.body)
            aim = replace(aim, heading=heading)
        across = np.abs(around @ [-math.sin(bearing), math.cos(bearing)])
        along = around @ [math.cos(bearing), math.sin(bearing)]
        hidden = (across < _HIDES) & (along > 0) & (along < distance - _PERSONS_OWN)
        return replace(aim, hidden=bool(hidden.any()))

    def _steer(self, person: Person, aim: _Aim, unseen: float, lost: float) -> tuple[Twist, Mode, str]:
        heading = aim.bearing if aim.heading is None else aim.heading
        angular = self.angular_gain * heading + aim.bearing_rate
        angular = min(max(angular, -self.max_angular), self.max_angular)
        error = aim.distance - self.body.camera_x - self.target_distance
        # Sideways the robot would only lose sight: turn first, then drive.
        linear = (self.linear_gain * error + aim.range_rate) * max(math.cos(heading), 0.0) ** 2
        linear = min(max(linear, -self.max_linear), self.max_linear)
        if lost > self.coast:
            return Twist(0.0, angular), Mode.LOST, "turning where the person went"
        if not person.confirmed and linear > 0:
            if aim.distance * SMALLEST_WINDOW < person.window or person.trust < self.hint:
                return Twist(0.0, angular), Mode.FOLLOW, "facing somebody, not sure yet"
            linear = min(linear, self.max_linear / 2)
            return Twist(linear, angular), Mode.FOLLOW, "going nearer to see who it is"
        if abs(error) < self.near_enough and abs(aim.range_rate) < 0.1:
            if abs(aim.bearing) < self.straight_enough and abs(aim.bearing_rate) < _STEADY:
                return Twist(), Mode.HOLD, "the person is where they should be"
            return Twist(0.0, angular), Mode.HOLD, "turning with the person"
        if aim.heading is None:
            return Twist(-self.back_off, angular), Mode.BLOCKED, "backing off: no way around what is ahead"
        twist = Twist(linear, angular)
        if aim.heading != aim.bearing:
            return twist, Mode.FOLLOW, "going around something"
        if unseen == 0:
            return twist, Mode.FOLLOW, "following a person"
        return twist, Mode.FOLLOW, "following legs, or where the person should be"

    def _region(self, person: Person, state: TrackingState, observation: Observation) -> Region | None:
        """Where the person should be in the next frame."""
        if state.since_full + 1 >= self.full_every or not self._worth(person):
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


def _is_other(person: Person, state: TrackingState) -> bool:
    """Whether somebody clearly wears something else than the person followed last."""
    return unlikeness(state.clothes, person.clothes) > OTHER_CLOTHES
