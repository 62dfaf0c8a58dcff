"""Followers that are given the arena's true positions, for `follow_bench`: what could be won by better senses.

`oracle` is the tracking controller with true tracks in place of its own, `sighted` the same with the people alone whom
its senses show. `crude` is a sampled rollout with critics that knows no routes. All stand behind `Guard` as every
controller does, and see walls by the lidar alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from limo_hog.detections import Detections
from limo_hog.follow.control.selection import Choice, Selection
from limo_hog.follow.control.tracking import TrackingController
from limo_hog.follow.decision import Controller, Decision, Mode
from limo_hog.follow.pipeline import Follower
from limo_hog.follow.robot import LIMO, Twist
from limo_hog.follow.sense.clearance import NO_POINTS, from_odometry, scan_points
from limo_hog.follow.sense.measurement import WINDOW_PER_STATURE
from limo_hog.follow.sense.observation import Observation, Odometry, pose_at
from limo_hog.follow.tracks.kalman import Track
from limo_hog.follow.tracks.person import Person, predict
from limo_hog.follow.tracks.tracker import Tracker, Tracks
from limo_sim.run.arena import Arena
from limo_sim.run.matching import CRITERIA

#: What `oracle` makes.
ORACLES = ("oracle", "sighted", "crude")
#: Number of the person to be followed: the scenario's first.
FOLLOWED = 1
_EXACT = (1e-4, 0.0, 0.0, 0.0, 1e-4, 0.0, 0.0, 1e-3, 0.0, 1e-3)


def oracle(name: str, arena: Arena) -> Follower[Any]:
    """Return one of `ORACLES` for an arena; its boxes are the silhouettes of people in view."""
    controller: Controller[Any]
    if name == "crude":
        controller = Crude(arena)
    else:
        tracker = SightedTracker(arena=arena) if name == "sighted" else TrueTracker(arena=arena)
        controller = replace(TrackingController(), tracker=tracker, selection=TrueSelection())
    return Follower(controller, TrueDetector(arena), search=lambda detector, image, _: detector.detect(image))


def shown(arena: Arena) -> list[int]:
    """Return the numbers of the people in view in the newest frame: their places in the scenario, from 1."""
    people = enumerate(arena.frame().truth.people, 1)
    return [number for number, person in people if person and person.box and person.visible >= CRITERIA.in_view]


@dataclass(frozen=True)
class TrueDetector:
    """Finds whoever is in view in the arena's newest frame, in the order of `shown`."""

    arena: Arena

    def detect(self, _: NDArray[np.uint8]) -> Detections:
        """Return the silhouettes as windows, each with the score 1."""
        people = self.arena.frame().truth.people
        boxes = [one.box for number in shown(self.arena) if (one := people[number - 1])]
        return Detections(np.array(boxes, np.int32).reshape(-1, 4), np.ones(len(boxes)))


@dataclass(frozen=True, slots=True)
class TrueTracker(Tracker):
    """Every person of the arena as a track without an error, whether something hides them or not.

    `past` is where everybody was in the last frame: a stamp [s], x, y in the arena [m]; a tracker is for one run.
    """

    arena: Arena | None = None
    past: dict[int, tuple[float, float, float]] = field(default_factory=dict)

    def update(self, observation: Observation, tracks: Tracks) -> tuple[Tracks, dict[int, int]]:
        """Bring all tracks up to a frame; as `Tracker.update`."""
        assert self.arena is not None
        tracks = self._remember(observation, tracks)
        truth, pose = self.arena.frame().truth, pose_at(tracks.poses, observation.stamp)
        boxes = {number: box for box, number in enumerate(shown(self.arena))}
        people, turned = [], pose.yaw - truth.robot[2]
        for number, person in enumerate(truth.people, 1):
            if person is None:
                continue
            before, stamp = tracks.person(number), observation.stamp
            yaw = pose.yaw + person.bearing
            x, y = pose.x + person.distance * math.cos(yaw), pose.y + person.distance * math.sin(yaw)
            # By places in the arena: in the odometry frame a person far away moves as the robot's heading slips.
            past = self.past.get(number, (stamp - 1.0, person.x, person.y))
            self.past[number] = stamp, person.x, person.y
            dt = max(stamp - past[0], 1e-3)
            along, aside = (person.x - past[1]) / dt, (person.y - past[2]) / dt
            cos, sin = math.cos(turned), math.sin(turned)
            track = Track(stamp, (x, y, cos * along - sin * aside, sin * along + cos * aside), _EXACT)
            height = self.arena.scenario.people[number - 1].height
            window = WINDOW_PER_STATURE * height * observation.focal_px
            centre = (self.robot.camera_z - height / 2) * observation.focal_px
            seen = stamp if number in boxes else -math.inf if before is None else before.seen
            people.append(Person(number, track, seen, 10.0, window, centre, confirmed=True, felt=stamp))
        return replace(tracks, people=tuple(people), boxes=tuple(boxes.items())), boxes

    def follow_legs(self, person: Person, tracks: Tracks, *_: Any) -> tuple[Person, Tracks]:
        """Return the same: a true track needs no legs."""
        return person, tracks

    def follow_movers(self, tracks: Tracks, *_: Any) -> Tracks:
        """Return the same: nobody moves in the scan whom the tracks lack."""
        return tracks


#: Up to this distance the camera tells `sighted` who a person is [m]: HOG finds people there. After a person was hidden
#: for this time, the scan alone does not [s].
BY_SIGHT_M, HIDDEN_S = 5.0, 0.15
#: A return this near to a person's place is theirs [m]: the radius of a body, and as much for the swing of the legs.
RETURN_M = 0.3
#: Added to a person's number while `sighted` cannot tell who they are.
STRANGER = 1000


@dataclass(frozen=True, slots=True)
class SightedTracker(TrueTracker):
    """Everybody whom the camera shows, or the scan within the reach of `Legs`, as a track without an error.

    A person whom neither showed for `HIDDEN_S` is a stranger until the camera shows them within `BY_SIGHT_M`.
    `shown` is when each was last shown [s], `strangers` whose number is not known.
    """

    shown: dict[int, float] = field(default_factory=dict)
    strangers: set[int] = field(default_factory=set)

    def update(self, observation: Observation, tracks: Tracks) -> tuple[Tracks, dict[int, int]]:
        """Bring the tracks of those who are shown up to a frame, and predict the others; as `Tracker.update`."""
        now, boxes = TrueTracker.update(self, observation, tracks)
        stamp, pose, people = observation.stamp, pose_at(now.poses, observation.stamp), list[Person]()
        returns = NO_POINTS if observation.scan is None else scan_points(observation.scan, self.robot)
        for person in now.people:
            number = person.number
            (at,) = from_odometry(np.array([person.track.place]), pose)
            by_sight = number in boxes and math.hypot(*at) < BY_SIGHT_M
            felt = math.hypot(*at) < self.movers.legs.reach and (np.hypot(*(returns - at).T) < RETURN_M).any()
            if by_sight:
                self.strangers.discard(number)
            elif not felt:
                continue
            elif stamp - self.shown.get(number, -math.inf) > HIDDEN_S:
                self.strangers.add(number)
            self.shown[number] = stamp
            people.append(replace(person, number=number + STRANGER) if number in self.strangers else person)
        numbers = {person.number for person in people}
        hidden = [person for person in tracks.people if person.number not in numbers]
        lately = [predict(person, stamp, self.noise) for person in hidden if stamp - person.felt < self.forget_s]
        return replace(now, people=(*people, *lately)), boxes

    def may_be(self, _: int | None, tracks: Tracks, now: float) -> list[Track]:
        """Return the strangers whom the scan has just shown, as of `now` [s]."""
        lately = now - self.movers.forget_s
        strangers = [person for person in tracks.people if person.number > STRANGER and person.felt > lately]
        return [predict(person, now, self.noise).track for person in strangers]


@dataclass(frozen=True, slots=True)
class TrueSelection(Selection):
    """Follows the scenario's first person."""

    def choose(self, tracks: Tracks, choice: Choice) -> Choice:
        """Return that person as the one followed."""
        person = tracks.person(FOLLOWED)
        return choice if person is None else Choice(FOLLOWED, measured=person.measured)


#: Of the rollouts: how long a step is [s] and how many there are; when the turn is halved [s].
STEP_S, STEPS, HALVED_S = 0.2, 12, 1.2
#: Radii of the robot and of a person [m].
ROBOT, PERSON = 0.18, 0.153


@dataclass(frozen=True)
class Crude:
    """Rolls 153 commands out for 2.4 s against people who walk straight on, and takes the one that costs least.

    The weights are those of the experiment of which 27 of 40 kept-back scenes are told; its state is where everybody
    was: a stamp [s] and float64 (N, 2) [m].
    """

    arena: Arena

    def start(self) -> None:
        """Return the state before the first observation."""
        return

    def step(self, observation: Observation, state: Any) -> Decision[Any]:
        """Decide by the true places, in the robot's frame."""
        now, wheels = self.arena.plan(), observation.odometry or Odometry()
        x, y, yaw = now.robot
        places = np.array([(p.x, p.y) if p else (np.inf, np.inf) for p in now.people])
        velocity = np.zeros_like(places)
        if state is not None and now.stamp > state[0]:
            with np.errstate(invalid="ignore"):
                velocity = np.nan_to_num((places - state[1]) / (now.stamp - state[0]))
        turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
        there, velocity = (places - (x, y)) @ turn, velocity @ turn
        walls = NO_POINTS if observation.scan is None else np.asarray(scan_points(observation.scan, LIMO))
        apart = np.linalg.norm(walls[:, None] - there[None], axis=2).min(axis=1)
        linear, angular = self._commands(wheels.linear)
        cost = self._cost(linear, angular, there, velocity, walls[apart > 0.35])
        best = int(np.argmin(cost + 0.3 * np.abs(linear - wheels.linear) + 0.05 * np.abs(angular - wheels.angular)))
        boxes = {number: box for box, number in enumerate(shown(self.arena))}
        twist = Twist(float(linear[best]), float(angular[best]))
        return Decision(twist, (now.stamp, places), Mode.FOLLOW, "least cost", boxes.get(FOLLOWED))

    @staticmethod
    def _commands(speed: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return 9 speeds by 17 turn rates, each float64 (153,) [m/s, rad/s]."""
        speeds, rates = np.linspace(speed - 0.5, min(speed + 0.5, 0.9), 9), np.linspace(-1.6, 1.6, 17)
        return np.repeat(speeds, len(rates)), np.tile(rates, len(speeds))

    @staticmethod
    def _cost(
        linear: NDArray[np.float64],
        angular: NDArray[np.float64],
        there: NDArray[np.float64],
        velocity: NDArray[np.float64],
        walls: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Return the critics' sum for each command, float64 (153,), of people and walls (N, 2) [m] in its frame."""
        cost, at, yaw = np.zeros_like(linear), np.zeros((len(linear), 2)), np.zeros_like(linear)
        for step in range(1, STEPS + 1):
            time = step * STEP_S
            yaw = yaw + STEP_S * angular * (1.0 if time <= HALVED_S else 0.5)
            at = at + STEP_S * linear[:, None] * np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
            apart = (there + time * velocity)[None] - at[:, None]
            away = np.linalg.norm(apart, axis=2)
            off = np.arctan2(apart[:, 0, 1], apart[:, 0, 0]) - yaw
            bearing, distance = np.abs(np.arctan2(np.sin(off), np.cos(off))), away[:, 0]
            cost += 0.5 * np.abs(distance - 1.5) + 0.8 * np.maximum(0, bearing - 0.25)
            cost += 20 * np.maximum(0, 0.6 - distance)
            if there.shape[0] > 1:
                gap = away[:, 1:].min(axis=1) - ROBOT - PERSON
                cost += math.exp(-time / 1.2) * (6 * np.maximum(0, 0.3 - gap) + 30 * (gap < 0.05))
            if len(walls):
                wall = np.linalg.norm(walls[None] - at[:, None], axis=2).min(axis=1)
                cost += 5 * np.maximum(0, 0.35 - wall) + 40 * (wall < 0.22)
        return cost
