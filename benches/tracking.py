"""Identities by tracker: HOTA, IDF1, MOTA and switches on TUD-Stadtmitte and five sequences of the arena.

    uv run python benches/tracking.py ../shared/data TUD

prints the table of docs/detect.md. TUD is a folder with frames 1 to 41 (docs/models.md says where they are).
"""

from __future__ import annotations

import itertools
import sys
import tempfile
from collections import ChainMap
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from trackers.eval import evaluate_mot_sequences

from limo_hog import PeopleDetector
from limo_hog.detections import Detections
from limo_hog.tracking import FED, TRACKERS, Tracker
from limo_sim.run.arena import STEPS_PER_SECOND, Arena
from limo_sim.world.scenario import Scenario

SCENARIOS = ("two_people", "crossing", "gathering", "side_door", "sharp_turns")
#: A person of whom less is seen need not be found, and is not counted false: MOTChallenge's classes of both.
WHOLE, PERSON, IGNORED = 0.65, 1, 8
#: Pictures of an arena sequence, taken by a robot that stands, and their rate [Hz].
PICTURES, ARENA_HZ = 200, 10
FAMILIES = ["CLEAR", "HOTA", "Identity"]
#: A person's number, box x, y, w, h [px], and class.
Person = tuple[int, Any, int]


def tud(pictures: Path, truth: Path) -> Iterator[tuple[Any, list[Person]]]:
    """Yield the frames of TUD-Stadtmitte; MOTChallenge counts pixels from 1."""
    rows = np.loadtxt(truth, delimiter=",")
    for number in range(1, 42):
        people = [(int(row[1]), row[2:6] - [1, 1, 0, 0], PERSON) for row in rows[rows[:, 0] == number]]
        yield cv2.imread(str(pictures / f"{number:06d}.jpg")), people


def arena(name: str) -> Iterator[tuple[Any, list[Person]]]:
    """Yield what a robot that stands sees of a scenario."""
    arena = Arena(Scenario.load(name), seed=0)
    for _ in range(PICTURES):
        for _ in range(STEPS_PER_SECOND // ARENA_HZ):
            arena.step()
        frame = arena.frame()
        seen = [(i, one) for i, one in enumerate(frame.truth.people) if one is not None and one.box and one.visible]
        yield frame.image, [(i, one.box, PERSON if one.visible >= WHOLE else IGNORED) for i, one in seen]


def numbered(found: list[Detections], how: str, fps: float) -> Iterator[Iterator[Person]]:
    """Yield what a tracker says of each picture; by "none" each box is a person of its own."""
    tracker, numbers = Tracker("sort" if how == "none" else how, fps=fps), itertools.count(1)
    for people in found:
        told = people[people.scores >= tracker.lowest + FED] if how == "none" else tracker.update(people)
        yield zip(numbers if told.ids is None else told.ids, told.boxes, itertools.repeat(PERSON))


def write(path: Path, frames: Iterable[Iterable[Person]]) -> None:
    """Write MOTChallenge's lines."""
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [(number, who, *box, 1, kind) for number, people in enumerate(frames, 1) for who, box, kind in people]
    np.savetxt(path, rows, "%g", ",")


def main() -> None:
    """Print the table."""
    data, frames = map(Path, sys.argv[1:])
    # The smallest person of TUD is as docs/models.md has it.
    stadtmitte = tud(frames, data / "real" / "annotations" / "TUD-Stadtmitte_gt.txt")
    sets = {"TUD 1–41": (96, 25, {"TUD 1–41": stadtmitte})}
    sets["arena, all five"] = (64, ARENA_HZ, {name: arena(name) for name in SCENARIOS})
    print("|  | tracker | HOTA | IDF1 | MOTA | recall | precision | switches |\n|---|---|---|---|---|---|---|---|")
    for group, (min_height, fps, sequences) in sets.items():
        with tempfile.TemporaryDirectory() as folder:
            detector = PeopleDetector(threshold=Tracker().lowest, min_height=min_height)
            for name, sequence in sequences.items():
                images, people = zip(*sequence, strict=True)
                found = [detector.detect(image) for image in images]
                write(Path(folder, "truth", f"{name}.txt"), people)
                for how in ("none", *TRACKERS):
                    write(Path(folder, how, f"{name}.txt"), numbered(found, how, fps))
            for how in ("none", *TRACKERS):
                told = evaluate_mot_sequences(f"{folder}/truth", f"{folder}/{how}", None, FAMILIES)
                for name, result in {**told.sequences, group: told.aggregate}.items():
                    of = ChainMap(*(result.to_dict()[family] for family in FAMILIES))
                    shares = " | ".join(f"{of[key]:.3f}" for key in ("HOTA", "IDF1", "MOTA", "CLR_Re", "CLR_Pr"))
                    print(f"| {name} | {how} | {shares} | {of['IDSW']} |")


if __name__ == "__main__":
    main()
