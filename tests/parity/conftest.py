"""OpenCV made comparable: one thread, so that its rectangles come in level order."""

import cv2
import numpy as np
import pytest


@pytest.fixture(scope="session", autouse=True)
def _comparable_opencv() -> None:
    cv2.setNumThreads(1)
    # The first block normalised in a process fixes OpenCV's clipping value for all later ones: let it be the usual.
    cv2.HOGDescriptor().compute(np.zeros((128, 64), np.uint8))
