"""What is true in the arena at one instant: the robot, the people and the contacts; no sensor's errors."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PersonTruth:
    """One person at one instant."""

    #: x, y, yaw: in the arena's frame [m, m, rad]
    x: float
    y: float
    yaw: float
    #: distance, bearing: from the robot's base centre to the person's axis [m], and its direction from straight ahead,
    #: left positive [rad]
    distance: float
    bearing: float
    #: From the camera to the front of the person's trunk [m]: the distance that the depth image shows in the middle of
    #: the person, and that a follower holds.
    surface_distance: float
    visible: float  #: share of the person's silhouette in the image: 0 (hidden, or outside the image) … 1
    #: x, y, w, h [px] around the silhouette as if nothing stood in front of it, cut at the image's edge; None when all
    #: of it is outside.
    box: tuple[int, int, int, int] | None


@dataclass(frozen=True, slots=True)
class Contacts:
    """How often the robot has touched a person, and a wall or furniture, since the start."""

    person: int = 0
    wall: int = 0


@dataclass(frozen=True, slots=True)
class Truth:
    """The arena at one instant."""

    stamp: float  #: the instant [s]
    robot: tuple[float, float, float]  #: x, y, yaw of the base centre in the arena's frame [m, m, rad]
    #: In the scenario's order; None for a person who is not in the arena, yet or any more.
    people: tuple[PersonTruth | None, ...]
    contacts: Contacts  #: of the robot since the start
