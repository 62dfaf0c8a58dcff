"""Real photographs, crops and a video against the answers of OpenCV 4.14, where `../shared` is beside the checkout."""

import hashlib
import json
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from tests.parity.shared import ABSENT, PRESENT, SHARED

import limo_hog

if not PRESENT:
    pytest.skip(ABSENT, allow_module_level=True)

DATA = SHARED / "data" / "real"
GOLDEN = DATA / "golden_cv2_4.14.json"

#: Name of a call in the answers, its padding [px] and its grouping threshold.
CALLS = [(f"ws8_pad{pad}_s1.05_group{group}", pad, group) for pad in (8, 4) for group in (2, 0)]


def golden(kind: str) -> dict[str, Any]:
    answers: dict[str, Any] = json.loads(GOLDEN.read_text())[kind]
    assert answers, f"{GOLDEN} holds no {kind}"
    return answers


@pytest.fixture(scope="module")
def hog() -> limo_hog.HOGDescriptor:
    descriptor = limo_hog.HOGDescriptor()
    descriptor.setSVMDetector(limo_hog.HOGDescriptor_getDefaultPeopleDetector())
    return descriptor


def read(name: str) -> NDArray[np.uint8]:
    image = cv2.imread(str(DATA / name), cv2.IMREAD_COLOR)
    assert image is not None, name
    return image.astype(np.uint8, copy=False)


def by_place(rects: Any, weights: Any) -> list[tuple[list[int], float]]:
    """Rectangles with their weights in an order of their own: OpenCV's depends on its threads."""
    pairs = zip(np.asarray(rects).reshape(-1, 4).tolist(), np.asarray(weights).ravel().tolist(), strict=True)
    return sorted(pairs)


def assert_equals_golden(hog: limo_hog.HOGDescriptor, image: NDArray[np.uint8], answers: dict[str, Any]) -> None:
    for call, pad, group in CALLS:
        found = by_place(*hog.detectMultiScale(image, 0.0, (8, 8), (pad, pad), 1.05, group))
        wanted = by_place(answers[call]["rects"], answers[call]["weights"])
        assert [rect for rect, _ in found] == [rect for rect, _ in wanted], call
        np.testing.assert_allclose([w for _, w in found], [w for _, w in wanted], rtol=0, atol=1e-5, err_msg=call)


@pytest.mark.parametrize("name", golden("images"))
def test_a_photograph_has_opencvs_rectangles_and_weights(hog: limo_hog.HOGDescriptor, name: str) -> None:
    image, answers = read(name), golden("images")[name]
    assert hashlib.sha256(image.tobytes()).hexdigest() == answers["decoded_sha256"], "decoded to other pixels"
    assert_equals_golden(hog, image, answers)


@pytest.mark.parametrize("name", golden("crops"))
def test_a_crop_has_opencvs_score_and_descriptor(hog: limo_hog.HOGDescriptor, name: str) -> None:
    image, answers = read(name), golden("crops")[name]
    descriptor = np.asarray(hog.compute(image, winStride=(8, 8), padding=(0, 0)))
    model = limo_hog.HOGDescriptor_getDefaultPeopleDetector().astype(np.float64)
    assert float(descriptor @ model[:-1] + model[-1]) == pytest.approx(answers["score"], abs=1e-5)
    _, weights = hog.detect(image, hitThreshold=-100.0)
    assert float(np.asarray(weights)[0]) == pytest.approx(answers["score"], abs=1e-5)


@pytest.mark.parametrize("name", golden("video"))
def test_every_25th_frame_of_the_video_has_opencvs_rectangles(hog: limo_hog.HOGDescriptor, name: str) -> None:
    video = cv2.VideoCapture(str(DATA / name))
    answers = golden("video")[name]["results"]
    compared = 0
    for number in range(golden("video")[name]["frames"]):
        if not video.grab():
            break
        if str(number) not in answers:
            continue
        _, frame = video.retrieve()
        if hashlib.sha256(frame.tobytes()).hexdigest() != answers[str(number)]["decoded_sha256"]:
            continue  # another decoder version: other pixels, so the answers are of another picture
        assert_equals_golden(hog, frame.astype(np.uint8, copy=False), answers[str(number)])
        compared += 1
    assert compared > len(answers) // 2
