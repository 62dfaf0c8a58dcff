"""The nodes of strangers: right ones get all points, wrong ones lose points of the task that they have wrong."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pytest
from tests.sim.workshop.strangers import RIGHT, WRONG, checked

from limo_sim.workshop.report import total

#: Those that are checked with every change; the others are marked slow.
QUICK = (
    *("timer of 3 Hz", "functions and spin_once", "threads", "crop of the rows", "enlarged copy"),
    "logs every tenth image",
    *("2 a number that was made up", "3 a timer that always drives", "3 largest", "4 steers by the blue shirt"),
    *("any best effort commands", "any the model solution, read", "5 one pixel, unknown is nine metres"),
)


def listed(nodes: Iterable[str]) -> list[object]:
    return [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow, id=name) for name in nodes]


@pytest.mark.parametrize("name", listed(RIGHT))
def test_a_right_node_gets_all_points(tmp_path: Path, name: str) -> None:
    exercise, text = RIGHT[name]
    verdicts = checked(tmp_path, text, exercise)
    assert [(verdict.checkpoint, verdict.evidence) for verdict in verdicts if verdict.holds is not True] == []
    assert total(verdicts) == (100, 100)


@pytest.mark.parametrize("name", listed(WRONG))
def test_a_wrong_node_loses_points_of_its_task(tmp_path: Path, name: str) -> None:
    exercise, text = WRONG[name]
    verdicts = checked(tmp_path, text, exercise)
    lost = {str(verdict.task) for verdict in verdicts if verdict.holds is False}
    assert lost if name.startswith("any") else name[0] in lost
    assert total(verdicts)[0] < 100
