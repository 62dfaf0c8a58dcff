"""The tables of `limo-hog score`: the controllers by scenario or group, and how they differ from one of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from rich import box
from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    from limo_sim.run.sweep import Comparison, Estimate, Summary

#: Columns of the table: a figure of the score card, its heading, its unit, how it is written.
_COLUMNS = (
    ("success", "suc-\ncess", "%", ".0f"),
    ("in_view", "in\nview", "%", ".1f"),
    ("pixel_error_mean", "off\ncentre", "px", ".1f"),
    ("distance_rms_error_m", "dist.\nerror", "m", ".2f"),
    ("found_again", "found\nagain", "%", ".1f"),
    ("follows_first", "same\nperson", "%", ".1f"),
    ("clearance_min_m", "least\nclear", "m", ".2f"),
    ("contacts_person", "con-\ntacts", "", ".2g"),
    ("path_wrong_m", "path\nwrong", "m", ".2f"),
)


def show(summaries: Sequence[Summary], comparisons: Sequence[Comparison], runs: str) -> None:
    """Print both tables on standard output; `runs` says how many there were of each."""
    console = Console(highlight=False)
    rows = [(one.scenario, one.controller, one.measures) for one in summaries]
    console.print(_table(rows, f"mean and, below, half the 95 % interval over {runs}", _cell))
    if comparisons:
        rows = [(one.scenario, one.controller, one.differences) for one in comparisons]
        words = f"minus {comparisons[0].against}, run by run; bold: the interval leaves out 0"
        console.print(_table(rows, words, _difference))


def _table(
    rows: Sequence[tuple[str, str, dict[str, Estimate | None]]],
    caption: str,
    cell: Callable[[Estimate | None, str, str, str], str],
) -> Table:
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), caption=caption, caption_justify="left")
    table.add_column("\n", no_wrap=True)
    for _, heading, unit, _ in _COLUMNS:
        table.add_column(f"{heading}\n[dim]{unit}[/]", justify="right", no_wrap=True)
    before = ""
    for scenario, controller, measures in rows:
        if scenario != before:
            table.add_section()
            table.add_row(f"[bold]{scenario}[/]")
        table.add_row(
            f"  {controller}", *(cell(measures[name], name, unit, style) for name, _, unit, style in _COLUMNS)
        )
        before = scenario
    return table


def _cell(estimate: Estimate | None, name: str, unit: str, style: str) -> str:
    if estimate is None:
        return "[dim]–[/]"
    mean, interval = estimate.written(name, 100 if unit == "%" else 1, style)
    return f"{mean}\n[dim]{interval.replace(' ', '')}[/]" if interval else mean


def _difference(estimate: Estimate | None, name: str, unit: str, style: str) -> str:
    text = _cell(estimate, name, unit, f"+{style}")
    return f"[bold]{text}[/]" if estimate is not None and estimate.is_sure else text
