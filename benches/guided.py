"""The guided search beside the exact one: for each guide, how many pictures have the same rectangles, and how fast.

`uv run python benches/guided.py [--halvings 3 ...] [--margin 0.75 ...] [--reach 0.75,1.25 ...]` reads every picture and
every tenth frame of the videos in `../shared/data`; one thread, both searches in turn, least of two calls each. With
`--labels FILE` it evaluates `PeopleDetector` with either search on labelled pictures instead.
"""

from __future__ import annotations

import argparse
import itertools
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

import limo_hog
from limo_hog import PeopleDetector, _core
from limo_hog.learn.evaluation.run import Rival, evaluate
from limo_hog.learn.formats import read_labels
from limo_hog.learn.labels import choose

DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
Hits = tuple[NDArray[np.int32], NDArray[np.float64]]
Guide = tuple[int, float, tuple[float, float]]


def pictures(step: int) -> Iterator[NDArray[np.uint8]]:
    """Yield every `step`-th picture in gray that a window fits into, then every tenth frame of the videos."""
    files = sorted(path for path in DATA.rglob("*") if path.suffix.lower() in (".jpg", ".png"))
    for path in files[::step]:
        image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        if image is not None and image.shape[0] >= 200 and image.shape[1] >= 100:
            yield np.asarray(image, np.uint8)
    for path in sorted(path for path in DATA.rglob("*") if path.suffix.lower() in (".avi", ".mp4")):
        video = cv2.VideoCapture(str(path))
        for number in itertools.count():
            read, frame = video.read()
            if not read:
                break
            if number % (10 * step) == 0:
                yield np.asarray(cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY), np.uint8)


def searched(hog: _core.Hog, image: NDArray[np.uint8], group: float, guide: Guide | None) -> tuple[Hits, float]:
    """Return what a search finds, and the least of its times [s]."""
    times = []
    for _ in range(2):
        begin = time.perf_counter()
        found = hog.detect_multi_scale(image, 0.0, (8, 8), (4, 4), 1.05, group, False, None, guide)
        times.append(time.perf_counter() - begin)
    return found, min(times)


def pair(text: str) -> tuple[float, float]:
    """Return two numbers with a comma between them."""
    x, y = map(float, text.split(","))
    return x, y


def miss_rates(labels: Path) -> None:
    """Print the log-average miss rate, and the recall at .1 and 1 false positive an image, of either search.

    With a threshold of -1.2, as `limo-hog evaluate` has it, and with each model's own.
    """
    rivals = [
        Rival(f"{model} {search}, {least or 'own'}", PeopleDetector(model=model, search=search, threshold=least))
        for model in ("opencv", "limo")
        for least in (-1.2, None)
        for search in ("exact", "guided")
    ]
    used, evaluations = evaluate(rivals, choose(read_labels(labels, None), None))
    print(f"{len(used)} pictures\n| model, search, threshold | LAMR | recall at .1 | recall at 1 |\n|---|---|---|---|")
    for one in evaluations:
        print(f"| {one.name} | {one.figures.lamr:.3f} | {one.figures.recall_01:.3f} | {one.figures.recall_1:.3f} |")


def main() -> None:
    """Measure every combination and print one line for each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--halvings", type=int, nargs="+", default=[2, 3, 4])
    parser.add_argument("--margin", type=float, nargs="+", default=[0.6, 0.75, 0.9])
    parser.add_argument("--reach", type=pair, nargs="+", default=[(0.75, 1.25)], help="x,y [strides]")
    parser.add_argument("--step", type=int, default=1, help="read every so many pictures")
    parser.add_argument("--labels", type=Path, help="labelled pictures, in a format of `limo-hog evaluate`")
    options = parser.parse_args()
    if options.labels:
        miss_rates(options.labels)
        return
    limo_hog.set_num_threads(1)
    hog = _core.Hog((64, 128), (16, 16), (8, 8), (8, 8), 9, -1.0, 0.2, True, 64, False, _core.default_people_detector())
    guides: list[Guide] = list(itertools.product(options.halvings, options.margin, options.reach))
    same, kept, seconds, count, hits = dict.fromkeys(guides, 0), dict.fromkeys(guides, 0), {}, 0, 0
    least: dict[Guide | None, float] = dict.fromkeys([None, *guides], 0.0)
    for image in pictures(options.step):
        count += 1
        exact, _ = searched(hog, image, 2.0, None)
        raw, _ = searched(hog, image, 0.0, None)
        hits += len(raw[0])
        every = {tuple(box) for box in raw[0].tolist()}
        for guide in [None, *guides]:
            found, seconds[guide] = searched(hog, image, 2.0, guide)
            least[guide] += seconds[guide]
            if guide is not None:
                boxes, _ = hog.detect_multi_scale(image, 0.0, (8, 8), (4, 4), 1.05, 0.0, False, None, guide)
                same[guide] += np.array_equal(found[0], exact[0])
                kept[guide] += len(every & {tuple(box) for box in boxes.tolist()})
    print(f"{count} pictures, {hits} hits")
    print(
        "| halvings | margin | reach | same rectangles | hits kept | times faster than exact |\n"
        "|---|---|---|---|---|---|"
    )
    for guide in guides:
        ratio = least[None] / least[guide]
        print(f"| {' | '.join(map(str, guide))} | {same[guide] / count:.1%} | {kept[guide] / hits:.2%} | {ratio:.2f} |")


if __name__ == "__main__":
    main()
