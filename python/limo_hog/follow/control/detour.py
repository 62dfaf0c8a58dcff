"""Which way to drive around what stands between the robot and the person, by the lidar."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from limo_hog.follow.robot import RobotGeometry
from limo_hog.follow.sense.clearance import Margin, Points, rooms_ahead


@dataclass(frozen=True, slots=True)
class Detour:
    """Chooses a direction with enough free space near the direction of the person.

    Attributes
    ----------
    margin
        Ground kept free on the way [m]. Chosen: more than `Guard` wants, so that it need not intervene.
    step, steps
        Directions tried: so far apart [rad], so many to either side [1]. Chosen: at .48 rad to either side the
        person stays in the Limo's image, which ends at .62.
    preference
        Weight of the difference to the preferred detour against that to the direct way [1]. Chosen: a detour is kept
        until one to the other side is less than a third of it.
    look_ahead
        So much of the way must be free [m]. Chosen: two seconds at 0.6 m/s.
    lean_s
        The preferred detour is on the side the person walks to, their bearing rate times this [s]. Chosen.
    steps_near, creep
        Along a planned way, directions tried to either side [1], and how far one must be free [m]. Chosen: 1.2 rad, as
        the corner of a corridor of 1 m needs; almost the robot's length.
    person_radius
        Returns nearer than this to the person are the person's own [m]. Chosen: legs in mid-stride and an arm.
    occluder_half_width
        Something so near to the line of sight hides the person [m]. Chosen: a pillar this wide hides half of a body.
    """

    margin: Margin = field(default_factory=lambda: Margin(0.65, 0.25))
    step: float = 0.08
    steps: int = 6
    preference: float = 0.5
    look_ahead: float = 1.2
    lean_s: float = 2.0
    steps_near: int = 15
    creep: float = 0.25
    person_radius: float = 0.45
    occluder_half_width: float = 0.12

    def obstacles(self, points: Points, bearing: float, distance: float) -> Points:
        """Return the points, float64 (N, 2) [m], that are not the person at a bearing [rad] and a distance [m]."""
        here = distance * np.array([math.cos(bearing), math.sin(bearing)])
        others: Points = points.compress(np.hypot(*(points - here).T) > self.person_radius, axis=0)
        return others

    def hides(self, obstacles: Points, bearing: float, distance: float) -> bool:
        """Whether an obstacle is on the line of sight to the person."""
        across = np.abs(obstacles @ [-math.sin(bearing), math.cos(bearing)])
        along = obstacles @ [math.cos(bearing), math.sin(bearing)]
        hidden = (across < self.occluder_half_width) & (along > 0) & (along < distance - self.person_radius)
        return bool(hidden.any())

    def heading(
        self, obstacles: Points, bearing: float, distance: float, preferred: float, robot: RobotGeometry
    ) -> float | None:
        """Return the direction to drive in [rad]; None where none is free.

        Parameters
        ----------
        obstacles
            float64 (N, 2) [m], base frame.
        bearing, distance
            Of the person [rad, m].
        preferred
            The detour liked best, from `bearing` [rad]: the one already begun, or the side the person walks to.
        """
        reach = min(distance - 2 * self.person_radius, self.look_ahead)
        heading = self.free(obstacles, bearing, preferred, reach, robot)
        return heading if heading is not None else self.free(obstacles, bearing, preferred, reach / 2, robot)

    def near(self, obstacles: Points, bearing: float, robot: RobotGeometry) -> float | None:
        """Return the direction nearest to a bearing [rad] in which the robot can drive a little; None for none."""
        for reach in (self.creep, self.creep / 3):
            heading = self.free(obstacles, bearing, 0.0, reach, robot, self.steps_near)
            if heading is not None:
                return heading
        return None

    def free(
        self,
        obstacles: Points,
        bearing: float,
        preferred: float,
        reach: float,
        robot: RobotGeometry,
        steps: int | None = None,
    ) -> float | None:
        """Return the best direction in which the robot can drive at least `reach` [m]."""
        most = self.steps if steps is None else steps
        # What is further off is in no direction's way.
        near = obstacles.compress(np.hypot(*obstacles.T) < reach + robot.half_length + self.margin.ahead, axis=0)
        detours = [self.step * index for index in range(-most, most + 1)]
        detours.sort(key=lambda detour: abs(detour) + self.preference * abs(detour - preferred))
        # Mostly the best is free: to look at it alone takes half of the time of all.
        for some in (detours[:1], detours[1:]):
            rooms = rooms_ahead(near, bearing + np.array(some), self.margin, robot)
            free = (rooms >= reach).nonzero()[0]
            if len(free):
                return bearing + some[int(free[0])]
        return None
