"""`LimoFollow-v0` keeps Gymnasium's rules."""

from __future__ import annotations

import dataclasses
import math
import warnings
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from numpy.typing import NDArray

from limo_hog.follow import ApproachController, TrackingController, detector_named
from limo_hog.follow.sense.observation import Odometry, Scan, observed
from limo_sim.env import LimoFollow, reward_parts
from limo_sim.sensing.camera import FOCAL_PX
from limo_sim.sensing.renderer import Renderer
from limo_sim.world.scenario import Person, Robot, Scenario
from limo_sim.world.truth import Contacts, PersonTruth, Truth

# Whoever makes v0 by name is told of v1.
pytestmark = pytest.mark.filterwarnings("ignore:.*LimoFollow-v0 is out of date")

STRAIGHT = np.array([0.2, 0.0], np.float32)


def seen_at(distance: float, visible: float, person: int = 0, wall: int = 0) -> Truth:
    standing = PersonTruth(distance + 0.2, 0.0, 0.0, distance + 0.2, 0.0, distance, visible, None)
    return Truth(1.0, (0.0, 0.0, 0.0), (standing,), Contacts(person, wall))


def total(truth: Truth, before: Contacts = Contacts()) -> float:  # noqa: B008 — frozen
    return sum(reward_parts(truth, before, STRAIGHT).values())


def test_gymnasiums_checker_accepts_it() -> None:
    with warnings.catch_warnings():
        # it would rather have actions within ±1; ours are metres and radians a second
        warnings.simplefilter("ignore", UserWarning)
        check_env(LimoFollow("followable", render_mode="rgb_array"))


def test_it_is_made_by_name() -> None:
    env = gymnasium.make("limo_sim.env:LimoFollow-v0", scenario="empty", render_mode="rgb_array")
    observation, _ = env.reset(seed=0)
    np.testing.assert_array_equal(env.render(), observation["image"])
    _, reward, terminated, truncated, info = env.step(STRAIGHT)
    assert reward == pytest.approx(sum(info["reward"].values()))
    assert info["time"] == pytest.approx(0.1)
    assert not terminated
    assert not truncated
    assert info["distance"] is None


def test_an_observation_is_finite_and_shows_the_arena() -> None:
    env = LimoFollow("workshop")
    env.reset(seed=3)
    observation, *_ = env.step(STRAIGHT)
    assert env.observation_space.contains(observation)
    assert all(np.isfinite(part).all() for part in observation.values())
    assert 0.3 < np.median(observation["depth"][400:]) < 0.6
    assert observation["odometry"][3] > 0


def test_the_spaces_hold_all_that_a_sensor_may_say() -> None:
    observed = LimoFollow("empty").observation_space
    assert isinstance(observed, gymnasium.spaces.Dict)
    for name, top in (("image", 255), ("depth", Scenario().depth.far_m), ("scan", 8.0)):
        space = observed[name]
        assert isinstance(space, gymnasium.spaces.Box)
        assert (space.low.min(), space.low.max()) == (0, 0)
        assert space.high.max() == pytest.approx(top)


def test_depth_that_is_unknown_or_out_of_range_is_0(monkeypatch: pytest.MonkeyPatch) -> None:
    env = LimoFollow("empty")
    env.reset(seed=0)
    frame = env._running().frame()
    depth = frame.depth.copy()
    depth[0, :3] = np.nan, np.inf, -np.inf
    monkeypatch.setattr(type(env._running()), "frame", lambda _: dataclasses.replace(frame, depth=depth))
    assert env._observe()["depth"][0, :3].tolist() == [0.0, 0.0, 0.0]


def test_the_distance_is_that_of_the_scenarios_first_person() -> None:
    people = (Person(route=((3.0, 0.0, 3600.0),)), Person(route=((2.0, 1.0, 3600.0),)))
    env = LimoFollow(Scenario(people=people))
    env.reset(seed=0)
    *_, info = env.step(np.zeros(2, np.float32))
    assert info["distance"] == pytest.approx(3.0)


def run(seed: int) -> list[Any]:
    env = LimoFollow("followable")
    env.reset(seed=seed)
    return [env.step(STRAIGHT) for _ in range(3)]


def test_the_same_seed_gives_the_same_episode() -> None:
    for one, other in zip(run(5), run(5), strict=True):
        for name, part in one[0].items():
            np.testing.assert_array_equal(part, other[0][name])
        assert one[1:] == other[1:]
    assert any((one[0]["image"] != other[0]["image"]).any() for one, other in zip(run(5), run(6), strict=True))


def test_touching_the_person_ends_the_episode() -> None:
    env = LimoFollow(Scenario(people=(Person(route=((1.2, 0.0, 0.0),)),)))
    env.reset(seed=0)
    for _ in range(30):
        _, _, terminated, _, info = env.step(np.array([1.0, 0.0], np.float32))
        if terminated:
            break
    assert terminated
    assert info["reward"]["contact"] <= -10


def test_the_reward_is_best_at_the_target_distance_in_view() -> None:
    assert total(seen_at(1.5, 1.0)) > total(seen_at(2.0, 1.0)) > total(seen_at(2.4, 1.0))
    assert total(seen_at(1.5, 1.0)) > total(seen_at(1.0, 1.0)) > total(seen_at(0.5, 1.0))
    assert total(seen_at(1.5, 1.0)) > total(seen_at(1.5, 0.5))
    assert total(seen_at(1.5, 1.0)) - total(seen_at(1.5, 1.0, person=1)) == pytest.approx(10)
    assert total(seen_at(1.5, 1.0)) - total(seen_at(1.5, 1.0, wall=2)) == pytest.approx(2)


@pytest.mark.parametrize("distance", [0.0, 0.3, 2.5, 4.0, 8.0])
def test_a_person_in_view_earns_more_than_looking_away_at_every_distance(distance: float) -> None:
    assert total(seen_at(distance, 1.0)) > total(seen_at(distance, 0.3)) > total(seen_at(distance, 0.0))
    nobody = Truth(1.0, (0.0, 0.0, 0.0), (), Contacts())
    assert total(seen_at(distance, 0.0)) == total(nobody) == pytest.approx(-0.002)


def test_only_new_contacts_cost() -> None:
    assert total(seen_at(1.5, 1.0, person=2, wall=3), Contacts(2, 3)) == total(seen_at(1.5, 1.0))
    assert total(seen_at(1.5, 1.0, wall=3), Contacts(0, 2)) == pytest.approx(total(seen_at(1.5, 1.0)) - 1)


def test_a_contact_with_the_wall_costs_once_and_the_episode_goes_on() -> None:
    env = LimoFollow(Scenario(robot=Robot(x=4.5)))
    env.reset(seed=0)
    steps = [env.step(np.array([0.3, 0.0], np.float32)) for _ in range(15)]
    costs = [info["reward"]["contact"] for *_, info in steps]
    assert sum(costs) == min(costs) == -1.0
    assert not any(terminated for _, _, terminated, _, _ in steps)


@pytest.mark.parametrize("action", [[math.nan, 0.0], [0.0, math.inf], [0.1], [0.1, 0.0, 0.0], 0.3])
def test_an_action_that_is_not_two_finite_numbers_is_refused_by_name(action: Any) -> None:
    env = LimoFollow("empty")
    env.reset(seed=0)
    with pytest.raises(gymnasium.error.InvalidAction, match=r"action: got .*, want two finite numbers"):
        env.step(np.array(action, np.float32))


def test_an_action_draws_one_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    env = LimoFollow("standing")
    env.reset(seed=0)
    drawn = 0
    draw = Renderer._draw

    def counted(*arguments: Any) -> Any:
        nonlocal drawn
        drawn += 1
        return draw(*arguments)

    monkeypatch.setattr(Renderer, "_draw", counted)
    for _ in range(5):
        env.step(STRAIGHT)
    assert drawn == 5


class Policy:
    """A controller of `limo_hog.follow` as a policy of the environment."""

    def __init__(self, controller: Any) -> None:
        self.controller, self.state, self.detector = controller, controller.start(), detector_named("hog")

    def __call__(self, observation: Any, time: float) -> NDArray[np.float32]:
        image = np.ascontiguousarray(observation["image"][:, :, ::-1])
        scan = Scan(time, observation["scan"], -2.0, 2.0, 0.12, 8.0)
        odometry = Odometry(time, *observation["odometry"].tolist())
        found = self.detector.detect(image)
        seen = observed(time, image, FOCAL_PX, found, None, observation["depth"], scan, odometry)
        decision = self.controller.step(seen, self.state)
        self.state = decision.state
        return np.array([decision.twist.linear, decision.twist.angular], np.float32)


def earned(scenario: str, policy: Callable[[Any, float], NDArray[np.float32]], steps: int, seed: int = 0) -> float:
    """Return the reward of an episode of at most `steps` actions."""
    env = LimoFollow(scenario)
    observation, info = env.reset(seed=seed)
    sum_ = 0.0
    for _ in range(steps):
        observation, reward, terminated, _, info = env.step(policy(observation, info["time"]))
        sum_ += reward
        if terminated:
            break
    return sum_


def test_holding_the_distance_earns_most_approaching_less_and_chance_least() -> None:
    random = np.random.default_rng(0)
    limits = np.array([1.0, 2 / 0.172])
    policies: dict[str, Callable[[Any, float], NDArray[np.float32]]] = {
        "tracking": Policy(TrackingController()),
        "approach": Policy(ApproachController()),
        "still": lambda *_: np.zeros(2, np.float32),
        "random": lambda *_: random.uniform(-limits, limits).astype(np.float32),
    }
    rewards = {name: earned("standing", policy, 150) for name, policy in policies.items()}
    assert rewards["tracking"] > rewards["approach"] > rewards["random"]
    assert rewards["tracking"] > rewards["still"] > rewards["random"]


def test_stepping_before_reset_is_an_error_that_says_so() -> None:
    with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
        LimoFollow().step(STRAIGHT)


def test_vectorised_runs_in_two_processes_equal_runs_in_one() -> None:
    results = []
    for mode in ("async", "sync"):
        env = gymnasium.make_vec(
            "limo_sim.env:LimoFollow-v0", num_envs=2, vectorization_mode=mode, scenario="followable"
        )
        env.reset(seed=1)
        for _ in range(3):
            observation, reward, *_ = env.step(np.stack([STRAIGHT, -STRAIGHT]))
        results.append((observation["image"].copy(), observation["scan"].copy(), reward.copy()))
        env.close()
    for one, other in zip(*results, strict=True):
        np.testing.assert_array_equal(one, other)
