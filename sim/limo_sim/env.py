"""The arena for Gymnasium: `gymnasium.make("limo_sim.env:LimoFollow-v1")` imports this module, which registers it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from limo_hog.extras import needed
from limo_hog.follow.robot import Twist
from limo_sim.run.arena import STEPS_PER_SECOND, Arena, Plan
from limo_sim.run.detector_faults import Missing, misses_of
from limo_sim.run.last_seen import SCALE, SIZE, LastSeen, sighted, state_of
from limo_sim.run.matching import CRITERIA
from limo_sim.sensing import lidar
from limo_sim.sensing.camera import HEIGHT, WIDTH
from limo_sim.world.paths import FloorPlan
from limo_sim.world.person import trunk_radius
from limo_sim.world.scenario import DetectorFaults, Scenario
from limo_sim.world.schema import ScenarioError
from limo_sim.world.variants import SIGHTING_STREAM

with needed(by="the arena's camera"):
    import cv2

ACTIONS_PER_SECOND = 10
#: What an observation may be.
KINDS = ("camera", "gray", "state")
#: Size of the small gray image [px]: an eighth of the camera's.
SMALL = WIDTH // 8, HEIGHT // 8
# The furthest that `depth.far_m` may be [m].
_DEPTH_REACH = 20.0
# Standard deviations of a sighting [rad, m]. Measured in the arena: the middle of HOG's box strays by 2.7 … 6.4 px of a
# focal length of 449 px, and its depth by about 5 cm.
_BEARING_NOISE, _RANGE_NOISE = 0.011, 0.05
# Half the breadth of a silhouette in statures. Measured: arms swing to .13 on either side.
_HALF_BREADTH = 0.13
# HOG finds hardly anybody smaller, nor nearer to a side of the image [px]; above the head it wants room, so that people
# whose head touches the image's edge are missed. Measured in the arena, 48 views a cell.
_LEAST_PX, _SIDE_PX = 96.0, 60.0
# Nearer than this nothing is in front of the camera [m].
_NEAR = 0.05
# Furniture that is as high as a person.
_HIDING = ("pillar",)

Observation = Any  # a float32 array for "state", else a dict of arrays


@dataclass(frozen=True, slots=True)
class Shaping:
    """Weights of the reward, see `LimoFollowV1`."""

    #: Distance from the camera to the person's surface that earns most [m]: the one that the controllers hold.
    target_m: float = 1.5
    #: Error of the distance at which half is left [m]. Chosen: a person at the far wall, 5 m too far, leaves a sixth.
    halving_m: float = 1.0
    #: follow, visible: what facing the person at the target distance, and seeing the person whole, earns at most.
    #: Chosen: together 1.
    follow: float = 0.7
    visible: float = 0.3
    #: person_contact, wall_contact: what a new one costs. Chosen: ten seconds, and one, of following perfectly.
    person_contact: float = 100.0
    wall_contact: float = 10.0
    #: effort, jerk: what an action, and a change of the action, costs for each unit. Chosen: less than half a per cent,
    #: and 5 %.
    effort: float = 0.005
    jerk: float = 0.05


SHAPING = Shaping()


@dataclass(frozen=True, slots=True)
class Glimpse:
    """One person, seen from the robot."""

    #: bearing, distance: from the robot's centre to the person's axis [rad, m].
    bearing: float
    distance: float
    surface: float  #: from the camera to the front of the person's trunk [m]
    visible: float  #: share of the silhouette that is in the image and not behind a wall or a pillar, about
    height_px: float  #: of the whole silhouette [px]
    found: bool  #: whether HOG would find the person


class LimoFollowV1(gymnasium.Env[Observation, NDArray[np.float32]]):
    """Follow the scenario's first person; ten actions a second.

    An action is float32 (2,) in -1 … 1: forward speed, 1 is 0.7 m/s, and turn rate, 1 is 1.5 rad/s.

    Observations, as `observe` says:

    - "state": float32 (9,), see `limo_sim.run.last_seen.state_of`: where the person was last seen, and the motions.
      HOG's limits, the noise of its boxes and the scenario's `[detector]` (its false boxes left out) are those of the
      arena; no image is drawn, so that it is quick.
    - "gray": a dict of `gray`, uint8 (60, 80, 1), and `motion`, float32 (2,): speed and turn rate in units of actions.
    - "camera": a dict of `image`, uint8 (480, 640, 3) RGB; `depth`, float32 (480, 640) [m], 0 where it is unknown or
      out of range; `scan`, float32 (292,) [m], 8 where nothing was hit; and `motion`.

    The reward of an action, from where everything truly is, is the sum of `info["reward"]`:

    - `follow`: 0.7 · (1 + cos b) / 2 · 1 / (1 + e / 1 m), with the person's bearing b and the error e of the distance
      from the camera to the person's surface, to 1.5 m. It grows with every turn towards the person and with every step
      towards the distance, wherever the robot is: there is no dead zone but the single bearing right behind.
    - `visible`: 0.3 times the share of the person's silhouette that is in the image, about.
    - `contact`: -100 for a new contact with a person, which ends the episode, -10 with a wall or furniture.
    - `effort`: -0.005 for the size of each number of the action, and -0.05 for the size of its change.

    Parameters
    ----------
    scenario
        A `Scenario`, a name, a file, or several of these, of which every reset draws one; `[vary]` draws its people.
    observe
        "camera", "gray" or "state".
    render_mode
        "rgb_array": `render` returns the camera's image.

    Raises
    ------
    ScenarioError
        There is no such scenario or kind of observation, or a scenario asks for faults of a detector beside images.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": ACTIONS_PER_SECOND}  # noqa: RUF012 (Gymnasium's own way)

    def __init__(
        self,
        scenario: Scenario | str | Sequence[Scenario | str] = "followable",
        observe: str = "state",
        render_mode: str | None = None,
    ) -> None:
        if observe not in KINDS:
            raise ScenarioError(f"observe: got {observe!r}, want one of {', '.join(KINDS)}")
        self.render_mode = render_mode
        self._observe_kind = observe
        names = [scenario] if isinstance(scenario, Scenario | str) else list(scenario)
        self._scenarios = [name if isinstance(name, Scenario) else Scenario.load(name) for name in names]
        for scenario in self._scenarios:
            if observe != "state":
                scenario.check_detector_is_plain("images are given, and there is no detector; observe the state")
        self.action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
        self.observation_space = _space(observe)
        self._arena: Arena | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode; the same `seed` gives the same one."""
        super().reset(seed=seed, options=options)
        scenario = self._scenarios[int(self.np_random.integers(len(self._scenarios)))]
        arena = self._arena = Arena(scenario, int(self.np_random.integers(2**31)))
        self._walls = hiding(arena.scenario)
        self._noise = np.random.default_rng([arena.seed, SIGHTING_STREAM])
        self._misses: list[Missing[Any]] = []
        if scenario.detector != DetectorFaults():
            self._misses = misses_of(scenario.detector, scenario.camera.rate_hz, 1, arena.seed)
        self._last: LastSeen | None = None
        self._looked, self._seen = -1.0, False
        self._action = (0.0, 0.0)
        return self._observe(), {"time": 0.0}

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Drive for .1 s; raises `gymnasium.error.InvalidAction` if the action is not two numbers in -1 … 1."""
        arena = self._running()
        linear, angular = self._checked(action)
        before = arena.contacts
        arena.command(Twist(SCALE.linear * linear, SCALE.angular * angular))
        for _ in range(STEPS_PER_SECOND // ACTIONS_PER_SECOND):
            arena.step()
        observation = self._observe()
        seen = glimpse(arena.plan(), arena.scenario, 0, self._walls)
        touched = arena.contacts
        parts = _reward(seen, touched.person - before.person, touched.wall - before.wall)
        change = abs(linear - self._action[0]) + abs(angular - self._action[1])
        parts["effort"] = -SHAPING.effort * (abs(linear) + abs(angular)) - SHAPING.jerk * change
        self._action = (linear, angular)
        info = {"time": arena.time, "reward": parts, "distance": None if seen is None else seen.distance}
        return observation, sum(parts.values()), touched.person > 0, False, info

    def render(self) -> NDArray[np.uint8] | None:
        """Return the newest camera image, uint8 (480, 640, 3) RGB."""
        if self.render_mode != "rgb_array":
            return None
        return _rgb(self._running().frame().image)

    def _running(self) -> Arena:
        if self._arena is None:
            raise gymnasium.error.ResetNeeded("call reset() before step() and render()")
        return self._arena

    def _checked(self, action: NDArray[np.float32]) -> tuple[float, float]:
        if np.shape(action) == (2,):
            linear, angular = float(action[0]), float(action[1])
            if abs(linear) <= 1.0 and abs(angular) <= 1.0:
                return linear, angular
        units = f"forward speed in {SCALE.linear} m/s, turn rate in {SCALE.angular} rad/s"
        raise gymnasium.error.InvalidAction(f"action: got {action!r}, want two numbers in -1 … 1: {units}")

    def _observe(self) -> Observation:
        arena = self._running()
        odometry = arena.odometry()
        if self._observe_kind == "state":
            self._look(arena)
            return state_of(self._last, self._seen, arena.time, odometry)
        motion = np.array((odometry.linear / SCALE.linear, odometry.angular / SCALE.angular), np.float32)
        frame = arena.frame()
        observation: dict[str, Any] = {"motion": np.clip(motion, -1.0, 1.0)}
        if self._observe_kind == "gray":
            gray = cv2.resize(cv2.cvtColor(frame.image, cv2.COLOR_BGR2GRAY), SMALL, interpolation=cv2.INTER_AREA)
            return observation | {"gray": gray[..., None]}
        known = cv2.inRange(frame.depth, 0.0, _DEPTH_REACH)
        depth = cv2.copyTo(frame.depth, known, np.zeros((HEIGHT, WIDTH), np.float32))
        scan = np.minimum(arena.scan().ranges, np.float32(lidar.RANGE_MAX))
        return observation | {"image": _rgb(frame.image), "depth": depth, "scan": scan}

    def _look(self, arena: Arena) -> None:
        """Remember where the person is, if a new frame has come and HOG finds the person in it."""
        plan = arena.plan(of_frame=True)
        if plan.stamp <= self._looked:
            return
        self._looked, self._seen = plan.stamp, False
        seen = glimpse(plan, arena.scenario, 0, self._walls)
        if seen is None or not seen.found:
            return
        period = round(plan.stamp * arena.scenario.camera.rate_hz)
        if self._misses and self._misses[0].at(period, seen.height_px):
            return
        self._seen = True
        off, longer = self._noise.standard_normal(2).tolist()
        bearing, distance = seen.bearing + _BEARING_NOISE * off, seen.distance + _RANGE_NOISE * longer
        self._last = sighted(bearing, distance, plan.stamp, arena.odometry(), self._last)


def _space(observe: str) -> spaces.Space[Any]:
    if observe == "state":
        return spaces.Box(-1.0, 1.0, (SIZE,), np.float32)
    motion = spaces.Box(-1.0, 1.0, (2,), np.float32)
    if observe == "gray":
        return spaces.Dict({"gray": spaces.Box(0, 255, (SMALL[1], SMALL[0], 1), np.uint8), "motion": motion})
    return spaces.Dict(
        {
            "image": spaces.Box(0, 255, (HEIGHT, WIDTH, 3), np.uint8),
            "depth": spaces.Box(0.0, _DEPTH_REACH, (HEIGHT, WIDTH), np.float32),
            "scan": spaces.Box(0.0, lidar.RANGE_MAX, (lidar.BEAMS,), np.float32),
            "motion": motion,
        }
    )


def _reward(seen: Glimpse | None, touched_person: int, touched_wall: int) -> dict[str, float]:
    """Return the parts of a reward that depend on the arena; `None` stands for a person who is not there."""
    follow = visible = 0.0
    if seen is not None:
        error = abs(seen.surface - SHAPING.target_m)
        facing = (1.0 + math.cos(seen.bearing)) / 2
        follow = SHAPING.follow * facing / (1.0 + error / SHAPING.halving_m)
        visible = SHAPING.visible * seen.visible
    contact = -SHAPING.person_contact * touched_person - SHAPING.wall_contact * touched_wall
    return {"follow": follow, "visible": visible, "contact": contact}


def _rgb(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return cv2.cvtColor(image, cv2.COLOR_BGR2RGB).astype(np.uint8, copy=False)


def hiding(scenario: Scenario) -> FloorPlan:
    """Return what a person may stand behind, unseen."""
    pieces = [piece.footprint for piece in scenario.furniture if piece.kind in _HIDING]
    return FloorPlan([*pieces, *(wall.footprint for wall in scenario.walls)], scenario.room.half, 0.0)


def glimpse(plan: Plan, scenario: Scenario, index: int, walls: FloorPlan) -> Glimpse | None:
    """Return what is seen of a person; None where the person is not in the arena. `walls` is what hides people."""
    pose = plan.people[index] if index < len(plan.people) else None
    if pose is None:
        return None
    person, robot = scenario.people[index], scenario.robot.geometry
    x, y, yaw = plan.robot
    dx, dy = pose.x - x, pose.y - y
    cos, sin = math.cos(yaw), math.sin(yaw)
    left, ahead = cos * dy - sin * dx, cos * dx + sin * dy
    bearing, distance = math.atan2(left, ahead), math.hypot(dx, dy)
    depth = ahead - robot.camera_x
    towards = yaw + math.atan2(left, depth)
    surface = math.hypot(depth, left) - trunk_radius(person, pose, towards)
    if depth < _NEAR:
        return Glimpse(bearing, distance, surface, 0.0, 0.0, False)
    scale = robot.focal_px(WIDTH) / depth
    column, half = -left * scale, _HALF_BREADTH * person.height * scale
    height, head = person.height * scale, (person.height - robot.camera_z) * scale
    across = min(column + half, WIDTH / 2) - max(column - half, -WIDTH / 2)
    upright = min(head, HEIGHT / 2) + min(robot.camera_z * scale, HEIGHT / 2)
    visible = max(across, 0.0) / (2 * half) * upright / height
    camera = x + robot.camera_x * cos, y + robot.camera_x * sin
    if visible > 0.0 and walls.hidden(np.array([camera]), np.array([(pose.x, pose.y)]))[0]:
        visible = 0.0
    found = visible >= CRITERIA.in_view and height >= _LEAST_PX and head <= HEIGHT / 2
    found = found and abs(column) <= WIDTH / 2 - _SIDE_PX
    return Glimpse(bearing, distance, surface, visible, height, found)


gymnasium.register("LimoFollow-v1", entry_point="limo_sim.env:LimoFollowV1", max_episode_steps=600)
