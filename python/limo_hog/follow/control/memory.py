"""What the tracking controller remembers from frame to frame, and what it believes by that of the people around."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from limo_hog.follow.control.backing import Other
from limo_hog.follow.control.lookout import Hunt
from limo_hog.follow.control.selection import Choice
from limo_hog.follow.decision import Believed
from limo_hog.follow.sense.clearance import NO_POINTS, Points
from limo_hog.follow.space.grid import Ground
from limo_hog.follow.tracks.kalman import Noise, Track, bearing_range, predict
from limo_hog.follow.tracks.poses import pose_at
from limo_hog.follow.tracks.tracker import Tracks
from limo_hog.follow.twist import Twist


@dataclass(frozen=True, slots=True)
class TrackingState:
    """What the controller remembers.

    Attributes
    ----------
    tracks
        All tracked people.
    choice
        Which of them is followed.
    side
        Which way to search: 1 left, -1 right.
    detour
        How far off the direct way to the person the robot drives [rad].
    since_full
        Frames since the whole image was searched [1].
    ground
        What stands where; None before the first scan.
    known
        The followed person's track when last measured; None before anyone was followed.
    hunt
        What is remembered while looking for that person; None while they are measured.
    way, way_at
        float64 (N, 2) [m], odometry frame: the way to the person where the direct one is not free; when planned [s].
    way_out
        Direction in the odometry frame [rad] and speed [m/s] by which it gives way, and since when [s]; None while it
        does not.
    gave_way_at
        When it last gave way [s].
    acceleration
        Of the wheels, as learnt [m/s²].
    sent
        The last command.
    others
        Other people than the followed one, measured lately.
    brisk
        How fast the followed person walks at most, as far as known [m/s].
    """

    tracks: Tracks = field(default_factory=Tracks)
    choice: Choice = field(default_factory=Choice)
    side: float = 1.0
    detour: float = 0.0
    since_full: int = 0
    ground: Ground | None = None
    known: Track | None = None
    hunt: Hunt | None = None
    way: Points = field(default_factory=lambda: NO_POINTS)
    way_at: float = -math.inf
    way_out: tuple[float, float, float] | None = None
    gave_way_at: float = -math.inf
    acceleration: float = 1.0
    sent: Twist = field(default_factory=Twist)
    others: tuple[Other, ...] = ()
    brisk: float = 0.0


def believed(state: TrackingState, now: float, noise: Noise) -> tuple[Believed, ...]:
    """Return everyone tracked, in the base frame, as of the newest stamp `now` [s]."""
    boxes, likeness = dict(state.tracks.boxes), state.choice.likeness
    pose = pose_at(state.tracks.poses, now)
    people = []
    for one in state.tracks.people:
        track = predict(one.track, now, noise)
        bearing, distance = bearing_range(track, pose)
        speed, heading = math.hypot(*track.mean[2:]), math.atan2(track.mean[3], track.mean[2]) - pose.yaw
        people.append(
            Believed(
                distance * math.cos(bearing),
                distance * math.sin(bearing),
                one.existence,
                one.number,
                speed * math.cos(heading),
                speed * math.sin(heading),
                boxes.get(one.number),
                None if likeness is None else likeness.of(one.number),
            )
        )
    return tuple(people)
