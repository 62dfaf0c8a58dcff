"""What the follower finds, as the messages that others read: boxes, people, the followed person's pose and frame."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from limo_hog.detections import Detections
from limo_hog.follow.decision import Believed
from limo_hog.follow.robot import Twist
from limo_hog.ros2 import messages, names
from limo_hog.ros2.messages import default_message, stamped

#: The followed person's frame in TF; every tracked person has `person_NUMBER`.
PERSON_FRAME = "followed_person"


def detections_message(stamp: float, found: Detections, frame: str, ids: Mapping[int, int] | None = None) -> Any:
    """Return the boxes around people in an image taken at `stamp` [s] as vision_msgs/Detection2DArray, best first.

    Centres and sizes are in pixels, scores as the SVM gave them; `frame` is the camera's. `ids` has the number of a
    tracked person by the index of the box; a box of none has an empty id.
    """
    array = stamped(names.DETECTIONS_TYPE, stamp, frame)
    for index, (box, score) in enumerate(found):
        one = default_message("vision_msgs/msg/Detection2D")
        result = default_message("vision_msgs/msg/ObjectHypothesisWithPose")
        result.hypothesis.class_id, result.hypothesis.score = "person", score
        x, y, w, h = (float(value) for value in box)
        one.header = array.header
        one.results = [result]
        one.bbox.center.position.x, one.bbox.center.position.y = x + w / 2, y + h / 2
        one.bbox.size_x, one.bbox.size_y = w, h
        one.id = str(ids[index]) if ids is not None and index in ids else ""
        array.detections.append(one)
    return array


def person_pose(stamp: float, person: Believed, base: str = messages.BASE_FRAME) -> Any:
    """Return a person's geometry_msgs/PoseStamped in the frame `base`; its x axis points away from the robot.

    A planner that drives to this pose so ends with its camera on the person.
    """
    pose = stamped(names.FINDINGS[names.PERSON], stamp, base)
    pose.pose.position.x, pose.pose.position.y = person.x, person.y
    half = math.atan2(person.y, person.x) / 2
    pose.pose.orientation.z, pose.pose.orientation.w = math.sin(half), math.cos(half)
    return pose


def people_message(stamp: float, people: Sequence[Believed], base: str = messages.BASE_FRAME) -> Any:
    """Return everyone tracked as people_msgs/People in the frame `base`, the likeliest first.

    Names are the tracks' numbers, reliability is the probability of being a person.
    """
    array = stamped(names.FINDINGS[names.PEOPLE], stamp, base)
    for person in sorted(people, key=lambda one: -one.probability):
        one = default_message("people_msgs/msg/Person")
        one.name, one.reliability = str(person.number), float(person.probability)
        one.position.x, one.position.y = person.x, person.y
        one.velocity.x, one.velocity.y = person.vx, person.vy
        array.people.append(one)
    return array


def person_frames(
    stamp: float, people: Sequence[Believed], followed: int | None, base: str = messages.BASE_FRAME
) -> Any:
    """Return the TFMessage of everyone tracked: `person_NUMBER`, and `followed_person` once more, in `base`."""
    message = default_message("tf2_msgs/msg/TFMessage")
    for person in people:
        frames = [f"person_{person.number}"] + [PERSON_FRAME] * (person.number == followed)
        pose = person_pose(stamp, person, base)
        for frame in frames:
            one = default_message("geometry_msgs/msg/TransformStamped")
            one.header, one.child_frame_id = pose.header, frame
            one.transform.translation.x, one.transform.translation.y = person.x, person.y
            one.transform.rotation = pose.pose.orientation
            message.transforms.append(one)
    return message


def stamped_twist(stamp: float, command: Twist, base: str = messages.BASE_FRAME) -> Any:
    """Return a velocity command with its time, in the frame `base`."""
    message = stamped(names.STAMPED_COMMAND_TYPE, stamp, base)
    message.twist = messages.twist(command)
    return message
