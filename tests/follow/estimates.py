"""Estimates, made up: what a track's covariance is that textbooks write as a matrix."""

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.tracks.kalman import Covariance


def upper(matrix: NDArray[np.float64]) -> Covariance:
    """The upper triangle of a symmetric matrix, float64 (4, 4), by rows."""
    assert np.allclose(matrix, matrix.T)
    xx, xy, xu, xv, yy, yu, yv, uu, uv, vv = matrix[np.triu_indices(4)].tolist()
    return xx, xy, xu, xv, yy, yu, yv, uu, uv, vv
