"""A walking person: route, gait and body as pure functions of time.

The gait is tied to the distance walked, so feet do not slide however slow the person is. Body lengths are
fractions of the stature; the body's own frame is x forward, y left, z up from the floor between the feet.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from limo_sim.world.furniture import Colour, Disc
from limo_sim.world.people import Person

Point = tuple[float, float, float]
Capsule = tuple[Point, Point, float, float, str]
Ellipsoid = tuple[Point, Point, float, str]

STRIDE = 0.75 / 0.9
"""Length of a gait cycle (two steps) in statures: 0.75 m for the workshop's person of 0.9 m."""
# A turn at a corner takes this long, and the limbs start or stop swinging within the second [s]. Chosen by eye.
_TURN_S, _EASE_S = 0.5, 0.25

# Lengths of the limbs in statures; the whole body was chosen so that OpenCV's HOG model finds it from every side.
_THIGH = _SHIN = 0.245
_UPPER_ARM, _FOREARM = 0.165, 0.145
# Height of a stool's seat, and how far it stands behind the middle of who sits on it, in statures. Chosen.
_SEAT, _SEAT_BACK = 0.24, 0.13
# Half axes of the ellipse that a trunk is to the depth camera. Measured: median depth at the middle of HOG's box, 8
# directions, 6 phases of the gait, 1.5 … 3 m, statures 0.82 … 1 m. From the front .052, diagonally .077, from the side
# .09 of the stature, standard deviation .02.
_TRUNK_HALF_DEPTH, _TRUNK_HALF_BREADTH = 0.052, 0.090


@dataclass(frozen=True, slots=True)
class Pose:
    """Where a person is, and the phase of the gait."""

    #: x, y, yaw: in the arena's frame [m, m, rad]
    x: float
    y: float
    yaw: float
    phase: float = 0.0  #: of the gait [rad]; a cycle is two steps
    swing: float = 0.0  #: 1 when walking, 0 when standing


def earlier(before: Pose | None, now: Pose | None, steps: float) -> Pose | None:
    """Return where a person was some steps before `now`, who walked on from `before` in the last of them."""
    if before is None or now is None:
        return now
    return Pose(
        x=now.x - steps * (now.x - before.x),
        y=now.y - steps * (now.y - before.y),
        yaw=now.yaw - steps * math.remainder(now.yaw - before.yaw, math.tau),
        phase=now.phase - steps * math.remainder(now.phase - before.phase, math.tau),
        swing=now.swing,
    )


@dataclass(frozen=True, slots=True)
class _RouteLeg:
    """The way from one corner of a route to the next, and the pauses at both."""

    #: begins, duration: when the leg begins within a lap, and how long the walk takes [s]
    begins: float
    duration: float
    #: walked, length: way walked in the lap before, and on this leg [m]
    walked: float
    length: float
    heading: float  #: direction of the walk [rad]
    #: pause_before, pause_after: time spent standing at either end [s]
    pause_before: float
    pause_after: float


class Walk:
    """The timetable of one person's route."""

    def __init__(self, person: Person) -> None:
        self.person = person
        self._legs: list[_RouteLeg] = []
        clock = walked = 0.0
        corners = person.route
        for (x, y, pause), (next_x, next_y, next_pause) in zip(corners, corners[1:] + corners[:1], strict=True):
            length = math.hypot(next_x - x, next_y - y)
            heading = math.atan2(next_y - y, next_x - x) if length else person.facing
            duration = length / person.speed
            self._legs.append(_RouteLeg(clock, duration, walked, length, heading, pause, next_pause))
            clock += duration + next_pause
            walked += length
        self._begins = [leg.begins for leg in self._legs]
        self._lap_s, self._lap_m = clock, walked

    def pose(self, time: float) -> Pose | None:
        """Return the pose at `time` [s] after the start; None before the person arrives and after the person left."""
        person = self.person
        since = time - person.arrives_s
        if since < 0 or time >= person.leaves_s:
            return None
        if self._lap_m == 0:
            return Pose(person.route[0][0], person.route[0][1], person.facing)
        laps, clock = divmod(since, self._lap_s)
        index = bisect_right(self._begins, clock) - 1
        leg = self._legs[index]
        clock -= leg.begins
        walked = min(clock * person.speed, leg.length)
        x, y, _ = person.route[index]
        metres = laps * self._lap_m + leg.walked + walked
        return Pose(
            x=x + walked * math.cos(leg.heading),
            y=y + walked * math.sin(leg.heading),
            yaw=self._yaw(index, clock, first=laps == 0 and index == 0),
            phase=math.tau * metres / (STRIDE * person.height) % math.tau,
            swing=_swing(leg, clock),
        )

    def _yaw(self, index: int, clock: float, *, first: bool) -> float:
        """Heading, with half a second for a turn: the end of the pause, or the first steps after it."""
        leg = self._legs[index]
        turned = (clock + min(leg.pause_before, _TURN_S)) / _TURN_S
        if turned < 1.0 and not first:
            return _blend(self._legs[index - 1].heading, leg.heading, turned)
        turned = (clock - leg.duration - max(leg.pause_after - _TURN_S, 0.0)) / _TURN_S
        if turned > 0.0:
            return _blend(leg.heading, self._legs[(index + 1) % len(self._legs)].heading, turned)
        return leg.heading


def _swing(leg: _RouteLeg, clock: float) -> float:
    """How much the limbs swing: eased in after a pause and out before one."""
    rise = clock / _EASE_S if leg.pause_before > 0 else 1.0
    fall = (leg.duration - clock) / _EASE_S if leg.pause_after > 0 else 1.0
    return smooth(min(rise, fall))


def smooth(share: float) -> float:
    """Rise from 0 to 1 with its share of the way, slowly at both ends."""
    share = min(max(share, 0.0), 1.0)
    return share * share * (3.0 - 2.0 * share)


def _blend(start: float, end: float, share: float) -> float:
    turn = (end - start + math.pi) % math.tau - math.pi
    return start + smooth(share) * turn


@dataclass(frozen=True, slots=True)
class BodyMesh:
    """The solids a person is made of, in the arena's frame."""

    #: start, end: float64 (N, 3): the axes of tapered capsules [m].
    start: NDArray[np.float64]
    end: NDArray[np.float64]
    #: start_radius, end_radius: float64 (N,): the radii of the balls at the ends [m].
    start_radius: NDArray[np.float64]
    end_radius: NDArray[np.float64]
    centre: NDArray[np.float64]  #: float64 (M, 3): the centres of ellipsoids [m]
    axes: NDArray[np.float64]  #: float64 (M, 3, 3): their semi-axes as columns [m]


def _limb_angles(phase: float, swing: float) -> tuple[float, float, float]:
    """Hip, shin and foot angle from the vertical or the floor [rad], forward and toes-up positive."""
    hip = swing * 0.40 * math.sin(phase)
    knee = 0.03 + swing * (0.04 + 0.85 * max(0.0, math.cos(phase + 0.25)) ** 2)
    return hip, hip - knee, 0.6 * (hip - knee)


def _shifted(capsules: list[Capsule], ahead: float, up: float) -> list[Capsule]:
    return [
        ((x0 + ahead, y0, z0 + up), (x1 + ahead, y1, z1 + up), r0, r1, name)
        for (x0, y0, z0), (x1, y1, z1), r0, r1, name in capsules
    ]


def _along(start: Point, direction: Point, length: float) -> Point:
    return start[0] + length * direction[0], start[1] + length * direction[1], start[2] + length * direction[2]


def _legs(pose: Pose) -> tuple[list[Capsule], float]:
    """Capsules of both legs (ends, radii, colour) and the height of the hips, for stature 1."""
    capsules: list[Capsule] = []
    soles = []
    for side, phase in ((1, pose.phase), (-1, pose.phase + math.pi)):
        hip, shin, foot = _limb_angles(phase, pose.swing)
        y = side * 0.05
        knee = (_THIGH * math.sin(hip), y, -_THIGH * math.cos(hip))
        ankle = (knee[0] + _SHIN * math.sin(shin), y, knee[2] - _SHIN * math.cos(shin))
        cos, sin = math.cos(foot), math.sin(foot)
        sole = ankle[2] - 0.012
        heel = (ankle[0] - 0.025 * cos, y, sole - 0.025 * sin)
        toe = (ankle[0] + 0.095 * cos, y + side * 0.012, sole + 0.095 * sin)
        capsules += [
            ((0.0, side * 0.047, 0.0), knee, 0.056, 0.040, "trousers"),
            (knee, ankle, 0.040, 0.027, "trousers"),
            (heel, toe, 0.026, 0.021, "shoes"),
        ]
        soles.append(min(heel[2] - 0.026, toe[2] - 0.021))
    hips = -min(soles)
    return _shifted(capsules, 0.0, hips), hips


def _seated_legs() -> tuple[list[Capsule], float]:
    """Capsules of the legs of a person on a stool, and of the stool's; the height of the hips, for stature 1."""
    capsules: list[Capsule] = []
    for side in (1, -1):
        y = side * 0.05
        knee, ankle = (_THIGH - _SEAT_BACK, y * 1.2, _SEAT + 0.045), (_THIGH - _SEAT_BACK + 0.02, y * 1.2, 0.038)
        capsules += [
            ((-_SEAT_BACK, y, _SEAT + 0.05), knee, 0.056, 0.040, "trousers"),
            (knee, ankle, 0.040, 0.027, "trousers"),
            ((ankle[0] - 0.025, ankle[1], 0.026), (ankle[0] + 0.095, ankle[1], 0.021), 0.026, 0.021, "shoes"),
        ]
    for x, y in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
        top, foot = (0.055 * x - _SEAT_BACK, 0.055 * y, _SEAT), (0.075 * x - _SEAT_BACK, 0.075 * y, 0.012)
        capsules.append((top, foot, 0.012, 0.012, "stool"))
    return capsules, _SEAT + 0.05


def _skeleton(pose: Pose, *, sits: bool) -> tuple[list[Capsule], list[Ellipsoid]]:
    """Capsules (ends, radii, colour) and ellipsoids (centre, semi-axes, twist, colour) for stature 1."""
    if not sits:
        legs, hips = _legs(pose)
        capsules, ellipsoids = _trunk(pose, hips, 0.0, 0.0)
        return [*legs, *capsules], ellipsoids
    legs, hips = _seated_legs()
    capsules, ellipsoids = _trunk(pose, hips, 0.1, 0.75)
    back = -_SEAT_BACK
    seat: Ellipsoid = ((back, 0.0, _SEAT - 0.005), (0.085, 0.085, 0.022), 0.0, "stool")
    return [*legs, *_shifted(capsules, back, 0.0)], [
        *(((c[0] + back, *c[1:]), a, t, name) for c, a, t, name in ellipsoids),
        seat,
    ]


def _trunk(pose: Pose, hips: float, arms: float, bent: float) -> tuple[list[Capsule], list[Ellipsoid]]:
    """All above the legs: hips at a height, upper arms and elbows bent forward by so much [rad], for stature 1."""
    phase, swing = pose.phase, pose.swing
    twist = swing * 0.12 * math.sin(phase)
    cos, sin = math.cos(twist), math.sin(twist)
    shoulders = hips + 0.285
    across = 0.092 * sin, 0.092 * cos
    capsules: list[Capsule] = [
        ((across[0], -across[1], shoulders), (-across[0], across[1], shoulders), 0.038, 0.038, "shirt")
    ]
    for side in (1, -1):
        upper = arms + 0.03 - side * swing * 0.38 * math.sin(phase)
        fore = upper + bent + 0.16 + 0.14 * swing
        shoulder = (-side * 0.112 * sin, side * 0.112 * cos, shoulders - 0.008)
        elbow = (
            shoulder[0] + _UPPER_ARM * math.sin(upper),
            shoulder[1] + side * 0.018,
            shoulder[2] - _UPPER_ARM * math.cos(upper),
        )
        reach = (math.sin(fore), -side * 0.05, -math.cos(fore))
        wrist = _along(elbow, reach, _FOREARM)
        palm = _along(wrist, reach, 0.045)
        capsules += [
            (shoulder, elbow, 0.036, 0.028, "shirt"),
            (elbow, wrist, 0.028, 0.021, "shirt"),
            (wrist, palm, 0.019, 0.022, "skin"),
        ]
    capsules.append(((0.0, 0.0, shoulders + 0.01), (0.006, 0.0, shoulders + 0.09), 0.030, 0.026, "skin"))
    head = shoulders + 0.122
    ellipsoids = [
        ((0.0, 0.0, hips + 0.020), (0.062, 0.090, 0.080), 0.0, "trousers"),
        ((0.002, 0.0, hips + 0.120), (0.057, 0.084, 0.150), 0.5 * twist, "shirt"),
        ((0.004, 0.0, hips + 0.195), (0.061, 0.097, 0.130), twist, "shirt"),
        ((0.010, 0.0, head), (0.052, 0.046, 0.066), 0.0, "skin"),
        ((0.004, 0.0, head + 0.042), (0.050, 0.050, 0.036), 0.0, "hair"),
        ((-0.014, 0.0, head + 0.014), (0.043, 0.049, 0.056), 0.0, "hair"),
        ((0.060, 0.0, head - 0.012), (0.012, 0.008, 0.013), 0.0, "skin"),
        ((0.0555, 0.018, head + 0.006), (0.005, 0.0055, 0.004), 0.0, "hair"),
        ((0.0555, -0.018, head + 0.006), (0.005, 0.0055, 0.004), 0.0, "hair"),
    ]
    return capsules, ellipsoids


def body(person: Person, pose: Pose) -> BodyMesh:
    """Build a person's body in a pose; the lower foot touches the floor."""
    capsules, ellipsoids = _skeleton(pose, sits=person.sits)
    height, girth = person.height, person.girth
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    turn = height * np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    origin = np.array([pose.x, pose.y, 0.0])
    points = np.array([point for capsule in capsules for point in capsule[:2]]) @ turn.T + origin
    radii = np.array([capsule[2:4] for capsule in capsules]) * (height * girth)
    twists = [(math.cos(twist), math.sin(twist)) for _, _, twist, _ in ellipsoids]
    axes = np.array(
        [
            [[c * a * girth, -s * b * girth, 0.0], [s * a * girth, c * b * girth, 0.0], [0.0, 0.0, h]]
            for (_, (a, b, h), _, _), (c, s) in zip(ellipsoids, twists, strict=True)
        ]
    )
    return BodyMesh(
        start=points[0::2],
        end=points[1::2],
        start_radius=radii[:, 0],
        end_radius=radii[:, 1],
        centre=np.array([ellipsoid[0] for ellipsoid in ellipsoids]) @ turn.T + origin,
        axes=turn @ axes,
    )


def colours(person: Person) -> list[Colour]:
    """Return the colour of each of a body's solids, capsules first."""
    palette = {
        "shirt": person.shirt,
        "trousers": person.trousers,
        "skin": person.skin,
        "hair": person.hair,
        "shoes": (34, 30, 30),
        "stool": (150, 108, 72),
    }
    capsules, ellipsoids = _skeleton(Pose(0, 0, 0), sits=person.sits)
    return [palette[name] for *_, name in capsules] + [palette[name] for *_, name in ellipsoids]


def trunk_radius(person: Person, pose: Pose, direction: float) -> float:
    """Return the distance [m] from the person's axis to the surface of the trunk that faces a camera.

    The camera looks at the person in a direction [rad] of the arena's frame.
    """
    turn = direction - pose.yaw
    depth, breadth = _TRUNK_HALF_DEPTH * math.cos(turn), _TRUNK_HALF_BREADTH * math.sin(turn)
    radius = person.height * person.girth * math.hypot(depth, breadth)
    # Who sits has the trunk behind the axis, which goes through the thighs.
    return radius + (person.height * _SEAT_BACK * math.cos(turn) if person.sits else 0.0)


def legs_at(person: Person, pose: Pose, height: float) -> list[Disc]:
    """Cut a person's legs with a horizontal plane at a height [m] below the hands."""
    cut = []
    cos, sin = person.height * math.cos(pose.yaw), person.height * math.sin(pose.yaw)
    level = height / person.height
    for (x0, y0, z0), (x1, y1, z1), r0, r1, _ in (_seated_legs() if person.sits else _legs(pose))[0]:
        rise = z1 - z0
        share = min(max((level - z0) / rise if rise else 0.5, 0.0), 1.0)
        radius, above = person.girth * (r0 + share * (r1 - r0)), level - (z0 + share * rise)
        if abs(above) < radius:
            x, y = x0 + share * (x1 - x0), y0 + share * (y1 - y0)
            size = person.height * math.sqrt(radius**2 - above**2)
            cut.append(Disc(pose.x + cos * x - sin * y, pose.y + sin * x + cos * y, size))
    return cut
