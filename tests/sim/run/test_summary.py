"""Score cards are summed up and compared as a textbook does it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import t as student
from scipy.stats import ttest_1samp
from tests.sim.run.steps import card, person, step

from limo_sim.run.score import ScoreCard
from limo_sim.run.sweep import compare, estimate, summarise


def test_the_interval_is_students() -> None:
    values = [1.0, 2.0, 4.0, 4.5, 7.0, 2.5]
    found = estimate(values)
    half = student.ppf(0.975, 5) * np.std(values, ddof=1) / math.sqrt(6)
    assert found.mean == pytest.approx(3.5)
    assert found.interval == pytest.approx(half, rel=0.02)
    assert (found.least, found.most) == (1.0, 7.0)
    assert estimate([1.0, 2.0]).interval is not None
    assert estimate([3.0]).interval is None
    assert not estimate([3.0]).is_sure


def test_cards_are_summed_up_by_scenario_and_controller() -> None:
    one = card(step(0, person()))
    summaries = summarise([one, replace(one, seed=1), replace(one, controller="other")])
    assert [(s.controller, s.runs) for s in summaries] == [("c", 2), ("other", 1)]
    assert summaries[0].measures["found_again"] is None


def several(controller: str, figures: dict[tuple[str, int], float]) -> list[ScoreCard]:
    """Return cards by scenario and seed that differ in one figure."""
    plain = replace(card(step(0, person())), controller=controller)
    return [replace(plain, scenario=name, seed=seed, path_wrong_m=value) for (name, seed), value in figures.items()]


def test_a_group_is_averaged_seed_by_seed_and_its_interval_is_that_of_the_seeds() -> None:
    cards = several("c", {("one", 0): 1.0, ("two", 0): 3.0, ("one", 1): 5.0, ("two", 1): 7.0})
    (summary,) = summarise(cards, {"one": "both", "two": "both"})
    assert (summary.scenario, summary.runs) == ("both", 4)
    assert summary.measures["path_wrong_m"] == estimate([2.0, 6.0])


def test_two_controllers_are_compared_run_by_run() -> None:
    # A seed that is hard for both moves both figures, not their difference.
    mine = several("mine", {("one", 0): 1.5, ("one", 1): 10.5, ("one", 2): 5.5})
    theirs = several("theirs", {("one", 0): 1.0, ("one", 1): 10.0, ("one", 2): 5.0, ("one", 3): 50.0})
    (comparison,) = compare([*mine, *theirs], "theirs")
    assert (comparison.controller, comparison.against, comparison.pairs) == ("mine", "theirs", 3)
    difference = comparison.differences["path_wrong_m"]
    assert difference is not None
    assert difference.mean == pytest.approx(0.5)
    assert difference.interval == pytest.approx(0.0)
    assert comparison.differences["found_again"] is None
    overall = compare([*mine, *theirs], "theirs", {"one": "all"})[0]
    assert (overall.scenario, overall.differences) == ("all", comparison.differences)


@pytest.mark.parametrize("values", [[1.0, 2.0, 1.5], [-3.0, -2.5, -3.5, -2.9], [1.0, -1.0, 0.5], [0.1, 4.0, 0.2, -1.0]])
def test_a_difference_is_sure_where_students_test_rejects_that_there_is_none(values: list[float]) -> None:
    assert estimate(values).is_sure == (ttest_1samp(values, 0.0).pvalue < 0.05)


@pytest.mark.parametrize("count", [51, 201, 1001])
def test_students_quantile_is_right_to_the_third_power_of_the_degrees_of_freedom(count: int) -> None:
    values = np.random.default_rng(1).normal(0.0, 1.0, count).tolist()
    found, freedom = estimate(values), count - 1
    assert found.interval is not None
    quantile = found.interval / (np.std(values, ddof=1) / math.sqrt(count))
    assert quantile == pytest.approx(float(student.ppf(0.975, freedom)), abs=5 / freedom**3)
