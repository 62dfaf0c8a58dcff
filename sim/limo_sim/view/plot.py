"""A run in one figure: the path from above, the error, the distance and the speed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from limo_hog.atomic import about, whole_file
from limo_hog.extras import needed
from limo_hog.follow.sense.measurement import ZONE_ENDS, Zone
from limo_sim.run.episode import Episode
from limo_sim.run.log import Step
from limo_sim.view.reading import figures
from limo_sim.world.furniture import Disc
from limo_sim.world.scenario import Scenario

with needed(by="--plot"):
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle, Polygon
    from matplotlib.patches import Rectangle as Bar

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_ROBOT, _PERSON, _INK, _FAINT = "#1f6feb", "#d1242f", "#1d2329", "#8a949e"
_ZONES = {Zone.INTIMATE: "#d1242f", Zone.PERSONAL: "#e8a317", Zone.SOCIAL: "#2da44e", Zone.PUBLIC: "#8a949e"}


def plot(episode: Episode, steps: Sequence[Step], path: Path) -> None:
    """Draw an episode by its steps into a picture of the kind the path's suffix says."""
    figure = Figure(figsize=(11, 6.4), layout="constrained", dpi=150)
    title = f"{episode.scenario.name} · {episode.controller} · {episode.detector} · seed {episode.seed}"
    figure.suptitle(title, color=_INK, fontweight="bold")
    grid = figure.add_gridspec(3, 2, width_ratios=[1, 1.1], height_ratios=[1, 1.2, 1])
    _path(figure.add_subplot(grid[:, 0]), episode.scenario, steps)
    error, distance, speed = (figure.add_subplot(grid[row, 1]) for row in range(3))
    rows = [figures(step) for step in steps]
    time = [step.log.time for step in steps]
    _line(error, time, [row["error_px"] for row in rows], "#1f6feb")
    error.set_title("off centre [px], left positive", **_TITLE)
    error.axhline(0, color=_FAINT, linewidth=0.8)
    _distance(distance, time, [row["distance_m"] for row in rows])
    _line(speed, time, [row["linear_m_s"] for row in rows], "#b35900", "forward [m/s]")
    _line(speed, time, [row["angular_rad_s"] for row in rows], "#7a4fd0", "turn [rad/s]")
    speed.set_title("command", **_TITLE)
    speed.legend(loc="lower right", bbox_to_anchor=(1, 0.97), frameon=False, fontsize=8, ncols=2)
    speed.set_xlabel("time [s]")
    for axes in (error, distance, speed):
        _tidy(axes)
        axes.set_xlim(0, episode.seconds)
    for axes in (error, distance):
        axes.set_xticklabels([])
    with whole_file(path) as part, about(path):
        figure.savefig(part)


_TITLE: dict[str, Any] = {"loc": "left", "fontsize": 10, "color": _INK}


def _path(axes: Axes, scenario: Scenario, steps: Sequence[Step]) -> None:
    for shape in scenario.footprints:
        if isinstance(shape, Disc):
            axes.add_patch(Circle((shape.x, shape.y), shape.radius, color=_FAINT))
        else:
            corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (shape.half_x, shape.half_y)
            cos, sin = np.cos(shape.yaw), np.sin(shape.yaw)
            axes.add_patch(Polygon(corners @ [[cos, sin], [-sin, cos]] + (shape.x, shape.y), color=_FAINT))
    robot = np.array([step.truth.robot for step in steps]).reshape(-1, 3)
    for index in range(len(scenario.people)):
        walk = [(p.x, p.y) for step in steps if (p := step.truth.people[index]) is not None]
        people = np.array(walk).reshape(-1, 2)
        axes.plot(*people.T, color=_PERSON, linewidth=1.2, alpha=0.8, label="person" if index == 0 else None)
        axes.plot(*people[-1:].T, "o", color=_PERSON)
    axes.plot(robot[:, 0], robot[:, 1], color=_ROBOT, linewidth=1.8, label="robot")
    every = max(1, len(robot) // 12)
    x, y, yaw = robot[::every].T
    axes.quiver(x, y, np.cos(yaw), np.sin(yaw), color=_ROBOT, scale=22, width=0.005, alpha=0.7)
    half = scenario.room.half
    axes.add_patch(Bar((-half, -half), 2 * half, 2 * half, fill=False, color=_INK, linewidth=2))
    axes.set_aspect("equal")
    axes.set_xlim(-half - 0.1, half + 0.1)
    axes.set_ylim(-half - 0.1, half + 0.1)
    # Every 2 m in the workshop's room, fewer in a large one.
    far, every_m = int(half), 2 if half < 8 else 4
    ticks = [*range(-(far // every_m) * every_m, far + 1, every_m)]
    axes.set_xticks(ticks)
    axes.set_yticks(ticks)
    axes.set_title("path from above [m]; arrows: where the robot looks", **_TITLE)
    axes.legend(loc="lower left", frameon=False, fontsize=8, ncols=2)
    _tidy(axes)


def _distance(axes: Axes, time: Sequence[float], values: Sequence[float | None]) -> None:
    top = max([4.5, *(1.05 * value for value in values if value is not None)])
    begins = 0.0
    for zone, colour in _ZONES.items():
        ends = min(ZONE_ENDS.get(zone, top), top)
        axes.axhspan(begins, ends, color=colour, alpha=0.13, linewidth=0)
        axes.text(1.01, (begins + ends) / 2, zone.value, transform=axes.get_yaxis_transform(), fontsize=8, va="center")
        begins = ends
    _line(axes, time, values, "#0b7a5e")
    axes.set_ylim(0, top)
    axes.set_title("distance to the nearest person [m], in Hall's zones", **_TITLE)


def _line(
    axes: Axes, time: Sequence[float], values: Sequence[float | None], colour: str, label: str | None = None
) -> None:
    # A gap where there is nothing to say.
    heights = [np.nan if value is None else value for value in values]
    axes.plot(time, heights, color=colour, linewidth=1.4, label=label)


def _tidy(axes: Axes) -> None:
    axes.grid(color="#d9dde2", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8, color=_FAINT)
    for side in axes.spines.values():
        side.set_visible(False)
