"""What a camera would show of a person and whether HOG would find the person, by geometry alone: no image is drawn."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from limo_sim.run.arena import Plan
from limo_sim.run.matching import CRITERIA
from limo_sim.sensing.camera import FOCAL_PX, HEIGHT, MOUNT_AHEAD, MOUNT_HEIGHT, WIDTH
from limo_sim.world.furniture import Disc, Rectangle
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


def hiding(scenario: Scenario) -> list[Disc | Rectangle]:
    """Return what a person may stand behind, unseen."""
    pieces = [piece.footprint for piece in scenario.furniture if piece.kind in _HIDING]
    return [*pieces, *(wall.footprint for wall in scenario.walls)]


def glimpse(plan: Plan, scenario: Scenario, index: int, walls: Sequence[Disc | Rectangle]) -> Glimpse | None:
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
    if visible > 0.0 and any(_between(camera, (pose.x, pose.y), wall) for wall in walls):
        visible = 0.0
    found = visible >= CRITERIA.in_view and height >= _LEAST_PX and head <= HEIGHT / 2
    found = found and abs(column) <= WIDTH / 2 - _SIDE_PX
    return Glimpse(bearing, distance, surface, visible, height, found)


def _between(start: tuple[float, float], end: tuple[float, float], shape: Disc | Rectangle) -> bool:
    """Whether a shape cuts the straight line from one place to another."""
    x0, y0 = start[0] - shape.x, start[1] - shape.y
    dx, dy = end[0] - start[0], end[1] - start[1]
    if isinstance(shape, Disc):
        share = min(max(-(x0 * dx + y0 * dy) / max(dx * dx + dy * dy, 1e-12), 0.0), 1.0)
        return math.hypot(x0 + share * dx, y0 + share * dy) < shape.radius
    cos, sin = math.cos(shape.yaw), math.sin(shape.yaw)
    first, last = 0.0, 1.0
    for place, way, half in (
        (cos * x0 + sin * y0, cos * dx + sin * dy, shape.half_x),
        (cos * y0 - sin * x0, cos * dy - sin * dx, shape.half_y),
    ):
        if abs(way) < 1e-12:
            if abs(place) > half:
                return False
            continue
        near, far = sorted(((-half - place) / way, (half - place) / way))
        first, last = max(first, near), min(last, far)
    return first < last
