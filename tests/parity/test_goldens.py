"""OpenCV 4.14's recorded answers to generated images: a clone needs nothing else to prove parity."""

import json
from collections import Counter
from typing import Any

import cv2
import numpy as np
import pytest
from tests.parity.goldens.case import RETURNS, Case, ask
from tests.parity.goldens.record import ANSWERS, CASES, digest, opencv_answers, sample
from tests.parity.shared import ABSENT, PRESENT, SHARED

import limo_hog

ANSWER = json.loads(ANSWERS.read_text())
BY_NAME = {case.name: case for case in CASES}

#: The recorded digests are those of a CPU with fused multiply-add; others round a few gradients differently.
FUSED = "AVX2" in cv2.getCPUFeaturesLine().replace("*", "").split()
TOLERANCE = {"grad": 4e-5, "angleOfs": 0.0, "descriptors": 4e-7}
WEIGHT_TOLERANCE = 1e-5


def of(kind: str) -> list[Any]:
    return [pytest.param(case, id=case.name) for case in CASES if case.method.startswith(kind)]


def answers_of_limo_hog(case: Case) -> dict[str, Any]:
    image = case.image()
    drift = "NumPy or scikit-image makes another image here: the recorded answer is not for it"
    assert digest(image) == ANSWER[case.name]["image"], drift
    return ask(case, image, limo_hog)


@pytest.mark.parametrize("case", of("compute"))
def test_arrays_equal_opencvs_bit_for_bit(case: Case) -> None:
    for name, found in answers_of_limo_hog(case).items():
        expected = ANSWER[case.name][name]
        if expected is None:
            assert found == ()
            continue
        assert (list(found.shape), str(found.dtype)) == (expected["shape"], expected["dtype"])
        np.testing.assert_allclose(sample(found), expected["sample"], rtol=0, atol=TOLERANCE[name] + 1e-8)
        if FUSED:
            assert digest(found) == expected["md5"]


@pytest.mark.parametrize("case", of("detect"))
def test_places_and_weights_are_opencvs_in_its_order(case: Case) -> None:
    found, (places, weights) = answers_of_limo_hog(case), RETURNS[case.method]
    expected = ANSWER[case.name]
    if expected[places] is None:
        assert (found[places], found[weights]) == ((), ())
        return
    assert (found[places].dtype, found[weights].dtype) == (np.int32, np.float64)
    assert found[places].tolist() == expected[places]
    np.testing.assert_allclose(found[weights], expected[weights], rtol=0, atol=WEIGHT_TOLERANCE)


@pytest.mark.parametrize("name", ["Default", "Daimler"])
def test_the_people_models_are_opencvs(name: str) -> None:
    ours, theirs = (getattr(library, f"HOGDescriptor_get{name}PeopleDetector")() for library in (limo_hog, cv2))
    assert ours.dtype == np.float32
    np.testing.assert_array_equal(getattr(limo_hog.HOGDescriptor, f"get{name}PeopleDetector")(), ours)
    np.testing.assert_array_equal(ours, np.ravel(theirs))


def test_every_case_has_one_name_and_one_answer() -> None:
    assert Counter(case.name for case in CASES) == Counter(list(ANSWER))


@pytest.mark.skipif(not cv2.__version__.startswith("4.14."), reason=f"OpenCV is {cv2.__version__}, not 4.14")
@pytest.mark.skipif(not FUSED, reason="the answers are those of a CPU with AVX2 and FMA")
def test_opencv_gives_the_recorded_answers_again() -> None:
    again = opencv_answers()
    assert [name for name in ANSWER if again[name] != ANSWER[name]] == []


@pytest.mark.skipif(not PRESENT, reason=ABSENT)
def test_every_case_of_the_shared_specification_is_asked() -> None:
    for theirs in json.loads((SHARED / "spec" / "cases.json").read_text())["cases"]:
        ours = BY_NAME[theirs["id"]]
        asked = json.loads(json.dumps([ours.geometry or None, ours.detector, ours.method, ours.arguments]))
        assert asked == [theirs["ctor"], theirs["svm"], theirs["method"], theirs["args"]]
