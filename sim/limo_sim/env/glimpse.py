"""What a camera would show of a person and whether HOG would find the person, by geometry alone: no image is drawn."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from limo_sim.run.arena import Plan
from limo_sim.run.matching import CRITERIA
from limo_sim.sensing.camera import FOCAL_PX, HEIGHT, MOUNT_AHEAD, MOUNT_HEIGHT, WIDTH
from limo_sim.world.paths import FloorPlan
from limo_sim.world.person import trunk_radius
from limo_sim.world.scenario import Scenario

# Half the breadth of a silhouette in statures. Measured: arms swing to .13 on either side.
_HALF_BREADTH = 0.13
# HOG finds hardly anybody smaller, nor nearer to a side of the image [px]; above the head it wants room, so that people
# whose head touches the image's edge are missed. Measured in the arena, 48 views a cell.
_LEAST_PX, _SIDE_PX = 96.0, 60.0
# Nearer than this nothing is in front of the camera [m].
_NEAR = 0.05
# Furniture that is as high as a person.
_HIDING = ("pillar",)


@dataclass(frozen=True, slots=True)
class Glimpse:
    """One person, seen from the robot.

    Attributes
    ----------
    bearing, distance
        From the robot's centre to the person's axis [rad, m].
    surface
        From the camera to the front of the person's trunk [m].
    visible
        Share of the silhouette that is in the image and not behind a wall or a pillar, about.
    height_px
        Of the whole silhouette [px].
    found
        Whether HOG would find the person.
    """

    bearing: float
    distance: float
    surface: float
    visible: float
    height_px: float
    found: bool


def hiding(scenario: Scenario) -> FloorPlan:
    """Return what a person may stand behind, unseen."""
    pieces = [piece.footprint for piece in scenario.furniture if piece.kind in _HIDING]
    return FloorPlan([*pieces, *(wall.footprint for wall in scenario.walls)], scenario.room.half, 0.0)


def glimpse(plan: Plan, scenario: Scenario, index: int, walls: FloorPlan) -> Glimpse | None:
    """Return what is seen of a person; None where the person is not in the arena. `walls` is what hides people."""
    pose = plan.people[index] if index < len(plan.people) else None
    if pose is None:
        return None
    person = scenario.people[index]
    x, y, yaw = plan.robot
    dx, dy = pose.x - x, pose.y - y
    cos, sin = math.cos(yaw), math.sin(yaw)
    left, ahead = cos * dy - sin * dx, cos * dx + sin * dy
    bearing, distance = math.atan2(left, ahead), math.hypot(dx, dy)
    depth = ahead - MOUNT_AHEAD
    towards = yaw + math.atan2(left, depth)
    surface = math.hypot(depth, left) - trunk_radius(person, pose, towards)
    if depth < _NEAR:
        return Glimpse(bearing, distance, surface, 0.0, 0.0, False)
    scale = FOCAL_PX / depth
    column, half = -left * scale, _HALF_BREADTH * person.height * scale
    height, head = person.height * scale, (person.height - MOUNT_HEIGHT) * scale
    across = min(column + half, WIDTH / 2) - max(column - half, -WIDTH / 2)
    upright = min(head, HEIGHT / 2) + min(MOUNT_HEIGHT * scale, HEIGHT / 2)
    visible = max(across, 0.0) / (2 * half) * upright / height
    camera = x + MOUNT_AHEAD * cos, y + MOUNT_AHEAD * sin
    if visible > 0.0 and walls.hidden(np.array([camera]), np.array([(pose.x, pose.y)]))[0]:
        visible = 0.0
    found = visible >= CRITERIA.in_view and height >= _LEAST_PX and head <= HEIGHT / 2
    found = found and abs(column) <= WIDTH / 2 - _SIDE_PX
    return Glimpse(bearing, distance, surface, visible, height, found)
