"""Scenarios and controllers compared in one figure: a panel a figure, a dot a controller, its interval as a bar."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from limo_hog.atomic import about, whole_file
from limo_hog.extras import needed
from limo_sim.run.sweep import Summary

with needed(by="--plot"):
    from matplotlib.figure import Figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_INK, _FAINT = "#1d2329", "#8a949e"
# Okabe and Ito's colours, which people who cannot tell red from green tell apart; markers for print in grey.
_STYLES = {
    "approach": ("#d55e00", "s"),
    "proxemic": ("#cc79a7", "D"),
    "pursuit": ("#e69f00", "v"),
    "ppo": ("#009e73", "^"),
    "tracking": ("#0072b2", "o"),
}
#: A figure of the score card, what it says, and whether it is a share.
_PANELS = (
    ("success", "success [share of runs]", True),
    ("in_view", "in view [share of frames]", True),
    ("distance_rms_error_m", "error to the target distance [m]", False),
    ("time_to_find_again_s", "time to find again [s]", False),
    ("intrusion_personal", "in a personal zone [share of time]", True),
)


def plot(summaries: Sequence[Summary], path: Path) -> None:
    """Draw summaries into a picture of the kind the path's suffix says."""
    scenarios = list(dict.fromkeys(summary.scenario for summary in summaries))
    controllers = list(dict.fromkeys(summary.controller for summary in summaries))
    size = 2.6 * len(_PANELS), 1.4 + (0.2 + 0.1 * len(controllers)) * len(scenarios)
    figure = Figure(figsize=size, layout="constrained", dpi=150)
    panels = figure.subplots(1, len(_PANELS), sharey=True, squeeze=False)[0]
    for axes, (name, title, share) in zip(panels, _PANELS, strict=True):
        for place, controller in enumerate(controllers):
            shift = 0.7 / len(controllers) * (place - (len(controllers) - 1) / 2)
            _dots(axes, [summary for summary in summaries if summary.controller == controller], name, scenarios, shift)
        axes.set_title(title.replace(" [", "\n["), loc="left", fontsize=10, color=_INK)
        axes.set_yticks(range(len(scenarios)), scenarios)
        axes.set_ylim(len(scenarios) - 0.5, -0.5)
        if share:
            axes.set_xlim(-0.02, 1.02)
        else:
            axes.set_xlim(left=-0.02 * axes.get_xlim()[1])
        if all(summary.measures[name] is None for summary in summaries):
            axes.text(0.5, 0.5, "no data", transform=axes.transAxes, ha="center", color=_FAINT)
        axes.grid(axis="x", color=_FAINT, alpha=0.3, linewidth=0.6)
        axes.tick_params(length=0, labelsize=9, colors=_INK)
        axes.spines[["top", "right", "left"]].set_visible(False)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=len(controllers), frameon=False)
    with whole_file(path) as part, about(path):
        figure.savefig(part)


def _dots(axes: Axes, summaries: Sequence[Summary], name: str, scenarios: Sequence[str], shift: float) -> None:
    found = [(summary.scenario, summary.measures[name]) for summary in summaries]
    dots = [(scenarios.index(where) + shift, estimate) for where, estimate in found if estimate is not None]
    colour, marker = _STYLES.get(summaries[0].controller, (_INK, "x"))
    means, rows = [estimate.mean for _, estimate in dots], [row for row, _ in dots]
    errors = [estimate.interval or 0.0 for _, estimate in dots]
    style: dict[str, Any] = {"markersize": 4, "linewidth": 1.2, "fmt": marker, "color": colour}
    axes.errorbar(means, rows, xerr=errors, label=summaries[0].controller, **style)
