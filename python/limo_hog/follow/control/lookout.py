"""Looking for a person: a turn in place, or a drive to where the ground comes into view that may hide a lost one."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from limo_hog.follow.control.steer import Detour
from limo_hog.follow.decision import Mode
from limo_hog.follow.parameters import param
from limo_hog.follow.robot import RobotGeometry, Twist
from limo_hog.follow.sense.clearance import Points, from_odometry
from limo_hog.follow.sense.observation import Odometry, Scan
from limo_hog.follow.space.grid import Grid, Ground
from limo_hog.follow.space.places import Places, Wandering
from limo_hog.follow.space.routes import Router, point_ahead
from limo_hog.follow.tracks.kalman import Track


@dataclass(frozen=True, slots=True)
class Hunt:
    """What is remembered while looking for one person.

    Attributes
    ----------
    track
        The person when last measured.
    places
        Where the person may be.
    way
        float64 (N, 2) [m], odometry frame: still to be driven; empty to turn in place.
    facing
        A point to turn to where there is no way [m], odometry frame; None to turn on and on.
    planned
        When the way was chosen [s].
    """

    track: Track
    places: Places
    way: Points = field(default_factory=lambda: np.empty((0, 2)))
    facing: tuple[float, float] | None = None
    planned: float = -math.inf


@dataclass(frozen=True, slots=True)
class Lookout:
    """Chooses the place from which most of the hidden ground is seen soonest, and drives there.

    Attributes
    ----------
    ahead
        The point of the way that is driven to is so far off [m]. Chosen: half of the tightest corridor's width.
    aside
        A point of the way further aside than this is turned to before driving [rad]. Chosen: half a right angle.
    arrived
        A way ends so near to its last point [m]. Chosen: two cells.
    replan_s
        A way is chosen anew after so long [s]. Chosen: what the lidar has shown since changes it.
    candidates
        Places to look from that are compared [1]. Chosen: 2 ms.
    view
        From so far away a person is seen [m]. Chosen: HOG finds .9 m people up to 4.
    half_view
        So far to either side of straight ahead the camera shows a whole person [rad]. Chosen: the Limo's .62, less half
        a person at 2.5 m.
    same_goal, stay
        Places within this of the one driven to are worth so much more [m, 1]. Chosen: the distance of candidates in a
        room; to change the goal, another must be half as good again.
    settle_s
        Time that looking from a place takes, however near it is [s]. Chosen: a turn by half a right angle and a few
        frames.
    least
        A place that shows a smaller share of where the person may be is not worth driving to [1].
    """

    # Chosen: as long as `Steering` drives by the prediction.
    after_s: float = param(0.8, "s", "A person who is not measured for this time is looked for.", 0, 30)
    # Chosen: a little less than when following.
    speed: float = param(0.6, "m/s", "Limit of the speed on the way to a place to look from.", 0, 1)
    # Chosen: the search's rate, and half more.
    turn_gain: float = param(2.0, "1/s", "Turn rate for each radian off the way.", 0, 10)
    max_turn: float = param(1.2, "rad/s", "Limit of the turn rate on the way.", 0, 3)
    ahead: float = 0.5
    aside: float = 0.8
    arrived: float = 0.2
    replan_s: float = 0.8
    candidates: int = 40
    view: float = 3.5
    half_view: float = 0.5
    same_goal: float = 0.5
    stay: float = 1.5
    settle_s: float = 1.5
    least: float = 0.05
    # Chosen: a person is a room further by then.
    give_up_s: float = param(60.0, "s", "After this time looking round ends, and the robot turns in place.", 0, 3600)
    wandering: Wandering = field(default_factory=Wandering)
    router: Router = field(default_factory=Router)

    def begin(self, track: Track, number: int, grid: Grid, ground: Ground) -> Hunt:
        """Begin with the person as last measured."""
        places = self.wandering.start(track.stamp, track.mean, track.matrix, number)
        here = np.array([track.place])
        # Nobody is on the other side of a wall who was measured on this one.
        behind = ~grid.sees(ground, here, places.points)[0]
        places.points[behind] = here
        return Hunt(track, places)

    def step(
        self, hunt: Hunt, scan: Scan, now: float, pose: Odometry, grid: Grid, ground: Ground, robot: RobotGeometry
    ) -> Hunt:
        """Let the person walk on in mind, remove what is seen to be empty, and choose a way where one is due."""
        places = hunt.places
        while now - places.stamp > 1e-6:
            places = self.wandering.walk_on(places, min(places.stamp + 0.2, now), grid, ground)
        here = np.array([[pose.x, pose.y]])
        ahead = from_odometry(places.points, pose)
        off, far = np.arctan2(ahead[:, 1], ahead[:, 0]), np.hypot(*ahead.T)
        shown = (np.abs(off) < self.half_view) & (far < self.view) & grid.sees(ground, here, places.points)[0]
        places_left = self.wandering.look(places, scan, shown, pose, robot)
        if places_left is None:
            places_left = self._anywhere(hunt, now, grid, ground)
        if places_left is None:
            return replace(hunt, places=places, way=np.empty((0, 2)), facing=None, planned=now)
        hunt = replace(hunt, places=places_left)
        if now - hunt.planned < self.replan_s:
            return hunt
        return self._plan(hunt, now, pose, grid, ground)

    def command(
        self,
        hunt: Hunt,
        pose: Odometry,
        points: Points,
        detour: Detour,
        robot: RobotGeometry,
        turn: Twist,
    ) -> tuple[Twist, str]:
        """Return the command and the reason.

        Parameters
        ----------
        hunt, pose
            The way and where the robot is.
        points, detour, robot
            float64 (N, 2) [m], base frame: what the lidar sees, and how to drive around it.
        turn
            The turn in place where nothing else is to be done.
        """
        if len(hunt.way) and math.dist(hunt.way[-1], (pose.x, pose.y)) > self.arrived:
            off = self._off(point_ahead(hunt.way, pose, self.ahead), pose)
            heading = detour.near(points, off, robot) if abs(off) < self.aside else None
            speed = 0.0 if heading is None else self.speed * max(math.cos(heading), 0.0) ** 2
            return Twist(speed, self.turn(off if heading is None else heading)), "looking round for the lost person"
        if hunt.facing is not None:
            off = self._off(np.array(hunt.facing), pose)
            return Twist(0.0, self.turn(off)), "turning to where the lost person may be"
        return turn, "searching for the lost person"

    def turn(self, off: float) -> float:
        """Return the turn rate to face what is `off` straight ahead [rad/s, rad]."""
        return min(max(self.turn_gain * off, -self.max_turn), self.max_turn)

    def ways(self, hunt: Hunt, pose: Odometry) -> tuple[tuple[tuple[float, float], ...], ...]:
        """Return the places and the way in the base frame [m], for those who watch."""
        moved = (from_odometry(points, pose) for points in (hunt.places.points, hunt.way))
        return tuple(tuple((float(x), float(y)) for x, y in points) for points in moved)

    def _plan(self, hunt: Hunt, now: float, pose: Odometry, grid: Grid, ground: Ground) -> Hunt:
        routes = self.router.field(grid, ground, pose)
        cells = np.argwhere(np.isfinite(routes))
        here = np.array([[pose.x, pose.y]])
        step = max(len(cells) // self.candidates, 1)
        cells = cells[step // 2 :: step]
        origins = np.concatenate([here, grid.middle_of(ground, cells)])
        far = np.concatenate([[0.0], routes[cells[:, 0], cells[:, 1]]])
        points = hunt.places.points[:: max(len(hunt.places.points) // 50, 1)]
        near = np.hypot(*(origins[:, None] - points[None, :]).transpose(2, 0, 1)) < self.view
        shown = near & grid.sees(ground, origins, points)
        share = shown.mean(axis=1)
        worth = share / (self.settle_s + far / self.speed)
        if len(hunt.way):
            # Two places of about the same worth would be driven to in turns.
            goal = np.hypot(*(origins - hunt.way[-1]).T)
            worth[(goal < self.same_goal) & (share >= self.least)] *= self.stay
        best = int(np.argmax(worth))
        if share[best] < self.least:
            return replace(hunt, way=np.empty((0, 2)), facing=None, planned=now)
        middle = points[shown[best]].mean(axis=0)
        facing = float(middle[0]), float(middle[1])
        way = np.empty((0, 2)) if best == 0 else self.router.way(grid, ground, routes, tuple(cells[best - 1]))
        return replace(hunt, way=way, facing=facing, planned=now)

    def _anywhere(self, hunt: Hunt, now: float, grid: Grid, ground: Ground) -> Places | None:
        """Return places spread over the ground that was not seen lately, as far as the person can have walked."""
        reach = 1.0 + self.wandering.walk * (now - hunt.track.stamp)
        cells = np.argwhere((ground.occupied <= 0) & (ground.seen < now - 2.0) & np.isfinite(ground.seen))
        points = grid.middle_of(ground, cells)
        points = points[np.hypot(*(points - hunt.track.place).T) < reach]
        if len(points) == 0:
            return None
        count, random = self.wandering.count, np.random.default_rng([hunt.places.seed, 3])
        chosen = points[random.integers(len(points), size=count)]
        return Places(now, chosen, np.zeros((count, 2)), hunt.places.seed + 1)

    def _off(self, goal: Points, pose: Odometry) -> float:
        return math.remainder(math.atan2(goal[1] - pose.y, goal[0] - pose.x) - pose.yaw, math.tau)


@dataclass(frozen=True, slots=True)
class Search:
    """Turns the robot until a person is found."""

    # Chosen: a full turn in 9 s; in it the image moves by 31 px a frame, and everything is in view for 17 frames, more
    # than the 12 that confirm a person.
    rate: float = param(0.7, "rad/s", "Turn rate of the search in place.", 0, 3)
    # Chosen: a person passes behind a pillar within 2 s. Behind something wider, `Detour.hides` extends the wait.
    after_s: float = param(
        2.0, "s", "How long to face the predicted position of an unmeasured person before searching.", 0, 30
    )

    def command(self, side: float, *, lost: bool, other_in_view: bool) -> tuple[Twist, Mode, str]:
        """Return the command, the mode and the reason.

        Parameters
        ----------
        side
            1 to turn left, -1 right.
        lost
            Whether a person was followed before.
        other_in_view
            Whether a person is in view who is not the one followed before.
        """
        turn = Twist(0.0, side * self.rate)
        if other_in_view:
            return turn, Mode.LOST, "searching for the lost person: another is in view"
        if lost:
            return turn, Mode.LOST, "searching for the lost person"
        return turn, Mode.SEARCH, "searching for a person"
