"""The front of quality against time: searches before the second look, LAMR against the time of a street frame.

    uv run python benches/front.py ../shared/data --frames TUD

prints a Markdown table and draws docs/images/front.png. Every search takes its turn on each picture, with one thread.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from matplotlib.figure import Figure

import limo_hog
from limo_hog import PeopleDetector
from limo_hog.atomic import whole_file
from limo_hog.cli.support.scene import street
from limo_hog.learn.evaluation.run import Rival, evaluate
from rivals import heads, tud, usc

PLOT = Path(__file__).parents[1] / "docs" / "images" / "front.png"
#: Where measured curves end: below it nothing is found before one false alarm an image.
LEAST = -1.5
ROUNDS = 9
SEARCHES: dict[str, dict[str, Any]] = {
    **{f"exact, scale {scale}": {"scale": scale} for scale in (1.05, 1.075, 1.1, 1.15, 1.2)},
    "guided, scale 1.05": {"search": "guided"},
}


def main() -> None:
    """Measure, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help="with eval/usc-c and real/annotations")
    parser.add_argument("--frames", type=Path, required=True, help="frames of TUD-Stadtmitte, 000001.jpg to 000041.jpg")
    args = parser.parse_args()
    limo_hog.set_num_threads(1)
    cv2.setNumThreads(1)
    detectors = {
        f"{name}{'' if look else ', first look'}": PeopleDetector(threshold=LEAST, second_look=look, **search)
        for name, search in SEARCHES.items()
        for look in (True, False)
        if not (look and search.get("search") == "guided")
    }
    lamrs = []
    for pictures, min_height in ((usc(args.data), 64), (tud(args.data, args.frames), 96)):
        rivals = [Rival(name, replace(one, min_height=min_height)) for name, one in detectors.items()]
        _, evaluations = evaluate(rivals, pictures, draws=1)
        lamrs.append([evaluation.figures.lamr for evaluation in evaluations])
    times = street_times(list(detectors.values()))
    heads("", "USC-C", "TUD 1–41", "ms", "OpenCV's plain search takes")
    for name, in_usc, in_tud, ms in zip(detectors, *lamrs, times[1:], strict=True):
        print(f"| {name} | {in_usc:.3f} | {in_tud:.3f} | {ms:.1f} | {times[0] / ms:.1f} × |")
    draw(list(detectors), np.mean(lamrs, axis=0).tolist(), times[1:])


def street_times(detectors: list[PeopleDetector]) -> list[float]:
    """Return the least time [ms] that OpenCV's plain search and each detector take for a street frame in colour."""
    image = street(640, 480, 3)
    hog = cv2.HOGDescriptor()
    hog.setSVMDetector(np.asarray(cv2.HOGDescriptor.getDefaultPeopleDetector()))
    calls: list[Callable[[], object]] = [
        lambda: hog.detectMultiScale(image, winStride=(8, 8), padding=(4, 4), scale=1.05)
    ]
    calls += [partial(replace(detector, threshold=None).detect, image) for detector in detectors]
    times = np.full((ROUNDS, len(calls)), np.inf)
    for times_of_round in times:
        for i, call in enumerate(calls):
            begun = time.perf_counter()
            call()
            times_of_round[i] = 1e3 * (time.perf_counter() - begun)
    return list(times.min(axis=0).tolist())


def draw(names: list[str], lamrs: list[float], times: list[float]) -> None:
    """Draw the mean of both sets' LAMR against the time, and which search it is."""
    figure = Figure(figsize=(8, 4), layout="constrained", dpi=150)
    axes = figure.subplots()
    for look, colour in ((True, "#1f6feb"), (False, "#8a949e")):
        for search, mark, above in (("exact", "o", (4, 4)), ("guided", "s", (4, -12))):
            chosen = [i for i, name in enumerate(names) if name.startswith(search) and ("first" in name) != look]
            if not chosen:
                continue
            label = f"{search}, {'second look' if look else 'first look alone'}"
            axes.plot([times[i] for i in chosen], [lamrs[i] for i in chosen], mark, color=colour, label=label, ls="-")
            for i in chosen:
                axes.annotate(names[i].split()[2].rstrip(","), (times[i], lamrs[i]), above, textcoords="offset points")
    axes.set_xlabel("time for a street frame of 640 × 480 in colour, one thread [ms]")
    axes.set_ylabel("LAMR, mean of USC-C and TUD 1–41")
    axes.legend(frameon=False)
    axes.spines[["top", "right"]].set_visible(False)
    with whole_file(PLOT) as part:
        figure.savefig(part)


if __name__ == "__main__":
    main()
