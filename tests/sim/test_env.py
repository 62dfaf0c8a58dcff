"""`LimoFollow-v0` keeps Gymnasium's rules."""

from __future__ import annotations

import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from limo_sim.env import LimoFollow, reward_parts
from limo_sim.world.scenario import Person, Scenario
from limo_sim.world.truth import Contacts, PersonTruth, Truth

STRAIGHT = np.array([0.2, 0.0], np.float32)


def seen_at(distance: float, visible: float, person: int = 0, wall: int = 0) -> Truth:
    somebody = PersonTruth(distance, 0.0, 0.0, distance, 0.0, distance, visible, None)
    return Truth(1.0, (0.0, 0.0, 0.0), (somebody,), Contacts(person, wall))


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
    env = LimoFollow("workshop:4")
    env.reset(seed=3)
    observation, *_ = env.step(STRAIGHT)
    assert env.observation_space.contains(observation)
    assert all(np.isfinite(part).all() for part in observation.values())
    assert 0.3 < np.median(observation["depth"][400:]) < 0.6
    assert observation["odometry"][3] > 0


def run(seed: int) -> list[Any]:
    env = LimoFollow("random")
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
    def total(truth: Truth) -> float:
        return sum(reward_parts(truth, Contacts(), STRAIGHT).values())

    assert total(seen_at(1.5, 1.0)) > total(seen_at(2.0, 1.0)) > total(seen_at(2.4, 1.0))
    assert total(seen_at(1.5, 1.0)) > total(seen_at(1.5, 0.5))
    assert total(seen_at(1.5, 1.0)) - total(seen_at(1.5, 1.0, person=1)) == pytest.approx(10)
    assert total(seen_at(1.5, 1.0)) - total(seen_at(1.5, 1.0, wall=2)) == pytest.approx(2)


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
