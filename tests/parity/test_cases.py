"""OpenCV 4.14's own answers to tricky inputs, as `spec/cases.json` records them."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import skimage.data

import limo_hog

CASES = Path(__file__).parents[3] / "shared" / "spec" / "cases.json"
if not CASES.exists():
    pytest.skip(f"needs {CASES.name} from ../shared/spec", allow_module_level=True)
SPEC = json.loads(CASES.read_text())

#: The recorded digests are those of a CPU with fused multiply-add; others round a few gradients differently.
FUSED = "AVX2" in cv2.getCPUFeaturesLine().replace("*", "").split()
TOLERANCE = {"grad": 4e-5, "angleOfs": 0.0, "descriptors": 4e-7, "weights": 1e-5}

DETECTORS = {
    "default": limo_hog.HOGDescriptor_getDefaultPeopleDetector(),
    "default_no_bias": limo_hog.HOGDescriptor_getDefaultPeopleDetector()[:-1],
    "daimler": limo_hog.HOGDescriptor_getDaimlerPeopleDetector(),
}


def run(case: dict[str, Any]) -> tuple[Any, ...]:
    image = eval(case["image"], {"np": np, "skimage": skimage})
    hog = limo_hog.HOGDescriptor(*case["ctor"] or ())
    if case["svm"]:
        hog.setSVMDetector(DETECTORS[case["svm"]])
    args = dict(case["args"])
    if case["method"] == "computeGradient":
        args |= {"grad": None, "angleOfs": None}
    found = getattr(hog, case["method"])(image, **args)
    return found if isinstance(found, tuple) else (found,)


def digest(array: np.ndarray[Any, Any]) -> str:
    return hashlib.md5(np.ascontiguousarray(array).tobytes()).hexdigest()


def of(method: str) -> list[Any]:
    chosen = [case for case in SPEC["cases"] if case["method"].startswith(method)]
    return [pytest.param(case, id=case["id"]) for case in chosen]


@pytest.mark.parametrize("case", of("compute"))
def test_arrays_equal_the_recorded_ones_bit_for_bit(case: dict[str, Any]) -> None:
    for (name, expected), array in zip(case["expect"].items(), run(case), strict=True):
        assert array.shape == tuple(expected["shape"])
        assert array.dtype == expected["dtype"]
        np.testing.assert_allclose(array.ravel()[: len(expected["first"])], expected["first"], 0, TOLERANCE[name])
        if FUSED:
            assert digest(array) == expected["md5"]
        else:
            total = array.sum(dtype=np.float64)
            assert abs(total - expected["sum_f64"]) <= TOLERANCE[name] * array.size


@pytest.mark.parametrize("case", of("detect"))
def test_hits_equal_the_recorded_ones_in_order(case: dict[str, Any]) -> None:
    expected = case["expect"]
    places, weights = run(case)
    tolerance = TOLERANCE["weights"]
    assert isinstance(places, tuple) == expected["empty_is_tuple"]
    assert (places.dtype, weights.dtype) == (np.int32, np.float64)
    if "foundLocations" in expected:
        np.testing.assert_array_equal(places, expected["foundLocations"])
        np.testing.assert_allclose(weights, expected.get("foundWeights", expected.get("weights")), 0, tolerance)
        return
    assert len(places) == len(weights) == expected["n"]
    np.testing.assert_array_equal(places.sum(0), expected["rects_sum"])
    first_places, first_weights = expected["first5_single_thread"]
    np.testing.assert_array_equal(places[:5], first_places)
    np.testing.assert_allclose(weights[:5], first_weights, 0, tolerance)
    last_place, last_weight = expected["last_single_thread"]
    np.testing.assert_array_equal(places[-1], last_place)
    assert abs(weights[-1] - last_weight) <= tolerance
    assert abs(weights.sum() - expected["weights_sum"]) <= 1e-12 + tolerance * len(weights)


@pytest.mark.parametrize("name", ["default", "daimler"])
def test_the_people_models_are_opencvs(name: str) -> None:
    assert digest(DETECTORS[name]) == SPEC["detectors_md5"][name]


def noise(*shape: int, seed: int = 7) -> np.ndarray[Any, np.dtype[np.uint8]]:
    return np.random.default_rng(seed).integers(0, 256, shape, dtype=np.uint8)


def err_cell6_detect() -> None:
    hog = limo_hog.HOGDescriptor((48, 96), (12, 12), (6, 6), (6, 6), 9)
    hog.setSVMDetector(np.ones(hog.getDescriptorSize(), np.float32))
    image = noise(200, 150)
    places, weights = hog.detect(image, 0, (6, 6), (6, 6))
    # The grid is that of `compute`, and so are the scores: a detector of ones sums up the descriptor.
    sums = np.asarray(hog.compute(image, (6, 6), (6, 6))).reshape(-1, hog.getDescriptorSize()).sum(1)
    np.testing.assert_allclose(np.asarray(weights, np.float64), sums, rtol=1e-5)
    np.testing.assert_array_equal(np.asarray(places)[0], (-10, -10))


def nothing_where_no_window_fits(*shape: int) -> None:
    hog = limo_hog.HOGDescriptor()
    hog.setSVMDetector(DETECTORS["default"])
    image = noise(*shape)
    assert hog.compute(image) == ()
    assert hog.detect(image) == ((), ())
    assert hog.detectMultiScale(image) == ((), ())


def no_detector() -> None:
    image: Any = noise(200, 150).astype(np.float32)
    assert limo_hog.HOGDescriptor().detectMultiScale(image) == ((), ())


def float_image() -> None:
    image: Any = noise(200, 150).astype(np.float32)
    with pytest.raises(limo_hog.ImageTypeError, match="float32"):
        limo_hog.HOGDescriptor().compute(image)


def clipped_at(threshold: float) -> np.ndarray[Any, Any]:
    hog = limo_hog.HOGDescriptor((64, 128), (16, 16), (8, 8), (8, 8), 9, _L2HysThreshold=threshold)
    return np.asarray(hog.compute(noise(200, 150)))


def l2hys_frozen() -> None:
    fresh = clipped_at(0.1)
    clipped_at(0.5)
    np.testing.assert_array_equal(clipped_at(0.1), fresh)
    assert not np.array_equal(clipped_at(0.5), fresh)


def nbins_200() -> None:
    hog = limo_hog.HOGDescriptor((16, 16), (8, 8), (8, 8), (8, 8), 200)
    bins = np.asarray(hog.computeGradient(noise(16, 18))[1])
    assert bins[:, :16].max() > 127
    first, second = bins[..., 0].astype(int), bins[..., 1].astype(int)
    np.testing.assert_array_equal(second, (first + 1) % 200)


#: What limo-hog does instead where OpenCV errs, crashes or answers at random.
REPLACEMENTS = {
    "err-cell6-detect": err_cell6_detect,
    "err-too-small-both": lambda: nothing_where_no_window_fits(10, 10),
    "err-too-small-one-axis": lambda: nothing_where_no_window_fits(16, 193),
    "ub-one-stride-short": lambda: nothing_where_no_window_fits(125, 60),
    "empty-window-grid": lambda: nothing_where_no_window_fits(128, 56),
    "no-detector": no_detector,
    "float-image": float_image,
    "l2hys-frozen": l2hys_frozen,
    "nbins-200": nbins_200,
}


@pytest.mark.parametrize("name", [case["id"] for case in SPEC["error_and_undefined_cases"]])
def test_where_opencv_fails_limo_hog_answers_or_names_the_error(name: str) -> None:
    REPLACEMENTS[name]()
