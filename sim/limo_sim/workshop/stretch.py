"""The stretch tasks' scenes and checkpoints: each holds on evidence of the node's own doing, as the workshop's do."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.robot import LIMO
from limo_hog.ros2 import names
from limo_hog.suppression import intersection_over_union
from limo_sim.workshop import checkpoints as points
from limo_sim.workshop.checkpoints import CLEAR_ERROR, RED, RIGHT_LINES, SILENCE, Checkpoint, Picture
from limo_sim.workshop.mistakes import Finding
from limo_sim.workshop.scenes import AHEAD, LEFT, NOBODY, RIGHT, TWO, Look, Scene, Take, standing
from limo_sim.world.furniture import distance_to
from limo_sim.world.scenario import Furniture, Person, Scenario

#: Overlap of a drawn box with a person's outline from which it is on that person. Measured: HOG's boxes, which have a
#: margin, have .3 to .4 (intersection over union), and less than .05 with the other person.
ON_PERSON = 0.2
#: Wanted between the robot and the chair [m]: the task's half metre, which is from the lidar to the chair's legs, less
#: the time of a scan and of braking.
LEAST_CLEARANCE = 0.2


def speeds(takes: Sequence[Take], scene: str) -> list[float]:
    """Return the last forward speed that answers each picture of a scene with a person found in it [m/s]."""
    looks = [look for take in takes if take.scene.name == scene for look in take.looks]
    return [look.commands[-1].twist.linear for look in looks if look.commands and len(look.found)]


def reads(task: int, topic: str, what: str) -> Checkpoint:
    """Return the checkpoint that a topic is subscribed to."""

    def judge(takes: Sequence[Take]) -> Finding:
        calls = takes[0].calls
        if topic not in calls.readers:
            return Finding(False, f"the node does not subscribe to {topic!r}, which has {what}")
        return Finding(True, f"subscribes to {topic!r}", calls.readers[topic])

    hint = f"self.create_subscription(…, {topic!r}, self.on_…, 10); keep the newest message."
    return Checkpoint(task, f"{what} is read", 20, judge, (hint,))


def _people(look: Look) -> int:
    """Return how many people the picture shows."""
    return sum(person is not None and person.box is not None and person.visible > 0.5 for person in look.truth.people)


def red_on_person(takes: Sequence[Take]) -> Finding:
    """Whether every window of a scene with people has its red box on one of them."""
    tried = right = 0
    worst = ""
    for take in takes:
        for look in take.looks[1:]:
            if not _people(look):
                continue
            tried += 1
            if any(_red_is_on(look, index) for index in range(len(look.truth.people))):
                right += 1
            elif not worst:
                worst = f"{take.scene.words}, frame at {look.time:.1f} s: no red box, (0, 0, 255), is on a person"
    if not tried or right < RIGHT_LINES * tried:
        return Finding(False, worst or "no picture with a person was seen")
    return Finding(True, f"the red box is on a person in {right} of {tried} frames")


def _off_the_middle(look: Look) -> bool:
    """Whether the person is so far off the picture's middle that the robot must turn."""
    boxes = [person.box for person in look.truth.people if person is not None and person.box is not None]
    return any(abs(x + w / 2 - look.image.shape[1] / 2) > CLEAR_ERROR for x, _, w, _ in boxes)


def _red_is_on(look: Look, index: int) -> bool:
    return any(_overlap(box, look, index) for box in _reds(look))


def _reds(look: Look) -> Iterator[NDArray[np.int32]]:
    """Yield the red box in each window of the last half second."""
    for shown in look.windows.values():
        picture: Picture = shown.picture
        if look.time - shown.time > SILENCE or picture.ndim != 3:
            continue
        rows, columns = np.nonzero((picture == RED).all(axis=2))
        if len(rows) > 40:
            left, top = columns.min(), rows.min()
            yield np.array([left, top, columns.max() - left, rows.max() - top], np.int32)


def _overlap(box: NDArray[np.int32], look: Look, index: int) -> bool:
    """Whether a box is on a person: intersection over union with the person's outline."""
    person = look.truth.people[index] if index < len(look.truth.people) else None
    if person is None or person.box is None:
        return False
    return bool(intersection_over_union(box[None], np.array([person.box])).item() >= ON_PERSON)


# A: slow down

FAR = Scene("far", "a person stands 3.4 m ahead", standing((3.4, 0.0)), 0.6)
HALF_WAY = Scene("half way", "a person stands 2.6 m ahead", standing((2.6, 0.0)), 0.6)
NEAR = Scene("near", "a person stands 1.9 m ahead", standing((1.9, 0.0)), 0.6)
SLOW_SCENES = (FAR, HALF_WAY, NEAR, NOBODY)


def slows(takes: Sequence[Take]) -> Finding:
    """Whether the nearer person is approached the more slowly."""
    means = {scene.name: float(np.median(speeds(takes, scene.name) or [np.nan])) for scene in SLOW_SCENES[:3]}
    said = ", ".join(f"{speed:.2f} m/s {name}" for name, speed in means.items())
    if np.isnan(list(means.values())).any():
        return Finding(None, "not tried: a person was not found, or no command answers the picture")
    if means["far"] <= 0:
        return Finding(False, f"{said}: the robot does not drive towards a person far away")
    if means["far"] - means["near"] < 0.05:
        return Finding(False, f"{said}: the speed does not depend on the distance")
    if not means["near"] <= means["half way"] <= means["far"]:
        return Finding(False, f"{said}: the robot must not be faster when nearer")
    return Finding(True, said)


SLOW = (
    reads(6, names.DEPTH, "the depth image"),
    Checkpoint(
        6,
        "the robot is slower when nearer",
        60,
        slows,
        (
            "Take the median of the depths around the box's centre; nan, inf and 0 mean unknown.",
            "twist.linear.x = float(np.clip(0.5 * (distance - 1.5), -0.3, 0.3))",
        ),
    ),
    Checkpoint(6, "it stands while no person is found", 20, points.stands, ("Publish Twist() when boxes is empty.",)),
)

# B: fewer boxes

MERGE_SCENES = (LEFT, AHEAD, TWO)


def every_hit(takes: Sequence[Take]) -> Finding:
    """Whether the detector returns more boxes than people: the merging is then the node's own."""
    looks = [look for take in takes for look in take.looks if look.raw is not None]
    more = [look for look in looks if len(look.found) > _people(look) > 0]
    if not more:
        return Finding(False, "the detector returns no more boxes than people: give detectMultiScale groupThreshold=0")
    most = max(len(look.found) for look in more)
    return Finding(True, f"the detector returns up to {most} boxes of {_people(more[0])} person")


def merged(takes: Sequence[Take]) -> Finding:
    """Whether the number that is logged is that of the people, while the detector returns many boxes."""
    right = tried = 0
    worst = ""
    for take in takes:
        for look in take.looks:
            numbers = [re.findall(r"\d+", line) for line in look.said]
            if not len(look.found) > _people(look) > 0 or not any(numbers):
                continue
            tried += 1
            if any(str(_people(look)) in found for found in numbers):
                right += 1
            else:
                worst = (
                    f"{take.scene.words}: {len(look.found)} boxes, {_people(look)} person, logged: {look.said[-1]!r}"
                )
    if not tried:
        return Finding(None, "not tried: no log line has a number while the detector returns many boxes")
    if right < RIGHT_LINES * tried:
        return Finding(False, worst)
    return Finding(True, f"{right} of {tried} log lines have the number of people")


MERGE = (
    Checkpoint(
        7, "every hit is asked for", 20, every_hit, ("detectMultiScale groups by itself, unless groupThreshold=0.",)
    ),
    Checkpoint(
        7,
        "the number of people is logged",
        50,
        merged,
        (
            "Keep the box with the greatest weight, drop what overlaps it, and go on with the rest.",
            "Log len(kept): f'Detections: {len(kept)}'.",
        ),
    ),
    Checkpoint(7, "the red box is on a person", 30, red_on_person, ("Draw the kept box with the greatest weight.",)),
)

# C: another detector

DETECTOR_SCENES = (LEFT, RIGHT, NOBODY)


def no_hog(takes: Sequence[Take]) -> Finding:
    """Whether people are found without OpenCV's HOG detector: a red box is on the person."""
    if any(take.outcome is not None and take.outcome.stage.detector_inputs for take in takes):
        return Finding(False, "cv2's HOGDescriptor is still asked: detectMultiScale runs")
    return red_on_person(takes)


def turns_to(takes: Sequence[Take]) -> Finding:
    """Whether the robot turns to the person's side, who stands left and right, by the arena's truth."""
    sides: dict[int, list[bool]] = {}
    for take in takes:
        wanted = {"left": 1, "right": -1}.get(take.scene.name, 0)
        for look in take.looks if wanted else ():
            if look.commands and _off_the_middle(look):
                sides.setdefault(wanted, []).append(look.commands[-1].twist.angular * wanted > 0)
                if not sides[wanted][-1]:
                    said = f"{take.scene.words}, frame at {look.time:.1f} s: the command is {points.command_of(look)}"
                    return Finding(False, said, look.commands[-1].line)
    if len(sides) < 2:
        return Finding(None, "not tried: no command answers a person on either side")
    return Finding(True, "left of the middle turns left, right turns right")


def stands_alone(takes: Sequence[Take]) -> Finding:
    """Whether the empty room is answered with a stop, while a person is answered with a motion."""
    empty = [look for take in takes if take.scene.name == "nobody" for look in take.looks if look.commands]
    seen = [look for take in takes if take.scene.name != "nobody" for look in take.looks if look.commands]
    moving = [c for look in seen for c in look.commands if c.twist.linear or c.twist.angular]
    if not empty or not moving:
        return Finding(None, "not tried: no command answers the empty room, or none answers a person")
    for look in empty:
        last = look.commands[-1]
        if last.twist.linear or last.twist.angular:
            return Finding(False, f"the room is empty, yet the command is {points.command_of(look)}", last.line)
    return Finding(True, f"{len(empty)} frames of the empty room are answered with a zero Twist")


DETECTOR = (
    Checkpoint(
        8, "another detector finds the person", 50, no_hog, ("Draw the best box in (0, 0, 255) and show the picture.",)
    ),
    Checkpoint(8, "the robot turns to the person", 30, turns_to, ("The error is middle - cx.",)),
    Checkpoint(8, "it stands in an empty room", 20, stands_alone, ("Publish Twist() when nobody is found.",)),
)

# D: track

#: The first person stands on the right; from 1.5 s on a second stands nearer on the left, and HOG is surer of that one.
CROSSING = Scene(
    "joined",
    "a second person appears, nearer than the first",
    Scenario(
        name="workshop check",
        people=(
            Person(route=((3.6, -0.8, 3600.0),), facing=0.0),
            Person(route=((2.8, 0.6, 3600.0),), facing=0.0, arrives_s=1.5),
        ),
    ),
    3.5,
)
TRACK_SCENES = (CROSSING, LEFT, NOBODY)


def stays(takes: Sequence[Take]) -> Finding:
    """Whether the red box stays on the person who was followed first."""
    looks = [look for take in takes if take.scene.name == "joined" for look in take.looks]
    both = [look for look in looks if _people(look) == 2 and len(look.found) > 1]
    telling = [look for look in both if _overlap(look.found.windows[int(np.argmax(look.found.scores))], look, 1)]
    if not telling:
        return Finding(None, "not tried: the second person was not found, or not surer than the first")
    if not any(_red_is_on(look, 0) for look in looks if look not in both):
        return Finding(None, "not tried: the first person had no red box before the second came")
    wrong = [look for look in telling if not _red_is_on(look, 0)]
    if len(wrong) > (1 - RIGHT_LINES) * len(telling):
        said = f"frame at {wrong[0].time:.1f} s: the red box leaves the first person for one HOG is surer of"
        return Finding(False, said)
    return Finding(
        True, f"the red box stays on the first person in {len(telling) - len(wrong)} of {len(telling)} frames"
    )


TRACK = (
    Checkpoint(
        9,
        "the person followed first stays the one",
        70,
        stays,
        (
            "Remember the last box's centre in self; where there is one, take the box nearest to it.",
            "best = min(range(len(boxes)), key=lambda i: abs(centre(boxes[i]) - self.last))",
        ),
    ),
    Checkpoint(9, "it stands while no person is found", 30, points.stands, ("Publish Twist() when boxes is empty.",)),
)

# E: the laser

CHAIR = Scene(
    "chair",
    "a chair stands between robot and person",
    Scenario(
        name="workshop check",
        people=(Person(route=((3.4, 0.0, 3600.0),), facing=0.0),),
        furniture=(Furniture(kind="chair", x=1.5, y=0.0),),
    ),
    7.0,
)
LASER_SCENES = (CHAIR, FAR)


def stops(takes: Sequence[Take]) -> Finding:
    """Whether a robot that drives to people stops before the chair."""
    take = next(take for take in takes if take.scene.name == "chair")
    if take.outcome is None or not any(speed > 0 for speed in speeds(takes, "far")):
        return Finding(None, "not tried: the robot does not drive to a person in a free room")
    way = max(x for x, _, _ in take.path)
    if way < 0.1:
        return Finding(None, "not tried: the robot does not drive towards the chair")
    if take.outcome.episode.contacts.wall:
        return Finding(False, f"the robot drives {way:.2f} m and into the chair")
    room = min(_room(pose) for pose in take.path)
    said = f"the robot drives {way:.2f} m and stops {room:.2f} m before the chair"
    if room < LEAST_CLEARANCE:
        return Finding(False, f"{said}; wanted are at least {LEAST_CLEARANCE} m")
    return Finding(True, said)


def _room(robot: tuple[float, float, float]) -> float:
    """Return the distance from the chair to the nearest of the robot's corners, its pose being x, y, yaw [m]."""
    x, y, yaw = robot
    cos, sin = math.cos(yaw), math.sin(yaw)
    (chair,) = CHAIR.scenario.furniture
    return min(
        distance_to(chair.footprint, x + cos * ahead - sin * left, y + sin * ahead + cos * left)
        for ahead in (-LIMO.half_length, LIMO.half_length)
        for left in (-LIMO.half_width, LIMO.half_width)
    )


def drives_freely(takes: Sequence[Take]) -> Finding:
    """Whether the robot drives to a person with nothing in between."""
    return points.drives([take for take in takes if take.scene.name == "far"])


LASER = (
    reads(10, names.SCAN, "the scan"),
    Checkpoint(
        10,
        "the robot stops before the chair",
        60,
        stops,
        (
            "Take the least finite range of the beams ahead, |angle| < 0.4; below 0.5 m, linear.x = 0.",
            "ahead = [r for i, r in enumerate(scan.ranges) if abs(scan.angle_min + i * scan.angle_increment) < 0.4]",
        ),
    ),
    Checkpoint(10, "it drives where the way is free", 20, drives_freely, ("Stop for what is ahead alone.",)),
)
