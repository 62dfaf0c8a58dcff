"""What a progress bar says: how far it is, and how long it takes where that is known."""

import pytest
from rich.progress import Task

from limo_hog.cli.support.progress import CountColumn, LeftColumn


@pytest.mark.parametrize(("total", "count", "left"), [(60.0, "2 of 60 s", " left"), (None, "2 s", "")])
def test_without_an_end_nothing_is_left(total: float | None, count: str, left: str) -> None:
    task = Task(1, "", total, 2.25, _get_time=lambda: 10.0)  # type: ignore[arg-type]
    task.start_time = 6.0
    assert CountColumn("s").render(task).plain == count
    shown = LeftColumn().render(task).plain
    assert shown.endswith(left) and bool(shown) == bool(left)
