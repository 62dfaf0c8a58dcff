"""Searches with geometries that have no kernels, beside OpenCV 4.14: the same windows and rectangles."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest
import skimage.data

import limo_hog

#: Block, block stride and cell [px], bins, signed gradients.
GEOMETRIES = {
    "4 px cells": ((8, 8), (4, 4), (4, 4), 9, False),
    "16 px cells": ((32, 32), (16, 16), (16, 16), 9, False),
    "blocks of 32 px": ((32, 32), (8, 8), (8, 8), 9, False),
    "12 bins": ((16, 16), (8, 8), (8, 8), 12, False),
    "18 signed bins": ((16, 16), (8, 8), (8, 8), 18, True),
}


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("name", GEOMETRIES)
def test_a_search_without_kernels_finds_what_opencv_finds(name: str, channels: int) -> None:
    block, stride, cell, bins, signed = GEOMETRIES[name]
    pictures: Any = skimage.data
    image = np.ascontiguousarray(pictures.astronaut()[:300, 100:390, :] if channels == 3 else pictures.camera()[:300])
    hogs: list[Any] = [
        module.HOGDescriptor((64, 128), block, stride, cell, bins, 1, -1, 0, 0.2, True, 64, signed)
        for module in (limo_hog, cv2)
    ]
    weights = np.random.default_rng(7).normal(size=hogs[0].getDescriptorSize() + 1).astype(np.float32)
    # As loud as the people model, whose blocks' weights have norms of 50 together.
    of_block = block[0] * block[1] // (cell[0] * cell[1]) * bins
    weights *= 50 / np.linalg.norm(weights[:-1].reshape(-1, of_block), axis=1).sum()
    for hog in hogs:
        hog.setSVMDetector(weights)
    for win_stride in ((8, 8), (4, 12)):
        _, scores = hogs[1].detect(image, -1e6, win_stride, (8, 8))
        threshold = float(np.quantile(scores, 0.97))
        (ours, weighed), (theirs, wanted) = (hog.detect(image, threshold, win_stride, (8, 8)) for hog in hogs)
        assert len(theirs) > 5
        np.testing.assert_array_equal(ours, theirs)
        np.testing.assert_allclose(weighed, np.ravel(wanted), rtol=0, atol=1e-5)
        found = [hog.detectMultiScale(image, threshold, win_stride, (8, 8), 1.1, 1)[0] for hog in hogs]
        assert sorted(map(tuple, found[0])) == sorted(map(tuple, found[1]))
