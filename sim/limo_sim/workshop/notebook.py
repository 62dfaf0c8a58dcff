"""The workshop in Jupyter: the notebook that `limo-hog workshop new --notebook` writes, and what its cells call."""

from __future__ import annotations

import json
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from limo_hog.imaging.notebook import data_uri
from limo_hog.imaging.writing import jpeg
from limo_sim.ros.script import run_script, score_of
from limo_sim.workshop import template
from limo_sim.workshop.check import examine
from limo_sim.workshop.html_report import to_html
from limo_sim.world.scenario import Scenario

_TASKS = {
    "follower": (
        "# A robot that finds and follows a person",
        "You write a ROS 2 node, task by task. It runs here against an arena, and unchanged on a robot. The tasks are "
        "told at https://github.com/limo-hog/limo-hog/blob/main/docs/workshop/tasks.md; in short:",
        "1. **See.** Show the camera's picture: `self.show(picture)` for every image.\n"
        "2. **Detect.** `self.hog.detectMultiScale(image, winStride=(8, 8), scale=1.05)`; log how many.\n"
        "3. **Choose.** No box: publish `Twist()` and return. Else draw all green, the surest red with a blue dot.\n"
        "4. **Drive.** Turn by 0.005 rad/s per pixel of `middle - cx`, not within 20 px; drive at 0.2 m/s.",
    ),
    "proxemic": (
        "# Keep a distance",
        "The sequel of the workshop: https://github.com/limo-hog/limo-hog/blob/main/docs/workshop/sequel.md",
        "**Measure** the depth in a square around the box's centre, the median of the values that are known. **Hold** "
        "`self.target`: 0.5 m/s per metre of error, at most 0.3 m/s, and stand where nothing is known.",
    ),
}


def notebook(node: str) -> str:
    """Return a notebook's text: a cell with the template writes the file, one runs it, one checks it."""
    file = f"{node}.py"
    title, words, tasks = _TASKS[node]
    sequel = "" if node == "follower" else ", sequel=True"
    cells = [
        _cell("markdown", f"{title}\n\n{words}\n\n{tasks}"),
        _cell("markdown", "Your node. Run this cell to write the file, after every change."),
        _cell("code", f"%%writefile {file}\n{template(node)}"),
        _cell("markdown", "Try it: the last picture of each window, what was logged, and where the robot went."),
        _cell(
            "code",
            f'from limo_sim.workshop.notebook import check, run\n\nrun("{file}", scenario="followable", seconds=10)',
        ),
        _cell("markdown", "Check it: points, evidence or the likely mistake, and the pictures your node showed."),
        _cell("code", f'check("{file}"{sequel})'),
    ]
    for number, cell in enumerate(cells):
        cell["id"] = f"cell-{number:02}"
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    content = {"cells": cells, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


def _cell(kind: str, text: str) -> dict[str, Any]:
    cell: dict[str, Any] = {"cell_type": kind, "metadata": {}, "source": text.rstrip("\n").splitlines(keepends=True)}
    return cell if kind == "markdown" else {**cell, "execution_count": None, "outputs": []}


@dataclass(frozen=True, slots=True)
class Shown:
    """Something that Jupyter shows as HTML, and a terminal as text."""

    text: str
    html: str

    def __repr__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        return self.html


def check(file: str | Path, *, sequel: bool = False, stretch: str = "") -> Shown:
    """Check a node as `limo-hog workshop check` does; Jupyter shows the report."""
    script, node = Path(file), f"stretch {stretch}" if stretch else "proxemic" if sequel else "follower"
    examination = examine(script, node)
    points = sum(verdict.points for verdict in examination.verdicts)
    page = escape(to_html(script, node, examination), quote=True)
    # A frame keeps the page's styles from the notebook's.
    frame = f'<iframe srcdoc="{page}" style="width: 100%; height: 40rem; border: 0" title="report"></iframe>'
    return Shown(f"{script.name}: {points} of 100 points", frame)


def run(file: str | Path, scenario: str = "workshop", seconds: float = 10.0, seed: int = 0) -> Shown:
    """Run a node in the arena; Jupyter shows the last picture of each window and the last lines of the log.

    Parameters
    ----------
    file
        The node.
    scenario, seed
        The arena and its random numbers.
    seconds
        Simulated time [s].
    """
    lines: list[str] = []
    outcome = run_script(
        Path(file),
        Scenario.load(scenario),
        seconds,
        seed,
        log=lambda time, level, _name, message: lines.append(f"{time:6.2f} s {level}: {message}"),
    )
    card = score_of(outcome)
    said = [*lines[-8:], outcome.traceback, outcome.failure] if outcome.failure else lines[-8:]
    said.append(
        f"in view {card.in_view or 0:.0%}, nearest {card.distance_min_m or 0:.1f} m, way {card.path_m:.1f} m, "
        f"contacts {card.contacts_person + card.contacts_wall}"
    )
    text = "\n".join(line for line in said if line)
    pictures = "".join(
        f'<figure style="display: inline-block; margin: 0 1rem 0 0"><img alt="{escape(name, quote=True)}" width="480" '
        f'src="{data_uri(jpeg(picture))}"><figcaption>{escape(name)}</figcaption></figure>'
        for name, picture in outcome.world.windows.items()
    )
    return Shown(text, f"{pictures}<pre>{escape(text)}</pre>")
