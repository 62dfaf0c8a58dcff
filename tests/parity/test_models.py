"""The two people models are OpenCV's, coefficient for coefficient."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

import limo_hog

oracle: Any = cv2  # its stubs leave HOG out


def test_the_default_model_is_opencvs() -> None:
    ours = limo_hog.HOGDescriptor_getDefaultPeopleDetector()
    np.testing.assert_array_equal(ours, np.ravel(oracle.HOGDescriptor_getDefaultPeopleDetector()))
    assert ours.dtype == np.float32


def test_the_daimler_model_is_opencvs() -> None:
    ours = limo_hog.HOGDescriptor_getDaimlerPeopleDetector()
    np.testing.assert_array_equal(ours, np.ravel(oracle.HOGDescriptor_getDaimlerPeopleDetector()))
    assert ours.dtype == np.float32
