"""One descriptor in many threads, some of which change it: every search is of one state, never a part of two."""

import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from limo_hog import HOGDescriptor


@pytest.fixture(autouse=True)
def threads_take_turns_often() -> Iterator[None]:
    """Let Python change threads as often as it can, so that few tries show what free threading would."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


IMAGE = np.random.default_rng(3).integers(0, 256, (48, 48, 3), dtype=np.uint8)
#: Two geometries with descriptors of the same length, so that coefficients of one would fit the other.
GEOMETRIES: list[Any] = [((16, 32), (16, 16), (8, 8), (8, 8), 9), ((32, 16), (16, 16), (8, 8), (8, 8), 9)]


def detector(geometry: Any, seed: int) -> HOGDescriptor:
    hog = HOGDescriptor(*geometry)
    hog.setSVMDetector(np.random.default_rng(seed).normal(0, 1, hog.getDescriptorSize() + 1).astype(np.float32))
    return hog


def answer(hog: HOGDescriptor) -> tuple[Any, ...]:
    """The windows' places and weights, and so which geometry and which coefficients were in force."""
    places, weights = hog.detect(IMAGE, -1e9)
    return tuple(map(tuple, np.asarray(places).tolist())), tuple(np.asarray(weights).tolist())


def test_a_search_during_load_is_of_the_old_detector_or_of_the_new_one(tmp_path: Path) -> None:
    files, answers = [], set()
    for number, geometry in enumerate(GEOMETRIES):
        hog = detector(geometry, number)
        files.append(tmp_path / f"{number}.yml")
        hog.save(files[-1])
        answers.add(answer(hog))
    shared = detector(GEOMETRIES[0], 0)

    def look() -> None:
        assert answer(shared) in answers, "a mix of two detectors"

    def again_and_again(work: Callable[[], object]) -> None:
        while time.monotonic() < until:
            work()

    until, loads = time.monotonic() + 4, [partial(shared.load, file) for file in files]
    with ThreadPoolExecutor(6) as pool:
        [*pool.map(again_and_again, [look] * 4 + loads)]


def test_coefficients_set_during_load_never_meet_the_geometry_that_was_replaced(tmp_path: Path) -> None:
    old, new = HOGDescriptor(*GEOMETRIES[0]), detector(GEOMETRIES[1], 1)
    new.save(tmp_path / "new.yml")
    weights = np.random.default_rng(2).normal(0, 1, old.getDescriptorSize() + 1).astype(np.float32)
    wanted = set()
    for svm in (weights, new.svmDetector):
        last = HOGDescriptor(*GEOMETRIES[1])
        last.setSVMDetector(svm)
        wanted.add(answer(last))
    barrier = threading.Barrier(2)

    def at_once(work: Any, argument: Any) -> None:
        barrier.wait()
        work(argument)

    with ThreadPoolExecutor(2) as pool:
        for _ in range(300):
            shared = HOGDescriptor(*GEOMETRIES[0])
            [*pool.map(at_once, (shared.setSVMDetector, shared.load), (weights, tmp_path / "new.yml"))]
            # Whichever came last, the geometry is the file's; the coefficients are of one of the two.
            assert shared.winSize == GEOMETRIES[1][0] and answer(shared) in wanted
