"""limo-hog's calls beside OpenCV's, timed in turn, with the answers compared: a Markdown table for each name given.

Run on a quiet machine: `uv run python benches/speed.py [search] [methods] [describe] [geometries] [guided]`; without a
name it measures all. Milliseconds are the least of many calls. `search` runs `limo-hog bench` with every backend of
this machine, for benches/RESULTS.md; the other tables take one thread and the backend in force.
"""

from __future__ import annotations

import itertools
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import cv2
import numpy as np

import limo_hog
from limo_hog import PeopleDetector, _core
from limo_hog.cli.bench import PARAMETERS
from limo_hog.cli.support.race import race
from limo_hog.cli.support.scene import street
from limo_sim.run.arena import Arena
from limo_sim.world.scenario import Scenario

WINDOWS = {"people": (64, 128), "Daimler": (48, 96), "random": (64, 128)}
COEFFICIENTS = {
    "people": cv2.HOGDescriptor_getDefaultPeopleDetector(),
    "Daimler": cv2.HOGDescriptor_getDaimlerPeopleDetector(),
    # Half of all windows are hits, with sums too large for the kernels' error bound: all take the exact path.
    "random": np.random.default_rng(0).normal(size=3781).astype(np.float32),
}
#: Block, block stride and cell [px], bins, signed gradients.
GEOMETRIES = {
    "8 px cells, 9 bins": ((16, 16), (8, 8), (8, 8), 9, False),
    "4 px cells": ((8, 8), (4, 4), (4, 4), 9, False),
    "16 px cells": ((32, 32), (16, 16), (16, 16), 9, False),
    "blocks of 32 px": ((32, 32), (8, 8), (8, 8), 9, False),
    "12 bins": ((16, 16), (8, 8), (8, 8), 12, False),
    "18 signed bins": ((16, 16), (8, 8), (8, 8), 18, True),
}

Call = Callable[[], Any]


class Line(NamedTuple):
    """The same question to both libraries."""

    text: str
    ours: Call
    theirs: Call


def search() -> None:
    """Print `detectMultiScale` by size, channels and threads, a column for each backend."""
    cells: dict[tuple[str, int], list[str]] = {}
    backends = _core.available_backends()
    for backend in backends:
        command = [sys.executable, "-m", "limo_hog", "bench", "--json", "-", "--threads", "1", "2"]
        environment = {**os.environ, "LIMO_HOG_BACKEND": backend}
        found = json.loads(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout)
        if not cells:
            print("\n".join(f"- {name}: {value}" for name, value in found["environment"].items()))
        for row in found["rows"]:
            frame = "{}×{} ".format(*row["size"]) + ("gray" if row["channels"] == 1 else "BGR")
            ours, theirs, equal = row["limo_ms"], row["cv2_ms"], "" if row["rects_equal"] else ", DIFFERENT"
            line = cells.setdefault((frame, row["threads"]), [f"{theirs['min']:.1f} ({theirs['p50']:.1f})"])
            line.append(f"{ours['min']:.2f} ({ours['p50']:.2f}), {row['ratio']:.1f}×{equal}")
    heads(["frame", "threads", "cv2 ms (median)", *(f"{backend} ms (median), times faster" for backend in backends)])
    for (frame, threads), values in cells.items():
        print(f"| {frame} | {threads} | {' | '.join(values)} |")


def methods() -> Iterator[Line]:
    """Yield `compute`, `computeGradient` and `detect`, of frames and of a window, with either stride and padding."""
    frame = street(640, 480, 3)
    for name, colour, whole, pad in itertools.product(WINDOWS, ("gray", "BGR"), (False, True), (0, 8)):
        width, height = WINDOWS[name]
        image = frame if whole else frame[200 : 200 + height, 300 : 300 + width]
        image = np.ascontiguousarray(image if colour == "BGR" else image[:, :, 1])
        hogs = [detector(module, name) for module in (limo_hog, cv2)]
        where, edge = f"{image.shape[1]}×{image.shape[0]} {colour}, {name}, padding {pad}", (pad, pad)
        if name != "random":
            yield Line(
                f"computeGradient, {where}", *(partial(h.computeGradient, image, None, None, edge, edge) for h in hogs)
            )
        for step in ((8, 8), (4, 4)):
            if whole or pad or step == (8, 8):  # a window alone has no neighbours
                text = f"{where}, stride {step[0]}"
                if name != "random":
                    yield Line(f"compute, {text}", *(partial(h.compute, image, step, edge) for h in hogs))
                yield Line(f"detect, {text}", *(partial(h.detect, image, 0.0, step, edge) for h in hogs))


def detector(module: Any, name: str) -> Any:
    """Return a library's detector with the model `name`; the people model has gamma correction, as by default."""
    hog = module.HOGDescriptor(WINDOWS[name], (16, 16), (8, 8), (8, 8), 9, 1, -1, 0, 0.2, name == "people")
    hog.setSVMDetector(COEFFICIENTS[name])
    return hog


def describe() -> Iterator[Line]:
    """Yield the descriptors of one crop and of 200."""
    hog = cv2.HOGDescriptor()
    for colour, count in itertools.product(("gray", "BGR"), (1, 200)):
        crop = street(640, 480, 3)[200:328, 300:364]
        crops = np.stack([crop if colour == "BGR" else crop[:, :, 1]] * count)
        yield Line(f"{count} × {colour}", partial(limo_hog.describe, crops), partial(computed, hog, crops))


def computed(hog: Any, crops: Any) -> Any:
    """Return OpenCV's descriptors of crops."""
    return np.stack([np.ravel(hog.compute(crop)) for crop in crops])


def geometries() -> Iterator[Line]:
    """Yield `detect` in a gray 640×480 frame with geometries beyond the people models'."""
    image = street(640, 480, 1)
    for name, (block, stride, cell, bins, signed) in GEOMETRIES.items():
        form = ((64, 128), block, stride, cell, bins, 1, -1, 0, 0.2, True, 64, signed)
        hogs = [module.HOGDescriptor(*form) for module in (limo_hog, cv2)]
        weights = np.random.default_rng(0).normal(size=hogs[0].getDescriptorSize() + 1).astype(np.float32)
        # As large as the people model's: the norms of its blocks' weights add up to 50.
        cells = block[0] * block[1] // (cell[0] * cell[1])
        weights *= 50 / np.linalg.norm(weights[:-1].reshape(-1, cells * bins), axis=1).sum()
        weights[-1] = -3.0 * np.linalg.norm(weights) / 8
        for hog in hogs:
            hog.setSVMDetector(weights)
        yield Line(name, *(partial(hog.detect, image) for hog in hogs))


def guided() -> Iterator[Line]:
    """Yield either search of `PeopleDetector` at 640×480, with people in sight and without."""
    frames = {
        "street": street(640, 480, 3),
        "arena, people crossing": Arena(Scenario.load("crossing"), 0).frame().image,
        "street, nobody": street(640, 480, 3, people=False),
        "arena, nobody": Arena(Scenario.load("empty"), 0).frame().image,
    }
    hog = detector(cv2, "people")
    for (name, frame), colour, kind in itertools.product(frames.items(), ("gray", "BGR"), ("guided", "exact")):
        image = frame if colour == "BGR" else cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY)
        people = PeopleDetector(model="opencv", min_height=None, nms="group", group_threshold=2, search=kind)
        yield Line(f"{kind}, {name}, {colour}", partial(ours, people, image), partial(theirs, hog, image))


def ours(people: PeopleDetector, image: Any) -> Any:
    """Return our rectangles and scores, sorted by place: `PeopleDetector` puts the best first, OpenCV does not."""
    found = people.detect(image)
    return np.array(sorted([*box, score] for box, score in zip(found.windows, found.scores, strict=True)))


def theirs(hog: Any, image: Any) -> Any:
    """Return OpenCV's, in the same order."""
    boxes, weights = hog.detectMultiScale(image, **PARAMETERS)
    return np.array(sorted([*box, weight] for box, weight in zip(boxes, weights, strict=True)))


def difference(ours: Any, theirs: Any) -> str:
    """Return the largest difference of two answers, arrays or pairs of arrays."""
    worst = 0.0
    for mine, other in zip(*(each if isinstance(each, tuple) else (each,) for each in (ours, theirs)), strict=True):
        mine, other = np.asarray(mine, np.float64), np.asarray(other, np.float64)
        if mine.size != other.size:
            return "OTHER SIZE"
        worst = max(worst, np.abs(mine.ravel() - other.ravel()).max(initial=0))
    return f"{worst:.0e}" if worst else "none"


def heads(names: list[str]) -> None:
    """Print the head of a Markdown table."""
    print(f"\n| {' | '.join(names)} |\n{'|---' * len(names)}|")


def main() -> None:
    """Print the tables asked for."""
    tables: dict[str, Callable[[], Iterator[Line]]] = {
        table.__name__: table for table in (methods, describe, geometries, guided)
    }
    cv2.setNumThreads(1)
    limo_hog.set_num_threads(1)
    for name in sys.argv[1:] or ["search", *tables]:
        if name == "search":
            search()
            continue
        heads([f"{name} ({_core.backend()})", "limo-hog ms", "cv2 ms", "times faster", "largest difference"])
        for text, *calls in tables[name]():
            apart = difference(*(call() for call in calls))
            ours, theirs = (timing.min for timing in race(calls, 0.6, most=100_000))
            print(f"| {text} | {ours:.3f} | {theirs:.3f} | {theirs / ours:.1f} | {apart} |", flush=True)


if __name__ == "__main__":
    main()
