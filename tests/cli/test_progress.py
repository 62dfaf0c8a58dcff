"""What a progress bar says: how far it is, and how long it takes where that is known."""

from __future__ import annotations

import pytest
from rich.progress import Task

from limo_hog.cli.support.progress import CountColumn, LeftColumn


def task(total: float | None) -> Task:
    """A task that began 4 s ago, of which 2.25 steps are done."""
    now = 10.0
    made = Task(1, "", total, 2.25, _get_time=lambda: now)  # type: ignore[arg-type]
    made.start_time = 6.0
    return made


@pytest.mark.parametrize(("total", "count", "left"), [(60.0, "2 of 60 s", " left"), (None, "2 s", "")])
def test_without_an_end_nothing_is_left(total: float | None, count: str, left: str) -> None:
    assert CountColumn("s").render(task(total)).plain == count
    shown = LeftColumn().render(task(total)).plain
    assert shown.endswith(left)
    assert bool(shown) == bool(left)
