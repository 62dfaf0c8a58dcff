"""Identities by tracker: HOTA, IDF1, MOTA and switches on TUD-Stadtmitte and five sequences of the arena.

    uv run --with trackeval python benches/tracking.py ../shared/data --frames TUD

prints the table of docs/detect.md. TUD is a folder with frames 1 to 41 (docs/models.md says where they are). `--choose`
runs a grid of parameters on other pictures: TUD's odd frames, and the arena with other seeds.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from trackeval.metrics import CLEAR, HOTA, Identity

from limo_hog import PeopleDetector
from limo_hog.detections import Detections
from limo_hog.suppression import intersection_over_union
from limo_hog.tracking import TRACKERS, Tracker, Tracking
from limo_sim.run.export import labelled_frames
from limo_sim.world.scenario import Scenario

SCENARIOS = ("workshop", "two_people", "crossing", "gathering", "furniture")
#: A person of whom less is seen need not be found, and is not counted false.
WHOLE = 0.65
#: Pictures of an arena sequence, and the time between two [s].
PICTURES, EVERY_S = 200, 0.1
#: Below all that a tracker is fed.
LOWEST = -1.2


@dataclass(frozen=True)
class Frame:
    """What is found and what is true in one picture: boxes x, y, w, h [px] of people; those to `ignore` may be found."""

    found: Detections
    ids: np.ndarray
    boxes: np.ndarray
    ignored: np.ndarray


def tud(pictures: Path, truth: Path, numbers: range) -> list[Frame]:
    rows = np.loadtxt(truth, delimiter=",", ndmin=2)
    detector, frames = PeopleDetector(threshold=LOWEST), []
    for number in numbers:
        here = rows[rows[:, 0] == number]
        boxes = here[:, 2:6] - [1, 1, 0, 0]  # MOTChallenge counts pixels from 1
        found = detector.detect(pictures / f"{number:06d}.jpg")
        frames.append(Frame(found, here[:, 1].astype(int), boxes, np.zeros(len(here), bool)))
    return frames


def arena(name: str, seed: int) -> list[Frame]:
    detector, frames = PeopleDetector(threshold=LOWEST), []
    for frame, things in labelled_frames(Scenario.load(name), seed, PICTURES, EVERY_S):
        people = [thing for thing in things if thing.label == "person" and thing.visible > 0]
        boxes = np.array([person.box for person in people], float).reshape(-1, 4)
        ignored = np.array([person.visible < WHOLE for person in people], bool)
        ids = np.array([person.identity for person in people], int)
        frames.append(Frame(detector.detect(frame.image), ids, boxes, ignored))
    return frames


def without(frames: list[Frame], threshold: float) -> Iterator[Detections]:
    """Each box a person of its own: what a detector without a tracker says."""
    numbers = itertools.count(1)
    for frame in frames:
        found = frame.found[frame.found.scores >= threshold]
        yield dataclasses.replace(found, ids=np.array([next(numbers) for _ in found.scores], np.int64))


def tracked(frames: list[Frame], parameters: Tracking, fps: float) -> Iterator[Detections]:
    tracker = Tracker(parameters, fps=fps)
    for frame in frames:
        yield tracker.update(frame.found)


def data_of(frames: list[Frame], answers: Iterator[Detections]) -> dict[str, Any]:
    """Return a sequence as TrackEval has it; a box on somebody to be ignored (IoU ≥ .5) is left out, as they are."""
    data: dict[str, Any] = {"gt_ids": [], "tracker_ids": [], "similarity_scores": []}
    for frame, answer in zip(frames, answers, strict=True):
        shares = intersection_over_union(frame.boxes, answer.boxes)
        wanted = shares[~frame.ignored].max(axis=0, initial=0)
        kept = ~((shares[frame.ignored].max(axis=0, initial=0) >= 0.5) & (wanted < 0.5))
        data["gt_ids"].append(frame.ids[~frame.ignored])
        data["tracker_ids"].append(np.asarray(answer.ids)[kept])
        data["similarity_scores"].append(shares[~frame.ignored][:, kept])
    for side in ("gt", "tracker"):
        lists = data[f"{side}_ids"]
        known, flat = np.unique(np.concatenate(lists), return_inverse=True)
        data[f"{side}_ids"] = np.split(flat, np.cumsum([len(one) for one in lists])[:-1])
        data[f"num_{side}_ids"], data[f"num_{side}_dets"] = len(known), len(flat)
    return data | {"num_timesteps": len(frames)}


def figures(sequences: dict[str, dict[str, Any]]) -> dict[str, float]:
    """Return TrackEval's figures over all boxes of some sequences."""
    quiet, row = {"PRINT_CONFIG": False}, {}
    for metric in (HOTA(), CLEAR(quiet), Identity(quiet)):
        row |= metric.combine_sequences({name: metric.eval_sequence(data) for name, data in sequences.items()})
    wanted = ("HOTA", "IDF1", "MOTA", "IDSW", "CLR_Re", "CLR_Pr", "CLR_FP")
    return {name: float(np.mean(row[name])) for name in wanted}


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("data", type=Path)
    parser.add_argument("--frames", type=Path, required=True)
    args = parser.parse_args()
    truth = args.data / "real" / "annotations" / "TUD-Stadtmitte_gt.txt"
    rates = {"TUD 1–41": 25.0} | dict.fromkeys(SCENARIOS, 1 / EVERY_S)
    sets = {"TUD 1–41": tud(args.frames, truth, range(1, 42))} | {name: arena(name, 0) for name in SCENARIOS}
    print("| | tracker | HOTA | IDF1 | MOTA | switches | recall | precision |\n|---|---|---|---|---|---|---|---|")
    for names in ([name] for name in sets):
        for how in ("none", *TRACKERS):
            parts = {}
            for name in names:
                frames = sets[name]
                answers = without(frames, 0.0) if how == "none" else tracked(frames, Tracking(how), rates[name])
                parts[name] = data_of(frames, answers)
            row = figures(parts)
            shares = (f"{row[n]:.3f}" for n in ("HOTA", "IDF1", "MOTA"))
            rest = (f"{row['IDSW']:.0f}", f"{row['CLR_Re']:.3f}", f"{row['CLR_Pr']:.3f}")
            print(f"| {', '.join(names)} | {how} |", " | ".join((*shares, *rest)), "|", flush=True)


if __name__ == "__main__":
    main()
