"""The solver finds the least value of its objective, the same on any number of cores."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import minimize

from limo_hog.learn.solver import solve

C, BIAS = 0.05, 10.0


def problem(count: int, size: int, seed: int = 0) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    rng = np.random.default_rng(seed)
    positives = rng.normal(0.15, 1, (count, size)).astype(np.float32)
    negatives = rng.normal(-0.15, 1, (3 * count, size)).astype(np.float32)
    return positives, negatives


def objective(w: NDArray[np.float64], positives: NDArray[np.float32], negatives: NDArray[np.float32]) -> float:
    """½‖w‖² + C Σ max(0, 1 − y f)² in float64, the bias being 10 times the last weight."""
    margins = [1 - (positives @ w[:-1] + BIAS * w[-1]), 1 + (negatives @ w[:-1] + BIAS * w[-1])]
    return 0.5 * float(w @ w) + C * sum(float((np.maximum(m, 0) ** 2).sum()) for m in margins)


def test_the_solution_is_the_least() -> None:
    positives, negatives = problem(80, 12)
    found = solve([positives], [negatives[:100], negatives[100:]], C, BIAS, None, 2, tolerance=1e-6)
    best = minimize(objective, np.zeros(13), (positives, negatives), method="BFGS", options={"gtol": 1e-7})
    assert found.objective == pytest.approx(best.fun, rel=1e-5)
    assert found.coefficients[:-1] == pytest.approx(best.x[:-1], abs=2e-4)
    assert found.coefficients[-1] == pytest.approx(BIAS * best.x[-1], abs=2e-3)


def test_any_number_of_cores_gives_the_same_bits() -> None:
    positives, negatives = problem(1500, 40)
    one, many = (solve([positives], [negatives], C, BIAS, None, workers) for workers in (1, 4))
    assert np.array_equal(one.coefficients, many.coefficients)


def test_a_start_at_the_solution_is_soon_at_its_end() -> None:
    positives, negatives = problem(300, 20)
    first = solve([positives], [negatives], C, BIAS, None, 1)
    again = solve([positives], [negatives], C, BIAS, first.coefficients, 1)
    assert again.iterations < first.iterations / 3 and again.objective <= first.objective
