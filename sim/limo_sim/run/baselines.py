"""Controllers to compare with, beside those of `limo_hog.follow`: pure pursuit, and policies that were learnt."""

from __future__ import annotations

import math
import zipfile
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.control.naming import CONTROLLERS, ControllerError, controller_named
from limo_hog.follow.decision import Controller, Decision, Mode
from limo_hog.follow.parameters import param
from limo_hog.follow.robot import LIMO, RobotGeometry, Twist
from limo_hog.follow.sense.measurement import measure
from limo_hog.follow.sense.observation import Observation, Odometry
from limo_sim.run.last_seen import SCALE, SIZE, LastSeen, sighted, state_of

#: Names that `controller_of` knows beside those of `limo_hog.follow` and "policy:FILE.npz".
BASELINES = ("pursuit", "ppo")
#: The policy of examples/train_ppo.py.
PPO_FILE = Path(__file__).with_name("ppo.npz")
# A box further than this from where the person would be now is another person's [m]. Chosen: 1.5 m/s for half a second.
_SAME_PERSON = 0.75
# After this time any box will do [s]: the tracking controller's, too, forgets a person who is away for long.
_FORGET_S = 5.0


def controller_of(name: str, target: float | None = None) -> Controller[Any]:
    """Return a controller by its name, with another distance to hold [m] where one is given.

    The name is one of `limo_hog.follow.control.naming.CONTROLLERS` or `BASELINES`, or "policy:FILE.npz". Raises
    `ControllerError` where there is no such controller, it holds no distance, or the file is no policy.
    """
    if name in CONTROLLERS:
        return controller_named(name, target)
    if name == "pursuit":
        return PurePursuit() if target is None else PurePursuit(target_distance=target)
    if name == "ppo" or name.startswith("policy:"):
        if target is not None:
            raise ControllerError(f"the controller {name} holds the distance it was trained for: leave --target out")
        return Policy(PPO_FILE if name == "ppo" else Path(name.removeprefix("policy:")))
    known = ", ".join((*CONTROLLERS, *BASELINES))
    raise ControllerError(f"no controller {name!r}: want one of {known}, policy:FILE.npz")


@dataclass(frozen=True, slots=True)
class PurePursuit:
    """Drive the arc that leads to where the person was last seen (Coulter, CMU-RI-TR-92-01, 1992).

    The curvature is 2 sin(bearing) / distance. The state is the last sighting.
    """

    target_distance: float = param(1.5, "m", "Distance to hold, from the camera to the person's surface.", 0.1, 8)
    linear_gain: float = param(0.8, "1/s", "Speed for each metre of error.", 0, 5)
    max_linear: float = param(0.7, "m/s", "Limit of the speed; it never drives backwards.", 0, 1)
    max_angular: float = param(1.5, "rad/s", "Limit of the turn rate, either way.", 0, 3)
    robot: RobotGeometry = LIMO  #: where its camera sits

    def start(self) -> LastSeen | None:
        """Return the state before the first observation."""
        return None

    def step(self, observation: Observation, state: LastSeen | None) -> Decision[LastSeen | None]:
        """Drive towards the last sighting; stand where there was none."""
        odometry = observation.odometry or Odometry()
        target, state = _look(observation, self.robot, odometry, state)
        if state is None:
            return Decision(Twist(), None, Mode.SEARCH, "no person detected")
        dx, dy = state.x - odometry.x, state.y - odometry.y
        bearing, distance = math.atan2(dy, dx) - odometry.yaw, math.hypot(dx, dy)
        error = distance - self.robot.camera_x - self.target_distance
        linear = min(max(self.linear_gain * error, 0.0), self.max_linear)
        angular = 2.0 * linear * math.sin(bearing) / max(distance, 0.1)
        twist = Twist(linear, min(max(angular, -self.max_angular), self.max_angular))
        mode = Mode.LOST if target is None else Mode.FOLLOW
        return Decision(twist, state, mode, "driving the arc to the last sighting", target)


@dataclass(frozen=True)
class Policy:
    """A network that was learnt in `LimoFollow-v1` from the observation "state".

    The state is the last sighting. Raises `ControllerError` where the file cannot be read, or is no such network.
    """

    #: An .npz file with the arrays `w0`, `b0`, `w1`, `b1`, …: float32 weights (inputs, outputs) and biases of layers
    #: with tanh between them, from the 9 numbers of `state_of` to the 2 of an action.
    path: Path
    target_distance: float = 1.5  #: the distance that the environment's reward holds best [m]
    robot: RobotGeometry = LIMO  #: where its camera sits

    def __post_init__(self) -> None:
        # A wrong file is an error before the robot starts.
        _ = self._layers

    def start(self) -> LastSeen | None:
        """Return the state before the first observation."""
        return None

    def step(self, observation: Observation, state: LastSeen | None) -> Decision[LastSeen | None]:
        """Do what the network says."""
        odometry = observation.odometry or Odometry()
        target, state = _look(observation, self.robot, odometry, state)
        values = state_of(state, target is not None, observation.now, odometry)
        linear, angular = self.act(values).tolist()
        mode = Mode.FOLLOW if target is not None else Mode.SEARCH if state is None else Mode.LOST
        return Decision(Twist(SCALE.linear * linear, SCALE.angular * angular), state, mode, "by the network", target)

    def act(self, state: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the action, float32 (2,) in -1 … 1, for a state, float32 (9,)."""
        values = state
        for index, (weights, biases) in enumerate(self._layers):
            values = values @ weights + biases
            if index + 1 < len(self._layers):
                values = np.tanh(values)
        return np.clip(values, -1.0, 1.0)

    @cached_property
    def _layers(self) -> list[tuple[NDArray[np.float32], NDArray[np.float32]]]:
        try:
            with np.load(self.path, allow_pickle=False) as file:
                layers = [(file[f"w{index}"], file[f"b{index}"]) for index in range(len(file.files) // 2)]
        except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
            raise ControllerError(f"{self.path}: cannot be read as a policy: {error}") from error
        sizes = [weights.shape for weights, _ in layers]
        inputs, outputs = [size[0] for size in sizes], [size[-1] for size in sizes]
        if not layers or inputs != [SIZE, *outputs[:-1]] or outputs[-1] != 2:
            raise ControllerError(f"{self.path}: layers of {sizes}, want a network from {SIZE} numbers to 2")
        return layers


def _look(
    observation: Observation, robot: RobotGeometry, odometry: Odometry, before: LastSeen | None
) -> tuple[int | None, LastSeen | None]:
    """Return the box that is the person's, and the newest sighting.

    The first person is the one with the highest score; then the box nearest to where that person would be now.
    """
    seen = [
        (index, sighted(found.bearing, found.range, observation.stamp, odometry, before))
        for index, found in enumerate(measure(observation, robot))
        if found.range is not None
    ]
    if not seen:
        return None, before
    if before is None or observation.stamp - before.stamp > _FORGET_S:
        return seen[0]
    index, nearest = min(seen, key=lambda one: math.dist((one[1].x, one[1].y), (before.x, before.y)))
    gap = math.dist((nearest.x, nearest.y), (before.x, before.y))
    slack = _SAME_PERSON + SCALE.person * (observation.stamp - before.stamp)
    return (index, nearest) if gap <= slack else (None, before)
