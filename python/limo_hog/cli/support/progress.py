"""Progress bars on standard error, where that is a terminal."""

from __future__ import annotations

import sys

from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.text import Text

from limo_hog.cli.support.console import console


class RateColumn(ProgressColumn):
    """Steps a second."""

    def render(self, task: Task) -> Text:
        """Return the rate, once it is known."""
        return Text(f"{task.speed:.4g}/s" if task.speed else "", style="progress.data.speed")


class CountColumn(ProgressColumn):
    """Steps done, and of how many where that is known."""

    def __init__(self, unit: str) -> None:
        super().__init__()
        self._unit = unit

    def render(self, task: Task) -> Text:
        """Return the steps done and, if known, of how many."""
        of = "" if task.total is None else f" of {task.total:g}"
        return Text(f"{task.completed:.0f}{of} {self._unit}")


class LeftColumn(TimeRemainingColumn):
    """The time left, where it is known how many steps there are."""

    def render(self, task: Task) -> Text:
        """Return the time left, or nothing."""
        return Text("") if task.total is None else Text.assemble(super().render(task), " left")


def progress(unit: str) -> Progress:
    """Make a progress display on standard error: shown only on a terminal, gone when it ends."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        CountColumn(unit),
        RateColumn(),
        TimeElapsedColumn(),
        LeftColumn(),
        console=console(stderr=True),
        transient=True,
        disable=not sys.stderr.isatty(),
    )
