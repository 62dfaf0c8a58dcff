"""Fits the arena's detector to photographs: recall by height, bursts of misses, false boxes.

    uv run python benches/fit_detector.py ../shared/data --frames TUD

writes `sim/limo_sim/run/detector_fit.json`, which `[detector] misses_like` reads, and the plot of
docs/detector-model.md.
TUD is a folder with frames 1 to 41 of TUD-Stadtmitte (docs/models.md says where they are); the rest lies in the data.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import NormalDist
from typing import Any

import cv2
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.optimize import minimize

from limo_hog import PeopleDetector
from limo_hog.atomic import whole_file
from limo_hog.detections import Detections, Detector
from limo_hog.named_detectors import detector_named
from limo_hog.suppression import intersection_over_union
from limo_sim.run.arena import Arena
from limo_sim.run.detector_faults import FIT_FILE, Curve, FaultySearch
from limo_sim.run.matching import CRITERIA, NO_PERSON, person_of
from limo_sim.sensing.camera import HEIGHT, WIDTH
from limo_sim.world.scenario import DetectorFaults, Person, Room, Scenario
from limo_sim.world.truth import PersonTruth, Truth

PLOT = Path(__file__).parents[1] / "docs" / "images" / "detector-model.png"
#: Up to this height people are compared [px]: nearer ones are cut off by the arena's image, but not by photographers.
TALLEST = 250.0
#: Photographs and arena are compared in bins of equal width in octaves, four of them from 80 to 250 px [px].
EDGES = (*(80.0 * (TALLEST / 80) ** (step / 4) for step in range(-1, 4)), TALLEST, TALLEST * (TALLEST / 80) ** 0.25)
COMPARED = range(1, 5)
MIDDLES = tuple(math.sqrt(low * high) for low, high in itertools.pairwise(EDGES))
#: How many people are looked at in the arena, their heights in the image as in the photographs.
VIEWS = 160
#: Each photograph is searched at these sizes, so that a few hundred people cover all heights.
SIZES = (0.7, 1.0, 1.4, 2.0)
#: The video's rate [Hz], and the times apart [frames] at which misses are compared: 0.08 to 0.4 s.
VIDEO_HZ, LAGS = 25.0, tuple(range(2, 11))
#: A box with an intersection over union below this with everybody is on nothing.
APART = 0.1
#: Share of a silhouette from which a person in the arena is seen whole.
WHOLE = 0.95


@dataclass(frozen=True)
class Sighting:
    """One person in one picture: the height [px], whether HOG found the person, the picture's frame and the person."""

    height: float
    found: bool
    frame: int = -1
    person: int = -1


def main() -> None:
    """Fits, writes the table, draws the plot."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path, help="with eval/usc-c, real/annotations and real/negatives")
    parser.add_argument("--frames", type=Path, required=True, help="frames of TUD-Stadtmitte, 000001.jpg to 000041.jpg")
    args = parser.parse_args()
    table: dict[str, Any] = {
        "origin": "benches/fit_detector.py: USC-C (100 pictures, 232 people), TUD-Stadtmitte frames 1 to 41 (304 "
        "people) and 14 photographs without people, each at 0.7, 1, 1.4 and 2 times its size; the arena with people of "
        "0.9 m",
        "models": {},
    }
    results = {}
    detectors = {"opencv": detector_named("hog"), "limo": PeopleDetector(model="limo", min_height=None)}
    for name, detector in detectors.items():
        real, false, megapixels = photographed(args.data, args.frames, detector)
        curve = fitted(real)
        films = [film(view, detector) for view in arena_views([one.height for one in real])]
        own = [sighting for frames in films for sighting in plain(frames)]
        alone = fitted(own)
        table["models"][name] = {
            "photographs": rounded(curve),
            "arena": rounded(alone),
            "memory_s": round(memory(filmed(args.data, args.frames, detector), curve), 3),
            "false_rate": round(false / megapixels * WIDTH * HEIGHT / 1e6, 4),
            "false_boxes": false,
            "megapixels": round(megapixels, 1),
        }
        results[name] = real, curve, own, films
    with whole_file(FIT_FILE) as part:
        part.write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")
    rows = {}
    for name, (real, curve, own, films) in results.items():
        less = [sighting for seed, frames in enumerate(films) for sighting in with_model(frames, name, seed)]
        rows[name] = curve, recall(real), recall(own), recall(less)
        print(name, table["models"][name])
        for middle, *shares in zip(MIDDLES, *rows[name][1:], strict=True):
            (seen, count), (alone, _), (modelled, views) = shares
            print(
                f"  {middle:4.0f} px: photographs {seen:.2f} ({count} people), arena {alone:.2f}, with the model "
                f"{modelled:.2f} ({views} views)"
            )
    draw(rows)


def fitted(sightings: Sequence[Sighting]) -> Curve:
    """Return the curve whose means over the bins from 80 to 250 px come closest to the shares found there.

    Every bin counts alike: the sets of photographs differ by more than chance, and each has its own heights.
    """
    octaves = np.log2([one.height for one in sightings])
    at = np.digitize([one.height for one in sightings], EDGES) - 1
    shares = dict(enumerate(share for share, _ in recall(sightings)))

    def error(parameters: NDArray[np.float64]) -> float:
        top, middle, slope = parameters
        curve = top / (1 + np.exp(-slope * (octaves - middle)))
        return float(
            sum((curve[at == index].mean() - share) ** 2 for index, share in shares.items() if index in COMPARED)
        )

    best = minimize(error, [0.8, math.log2(100), 5.0], method="L-BFGS-B", bounds=[(0.1, 1), (5, 9), (0.5, 30)])
    top, middle, slope = (float(value) for value in best.x)
    return Curve(top, 2**middle, slope)


def rounded(curve: Curve) -> dict[str, float]:
    """Return the coefficients of a curve as the table has them."""
    return {"top": round(curve.top, 3), "middle_px": round(curve.middle_px, 1), "slope": round(curve.slope, 2)}


def recall(sightings: Sequence[Sighting]) -> list[tuple[float, int]]:
    """Return the share found in each bin of heights, and of how many people."""
    at = np.digitize([one.height for one in sightings], EDGES) - 1
    found = np.array([one.found for one in sightings])
    bins = [found[at == index] for index in range(len(MIDDLES))]
    return [(float(values.mean()) if len(values) else math.nan, len(values)) for values in bins]


def photographed(data: Path, frames: Path, detector: Detector) -> tuple[list[Sighting], int, float]:
    """Return who was found in the photographs, how many false boxes there are, and on what area [megapixels]."""
    sightings, false, megapixels = [], 0, 0.0
    for image, boxes, _ in (*usc(data), *tud(data, frames), *without_people(data)):
        shown = in_view(boxes)
        for size in SIZES:
            sized = image if size == 1 else cv2.resize(image, None, fx=size, fy=size, interpolation=cv2.INTER_AREA)
            found = detector.detect(sized).windows
            people = [person_at(box * size) for box in boxes]
            on = [person_of(box, people) for box in found]
            sightings += [
                Sighting(float(box[3] * size), index in on)
                for index, box in enumerate(boxes)
                if shown[index] >= CRITERIA.in_view
            ]
            megapixels += sized.shape[0] * sized.shape[1] / 1e6
            apart = (intersection_over_union(found, boxes * size) < APART).all(axis=1)
            false += int((apart & (np.array(on) == NO_PERSON)).sum())
    return sightings, false, megapixels


def filmed(data: Path, frames: Path, detector: Detector) -> list[Sighting]:
    """Return who was found in each frame of the video."""
    sightings = []
    for frame, (image, boxes, names) in enumerate(tud(data, frames)):
        shown = in_view(boxes)
        people = [person_at(box) for box in boxes]
        hits = {person_of(box, people) for box in detector.detect(image).windows}
        sightings += [
            Sighting(float(box[3]), index in hits, frame, names[index])
            for index, box in enumerate(boxes)
            if shown[index] >= CRITERIA.in_view
        ]
    return sightings


def memory(sightings: Sequence[Sighting], curve: Curve) -> float:
    """Return the time constant of misses [s]: that of a normal process whose misses coincide as often as the film's.

    A person is missed while a standard normal process with correlation exp(-t / memory) is above the quantile of the
    recall at the person's height.
    """
    found = {(one.person, one.frame): one for one in sightings}
    pairs = defaultdict(list)
    for (person, frame), one in found.items():
        for lag in LAGS:
            later = found.get((person, frame + lag))
            if later is not None:
                pairs[lag].append((one, later))
    first, other = np.random.default_rng(0).standard_normal((2, 4000))
    limits = {one: NormalDist().inv_cdf(curve.at(one.height)) for one in sightings}
    best: list[tuple[float, float]] = []
    for seconds in np.geomspace(0.02, 4.0, 40):
        error = 0.0
        for lag, both in pairs.items():
            rho = math.exp(-lag / VIDEO_HZ / seconds)
            second = rho * first + math.sqrt(1 - rho**2) * other
            observed = np.mean([not one.found and not later.found for one, later in both])
            expected = np.mean([np.mean((first > limits[one]) & (second > limits[later])) for one, later in both])
            error += float(observed - expected) ** 2
        best.append((error, float(seconds)))
    return min(best)[1]


def usc(data: Path) -> Iterator[tuple[NDArray[np.uint8], NDArray[np.float64], list[int]]]:
    """Yield the pictures of USC-C: image, boxes (N, 4) [px], who they are."""
    folder = data / "eval" / "usc-c"
    for name, boxes in json.loads((folder / "boxes.json").read_text()).items():
        yield cv2.imread(str(folder / name)), np.array(boxes, float).reshape(-1, 4), list(range(len(boxes)))


def tud(data: Path, frames: Path) -> Iterator[tuple[NDArray[np.uint8], NDArray[np.float64], list[int]]]:
    """Yield the frames of TUD-Stadtmitte, likewise."""
    lines = (data / "real" / "annotations" / "TUD-Stadtmitte_gt.txt").read_text().split()
    rows = np.array([[float(value) for value in line.split(",")[:6]] for line in lines])
    for frame in range(1, 42):
        image = cv2.imread(str(frames / f"{frame:06d}.jpg"))
        if image is None:
            raise SystemExit(f"{frames / f'{frame:06d}.jpg'}: cannot be read")
        here = rows[rows[:, 0] == frame]
        yield image, here[:, 2:6], [int(person) for person in here[:, 1]]


def without_people(data: Path) -> Iterator[tuple[NDArray[np.uint8], NDArray[np.float64], list[int]]]:
    """Yield the photographs without people, likewise."""
    for path in sorted((data / "real" / "negatives").iterdir()):
        yield cv2.imread(str(path)), np.empty((0, 4)), []


def in_view(boxes: NDArray[np.float64]) -> list[float]:
    """Return the share of each box that no nearer person's box covers: nearer is who stands lower in the picture."""
    shares = []
    for x, y, w, h in boxes:
        covered = np.zeros((max(1, round(h)), max(1, round(w))), bool)
        for x1, y1, w1, h1 in boxes:
            if y1 + h1 > y + h:
                left, top = max(0, round(x1 - x)), max(0, round(y1 - y))
                covered[top : max(0, round(y1 + h1 - y)), left : max(0, round(x1 + w1 - x))] = True
        shares.append(1.0 - float(covered.mean()))
    return shares


def person_at(box: NDArray[np.float64]) -> PersonTruth:
    """Return a person with this box; where the person stands is not known."""
    return PersonTruth(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, tuple(float(value) for value in box))


def arena_views(heights: Sequence[float]) -> Iterator[Scenario]:
    """Yield people of 0.9 m, in view and as high in the image as `heights` [px], in other clothes and directions."""
    random = np.random.default_rng(0)
    heights = [height for height in heights if EDGES[0] < height < EDGES[-1]]
    for view in range(VIEWS):
        away = 404.0 / random.choice(heights) + 0.084
        ahead, way = random.uniform(-0.25, 0.25), view / 12 * math.tau
        x, y = away * math.cos(ahead), away * math.sin(ahead)
        # To and fro over 0.3 m, so that the gait passes.
        there = x + 0.3 * math.cos(way), y + 0.3 * math.sin(way)
        person = Person(
            route=((x, y, 0.0), (*there, 0.0)),
            shirt=tuple(random.uniform(20, 190, 3)),
            trousers=tuple(random.uniform(20, 110, 3)),
            girth=float(random.uniform(0.85, 1.2)),
        )
        yield Scenario(people=(person,), room=Room(half=9.0))


def film(scenario: Scenario, detector: Detector) -> list[tuple[Truth, Detections]]:
    """Return 8 frames of a scenario, 0.5 s apart: what was there, and what HOG found."""
    arena = Arena(scenario, 0)
    frames = []
    for step in range(200):
        if step % 25 == 0:
            frame = arena.frame()
            frames.append((frame.truth, detector.detect(frame.image)))
        arena.step()
    return frames


def plain(frames: Sequence[tuple[Truth, Detections]]) -> Iterator[Sighting]:
    """Yield the person of each frame in which they are in view, and whether HOG found them."""
    for truth, found in frames:
        person = truth.people[0]
        if person is not None and person.box is not None and person.visible > WHOLE:
            yield Sighting(float(person.box[3]), any(person_of(box, truth.people) == 0 for box in found.windows))


def with_model(frames: Sequence[tuple[Truth, Detections]], model: str, seed: int) -> Iterator[Sighting]:
    """Yield the same with a scenario's `[detector] misses_like` on."""
    detector, newest = Again(), frames[0][0]
    scenario = Scenario(
        name=model, people=(Person(route=((2.0, 0.0, 3600.0),)),), detector=DetectorFaults(misses_like=model)
    )
    search = FaultySearch(scenario, seed, lambda: newest)
    changed = []
    for truth, found in frames:
        detector.found, newest = found, truth
        changed.append((truth, search(detector, np.zeros((HEIGHT, WIDTH, 3), np.uint8), None)))
    return plain(changed)


class Again:
    """A detector that gives what HOG found before."""

    found = Detections.none()

    def detect(self, _image: NDArray[np.uint8]) -> Detections:
        """Return it."""
        return self.found


def draw(
    rows: dict[str, tuple[Curve, list[tuple[float, int]], list[tuple[float, int]], list[tuple[float, int]]]],
) -> None:
    """Draw recall against height: the photographs, the arena as it is, and with the model on."""
    figure = Figure(figsize=(9, 3.6), layout="constrained", dpi=150)
    panels = figure.subplots(1, len(rows), sharey=True, squeeze=False)[0]
    heights = np.geomspace(EDGES[0], EDGES[-1], 100)
    for axes, (name, (curve, real, own, less)) in zip(panels, rows.items(), strict=True):
        shares = np.array([share for share, _ in real])
        # The sizes of one photograph are no independent people.
        people = np.array([max(count / len(SIZES), 1) for _, count in real])
        spread = 1.96 * np.sqrt(shares * (1 - shares) / people)
        axes.axvspan(80, 250, color="#8a949e", alpha=0.12, linewidth=0)
        axes.errorbar(MIDDLES, shares, spread, fmt="o", color="#1f6feb", label="photographs, 95 % interval", capsize=2)
        axes.plot(heights, [curve.at(height) for height in heights], "-", color="#1f6feb", label="curve fitted to them")
        axes.plot(MIDDLES, [share for share, _ in own], "--", color="#8a949e", label="arena as it is")
        axes.plot(MIDDLES, [share for share, _ in less], "s", color="#b35900", label=f'arena, model = "{name}"')
        axes.set_xscale("log", base=2)
        axes.set_xticks(EDGES, [f"{edge:.0f}" for edge in EDGES])
        axes.set_xlabel("height of the person in the image [px]")
        axes.set_title({"opencv": "OpenCV's weights", "limo": "our weights"}[name], loc="left", fontsize=10)
        axes.legend(frameon=False, fontsize=8, loc="lower right")
        axes.spines[["top", "right"]].set_visible(False)
        axes.set_ylim(0, 1.05)
    panels[0].set_ylabel("recall")
    with whole_file(PLOT) as part:
        figure.savefig(part)


if __name__ == "__main__":
    main()
