"""Where to look for a person who was lost: the place from which most of where they may be comes into view soonest."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from limo_hog.follow.control.situation import Goal, Situation, goal_along
from limo_hog.follow.parameters import param
from limo_hog.follow.sense.clearance import NO_POINTS, Points, from_odometry
from limo_hog.follow.sense.observation import Array, Scan, turn_between
from limo_hog.follow.space.places import Places, Wandering
from limo_hog.follow.space.routes import Router
from limo_hog.follow.tracks.kalman import Track


@dataclass(frozen=True, slots=True)
class Hunt:
    """What is remembered while looking for one person."""

    track: Track  #: The person when last measured.
    places: Places  #: Where the person may be.
    #: float64 (N, 2) [m], odometry frame: still to be driven; empty to turn in place.
    way: Points = field(default_factory=lambda: NO_POINTS)
    #: A point to turn to where there is no way [m], odometry frame; None to turn on and on.
    facing: tuple[float, float] | None = None
    planned: float = -math.inf  #: When the way was chosen [s].


@dataclass(frozen=True, slots=True)
class Lookout:
    """Chooses the place to look from, and the way there."""

    after_s: float = param(0.8, "s", "Somebody not measured for this time is looked for, behind a wall.", 0, 30)
    speed: float = param(0.6, "m/s", "Highest speed on the way.", 0, 1)
    facing_rate: float = param(1.2, "rad/s", "Highest turn rate to a place: the detector needs sharp frames.", 0, 3)
    search_rate: float = param(0.7, "rad/s", "Turn rate while nothing is known of the person.", 0, 3)
    arrived: float = param(0.2, "m", "A way ends this near to its last point.")
    replan_s: float = param(0.8, "s", "A way is chosen anew after this time.")
    candidates: int = param(40, "1", "Places to look from that are compared.")
    directions: int = param(24, "1", "Directions to look in that are compared at each.")
    view: float = param(6.0, "m", "From so far away a person is seen.")
    half_view: float = param(0.5, "rad", "So far to either side of straight ahead the camera shows a whole person.")
    same_goal: float = param(0.5, "m", "Places within this of the one driven to are worth more.")
    stay: float = param(1.5, "1", "So many times as much.")
    settle_s: float = param(1.5, "s", "Time that looking from a place takes, however near it is.")
    turn_rate: float = param(1.0, "rad/s", "Mean turn rate on the way there and at its end.", 0.1, 3)
    least: float = param(0.05, "1", "A place that shows less of where the person may be is not driven to.")
    hidden: float = param(0.5, "1", "What a place counts before which somebody walks, who will soon have gone.")
    near: float = param(2.0, "m", "How near a place is driven to that is faced, and still may hide the person.", 0.5, 8)
    give_up_s: float = param(60.0, "s", "Then looking round ends, and the robot turns in place.", 0, 3600)
    wandering: Wandering = field(default_factory=Wandering)
    router: Router = field(default_factory=Router)

    def begin(self, track: Track, number: int, situation: Situation) -> Hunt:
        """Begin with the person as last measured."""
        places = self.wandering.start(track.stamp, track.mean, track.matrix, number)
        if situation.ground is not None:
            # Nobody is on the other side of a wall who was measured on this one.
            here = np.array([track.place])
            places.points[~situation.grid.sees(situation.ground, here, places.points)[0]] = here
        return Hunt(track, places)

    def step(self, hunt: Hunt, scan: Scan, moving: Array, situation: Situation) -> Hunt:
        """Let the person walk on in mind, remove what is seen to be empty, and choose a way where one is due.

        `moving` (M, 4) is what moves in the scan and may be the person: x, y [m], vx, vy [m/s], odometry frame.
        """
        now, pose, grid, ground = situation.now, situation.pose, situation.grid, situation.mapped
        places = hunt.places
        while now - places.stamp > 1e-6:
            places = self.wandering.walk_on(places, min(places.stamp + 0.2, now), grid, ground)
        here = np.array([[pose.x, pose.y]])
        ahead = from_odometry(places.points, pose)
        off, far = np.arctan2(ahead[:, 1], ahead[:, 0]), np.hypot(*ahead.T)
        shown = (np.abs(off) < self.half_view) & (far < self.view) & grid.sees(ground, here, places.points)[0]
        left = self.wandering.look(places, scan, shown, moving, pose, situation.robot)
        left = left or self._anywhere(hunt, situation)
        if left is None:
            return replace(hunt, places=places, way=NO_POINTS, facing=None, planned=now)
        hunt = replace(hunt, places=left)
        return hunt if now - hunt.planned < self.replan_s else self._plan(hunt, scan, situation)

    def goal(self, hunt: Hunt, situation: Situation, times: Points) -> tuple[Goal | None, str]:
        """Return the goal of a rollout whose steps end at `times` [s], and the reason; None to turn on and on."""
        pose = situation.pose
        if len(hunt.way) and math.dist(hunt.way[-1], (pose.x, pose.y)) > self.arrived:
            goal = goal_along(hunt.way, situation, self.router.ahead, self.speed, times)
            return goal, "looking round for the lost person"
        if hunt.facing is None:
            return None, "searching for the lost person"
        goal = Goal(situation.bearing_of(*hunt.facing), turn_limit=self.facing_rate)
        further = math.dist(hunt.facing, (pose.x, pose.y)) - self.near
        if further <= 0 or abs(goal.heading) >= self.half_view:
            return goal, "turning to where the lost person may be"
        # Somebody stands before it, or it is too far away for HOG.
        places = np.repeat(from_odometry(np.array([hunt.facing]), pose), len(times), axis=0)
        goal = replace(goal, speed=min(further, self.speed), places=places, keeps=self.near)
        return goal, "driving to where the lost person may be"

    def ways(self, hunt: Hunt, situation: Situation) -> tuple[tuple[tuple[float, float], ...], ...]:
        """Return the places and the way in the base frame [m], for those who watch."""
        moved = (from_odometry(points, situation.pose).tolist() for points in (hunt.places.points, hunt.way))
        return tuple(tuple((x, y) for x, y in points) for points in moved)

    def _plan(self, hunt: Hunt, scan: Scan, situation: Situation) -> Hunt:
        now, pose, grid, ground = situation.now, situation.pose, situation.grid, situation.mapped
        routes = self.router.field(grid, ground, pose)
        cells = np.argwhere(np.isfinite(routes))
        step = max(len(cells) // self.candidates, 1)
        cells = cells[step // 2 :: step]
        origins = np.concatenate([[[pose.x, pose.y]], grid.middle_of(ground, cells)])
        far = np.concatenate([[0.0], routes[cells[:, 0], cells[:, 1]]])
        points = hunt.places.points[:: max(len(hunt.places.points) // 50, 1)]
        dx, dy = (points[None, :] - origins[:, None]).transpose(2, 0, 1)
        seen = np.where((np.hypot(dx, dy) < self.view) & grid.sees(ground, origins, points), 1.0, 0.0)
        # From here people, too, hide what is behind them: who walks soon gives it free, what stands does not.
        seen[0, self.wandering.beams_to(points, scan, pose, situation.robot)[1]] *= self.hidden
        seen[0, situation.is_hidden(np.arctan2(dy[0], dx[0]) - pose.yaw, np.hypot(dx[0], dy[0]))] = 0.0
        faced = np.linspace(-math.pi, math.pi, self.directions, endpoint=False)
        shown = seen[:, None] * (turn_between(np.arctan2(dy, dx)[:, None], faced[:, None]) < self.half_view)
        share = shown.mean(axis=2)
        courses = np.arctan2(origins[:, 1] - pose.y, origins[:, 0] - pose.x)
        courses[0] = pose.yaw
        turns = turn_between(courses, pose.yaw)[:, None] + turn_between(courses[:, None], faced)
        worth = share / (self.settle_s + far[:, None] / self.speed + turns / self.turn_rate)
        if len(hunt.way):
            # Two places of about the same worth would be driven to, or turned to, in turns.
            goal = np.hypot(*(origins - hunt.way[-1]).T)
            worth[(goal < self.same_goal)[:, None] & (share >= self.least)] *= self.stay
        elif hunt.facing is not None:
            worth[0, turn_between(faced, pose.yaw + situation.bearing_of(*hunt.facing)) < self.half_view] *= self.stay
        best, side = divmod(int(np.argmax(worth)), self.directions)
        if share[best, side] < self.least:
            return replace(hunt, way=NO_POINTS, facing=None, planned=now)
        x, y = points[shown[best, side] > 0].mean(axis=0).tolist()
        way = NO_POINTS if best == 0 else self.router.way(grid, ground, routes, tuple(cells[best - 1]))
        return replace(hunt, way=way, facing=(x, y), planned=now)

    def _anywhere(self, hunt: Hunt, situation: Situation) -> Places | None:
        """Return places spread over the ground that was not seen lately, as far as the person can have walked."""
        now, ground = situation.now, situation.mapped
        reach = 1.0 + self.wandering.walk * (now - hunt.track.stamp)
        cells = np.argwhere((ground.occupied <= 0) & (ground.seen < now - 2.0) & np.isfinite(ground.seen))
        points = situation.grid.middle_of(ground, cells)
        points = points[np.hypot(*(points - hunt.track.place).T) < reach]
        if len(points) == 0:
            return None
        count, random = self.wandering.count, np.random.default_rng([hunt.places.seed, 3])
        return Places(now, points[random.integers(len(points), size=count)], np.zeros((count, 2)), hunt.places.seed + 1)
