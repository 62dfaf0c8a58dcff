"""A linear SVM on many descriptors: squared hinge loss, solved in the primal by L-BFGS, within bounded memory.

liblinear and scikit-learn copy descriptors to float64 and index every element, six times their size; here they stay
float32 where they are. Sums run over blocks of fixed length in a fixed order: the same result with any number of cores.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from limo_hog.extras import needed

with needed(by="limo-hog train"):
    from scipy.optimize import minimize
    from threadpoolctl import threadpool_limits

#: Descriptors summed at a time: 15 MB of those of 64 × 128 windows, read once for margins and gradient.
_ROWS = 1024
#: Steps at the most.
_STEPS = 400


class Solution(NamedTuple):
    """A linear SVM: float64 (D + 1,) weights and bias, the objective's value, and the steps it took."""

    coefficients: NDArray[np.float64]
    objective: float
    iterations: int


def solve(
    positives: Sequence[NDArray[np.float32]],
    negatives: Sequence[NDArray[np.float32]],
    c: float,
    bias_feature: float,
    start: NDArray[np.float64] | None,
    workers: int,
    tolerance: float = 1e-4,
) -> Solution:
    """Minimise ½‖w‖² + C Σ max(0, 1 − y f)², f = w · descriptor + bias, over blocks of float32 (n, D) descriptors.

    The bias is `bias_feature` times a weight of its own, so that it is hardly held back by ½‖w‖². `start` is weights
    and bias to begin with, float64 (D + 1,). It stops where no element of the gradient is larger than `tolerance`.
    """
    blocks = [
        (part[i : i + _ROWS], y) for parts, y in ((positives, 1.0), (negatives, -1.0)) for part in parts
        for i in range(0, len(part), _ROWS)
    ]  # fmt: skip
    first = np.zeros(positives[0].shape[1] + 1) if start is None else np.append(start[:-1], start[-1] / bias_feature)
    with ThreadPoolExecutor(workers) as pool, threadpool_limits(1):
        found = minimize(
            _objective(blocks, c, bias_feature, pool),
            first,
            jac=True,
            method="L-BFGS-B",
            options={"maxiter": _STEPS, "maxfun": 2 * _STEPS, "gtol": tolerance, "ftol": 1e-7},
        )
    weights = np.append(found.x[:-1], found.x[-1] * bias_feature)
    return Solution(weights, float(found.fun), int(found.nit))


def _objective(
    blocks: list[tuple[NDArray[np.float32], float]], c: float, bias_feature: float, pool: ThreadPoolExecutor
) -> Callable[[NDArray[np.float64]], tuple[float, NDArray[np.float64]]]:
    def value_and_gradient(w: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        weights, bias = w[:-1].astype(np.float32), np.float32(bias_feature * w[-1])

        def part(block: tuple[NDArray[np.float32], float]) -> tuple[float, NDArray[np.float32] | None, float]:
            descriptors, y = block
            short = 1 - np.float32(y) * (descriptors @ weights + bias)
            active = np.flatnonzero(short > 0)
            if not active.size:
                return 0.0, None, 0.0
            pull = short[active] * np.float32(-2 * c * y)
            # Few negatives are active in later rounds: only these are read again.
            some = descriptors if 2 * active.size > len(descriptors) else descriptors[active]
            if some is descriptors:
                whole = np.zeros(len(descriptors), np.float32)
                whole[active] = pull
                pull = whole
            return float(np.square(short[active], dtype=np.float64).sum()), pull @ some, float(pull.sum())

        gradient = w.copy()
        loss = 0.0
        for squares, slope, bias_slope in pool.map(part, blocks):
            loss += squares
            if slope is not None:
                gradient[:-1] += slope
                gradient[-1] += bias_feature * bias_slope
        return 0.5 * float(w @ w) + c * loss, gradient

    return value_and_gradient
