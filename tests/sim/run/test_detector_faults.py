"""`[detector]` and `[vary]`: as much of each as is asked for, the same for the same seed, wherever a run begins."""

import math
from collections.abc import Callable
from itertools import groupby
from pathlib import Path
from statistics import NormalDist

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.sim.logs import Finds, figures

from limo_hog.detections import Detections, Detector
from limo_hog.follow import ApproachController, TrackingController
from limo_hog.follow.sense.region import Region
from limo_hog.named_detectors import AtScale, detector_named
from limo_sim.env import LimoFollowV1
from limo_sim.ros.live import run_live
from limo_sim.ros.runner import run_node
from limo_sim.ros.stage import Stage
from limo_sim.run.arena import Arena
from limo_sim.run.detector_faults import FaultySearch, fit_of
from limo_sim.run.episode import run_episode, score
from limo_sim.run.sweep import Run, in_processes, play
from limo_sim.world.scenario import Camera, DetectorFaults, Person, Scenario, Vary
from limo_sim.world.schema import ScenarioError
from limo_sim.world.truth import Contacts, PersonTruth, Truth
from limo_sim.world.variants import of_run

IMAGE = np.zeros((480, 640, 3), np.uint8)
SILHOUETTES = ((100, 150, 60, 180), (420, 150, 60, 180))
WINDOWS = np.array([[85, 120, 90, 240], [405, 120, 90, 240]], np.int32)


def truth(frame: int) -> Truth:
    people = tuple(PersonTruth(2.0, 0.0, 0.0, 2.0, 0.0, 1.8, 1.0, box) for box in SILHOUETTES)
    return Truth(frame / 10, (0.0, 0.0, 0.0), people, Contacts())


PERSON = Person(route=((2.0, 0.0, 3600.0),))


class Faulty:
    def __init__(self, detector: Detector, faults: DetectorFaults, seed: int = 0) -> None:
        scenario = Scenario(people=(PERSON, PERSON), detector=faults, camera=Camera(rate_hz=10.0))
        self._detector, self._truth = detector, truth(0)
        self._search = FaultySearch(scenario, seed, lambda: self._truth)

    def at(self, now: Truth, region: Region | None = None) -> Detections:
        self._truth = now
        return self._search(self._detector, IMAGE, region)


def seen(faults: DetectorFaults, frames: int, seed: int = 0) -> list[Detections]:
    faulty = Faulty(Finds(*WINDOWS), faults, seed)
    return [faulty.at(truth(frame)) for frame in range(frames)]


def found_of(frames: list[Detections], person: int) -> NDArray[np.bool_]:
    return np.array([(found.windows == WINDOWS[person]).all(axis=1).any() for found in frames])


@pytest.mark.parametrize(("recall", "burst_s"), [(0.5, 0.3), (0.7, 0.3), (0.9, 0.5), (0.2, 0.6)])
def test_recall_and_bursts_are_those_asked_for_in_ten_thousand_frames(recall: float, burst_s: float) -> None:
    frames = seen(DetectorFaults(recall=recall, burst_s=burst_s), 10_000)
    for person in (0, 1):
        found = found_of(frames, person)
        assert abs(found.mean() - recall) < 0.02
        bursts = [len(list(run)) for there, run in groupby(found) if not there]
        # Four standard errors of a geometric distribution's mean.
        mean = 10 * burst_s
        assert abs(np.mean(bursts) - mean) < 4 * math.sqrt(mean * (mean - 1) / len(bursts))


def test_people_are_missed_independently_of_each_other_all_or_never() -> None:
    frames = seen(DetectorFaults(recall=0.5), 10_000)
    one, other = found_of(frames, 0), found_of(frames, 1)
    assert abs((one & other).mean() - 0.25) < 0.03
    for recall in (0.0, 1.0):
        assert found_of(seen(DetectorFaults(recall=recall), 500), 0).mean() == recall


def test_false_boxes_come_at_their_rate_within_the_image_and_best_first() -> None:
    frames = seen(DetectorFaults(false_rate=0.4), 10_000)
    counts = [len(found) - 2 for found in frames]
    # Four standard errors of a Poisson distribution's mean.
    assert abs(np.mean(counts) - 0.4) < 4 * math.sqrt(0.4 / 10_000)
    assert abs(np.var(counts) - 0.4) < 0.05
    boxes = np.concatenate([found.windows for found in frames])
    assert (boxes[:, :2] >= 0).all()
    assert (boxes[:, :2] + boxes[:, 2:] <= (640, 480)).all()
    assert boxes[:, 3].min() >= 128
    assert all((np.diff(found.scores) <= 0).all() for found in frames)


def test_a_seed_fixes_every_miss_and_false_box_whichever_frames_are_read() -> None:
    faults = DetectorFaults(recall=0.5, false_rate=0.5)
    every = seen(faults, 300, seed=4)
    sparse = Faulty(Finds(*WINDOWS), faults, 4)
    for frame in range(0, 300, 7):
        found = sparse.at(truth(frame))
        np.testing.assert_array_equal(found.windows, every[frame].windows)
        np.testing.assert_array_equal(found.scores, every[frame].scores)
    assert (found_of(every, 0) != found_of(seen(faults, 300, seed=5), 0)).any()


@pytest.mark.parametrize("window_height", [200.0, 400.0])
def test_a_search_in_part_of_the_image_or_at_half_size_loses_the_same_people(window_height: float) -> None:
    class SeesOne:
        """Finds the first person in a part of the image that begins at (48, 96), at whatever size."""

        def detect(self, image: NDArray[np.uint8]) -> Detections:
            return Detections((WINDOWS[:1] - np.array([48, 96, 0, 0])) * image.shape[0] // 288, np.array([1.0]))

    region = Region(48, 96, 192, 288, window_height)
    faults = DetectorFaults(recall=0.5, false_rate=2.0)
    whole = seen(faults, 200)
    faulty = Faulty(SeesOne(), faults)
    extra = 0
    for frame in range(200):
        found = faulty.at(truth(frame), region)
        near = np.abs(found.windows - WINDOWS[0]).max(axis=1, initial=0) <= 1
        assert near.any() == found_of(whole[frame : frame + 1], 0)[0]
        assert (found.windows[:, :2] >= (48, 96)).all()
        assert (found.windows[:, :2] + found.windows[:, 2:] <= (240, 384)).all()
        extra += np.count_nonzero(~near)
    assert 0 < extra < 400


@pytest.mark.parametrize("half", [1, 2])
def test_in_a_part_of_the_image_the_false_boxes_are_those_that_lie_within_it(half: int) -> None:
    faulty = Faulty(Finds(), DetectorFaults(false_rate=2.0))
    region = Region(32, 64, 512, 384, 200.0 * half)
    count = from_the_top = 0
    for frame in range(100):
        x, y, w, h = faulty.at(truth(frame)).windows.T
        from_the_top += np.count_nonzero((y == 0) & (h == 480))
        # Windows of HOG are twice as high as wide.
        np.testing.assert_array_equal(w, h // 2)
        within = (x >= 32) & (y >= 64) & (x + w <= 544) & (y + h <= 448)
        # A search at half size gives even pixels from the region's corner.
        expected = np.stack([x - 32, y - 64, w, h], axis=1)[within] // half * half + (32, 64, 0, 0)
        np.testing.assert_array_equal(faulty.at(truth(frame), region).windows, expected)
        count += len(expected)
    assert count > 20
    # One window in eighty is drawn as high as the image or higher.
    assert from_the_top > 0
    # A search at half size keeps its own boxes.
    halves = Faulty(AtScale(Finds(*WINDOWS), 0.5), DetectorFaults(false_rate=0.001))
    np.testing.assert_array_equal(halves.at(truth(0)).windows[:2], WINDOWS * 2)


def at_height(height: int, model: str, frames: int, seed: int = 0) -> NDArray[np.bool_]:
    """Return in which frames a person of a height in the image [px] is found, with a model on."""
    x, y = 300, 470 - height
    person = PersonTruth(2.0, 0.0, 0.0, 2.0, 0.0, 1.8, 1.0, (x, y, height // 3, height))
    window = np.array([[x + height // 6 - height // 3, y - height // 6, 2 * height // 3, 4 * height // 3]], np.int32)

    faulty = Faulty(Finds(*window), DetectorFaults(misses_like=model), seed)
    truths = [Truth(frame / 10, (0.0, 0.0, 0.0), (person, None), Contacts()) for frame in range(frames)]
    return np.array([(faulty.at(now).windows == window).all(axis=1).any() for now in truths])


@pytest.mark.parametrize("model", ["opencv", "limo"])
@pytest.mark.parametrize("height", [90, 130, 200])
def test_a_model_keeps_the_share_of_its_fit_at_every_height(model: str, height: int) -> None:
    found = at_height(height, model, 10_000)
    # Frames of a process with a correlation of exp(-0.1 s / memory) count for fewer.
    assert abs(found.mean() - fit_of(model).kept(height)) < 0.03


def test_a_model_misses_in_bursts_of_its_memory_and_its_fit_grows_with_height() -> None:
    found = at_height(130, "opencv", 10_000)
    share, fit = found.mean(), fit_of("opencv")
    # P(missed twice) of two standard normals with this correlation: the bivariate normal integral, by quadrature.
    rho, limit = math.exp(-0.1 / fit.memory_s), NormalDist().inv_cdf(fit.kept(130))
    z = np.linspace(limit, 8.0, 4001)
    above = [1 - NormalDist().cdf((limit - rho * value) / math.sqrt(1 - rho**2)) for value in z]
    both = np.trapezoid(np.exp(-(z**2) / 2) / math.sqrt(2 * math.pi) * above, z)
    assert abs((~found[1:] & ~found[:-1]).mean() - both) < 0.02
    assert both > 1.3 * (1 - share) ** 2
    heights = np.geomspace(64, 250, 30)
    for fit in map(fit_of, ("opencv", "limo")):
        assert all(np.diff([fit.photographs.at(height) for height in heights]) > 0)
        assert all(0.0 < fit.kept(height) <= 1.0 for height in (0.0, *heights, 480.0))
        assert fit.memory_s > 0


def test_a_models_misses_and_false_boxes_are_those_of_the_seed() -> None:
    np.testing.assert_array_equal(at_height(130, "limo", 100, 3), at_height(130, "limo", 100, 3))
    assert (at_height(130, "limo", 100, 3) != at_height(130, "limo", 100, 4)).any()
    frames = seen(DetectorFaults(misses_like="opencv"), 10_000)
    extra = [len(found) - found_of([found], 0)[0] - found_of([found], 1)[0] for found in frames]
    rate = fit_of("opencv").false_rate
    assert abs(np.mean(extra) - rate) < 4 * math.sqrt(rate / 10_000)


@pytest.fixture
def unkind(tmp_path: Path) -> str:
    faults = "recall = 0.5\nburst_s = 0.2\nfalse_rate = 0.2\n"
    (tmp_path / "unkind.toml").write_text(f"[[people]]\nroute = [[3.0, 0.0, 0.0]]\n[detector]\n{faults}")
    return str(tmp_path / "unkind.toml")


def test_in_the_closed_loop_the_card_shows_the_recall(unkind: str) -> None:
    episode = run_episode(Scenario.load(unkind), TrackingController(), detector_named("hog"), 20.0, 0)
    # 200 frames of a chain with a correlation of 0: four standard errors.
    assert abs((score(episode).detected or 0.0) - 0.5) < 4 * 0.5 / math.sqrt(200)


def test_one_and_two_workers_play_the_same_runs(unkind: str) -> None:
    runs = [Run(unkind, "tracking", "hog", seed, 2.0) for seed in (0, 1)]
    one, two = (dict(in_processes(play, runs, workers)) for workers in (1, 2))
    assert all(figures(one[run]) == figures(two[run]) for run in runs)


DRAWN = Scenario(
    name="drawn", people=(Person(route=((2.5, 0.0, 0.0), (3.0, 1.5, 0.0))),), vary=Vary(clothes=True, place=0.4)
)
UNKIND = Scenario(name="unkind", detector=DetectorFaults(recall=0.5))


@pytest.fixture
def node(tmp_path: Path) -> Path:
    (tmp_path / "node.py").write_text("import rclpy\nrclpy.init()\nrclpy.spin(rclpy.create_node('idle'))\n")
    return tmp_path / "node.py"


def test_whoever_runs_meets_the_people_of_the_seed(node: Path) -> None:
    closed_loop = run_episode(DRAWN, ApproachController(), detector_named("hog"), 0.2, 3)
    by_node, on_the_network = run_node(Stage(node, DRAWN, 0.5, 3)).episode, run_live(DRAWN, 3, 0.04, None)
    for scenario in (Arena(DRAWN, 3).scenario, closed_loop.scenario, by_node.scenario, on_the_network.scenario):
        assert scenario == of_run(DRAWN, 3)


def test_a_sweep_and_every_episode_of_the_environment_have_their_seeds_people(tmp_path: Path) -> None:
    env = LimoFollowV1(DRAWN)
    places = [env.reset(seed=seed)[0].tolist() for seed in (0, 1, 0)]
    assert places[0] == places[2] != places[1]
    assert Arena(DRAWN).scenario == Arena(DRAWN, 0).scenario != Arena(DRAWN, 3).scenario
    file = tmp_path / "drawn.toml"
    file.write_text("[vary]\nplace = 0.4\n[[people]]\nroute = [[2.5, 0.0, 0.0], [3.0, 1.5, 0.0]]\n", encoding="utf-8")
    cards = [play(Run(str(file), "approach", "hog", seed, 0.2)) for seed in (3, 4, 3)]
    assert cards[0].scenario_hash == cards[2].scenario_hash != cards[1].scenario_hash


@pytest.mark.parametrize(
    "start",
    [
        lambda node: Stage(node, UNKIND, 0.5),
        lambda _: run_live(UNKIND, 0, 0.04, None),
        lambda _: LimoFollowV1(UNKIND, "camera"),
    ],
    ids=["run", "arena", "images of LimoFollow-v1"],
)
def test_faults_are_refused_where_the_detector_is_anothers(start: Callable[[Path], object], node: Path) -> None:
    with pytest.raises(ScenarioError, match=r"scenario 'unkind': detector: .*; leave the table out"):
        start(node)
