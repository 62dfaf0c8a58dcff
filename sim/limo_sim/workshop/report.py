"""Verdicts as data: JSON with points by task, and Gradescope's results.json."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from limo_sim.workshop.check import Verdict
from limo_sim.workshop.exercises import task_name


def total(verdicts: Sequence[Verdict]) -> tuple[int, int]:
    """Return the points won and the points to win."""
    return sum(verdict.points for verdict in verdicts), sum(verdict.worth for verdict in verdicts)


def by_task(verdicts: Sequence[Verdict]) -> dict[int, tuple[int, int]]:
    """Return the points won and to win of each task that is worth any."""
    tasks = sorted({verdict.task for verdict in verdicts if verdict.worth})
    return {task: total([verdict for verdict in verdicts if verdict.task == task]) for task in tasks}


def evidence(verdict: Verdict) -> str:
    """Return the evidence, with the line of the student's file in front where it is known."""
    return verdict.evidence if verdict.line is None else f"line {verdict.line}: {verdict.evidence}"


def to_json(script: Path, node: str, verdicts: Sequence[Verdict]) -> dict[str, Any]:
    """Return everything the checker found out about a file."""
    points, worth = total(verdicts)
    return {
        "file": script.name,
        "node": node,
        "points": points,
        "max_points": worth,
        "tasks": [{"task": task, "points": won, "max_points": of} for task, (won, of) in by_task(verdicts).items()],
        "checkpoints": [
            {
                "task": verdict.task,
                "checkpoint": verdict.checkpoint,
                "holds": verdict.holds,
                "points": verdict.points,
                "max_points": verdict.worth,
                "evidence": verdict.evidence,
                "line": verdict.line,
            }
            for verdict in verdicts
        ],
    }


def to_gradescope(script: Path, verdicts: Sequence[Verdict]) -> dict[str, Any]:
    """Return the content of a Gradescope autograder's results.json."""
    points, worth = total(verdicts)
    return {
        "score": points,
        "max_score": worth,
        "output": f"limo-hog workshop check {script.name}: {points} of {worth} points",
        "tests": [
            {
                "name": f"Task {task_name(verdict.task)}: {verdict.checkpoint}",
                "score": verdict.points,
                "max_score": verdict.worth,
                "status": "passed" if verdict.holds else "failed",
                "output": evidence(verdict),
            }
            for verdict in verdicts
        ],
    }
