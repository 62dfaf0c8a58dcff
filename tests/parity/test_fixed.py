"""Where OpenCV 4.14 crashes, errs or answers at random, limo-hog answers or names the error.

Every room of cases runs in a process of its own, which would notice a crash; `docs/parity.md` lists the differences.
"""

from __future__ import annotations

import faulthandler
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.parity.shared import ABSENT, PRESENT, SHARED

import limo_hog

#: Without its types, so that arguments can be wrong.
hogs: Any = limo_hog
SIZES = ((64, 128), (16, 16), (8, 8), (8, 8))
PEOPLE = limo_hog.HOGDescriptor_getDefaultPeopleDetector()
EVERYTHING = -1e9


def noise(*shape: int, dtype: Any = np.uint8) -> Any:
    return np.random.default_rng(7).integers(0, 256, shape).astype(dtype)


def armed(*geometry: Any) -> Any:
    hog = hogs.HOGDescriptor(*geometry)
    hog.setSVMDetector(np.ones(hog.getDescriptorSize()) if geometry else PEOPLE)
    return hog


def raises(kind: type[Exception], told: str, call: Callable[[], object]) -> None:
    with pytest.raises(limo_hog.HogError) as caught:
        call()
    assert isinstance(caught.value, kind) and told in str(caught.value)


def refused(told: str, *arguments: Any, kind: type[Exception] = ValueError) -> None:
    image, *steps = arguments
    raises(kind, told, lambda: armed().compute(image, *steps))
    raises(kind, told, lambda: armed().detect(image, 0, *steps))
    raises(kind, told, lambda: armed().detectMultiScale(image, 0, *steps))


def nothing_in(image: Any, *steps: Any, hog: Any = None) -> None:
    hog = hog or armed()
    assert hog.compute(image, *steps) == ()
    assert hog.detect(image, EVERYTHING, *steps) == ((), ())
    assert hog.detectMultiScale(image, EVERYTHING, *steps) == ((), ())


def small_images_have_no_windows() -> None:
    for shape in ((128, 63), (125, 60), (128, 56), (120, 64), (16, 193), (400, 8), (10, 10), (1, 1), (20, 20, 3)):
        nothing_in(noise(*shape))
    nothing_in(noise(3, 3), (8, 8), (16, 16))
    assert len(armed().compute(noise(2, 3), (8, 8), (40, 72))) > 0


def windows_smaller_than_their_block_hold_nothing() -> None:
    nothing_in(noise(40, 40), hog=armed((8, 8), (16, 16), (8, 8), (8, 8), 9))


def places_far_outside_are_passed_over() -> None:
    far = [(2**31 - 1, -(2**31)), (-1, 0), (10**6, 5)]
    assert not armed().compute(noise(200, 100), locations=far).any()
    assert armed().detect(noise(200, 100), EVERYTHING, searchLocations=far) == ((), ())


def strides_must_move_forward() -> None:
    for stride in ((0, 8), (8, 0), (-8, 8)):
        refused(f"winStride is {stride}", noise(200, 100), stride)


def sizes_must_fit_together() -> None:
    def geometry(told: str, *arguments: Any, **others: Any) -> None:
        hog = hogs.HOGDescriptor(*arguments, **others)
        raises(limo_hog.GeometryError, told, hog.getDescriptorSize)
        raises(limo_hog.GeometryError, told, lambda: hog.compute(noise(200, 100)))
        raises(limo_hog.GeometryError, told, lambda: hog.computeGradient(noise(20, 18)))

    geometry("(8, 0)", (64, 128), (16, 16), (8, 0), (8, 8), 9)
    geometry("(0, 8)", (64, 128), (16, 16), (8, 8), (0, 8), 9)
    geometry("multiple of cellSize", (64, 128), (16, 16), (8, 8), (6, 8), 9)
    geometry("65", (65, 128), (16, 16), (8, 8), (8, 8), 9)
    geometry("nlevels is 0", *SIZES, 9, _nlevels=0)
    for nbins in (0, -1, 257):
        geometry(f"nbins is {nbins}", *SIZES, nbins)


def images_of_other_types_are_named() -> None:
    for dtype in (np.float32, np.uint16, np.int8, bool):
        refused(np.dtype(dtype).name, noise(200, 100, dtype=dtype), kind=TypeError)
    refused("list", [[1, 2], [3, 4]], kind=TypeError)
    refused("the image is None", None, kind=TypeError)


def images_of_other_shapes_are_named() -> None:
    for shape in ((200, 100, 4), (200, 100, 2), (1, 200, 100), (1, 200, 100, 3), (0, 100), (10, 0, 3), ()):
        refused(str(shape), noise(*shape))


def one_row_of_pixels_is_an_image_of_one_column() -> None:
    nothing_in(noise(300))
    assert len(armed().compute(noise(300), (8, 8), (40, 0))) > 0


def without_a_detector_nothing_is_looked_at() -> None:
    assert hogs.HOGDescriptor().detect(None) == ((), ())
    assert hogs.HOGDescriptor().detectMultiScale(noise(9, 9, dtype=float)) == ((), ())


def blocks_may_have_fewer_than_four_elements() -> None:
    hog = armed((8, 8), (8, 8), (8, 8), (8, 8), 2)
    descriptors = hog.compute(noise(16, 16))
    assert descriptors.shape == (4 * 2,) and np.isfinite(descriptors).all()
    assert len(hog.detect(noise(16, 16), EVERYTHING)[0]) == 4


def more_than_128_bins_are_told_apart() -> None:
    hog = armed((16, 16), (8, 8), (8, 8), (8, 8), 200)
    bins = hog.computeGradient(noise(16, 18))[1].astype(int)
    # OpenCV's indices end at 127 in columns 0 to 15.
    assert bins[:, :16].max() > 127 and bins.max() == 199 and (bins[..., 1] == (bins[..., 0] + 1) % 200).all()
    assert len(hog.detect(noise(40, 40), EVERYTHING)[0]) > 0


def blocks_may_be_very_tall() -> None:
    hog = armed((8, 1200), (8, 1200), (8, 8), (8, 1200), 9)
    assert len(hog.compute(noise(1300, 20))) > 0


def each_detector_clips_at_its_own_threshold() -> None:
    def largest(threshold: float) -> float:
        hog = hogs.HOGDescriptor(*SIZES, 9, _L2HysThreshold=threshold)
        return float(hog.compute(noise(128, 64)).max())

    first = largest(0.1)
    assert largest(0.9) > first and largest(0.1) == first


def detection_takes_paddings_that_are_no_multiple() -> None:
    hog, image = armed((48, 96), (12, 12), (6, 6), (6, 6), 9), noise(200, 150)
    for padding in ((6, 6), (12, 12), (16, 5)):
        rows = hog.compute(image, (6, 6), padding).reshape(-1, hog.getDescriptorSize())
        _, scores = hog.detect(image, EVERYTHING, (6, 6), padding)
        np.testing.assert_allclose(rows.sum(1), scores, rtol=1e-4)
        # The same padding as in `compute`: a bit mask of -6 makes 10 of 6 and 5, and 16 of 12 and 16.
        corner = [10 if side < 7 else 16 for side in padding]
        np.testing.assert_array_equal(hog.detect(image, EVERYTHING, (6, 6), padding)[0][0], np.negative(corner))
        assert len(hog.detectMultiScale(image, 0, (6, 6), padding)[0]) > 0


def levels_come_in_order_with_their_own_weights_on_any_number_of_threads() -> None:
    image, found, grouped = noise(300, 300), [], []
    for threads in (1, 2, 3, 16):
        limo_hog.set_num_threads(threads)
        boxes_and_weights = (armed().detectMultiScale(image, -9, groupThreshold=0) for _ in range(10))
        found += [np.column_stack(pair) for pair in boxes_and_weights]
        grouped.append(np.column_stack(armed().detectMultiScale(image, -9, groupThreshold=1)))
    widths = found[0][(found[0][:, 0] > 0) & (found[0][:, 0] < 150), 2]
    assert len(widths) > 500 and (np.diff(widths) >= 0).all()
    assert all(np.array_equal(other, found[0]) for other in found)
    assert all(np.array_equal(other, grouped[0]) for other in grouped)


def a_wrong_detector_is_refused_before_it_is_taken() -> None:
    hog = armed()
    raises(limo_hog.DetectorSizeError, "1764 coefficients", lambda: hog.setSVMDetector(np.ones(1764)))
    assert hog.checkDetectorSize() and np.array_equal(hog.svmDetector, PEOPLE)


def coefficients_may_be_no_numbers() -> None:
    hog = armed()
    for value in (np.nan, np.inf, 3e38):
        hog.setSVMDetector(np.full(3780, value))
        hog.detectMultiScale(noise(200, 100), -np.inf)


def subclasses_live_and_die() -> None:
    class Mine(limo_hog.HOGDescriptor):
        pass

    for _ in range(100):
        Mine().compute(noise(128, 64))


def numbers_out_of_all_proportion_are_survived() -> None:
    refused("padding is 1000000", noise(200, 100), (8, 8), (10**6, 10**6))
    hog, nan, inf = armed(), float("nan"), float("inf")
    assert hog.detectMultiScale(noise(200, 100), nan) == ((), ())
    assert hog.detectMultiScale(noise(200, 100), -9, groupThreshold=1e10) == ((), ())
    hog.detectMultiScale(noise(200, 100), -9, scale=nan, groupThreshold=nan)
    hog.detectMultiScale(noise(200, 100), -9, scale=inf, groupThreshold=inf)
    big = 2**31 - 1
    hogs.groupRectangles([[big, -big, big, big], [-big, big, big, -big], [0, 0, -5, -5]], 1, 1e300)


ROOMS: dict[str, list[Callable[[], None]]] = {
    "windows": [
        small_images_have_no_windows,
        windows_smaller_than_their_block_hold_nothing,
        places_far_outside_are_passed_over,
        strides_must_move_forward,
    ],
    "geometry": [
        sizes_must_fit_together,
        blocks_may_have_fewer_than_four_elements,
        more_than_128_bins_are_told_apart,
        blocks_may_be_very_tall,
        each_detector_clips_at_its_own_threshold,
        detection_takes_paddings_that_are_no_multiple,
    ],
    "images": [
        images_of_other_types_are_named,
        images_of_other_shapes_are_named,
        one_row_of_pixels_is_an_image_of_one_column,
        without_a_detector_nothing_is_looked_at,
    ],
    "detectors": [
        levels_come_in_order_with_their_own_weights_on_any_number_of_threads,
        a_wrong_detector_is_refused_before_it_is_taken,
        coefficients_may_be_no_numbers,
        subclasses_live_and_die,
        numbers_out_of_all_proportion_are_survived,
    ],
}

#: What OpenCV 4.14 does in nine such cases, by the names of the specification, and the test of what is done here.
FAILURES: dict[str, tuple[str, Callable[[], None]]] = {
    "err-cell6-detect": ("cv2.error: padding 6 is no multiple", detection_takes_paddings_that_are_no_multiple),
    "err-too-small-both": ("SIGSEGV", small_images_have_no_windows),
    "err-too-small-one-axis": ("cv2.error in `compute`, SIGSEGV in `detect`", small_images_have_no_windows),
    "ub-one-stride-short": ("a descriptor of foreign memory, another each time", small_images_have_no_windows),
    "empty-window-grid": ("()", small_images_have_no_windows),
    "no-detector": ("((), ()) whatever the image's type", without_a_detector_nothing_is_looked_at),
    "float-image": ("cv2.error", images_of_other_types_are_named),
    "l2hys-frozen": ("the first threshold of the process for all", each_detector_clips_at_its_own_threshold),
    "nbins-200": ("bins clamped to 127 in columns 0 to 15", more_than_128_bins_are_told_apart),
}


def test_each_recorded_failure_of_opencv_has_its_test() -> None:
    tested = [case for cases in ROOMS.values() for case in cases]
    assert all(test in tested for _, test in FAILURES.values())


@pytest.mark.skipif(not PRESENT, reason=ABSENT)
def test_no_failure_of_the_shared_specification_is_left_out() -> None:
    specification = json.loads((SHARED / "spec" / "cases.json").read_text())
    assert {case["id"] for case in specification["error_and_undefined_cases"]} == set(FAILURES)


@pytest.mark.parametrize("room", ROOMS)
def test_nothing_crashes(room: str) -> None:
    command = [sys.executable, "-m", "tests.parity.test_fixed", room]
    run = subprocess.run(command, cwd=Path(__file__).parents[2], capture_output=True, text=True, timeout=120)
    assert run.returncode == 0, f"while {run.stdout.split()[-1:]}: {run.stderr}"


if __name__ == "__main__":
    faulthandler.enable()
    for case in ROOMS[sys.argv[1]]:
        sys.stdout.write(f"{case.__name__}\n")
        sys.stdout.flush()
        case()
