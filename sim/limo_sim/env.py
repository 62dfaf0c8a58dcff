"""`LimoFollow-v0`: the arena as a Gymnasium environment; ten actions a second, one for each camera frame.

`gymnasium.make("limo_sim.env:LimoFollow-v0")` imports this module, which registers it.
"""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from limo_hog.follow.twist import Twist
from limo_sim.run.arena import STEPS_PER_SECOND, Arena
from limo_sim.run.catalogue import load
from limo_sim.sensing import lidar
from limo_sim.sensing.camera import HEIGHT, WIDTH
from limo_sim.world.robot import WHEEL_SEPARATION
from limo_sim.world.scenario import Scenario
from limo_sim.world.truth import Contacts, Truth
from limo_sim.world.variants import made_up

ACTIONS_PER_SECOND = 10
TARGET_M = 1.5
"""The distance from the person that is rewarded most."""

Observation = dict[str, Any]


class LimoFollow(gymnasium.Env[Observation, NDArray[np.float32]]):
    """Follow the scenario's first person.

    An observation is a dict of `image`, uint8 (480, 640, 3) RGB; `depth`, float32 (480, 640) [m], 0 where it is
    unknown or out of range; `scan`, float32 (292,) [m], 8 where nothing was hit; and `odometry`, float64 (5,):
    x, y, yaw, forward speed and turn rate [m, m, rad, m/s, rad/s]. An action is float32 (2,): forward speed and
    turn rate. The reward is the sum of the parts in `info["reward"]`. An episode ends when the robot touches a
    person.

    Parameters
    ----------
    scenario
        A `Scenario`, a name or a file that `catalogue.load` knows, or "random": a new one at every reset.
    render_mode
        "rgb_array": `render` returns the image of the last observation.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": ACTIONS_PER_SECOND}  # noqa: RUF012 (Gymnasium's own way)

    def __init__(self, scenario: Scenario | str = "workshop", render_mode: str | None = None) -> None:
        self.render_mode = render_mode
        self._scenario: Scenario | None = None
        if scenario != "random":
            self._scenario = scenario if isinstance(scenario, Scenario) else load(scenario)
        known = self._scenario or Scenario()
        speed = known.robot.wheel_speed
        limits = np.array([speed, 2 * speed / WHEEL_SEPARATION], np.float32)
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
        """Start again; the same `seed` gives the same episode."""
        super().reset(seed=seed, options=options)
        scenario = self._scenario or made_up(int(self.np_random.integers(2**31)))
        self._arena = Arena(scenario, int(self.np_random.integers(2**31)))
        return self._observe(), {"time": 0.0}

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Drive for a tenth of a second."""
        arena = self._running()
        before = arena.contacts
        arena.command(Twist(float(action[0]), float(action[1])))
        for _ in range(STEPS_PER_SECOND // ACTIONS_PER_SECOND):
            arena.step()
        truth = arena.truth()
        parts = reward_parts(truth, before, action)
        info = {"time": arena.time, "reward": parts, "distance": _distance(truth)}
        return self._observe(), sum(parts.values()), truth.contacts.person > 0, False, info

    def render(self) -> NDArray[np.uint8] | None:
        """Return the newest camera image, uint8 (480, 640, 3) RGB."""
        return self._image() if self.render_mode == "rgb_array" else None

    def _running(self) -> Arena:
        if self._arena is None:
            raise gymnasium.error.ResetNeeded("call reset() before step() and render()")
        return self._arena

    def _image(self) -> NDArray[np.uint8]:
        return np.ascontiguousarray(self._running().frame().image[:, :, ::-1])

    def _observe(self) -> Observation:
        arena = self._running()
        odometry = arena.odometry()
        return {
            "image": self._image(),
            "depth": np.nan_to_num(arena.frame().depth, nan=0.0, posinf=0.0, neginf=0.0),
            "scan": np.minimum(arena.scan().ranges, np.float32(lidar.RANGE_MAX)),
            "odometry": np.array([odometry.x, odometry.y, odometry.yaw, odometry.linear, odometry.angular], np.float64),
        }


def reward_parts(truth: Truth, before: Contacts, action: NDArray[np.float32]) -> dict[str, float]:
    """Reward of one action, by what it is for.

    `visible`: how much of the first person the camera sees, 0 … 1. `distance`: minus how far from 1.5 m, at most
    1, while the person is seen. `contact`: -10 for every new contact with a person, -1 with a wall or furniture.
    `effort`: a little against driving for its own sake.
    """
    person = truth.people[0] if truth.people else None
    visible = person.visible if person else 0.0
    gap = min(abs(person.distance - TARGET_M), 1.0) if person and visible > 0 else 0.0
    touched_person = truth.contacts.person - before.person
    touched_wall = truth.contacts.wall - before.wall
    return {
        "visible": visible,
        "distance": -gap,
        "contact": -10.0 * touched_person - 1.0 * touched_wall,
        "effort": -0.01 * float(np.abs(action).sum()),
    }


def _distance(truth: Truth) -> float | None:
    person = truth.people[0] if truth.people else None
    return person.distance if person else None


gymnasium.register("LimoFollow-v0", entry_point="limo_sim.env:LimoFollow", max_episode_steps=600)
