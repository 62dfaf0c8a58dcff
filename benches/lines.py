"""Single figures beside OpenCV's, a table each: `uv run python benches/lines.py describe growth corners guided files`.

`LIMO_HOG_BACKEND` chooses the kernels; calls take turns, milliseconds are the least of each. Run on a quiet machine.
`limo-hog bench [--search guided]` gives the searches, `benches/methods.py` the other methods.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

import limo_hog
from limo_hog import PeopleDetector, _core
from limo_hog.cli.support.race import Rounds, race
from limo_hog.cli.support.scene import street
from limo_sim.run.arena import Arena
from limo_sim.world.scenario import Scenario

ROUNDS = Rounds(seconds=2.0, most=100_000)
SEARCH: dict[str, Any] = {"winStride": (8, 8), "padding": (4, 4), "scale": 1.05}
#: What differs from the default geometry: block, block stride and cell [px], bins, signed gradients.
CORNERS = {
    "8 px cells, 9 bins": ((16, 16), (8, 8), (8, 8), 9, False),
    "4 px cells": ((8, 8), (4, 4), (4, 4), 9, False),
    "16 px cells": ((32, 32), (16, 16), (16, 16), 9, False),
    "blocks of 32 px": ((32, 32), (8, 8), (8, 8), 9, False),
    "12 bins": ((16, 16), (8, 8), (8, 8), 12, False),
    "18 signed bins": ((16, 16), (8, 8), (8, 8), 18, True),
}
PICTURES = 500
#: The rival of `limo-hog detect`: reads, detects and prints a line for each picture; draws copies if given a folder.
SCRIPT = """
import json, sys, cv2
from pathlib import Path
hog = cv2.HOGDescriptor()
hog.setSVMDetector(cv2.HOGDescriptor.getDefaultPeopleDetector())
for path in sorted(Path(sys.argv[1]).glob("*.jpg")):
    image = cv2.imread(str(path))
    boxes, weights = hog.detectMultiScale(image, winStride=(8, 8), padding=(4, 4), scale=1.05)
    print(json.dumps([path.name, [list(map(int, box)) for box in boxes], [float(weight) for weight in weights]]))
    if len(sys.argv) > 2:
        for x, y, w, h in boxes:
            cv2.rectangle(image, (x, y), (x + w, y + h), (0, 255, 0), 2)
        cv2.imwrite(str(Path(sys.argv[2]) / path.name), image)
"""


def table(*heads: str) -> None:
    """Print the head of a markdown table."""
    print(f"\n| {' | '.join(heads)} |\n{'|---' * len(heads)}|")


def line(*cells: object) -> None:
    """Print a line of it."""
    print(f"| {' | '.join(map(str, cells))} |", flush=True)


def crop(channels: int) -> Any:
    """Return a window's crop of the street."""
    image = street(640, 480, 3)[200:328, 300:364]
    return np.ascontiguousarray(image if channels == 3 else image[:, :, 1])


def describe() -> None:
    """Descriptors of one crop and of 200, one thread; then 200 on two threads."""
    hog = cv2.HOGDescriptor()
    cv2.setNumThreads(1)
    limo_hog.set_num_threads(1)
    table("describe", "limo-hog µs a crop", "cv2 compute µs", "times faster", "largest difference")
    for name, channels in (("gray", 1), ("BGR", 3)):
        one = crop(channels)
        for count in (1, 200):
            crops = np.stack([one] * count)
            wanted = hog.compute(one)
            off = float(np.abs(limo_hog.describe(crops) - np.asarray(wanted).ravel()).max())
            ours, theirs = race([partial(limo_hog.describe, crops), partial(hog.compute, one)], ROUNDS)
            micros = 1e3 * ours.min / count
            line(
                f"{count} × {name}",
                f"{micros:.1f}",
                f"{1e3 * theirs.min:.1f}",
                f"{1e3 * theirs.min / micros:.1f}",
                f"{off:.0e}",
            )
    table("describe, 200 crops", "one thread ms", "two threads ms", "times faster")
    for name, channels in (("gray", 1), ("BGR", 3)):
        crops = np.stack([crop(channels)] * 200)
        one, two = race([partial(on, threads, partial(limo_hog.describe, crops)) for threads in (1, 2)], ROUNDS)
        line(name, f"{one.min:.2f}", f"{two.min:.2f}", f"{one.min / two.min:.2f}")


def on(threads: int, work: Callable[[], object]) -> object:
    """Do work on so many threads."""
    limo_hog.set_num_threads(threads)
    return work()


def growth() -> None:
    """What a pixel of the pyramid costs as images grow, and what threads add."""
    hog = limo_hog.HOGDescriptor()
    hog.setSVMDetector(limo_hog.HOGDescriptor_getDefaultPeopleDetector())
    limo_hog.set_num_threads(1)
    table("gray, one thread", "ms", "ns a pyramid pixel")
    for width, height in ((640, 480), (1920, 1080), (3840, 2160), (7680, 4320)):
        (spent,) = race([partial(hog.detectMultiScale, street(width, height, 1), **SEARCH)], Rounds(3.0, least=3))
        line(f"{width}×{height}", f"{spent.min:.2f}", f"{1e6 * spent.min / pyramid_pixels(width, height):.2f}")
    table("gray", "one thread ms", "two threads ms", "times faster", "CPU ms with 64 threads by CPU ms with one")
    for width, height in ((320, 240), (640, 480), (1920, 1080)):
        find = partial(hog.detectMultiScale, street(width, height, 1), **SEARCH)
        one, two = race([partial(on, threads, find) for threads in (1, 2)], ROUNDS)
        many = cpu_ms(partial(on, 64, find)) / cpu_ms(partial(on, 1, find))
        line(f"{width}×{height}", f"{one.min:.2f}", f"{two.min:.2f}", f"{one.min / two.min:.2f}", f"{many:.2f}")
    # A band: 16 rows of cells of a tile as wide as the level, the share of all levels' cells that one unit of work is.
    share = (1920 + 16) * 128 / pyramid_pixels(1920, 1080)
    print(f"\nLargest unit of work at 1920×1080, a band of level 0: {share:.1%} of the call's pixels.")


def pyramid_pixels(width: int, height: int) -> int:
    """Return the padded pixels of all levels."""
    pixels, scale = 0, 1.0
    for _ in range(64):
        w, h = round(width / scale), round(height / scale)
        if w < 64 or h < 128:
            break
        pixels += (w + 16) * (h + 16)
        scale *= 1.05
    return pixels


def cpu_ms(work: Callable[[], object]) -> float:
    """Return the least CPU time of a few runs, of all threads together."""
    spent = []
    for _ in range(12):
        begin = time.process_time()
        work()
        spent.append(1e3 * (time.process_time() - begin))
    return min(spent)


def corners() -> None:
    """`detect` in a gray 640×480 frame with geometries beyond the people models'."""
    cv2.setNumThreads(1)
    limo_hog.set_num_threads(1)
    image = street(640, 480, 1)
    table("detect", "limo-hog ms", "cv2 ms", "times faster", "places equal")
    for name, (block, stride, cell, bins, signed) in CORNERS.items():
        pair: list[Any] = []
        for module in (limo_hog, cv2):
            hog = module.HOGDescriptor((64, 128), block, stride, cell, bins, 1, -1, 0, 0.2, True, 64, signed)
            weights = np.random.default_rng(0).normal(size=hog.getDescriptorSize() + 1).astype(np.float32)
            # As loud as the people model, whose blocks' weights have norms of 50 together.
            cells = block[0] * block[1] // (cell[0] * cell[1])
            weights *= 50 / np.linalg.norm(weights[:-1].reshape(-1, cells * bins), axis=1).sum()
            weights[-1] = -3.0 * np.linalg.norm(weights) / 8
            hog.setSVMDetector(weights)
            pair.append(hog)
        found = [np.asarray(hog.detect(image)[0]).reshape(-1, 2) for hog in pair]
        ours, theirs = race([partial(hog.detect, image) for hog in pair], ROUNDS)
        equal = np.array_equal(found[0], found[1])
        line(name, f"{ours.min:.2f}", f"{theirs.min:.2f}", f"{theirs.min / ours.min:.2f}", equal)


def guided() -> None:
    """The guided search at 640×480, of streets and of the arena's first frame, with people in sight and without."""
    cv2.setNumThreads(1)
    limo_hog.set_num_threads(1)
    frames = {
        "street": street(640, 480, 3),
        "arena, people crossing": Arena(Scenario.load("crossing"), 0).frame().image,
        "street, nobody": street(640, 480, 3, people=False),
        "arena, nobody": Arena(Scenario.load("empty"), 0).frame().image,
    }
    detectors = [
        PeopleDetector(min_height=None, nms="group", group_threshold=2, search=search) for search in ("guided", "exact")
    ]
    cv = cv2.HOGDescriptor()
    cv.setSVMDetector(np.asarray(cv2.HOGDescriptor.getDefaultPeopleDetector()))
    table("search=guided", "guided ms", "exact ms", "cv2 ms", "times faster", "exact", "rectangles")
    for name, frame in frames.items():
        for kind, image in (("gray", cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY)), ("BGR", frame)):
            calls = [partial(detector.detect, image) for detector in detectors]
            ours, exact, theirs = race([*calls, partial(cv.detectMultiScale, image, **SEARCH)], Rounds(4.0))
            wanted, _ = cv.detectMultiScale(image, **SEARCH)
            same = "equal" if calls[0]().boxes.tolist() == np.reshape(wanted, (-1, 4)).tolist() else "DIFFERENT"
            ratios = (f"{theirs.min / ours.min:.1f}", f"{theirs.min / exact.min:.1f}")
            spent = (f"{timing.min:.2f}" for timing in (ours, exact, theirs))
            line(f"{name}, {kind}", *spent, *ratios, f"{len(wanted)}, {same}")


def files() -> None:
    """`limo-hog detect` over VGA JPEGs beside a plain cv2 script, in turn, each as a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        pictures, copies = Path(folder) / "pictures", Path(folder) / "copies"
        pictures.mkdir()
        frame = street(640, 480, 3)
        for number in range(PICTURES):
            cv2.imwrite(str(pictures / f"{number:03}.jpg"), np.roll(frame, 7 * number, axis=1))
        table(f"{PICTURES} JPEGs of 640×480, all cores", "limo-hog s", "cv2 script s", "times faster")
        ours = [sys.executable, "-m", "limo_hog", "detect", str(pictures), "--min-height", "none", "--nms", "group"]
        theirs = [sys.executable, "-c", SCRIPT, str(pictures)]
        copies.mkdir()
        line("results as JSON", *seconds([*ours, "--json", "-"], theirs))
        copied = [*ours, "--json", "-", "--out", str(copies), "--overwrite"]
        line("and annotated copies", *seconds(copied, [*theirs, str(copies)]))


def seconds(ours: list[str], theirs: list[str]) -> tuple[str, str, str]:
    """Return the time of either command, and their ratio."""
    spent = []
    for command in (ours, theirs):
        begin = time.perf_counter()
        subprocess.run(command, check=True, capture_output=True)
        spent.append(time.perf_counter() - begin)
    return f"{spent[0]:.1f}", f"{spent[1]:.1f}", f"{spent[1] / spent[0]:.1f}"


def main() -> None:
    """Print the tables that were asked for."""
    tables = {work.__name__: work for work in (describe, growth, corners, guided, files)}
    print(f"{_core.backend()}, OpenCV {cv2.__version__}")
    for name in sys.argv[1:] or tables:
        tables[name]()


if __name__ == "__main__":
    main()
