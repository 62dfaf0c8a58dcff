"""What scripts written for OpenCV 4 do, to be run under OpenCV 5; `test_opencv5.py` does so."""

import sys
import warnings
from typing import Any

import cv2 as typed_cv2
import numpy as np

import limo_hog

cv2: Any = typed_cv2  # whose types know no HOG


def figure(rng: np.random.Generator) -> Any:
    """Draw a person-like thing of 64 × 128 on a rough ground."""
    image = rng.normal(110, 8, (128, 64, 3)).clip(0, 255).astype(np.uint8)
    lean, shade = int(rng.integers(-2, 3)), int(rng.integers(0, 60))
    for at, size in (((32 + lean, 26), (7, 9)), ((32 + lean, 55), (13, 24))):
        cv2.ellipse(image, at, size, 0, 0, 360, (shade, shade, shade), -1)
    for foot in (-8, 8):
        cv2.line(image, (32 + lean + foot // 2, 72), (32 + foot, 112), (shade, shade, shade), 8)
    return image


def scene(rng: np.random.Generator) -> Any:
    image = np.tile(rng.normal(110, 8, (240, 160, 3)).clip(0, 255).astype(np.uint8), (2, 4, 1))
    image[180:308, 300:364] = figure(rng)
    return image


def people_detector() -> Any:
    hog = cv2.HOGDescriptor()
    hog.setSVMDetector(cv2.HOGDescriptor_getDefaultPeopleDetector())
    return hog


def the_workshops_call(image: Any) -> None:
    boxes, weights = people_detector().detectMultiScale(image, winStride=(8, 8), padding=(4, 4), scale=1.05)
    boxes = np.array([[x, y, x + w, y + h] for (x, y, w, h) in boxes])
    assert len(boxes) > 0 and boxes.shape == (len(weights), 4)
    for xa, ya, xb, yb in boxes:
        cv2.rectangle(image, (xa, ya), (xb, yb), (0, 255, 0), 2)


def the_peopledetect_sample(image: Any) -> None:
    found, _w = people_detector().detectMultiScale(image, winStride=(8, 8), padding=(32, 32), scale=1.05)

    def inside(r: Any, q: Any) -> bool:
        (rx, ry, rw, rh), (qx, qy, qw, qh) = r, q
        return bool(rx > qx and ry > qy and rx + rw < qx + qw and ry + rh < qy + qh)

    outer = [r for ri, r in enumerate(found) if not any(ri != qi and inside(r, q) for qi, q in enumerate(found))]
    assert len(outer) > 0
    for x, y, w, h in outer:
        pad_w, pad_h = int(0.15 * w), int(0.05 * h)
        cv2.rectangle(image, (x + pad_w, y + pad_h), (x + w - pad_w, y + h - pad_h), (0, 255, 0), 1)
    grouped, counts = cv2.groupRectangles([list(r) for r in found] * 3, 1)
    assert len(grouped) == len(counts) > 0


def training_ones_own(rng: np.random.Generator, directory: str) -> None:
    hog = cv2.HOGDescriptor((64, 128), (16, 16), (8, 8), (8, 8), 9)
    ground = scene(rng)[:128, :640]
    windows = [figure(rng) for _ in range(20)] + [ground[:, x : x + 64] for x in range(0, 570, 30)]
    features = np.array([hog.compute(np.ascontiguousarray(window)).flatten() for window in windows])
    labels = np.where(np.arange(len(windows)) < 20, 1.0, -1.0)
    # A linear SVM by ridge regression: that is all a test needs.
    centred = np.column_stack([features, np.ones(len(features))])
    weights = centred.T @ np.linalg.solve(centred @ centred.T + 0.1 * np.eye(len(centred)), labels)
    hog.setSVMDetector(weights.astype(np.float32))
    hog.save(f"{directory}/own.yml")
    again = cv2.HOGDescriptor()
    assert again.load(f"{directory}/own.yml")
    boxes, scores = again.detectMultiScale(scene(rng), hitThreshold=0.3)
    best = boxes[int(np.argmax(scores))]
    assert abs(int(best[0]) - 300) < 24 and abs(int(best[1]) - 180) < 24, (boxes, scores)


def a_video_that_ends(image: Any) -> None:
    people_detector().detectMultiScale(image)
    try:
        people_detector().detectMultiScale(None)
    except cv2.error:
        return
    raise AssertionError("no error at the end")


if __name__ == "__main__":
    directory, replace = sys.argv[1], sys.argv[2:] == ["replace"]
    had = hasattr(cv2, "HOGDescriptor")
    with warnings.catch_warnings(record=True) as said:
        installed = limo_hog.install_into_cv2()
    assert ("HOGDescriptor" in installed) == (not had), (cv2.__version__, installed)
    # opencv-contrib 5 has a detector of its own, which describes otherwise than OpenCV 4's.
    assert bool(said) == replace, said
    if replace:
        assert "HOGDescriptor" in limo_hog.install_into_cv2(replace=True)
    assert not cv2.HOGDescriptor((64, 128), (16, 16), (8, 8), (8, 8), 9).gammaCorrection
    generator = np.random.default_rng(5)
    a_video_that_ends(scene(generator))
    the_workshops_call(scene(generator))
    the_peopledetect_sample(scene(generator))
    training_ones_own(generator, directory)
    sys.stdout.write(f"OpenCV {cv2.__version__}: installed {len(installed)} names, all scripts ran\n")
