"""`LimoFollow-v0`: the arena as a Gymnasium environment; ten actions a second, one for each camera frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from limo_hog.follow.robot import LIMO, Twist
from limo_sim.run.arena import STEPS_PER_SECOND, Arena
from limo_sim.run.catalogue import load
from limo_sim.sensing import lidar
from limo_sim.sensing.camera import HEIGHT, WIDTH
from limo_sim.world.scenario import Scenario
from limo_sim.world.truth import Contacts, Truth
from limo_sim.world.variants import made_up

ACTIONS_PER_SECOND = 10


@dataclass(frozen=True, slots=True)
class Reward:
    """Weights of the reward.

    Attributes
    ----------
    target_m
        Distance from the camera to the person's surface that is rewarded most [m]: the one that the controllers hold.
    halving_m
        Error of the distance at which half of the reward for a visible person is left [m]. Chosen: the slope is
        steepest near the target, and a person at the far wall, 5 m too far, still earns a sixth.
    person_contact, wall_contact
        What a new contact costs. Chosen: a contact with a person costs a second of perfect following, with a wall a
        tenth of that.
    effort
        What a metre or a radian per second costs. Chosen: a hundredth of what a visible person earns, so that of two
        ways to see the same the calmer one earns more.
    """

    target_m: float = 1.5
    halving_m: float = 1.0
    person_contact: float = 10.0
    wall_contact: float = 1.0
    effort: float = 0.01


REWARD = Reward()

Observation = dict[str, Any]


class LimoFollow(gymnasium.Env[Observation, NDArray[np.float32]]):
    """Follow the scenario's first person.

    An observation is a dict of `image`, uint8 (480, 640, 3) RGB; `depth`, float32 (480, 640) [m], 0 where it is
    unknown or out of range; `scan`, float32 (292,) [m], 8 where nothing was hit; and `odometry`, float64 (5,):
    x, y, yaw, forward speed and turn rate [m, m, rad, m/s, rad/s]. An action is float32 (2,): forward speed [m/s] and
    turn rate [rad/s]. The reward is the sum of the parts in `info["reward"]` (see `reward_parts`): at most 1 an action.
    An episode ends when the robot touches a person.

    Parameters
    ----------
    scenario
        A `Scenario`, a name or a file that `catalogue.load` knows, or "random": a new one at every reset.
    render_mode
        "rgb_array": `render` returns the image of the last observation.

    Raises
    ------
    ScenarioError
        If there is no such scenario, or it asks for faults of a detector: this environment has none.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": ACTIONS_PER_SECOND}  # noqa: RUF012 (Gymnasium's own way)

    def __init__(self, scenario: Scenario | str = "workshop", render_mode: str | None = None) -> None:
        self.render_mode = render_mode
        self._scenario: Scenario | None = None
        if scenario != "random":
            self._scenario = scenario if isinstance(scenario, Scenario) else load(scenario)
            self._scenario.check_detector_is_plain("LimoFollow-v0 gives images, and has no detector")
        known = self._scenario or Scenario()
        speed = known.robot.wheel_speed
        limits = np.array([speed, 2 * speed / LIMO.wheel_separation], np.float32)
        self.action_space = spaces.Box(-limits, limits, dtype=np.float32)
        self.observation_space = spaces.Dict(
            {
                "image": spaces.Box(0, 255, (HEIGHT, WIDTH, 3), np.uint8),
                "depth": spaces.Box(0.0, known.depth.far_m, (HEIGHT, WIDTH), np.float32),
                "scan": spaces.Box(0.0, lidar.RANGE_MAX, (lidar.BEAMS,), np.float32),
                "odometry": spaces.Box(-np.inf, np.inf, (5,), np.float64),
            }
        )
        self._arena: Arena | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode; the same `seed` gives the same one."""
        super().reset(seed=seed, options=options)
        scenario = self._scenario or made_up(int(self.np_random.integers(2**31)))
        self._arena = Arena(scenario, int(self.np_random.integers(2**31)))
        return self._observe(), {"time": 0.0}

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Drive for a tenth of a second.

        Raises
        ------
        gymnasium.error.InvalidAction
            If the action is not two finite numbers.
        """
        arena = self._running()
        if np.shape(action) != (2,) or not np.isfinite(action).all():
            raise gymnasium.error.InvalidAction(
                f"action: got {action!r}, want two finite numbers: forward speed [m/s] and turn rate [rad/s]"
            )
        before = arena.contacts
        arena.command(Twist(float(action[0]), float(action[1])))
        for _ in range(STEPS_PER_SECOND // ACTIONS_PER_SECOND):
            arena.step()
        observation = self._observe()
        # After the observation: the truth of a frame that has been drawn costs nothing.
        truth = arena.truth()
        parts = reward_parts(truth, before, action)
        info = {"time": arena.time, "reward": parts, "distance": _distance(truth)}
        return observation, sum(parts.values()), truth.contacts.person > 0, False, info

    def render(self) -> NDArray[np.uint8] | None:
        """Return the newest camera image, uint8 (480, 640, 3) RGB."""
        return self._image() if self.render_mode == "rgb_array" else None

    def _running(self) -> Arena:
        if self._arena is None:
            raise gymnasium.error.ResetNeeded("call reset() before step() and render()")
        return self._arena

    def _image(self) -> NDArray[np.uint8]:
        return np.ascontiguousarray(self._running().frame().image[..., ::-1])

    def _observe(self) -> Observation:
        arena = self._running()
        odometry = arena.odometry()
        return {
            "image": self._image(),
            "depth": np.nan_to_num(arena.frame().depth, nan=0.0, posinf=0.0, neginf=0.0),
            "scan": np.minimum(arena.scan().ranges, np.float32(lidar.RANGE_MAX)),
            "odometry": np.array([odometry.x, odometry.y, odometry.yaw, odometry.linear, odometry.angular], np.float64),
        }


def reward_parts(
    truth: Truth, before: Contacts, action: NDArray[np.float32], weights: Reward = REWARD
) -> dict[str, float]:
    """Return the reward of one action, by what it is for.

    `visible`: share of the first person's silhouette in the image, 0 … 1. `distance`: what of it is taken away for the
    error of the distance, `-visible * error / (error + halving_m)`: nothing at the target, never all of it, so that a
    visible person always earns more than one who is out of view. `contact`: minus 10 for a new contact with a person,
    minus 1 with a wall or furniture. `effort`: minus a hundredth of the sizes of the action's numbers.
    """
    person = truth.people[0] if truth.people else None
    visible = person.visible if person else 0.0
    error = abs(person.surface_distance - weights.target_m) if person else 0.0
    touched_person = truth.contacts.person - before.person
    touched_wall = truth.contacts.wall - before.wall
    return {
        "visible": visible,
        "distance": -visible * error / (error + weights.halving_m),
        "contact": -weights.person_contact * touched_person - weights.wall_contact * touched_wall,
        "effort": -weights.effort * float(np.abs(action).sum()),
    }


def _distance(truth: Truth) -> float | None:
    person = truth.people[0] if truth.people else None
    return person.distance if person else None
