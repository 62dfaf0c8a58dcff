"""Identities by tracker: HOTA, IDF1, MOTA and switches on TUD-Stadtmitte and five sequences of the arena.

    uv run python benches/tracking.py ../shared/data --frames TUD

prints the table of docs/detect.md. TUD is a folder with frames 1 to 41 (docs/models.md says where they are).
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from trackers.eval.clear import aggregate_clear_metrics, compute_clear_metrics
from trackers.eval.hota import aggregate_hota_metrics, compute_hota_metrics
from trackers.eval.identity import aggregate_identity_metrics, compute_identity_metrics

from limo_hog import PeopleDetector
from limo_hog.detections import Detections
from limo_hog.suppression import intersection_over_union
from limo_hog.tracking import FED, TRACKERS, Tracker
from limo_sim.run.arena import STEPS_PER_SECOND, Arena
from limo_sim.world.scenario import Scenario

SCENARIOS = ("two_people", "crossing", "gathering", "side_door", "sharp_turns")
#: A person of whom less is seen need not be found, and is not counted false.
WHOLE = 0.65
#: Pictures of an arena sequence, taken by a robot that stands, and their rate [Hz].
PICTURES, ARENA_HZ = 200, 10
#: Smallest person: in TUD as docs/models.md has it [px].
TUD_HEIGHT, ARENA_HEIGHT = 96.0, 64.0


@dataclass(frozen=True)
class Frame:
    """What is found and what is true in one picture: ids, boxes x, y, w, h [px], and who need not be found."""

    found: Detections
    ids: NDArray[np.int64]
    boxes: NDArray[np.float64]
    ignored: NDArray[np.bool_]


def tud(pictures: Path, truth: Path, detector: PeopleDetector) -> Iterator[Frame]:
    """Yield the frames of TUD-Stadtmitte; MOTChallenge counts pixels from 1."""
    rows = np.loadtxt(truth, delimiter=",", ndmin=2)
    for number in range(1, 42):
        here = rows[rows[:, 0] == number]
        found = detector.detect(cv2.imread(str(pictures / f"{number:06d}.jpg")))
        yield Frame(found, here[:, 1].astype(int), here[:, 2:6] - [1, 1, 0, 0], np.zeros(len(here), bool))


def arena(name: str, detector: PeopleDetector) -> Iterator[Frame]:
    """Yield what a robot that stands sees of a scenario."""
    arena = Arena(Scenario.load(name), seed=0)
    for _ in range(PICTURES):
        for _ in range(STEPS_PER_SECOND // ARENA_HZ):
            arena.step()
        frame = arena.frame()
        seen = [(i, one) for i, one in enumerate(frame.truth.people) if one is not None and one.box and one.visible]
        boxes = np.array([one.box for _, one in seen], float).reshape(-1, 4)
        ignored = np.array([one.visible < WHOLE for _, one in seen], bool)
        yield Frame(detector.detect(frame.image), np.array([i for i, _ in seen], int), boxes, ignored)


def answers(frames: list[Frame], how: str, fps: float) -> Iterator[Detections]:
    """Yield what a tracker says; by "none" each box is a person of its own."""
    tracker, numbers = None if how == "none" else Tracker(how, fps=fps), itertools.count(1)
    for frame in frames:
        if tracker:
            yield tracker.update(frame.found)
        else:
            sure = frame.found[frame.found.scores >= Tracker().lowest + FED]
            yield dataclasses.replace(sure, ids=np.array([next(numbers) for _ in sure.scores], np.int64))


def data_of(frames: list[Frame], answers: Iterator[Detections]) -> dict[str, list[Any]]:
    """Return a sequence as TrackEval has it; a box on somebody to be ignored (IoU ≥ .5) is left out, as they are."""
    data: dict[str, list[Any]] = {"gt_ids": [], "tracker_ids": [], "similarity_scores": []}
    for frame, answer in zip(frames, answers, strict=True):
        shares = intersection_over_union(frame.boxes, answer.boxes)
        wanted = shares[~frame.ignored].max(axis=0, initial=0)
        kept = ~((shares[frame.ignored].max(axis=0, initial=0) >= 0.5) & (wanted < 0.5))
        data["gt_ids"].append(frame.ids[~frame.ignored])
        data["tracker_ids"].append(np.asarray(answer.ids)[kept])
        data["similarity_scores"].append(shares[~frame.ignored][:, kept])
    return data


def figures(sequences: list[dict[str, list[Any]]]) -> list[float]:
    """Return TrackEval's figures, as `trackers` computes them, over all boxes of some sequences."""
    row = aggregate_hota_metrics([compute_hota_metrics(**data) for data in sequences])
    row |= aggregate_clear_metrics([compute_clear_metrics(**data) for data in sequences])
    row |= aggregate_identity_metrics([compute_identity_metrics(**data) for data in sequences])
    return [row[name] for name in ("HOTA", "IDF1", "MOTA", "CLR_Re", "CLR_Pr", "IDSW")]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("data", type=Path)
    parser.add_argument("--frames", type=Path, required=True)
    args = parser.parse_args()
    truth = args.data / "real" / "annotations" / "TUD-Stadtmitte_gt.txt"
    lowest = Tracker().lowest
    street, room = (PeopleDetector(threshold=lowest, min_height=height) for height in (TUD_HEIGHT, ARENA_HEIGHT))
    sets = {"TUD 1–41": (list(tud(args.frames, truth, street)), 25.0)}
    sets |= {name: (list(arena(name, room)), float(ARENA_HZ)) for name in SCENARIOS}
    groups = {**{name: [name] for name in sets}, "arena, all five": list(SCENARIOS)}
    print("|  | tracker | HOTA | IDF1 | MOTA | recall | precision | switches |\n|---|---|---|---|---|---|---|---|")
    for group, names in groups.items():
        for how in ("none", *TRACKERS):
            *shares, switches = figures([data_of(sets[n][0], answers(sets[n][0], how, sets[n][1])) for n in names])
            print(f"| {group} | {how} |", " | ".join(f"{x:.3f}" for x in shares), f"| {switches:.0f} |", flush=True)


if __name__ == "__main__":
    main()
