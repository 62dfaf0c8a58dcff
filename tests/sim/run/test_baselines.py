"""Pure pursuit drives the arc to the last sighting; a policy does what its network says; wrong names are refused."""

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from limo_hog.detections import Detections
from limo_hog.follow.control.naming import ControllerError
from limo_hog.follow.decision import Mode
from limo_hog.follow.robot import LIMO
from limo_hog.follow.sense.observation import Observation, Odometry
from limo_sim.env import LimoFollowV1
from limo_sim.run.baselines import PPO_FILE, Policy, PurePursuit, controller_of
from limo_sim.run.last_seen import SIZE, LastSeen


def seeing(*places: tuple[float, float], stamp: float = 1.0, odometry: Odometry | None = None) -> Observation:
    """Return an observation of people at places x, y from the robot's centre [m], the first with the highest score."""
    depth = np.full((480, 640), 8.0, np.float32)
    boxes = []
    for x, y in places:
        ahead = x - 0.084
        column = round(320 - LIMO.focal_px(640) * y / ahead)
        boxes.append([column - 40, 120, 80, 160])
        depth[:, column - 40 : column + 40] = ahead
    found = Detections(np.array(boxes, np.int32).reshape(-1, 4), np.arange(len(boxes), 0.0, -1.0))
    return Observation(stamp, 640, 480, LIMO.focal_px(640), found, depth=depth, odometry=odometry or Odometry(stamp))


def test_pure_pursuit_drives_the_circle_through_the_person() -> None:
    decision = PurePursuit().step(seeing((2.5, 0.8)), None)
    twist = decision.twist
    radius = twist.linear / twist.angular
    # The circle that touches the robot's heading at the origin, and on which the person stands.
    assert math.hypot(2.5, 0.8 - radius) == pytest.approx(radius, rel=0.02)
    assert twist.linear == pytest.approx(0.7)
    assert decision.mode is Mode.FOLLOW


def test_pure_pursuit_stands_at_its_distance_and_never_backs_off() -> None:
    for x in (1.584, 1.2):
        assert PurePursuit().step(seeing((x, 0.0)), None).twist.linear == pytest.approx(0.0, abs=1e-6)
    assert controller_of("pursuit", 1.0).step(seeing((1.2, 0.0)), None).twist.linear > 0


def test_pure_pursuit_goes_on_to_where_the_person_was_last_seen() -> None:
    first = PurePursuit().step(seeing((2.5, 0.8)), None)
    lost = PurePursuit().step(seeing(stamp=2.0, odometry=Odometry(2.0, x=0.5)), first.state)
    assert (lost.mode, lost.target) == (Mode.LOST, None)
    assert lost.twist.angular / lost.twist.linear == pytest.approx(2 * 0.8 / (2.0**2 + 0.8**2), rel=0.02)
    nobody = PurePursuit().step(seeing(), None)
    assert (nobody.mode, nobody.twist.linear, nobody.twist.angular) == (Mode.SEARCH, 0.0, 0.0)


def test_the_person_is_the_one_nearest_to_the_last_sighting_not_the_surest() -> None:
    state = PurePursuit().step(seeing((2.5, 0.8)), None).state
    decision = PurePursuit().step(seeing((2.5, -0.8), (2.5, 0.7), stamp=1.1), state)
    assert decision.target == 1
    # Nobody near: none of them is the person, until the person is forgotten.
    assert PurePursuit().step(seeing((2.5, -0.8), stamp=1.1), state).target is None
    assert PurePursuit().step(seeing((2.5, -0.8), stamp=7.0), state).target == 0


def network(path: Path, *layers: tuple[NDArray[np.float32], NDArray[np.float32]]) -> Path:
    named = {f"w{index}": w for index, (w, _) in enumerate(layers)} | {f"b{k}": b for k, (_, b) in enumerate(layers)}
    np.savez(path, allow_pickle=False, **named)
    return path


def test_a_policy_is_a_network_with_tanh_and_acts_in_units_of_the_environments(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    w0, w1, b0, b1 = (random.normal(size=size).astype(np.float32) for size in ((SIZE, 4), (4, 2), 4, 2))
    policy = controller_of(f"policy:{network(tmp_path / 'a.npz', (w0, b0), (w1, b1))}")
    assert isinstance(policy, Policy)
    state = random.normal(size=SIZE).astype(np.float32)
    np.testing.assert_allclose(policy.act(state), np.clip(np.tanh(state @ w0 + b0) @ w1 + b1, -1, 1), rtol=1e-6)
    constant = np.zeros((SIZE, 2), np.float32), np.array([0.5, -2.0], np.float32)
    policy = Policy(network(tmp_path / "b.npz", constant))
    decision = policy.step(seeing((2.5, 0.8)), policy.start())
    assert (decision.twist.linear, decision.twist.angular) == pytest.approx((0.35, -1.5))
    assert isinstance(decision.state, LastSeen)


def test_wrong_controllers_and_files_that_are_no_policies_are_refused_by_name(tmp_path: Path) -> None:
    for name, target, told in (
        ("nobody", None, "no controller 'nobody': want one of approach, proxemic, tracking, pursuit, ppo"),
        ("ppo", 2.0, "the controller ppo holds the distance it was trained for"),
        ("approach", 2.0, "approach controller holds no distance"),
        ("policy:none.npz", None, "none.npz: cannot be read as a policy"),
    ):
        with pytest.raises(ControllerError, match=told):
            controller_of(name, target)
    (tmp_path / "text.npz").write_text("no network")
    network(tmp_path / "wrong.npz", (np.zeros((4, 2), np.float32), np.zeros(2, np.float32)))
    np.savez(tmp_path / "pickled.npz", w0=np.array([object()]), b0=np.zeros(2))
    wanted = {"text": "cannot be read", "wrong": "want a network from 9 numbers to 2", "pickled": "cannot be"}
    for name, told in wanted.items():
        with pytest.raises(ControllerError, match=rf"{name}\.npz: .*{told}"):
            Policy(tmp_path / f"{name}.npz")


def test_the_policy_that_comes_along_earns_more_than_standing_still() -> None:
    earned = []
    for act in (Policy(PPO_FILE).act, lambda _: np.zeros(2, np.float32)):
        env, rewards = LimoFollowV1("followable"), 0.0
        state, _ = env.reset(seed=7)
        for _ in range(300):
            state, reward, terminated, _, _ = env.step(act(state))
            rewards += reward
            assert not terminated
        earned.append(rewards)
    assert earned[0] > max(200, 1.5 * earned[1])
