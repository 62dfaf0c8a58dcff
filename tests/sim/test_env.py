"""`LimoFollow-v1` keeps Gymnasium's rules, its reward has a slope everywhere, and its state is what HOG would tell."""

import cmath
import math
import warnings
from dataclasses import astuple, replace
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from tests.sim.logs import there

from limo_hog.follow.robot import LIMO
from limo_hog.follow.sense.observation import Odometry
from limo_sim.env import SHAPING, Glimpse, LimoFollowV1, _reward, glimpse, hiding
from limo_sim.run.arena import Arena, Plan
from limo_sim.run.last_seen import sighted, state_of
from limo_sim.sensing.renderer import Renderer
from limo_sim.world.person import Pose
from limo_sim.world.scenario import Depth, DetectorFaults, Furniture, Person, Robot, Scenario, Wall
from limo_sim.world.schema import ScenarioError

STILL, AHEAD = np.zeros(2, np.float32), np.array([0.3, 0.0], np.float32)
STANDING = Scenario(people=(Person(route=((2.5, 0.0, 0.0),)),))


def begun(scenario: Any = "workshop", observe: str = "state", seed: int = 0) -> LimoFollowV1:
    env = LimoFollowV1(scenario, observe)
    env.reset(seed=seed)
    return env


@pytest.mark.parametrize("observe", ["state", "gray", "camera"])
def test_it_is_made_by_name_and_gymnasiums_checker_accepts_it_without_a_warning(observe: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make("limo_sim.env:LimoFollow-v1", observe=observe, render_mode="rgb_array")
        check_env(env.unwrapped)
    env.reset(seed=0)
    for action in (AHEAD, -AHEAD, env.action_space.sample()):
        _, reward, terminated, truncated, info = env.step(action)
        assert reward == pytest.approx(sum(info["reward"].values()))
        assert not terminated and not truncated
    assert info["time"] == pytest.approx(0.3)


def test_an_action_is_in_units_of_the_tracking_controllers_limits() -> None:
    env = begun(Scenario(people=(Person(route=((-2.5, 0.0, 0.0),)),)))
    state = [env.step(np.array([0.5, 0.0], np.float32))[0] for _ in range(10)][-1]
    assert state[7] == pytest.approx(0.5, abs=1e-6)
    assert env._running().odometry().linear == pytest.approx(0.35)


@pytest.mark.parametrize("action", [[math.nan, 0.0], [0.0, 1.01], [-2.0, 0.0], [0.1], [0.1, 0.0, 0.0], 0.3])
def test_an_action_out_of_its_range_is_refused_by_name(action: Any) -> None:
    env = begun()
    with pytest.raises(gymnasium.error.InvalidAction, match=r"action: got .*, want two numbers in -1 … 1"):
        env.step(np.array(action, np.float32))


def test_wrong_words_and_faults_beside_images_are_refused_by_name() -> None:
    unkind = replace(STANDING, name="unkind", detector=DetectorFaults(recall=0.5))
    with pytest.raises(ScenarioError, match="observe: got 'depth', want one of camera, gray, state"):
        LimoFollowV1(observe="depth")
    with pytest.raises(ScenarioError, match=r"'unkind': detector: .*observe the state"):
        LimoFollowV1(unkind, "gray")
    with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
        LimoFollowV1().step(STILL)


def follow(bearing: float, surface: float, visible: float = 0.0) -> float:
    return sum(_reward(Glimpse(bearing, surface + 0.2, surface, visible, 100.0, False), 0, 0).values())


@pytest.mark.parametrize("surface", [0.2, 1.0, 1.5, 2.5, 4.0, 8.0])
def test_turning_towards_the_person_earns_more_from_every_bearing(surface: float) -> None:
    rewards = [follow(bearing, surface) for bearing in np.linspace(0.0, math.pi, 181)]
    assert (np.diff(rewards) < -1e-7).all()


@pytest.mark.parametrize("bearing", [-3.0, -1.0, 0.0, 0.5, 2.0])
def test_a_step_towards_the_distance_earns_more_from_everywhere(bearing: float) -> None:
    beyond = [follow(bearing, surface) for surface in np.linspace(1.5, 12.0, 200)]
    before = [follow(bearing, surface) for surface in np.linspace(0.0, 1.5, 50)]
    assert (np.diff(beyond) < -1e-7).all() and (np.diff(before) > 1e-7).all()


def test_the_best_reward_is_one_and_contacts_and_changes_of_the_action_cost() -> None:
    assert follow(0.0, 1.5, 1.0) == pytest.approx(1.0)
    assert sum(_reward(None, 1, 2).values()) == pytest.approx(-SHAPING.person_contact - 2 * SHAPING.wall_contact)
    env = begun(STANDING)
    first, second = (env.step(AHEAD)[4]["reward"]["effort"] for _ in range(2))
    assert first == pytest.approx(-0.3 * (SHAPING.effort + SHAPING.jerk))
    assert second == pytest.approx(-0.3 * SHAPING.effort)


def test_touching_the_person_ends_the_episode_and_a_contact_with_the_wall_costs_once() -> None:
    env, terminated, steps = begun(Scenario(people=(Person(route=((1.2, 0.0, 0.0),)),))), False, 0
    while not terminated and steps < 30:
        _, reward, terminated, _, _ = env.step(np.array([1.0, 0.0], np.float32))
        steps += 1
    assert terminated
    assert reward < -SHAPING.person_contact + 1
    env = begun(Scenario(robot=Robot(x=4.5)))
    goes_on = [env.step(AHEAD) for _ in range(20)]
    costs = [info["reward"]["contact"] for *_, info in goes_on]
    assert sum(costs) == min(costs) == -SHAPING.wall_contact
    assert not any(terminated for _, _, terminated, _, _ in goes_on)


def run(seed: int, observe: str = "state") -> list[Any]:
    env = begun(("workshop", "followable", "sharp_turns"), observe, seed)
    return [env.step(AHEAD) for _ in range(20)]


def test_the_same_seed_gives_the_same_episode_whatever_is_observed() -> None:
    for one, other, gray in zip(run(5), run(5), run(5, "gray"), strict=True):
        np.testing.assert_array_equal(one[0], other[0])
        assert one[1:] == other[1:] == gray[1:]
    assert any(one[1] != other[1] for one, other in zip(run(5), run(6), strict=True))


def test_vectorised_runs_in_two_processes_equal_runs_in_one() -> None:
    results = []
    for mode in ("async", "sync"):
        env = gymnasium.make_vec("limo_sim.env:LimoFollow-v1", 2, vectorization_mode=mode, scenario="sharp_turns")
        env.reset(seed=1)
        for _ in range(5):
            states, rewards, *_ = env.step(np.stack([AHEAD, -AHEAD]))
        results.append((states.copy(), rewards.copy()))
        env.close()
    for one, other in zip(*results, strict=True):
        np.testing.assert_array_equal(one, other)


def test_no_image_is_drawn_for_the_state(monkeypatch: pytest.MonkeyPatch) -> None:
    env = begun()
    monkeypatch.setattr(Renderer, "_draw", lambda *_: pytest.fail("an image was drawn"))
    for _ in range(10):
        env.step(AHEAD)


def test_a_state_carries_the_last_sighting_along_and_the_velocity_of_many() -> None:
    seen = sighted(0.0, 2.0, 1.0, Odometry(1.0), None)
    turned = Odometry(3.0, x=1.0, y=0.0, yaw=math.pi / 2, linear=0.35, angular=-0.75)
    np.testing.assert_allclose(state_of(seen, False, 3.0, turned), [0, 0, -1, 1 / 8, 2 / 5, 0, 0, 0.5, -0.5], atol=1e-6)
    # No number leaves -1 … 1.
    rushing = Odometry(99.0, x=40.0, linear=9.0, angular=-9.0)
    assert state_of(seen, False, 99.0, rushing).tolist() == [0, -1, 0, 1, 1, 0, 0, 1, -1]
    # A person's velocity is that of many sightings.
    seen = sighted(0.0, 2.0, 0.0, Odometry(), None)
    for time in np.arange(1, 60) / 10:
        x, y = 2.0 + 0.3 * time, 0.6 * time
        seen = sighted(math.atan2(y, x), math.hypot(x, y), time, Odometry(time), seen)
    state = state_of(seen, True, 5.9, Odometry(5.9))
    np.testing.assert_allclose(state[5:7], [0.3 / 1.5, 0.6 / 1.5], atol=1e-3)


def test_a_glimpse_is_what_the_camera_shows() -> None:
    # The truth of the rendered image is the judge, over places before, beside and behind the robot.
    random, errors = np.random.default_rng(1), []
    for _ in range(40):
        bearing, distance = random.uniform(-1.0, 1.0), random.uniform(0.8, 4.2)
        route = ((distance * math.cos(bearing), distance * math.sin(bearing), 0.0),)
        arena = Arena(Scenario(people=(Person(route=route),)))
        truth = there(arena.truth().people[0])
        seen = there(glimpse(arena.plan(), arena.scenario, 0, hiding(arena.scenario)))
        assert (seen.distance, seen.bearing) == pytest.approx((truth.distance, truth.bearing))
        assert seen.surface == pytest.approx(truth.surface_distance)
        errors.append(abs(seen.visible - truth.visible))
    assert np.mean(errors) < 0.06
    assert max(errors) < 0.35


@pytest.mark.parametrize("blocked", [False, True])
@pytest.mark.parametrize("place", [(2.5, 0.4), (1.9, -0.6), (3.1, 0.0)])
def test_a_glimpse_is_the_same_wherever_both_are(place: tuple[float, float], blocked: bool) -> None:
    def seen(x: float, y: float, yaw: float) -> Glimpse:
        def moved(at: tuple[float, float]) -> tuple[float, float]:
            turned = complex(x, y) + complex(*at) * cmath.rect(1.0, yaw)
            return turned.real, turned.imag

        wall = Wall(moved((1.0, -0.5)), moved((1.6, 0.7) if blocked else (0.9, -1.5)))
        scenario = Scenario(people=(Person(route=((2.5, 0.0, 0.0),), height=1.7),), walls=(wall,))
        pose = Pose(*moved(place), math.pi + yaw)
        return there(glimpse(Plan(0.0, (x, y, yaw), (pose,)), scenario, 0, hiding(scenario)))

    here = seen(0.0, 0.0, 0.0)
    # A pinhole's image of a height is focal length × height / depth.
    assert here.height_px == pytest.approx(LIMO.focal_px(640) * 1.7 / (place[0] - LIMO.camera_x))
    assert (here.visible > 0) == (not blocked)
    for robot in ((1.0, -2.0, 0.9), (-2.5, 0.7, -2.0)):
        assert astuple(seen(*robot)) == pytest.approx(astuple(here))


def seen_at(x: float, y: float, **stands: Any) -> Glimpse:
    scenario = replace(STANDING, **stands)
    return there(glimpse(Plan(0.0, (0.0, 0.0, 0.0), (Pose(x, y, math.pi),)), scenario, 0, hiding(scenario)))


@pytest.mark.parametrize(
    ("hides", "hidden"),
    [
        (Wall((1.2, -0.5), (1.2, 0.5)), True),
        (Wall((1.2, 0.2), (1.2, 1.0)), False),
        (Wall((1.0, -0.5), (1.8, 0.3)), True),
        (Wall((3.2, -0.5), (3.2, 0.5)), False),
        (Furniture("pillar", 1.5, 0.0), True),
        (Furniture("pillar", 1.5, 0.6), False),
        (Furniture("chair", 1.5, 0.0), False),
    ],
)
def test_a_person_behind_a_wall_or_a_pillar_is_not_seen(hides: Wall | Furniture, hidden: bool) -> None:
    seen = seen_at(2.5, 0.0, **{"walls" if isinstance(hides, Wall) else "furniture": (hides,)})
    assert (seen.visible == 0.0) == hidden
    assert seen.found != hidden


@pytest.mark.parametrize(
    ("ahead", "column", "found"),
    [(2.5, 0, True), (1.2, 0, False), (4.6, 0, False)]
    + [(2.5, side * column, column < 260) for side in (-1, 1) for column in (250, 275)],
)
def test_what_hog_cannot_find_is_not_found(ahead: float, column: int, found: bool) -> None:
    # 320 px from the middle to a side, of which the last 60 are too near to it.
    seen = seen_at(ahead, -column * (ahead - LIMO.camera_x) / LIMO.focal_px(640))
    assert seen.visible == pytest.approx(1.0) or not column
    assert seen.found == found


@pytest.mark.parametrize("ahead", [0.0, 0.084 + 0.04, -2.0])
def test_of_a_person_behind_or_at_the_camera_nothing_is_seen(ahead: float) -> None:
    seen = seen_at(ahead, 0.3)
    assert (seen.visible, seen.height_px, seen.found) == (0.0, 0.0, False)
    assert seen.distance == pytest.approx(math.hypot(ahead, 0.3))


@pytest.mark.parametrize("share", [-3.0, -0.5, 0.5, 3.0])
def test_a_motion_faster_than_the_actions_is_cut_off_at_one(share: float, monkeypatch: pytest.MonkeyPatch) -> None:
    env = LimoFollowV1(STANDING, "gray")
    assert env.reset(seed=0)[0]["gray"].shape == (60, 80, 1)
    moving = Odometry(linear=share * 0.7, angular=share * 1.5)
    monkeypatch.setattr(Arena, "odometry", lambda _: moving)
    motion = env.step(STILL)[0]["motion"]
    assert motion.tolist() == pytest.approx([min(max(share, -1.0), 1.0)] * 2)


def test_the_scan_reaches_to_eight_metres_and_depth_that_is_unknown_is_0(monkeypatch: pytest.MonkeyPatch) -> None:
    walled = Scenario(walls=(Wall((1.5, -0.5), (1.5, 0.5)),))
    scan = LimoFollowV1(walled, "camera").reset(seed=0)[0]["scan"]
    assert scan[146] == pytest.approx(1.5 - LIMO.lidar_x, abs=0.1)
    # Beside it the arena ends further off.
    assert 2.0 < scan[60:100].min() <= scan.max() <= 8.0
    env = begun(STANDING, "camera")
    frame = env._running().frame()
    depth = frame.depth.copy()
    depth[0, :3] = math.nan, math.inf, -math.inf
    monkeypatch.setattr(Arena, "frame", lambda _: replace(frame, depth=depth))
    assert env._observe()["depth"][0, :3].tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("others", [(), ((3.0, 0.5),), ((-2.0, 0.0), (3.0, 0.5))])
def test_the_state_is_of_the_scenarios_first_person(others: tuple[tuple[float, float], ...]) -> None:
    people = tuple(Person(route=((*place, 0.0),)) for place in ((2.5, 0.0), *others))
    state, _ = LimoFollowV1(Scenario(people=people)).reset(seed=0)
    np.testing.assert_allclose(state[:5], [1, 1, 0, 2.5 / 8, 0], atol=0.03)
    # A detector that finds nobody leaves it without a sighting.
    blind, _ = LimoFollowV1(Scenario(people=people, detector=DetectorFaults(recall=0.0))).reset(seed=0)
    assert blind.tolist() == [0, 0, 0, 1, 1, 0, 0, 0, 0]


def test_the_depth_image_may_be_as_deep_as_a_scenario_may_ask_for() -> None:
    spaces: Any = LimoFollowV1(observe="camera").observation_space
    space, furthest = spaces["depth"], float(spaces["depth"].high.max())
    assert space.low.min() == 0.0
    replace(STANDING, depth=Depth(far_m=furthest)).check()
    with pytest.raises(ScenarioError, match="far_m"):
        replace(STANDING, depth=Depth(far_m=furthest + 0.5)).check()
