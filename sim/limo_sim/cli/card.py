"""The score card in a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich import box
from rich.console import Group
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from limo_sim.run.score import ScoreCard

_BAR = 24
_MODE_STYLES = {"search": "blue", "follow": "green", "hold": "cyan", "blocked": "red", "lost": "yellow"}
_MODE_STYLES |= {"drive": "green", "stand": "blue"}  # of a node whose detector is its own
_ZONE_STYLES = {"intimate": "red", "personal": "yellow", "social": "green", "public": "blue"}


def picture(card: ScoreCard) -> Panel:
    """Lay a score card out: figures in two columns, below them shares of time as bars."""
    figures = Table.grid(padding=(0, 2))
    for style in ("dim", "", "dim", ""):
        figures.add_column(style=style, no_wrap=True)
    contacts = card.contacts_person + card.contacts_wall
    switches = "–" if card.identity_switches is None else str(card.identity_switches)
    near = card.intrusion_intimate, card.intrusion_personal
    error = "error to target" if card.kept_m is None else f"error to {card.kept_m:.3g} m"
    for row in (
        ("success", _success(card), "distance, mean", _unit(card.distance_mean_m, "m", 2)),
        ("first detected", _unit(card.first_detection_s, "s"), "distance, least", _unit(card.distance_min_m, "m", 2)),
        ("in view", _share(card.in_view, 0.95, 1), error, _unit(card.distance_rms_error_m, "m", 2)),
        ("detected in view", _share(card.detected, 0.95, 1), "clearance, least", _unit(card.clearance_min_m, "m", 2)),
        ("longest gap", _unit(card.longest_gap_s, "s"), "contacts", _good(str(contacts), contacts == 0)),
        ("best box wrong", _share(card.best_box_wrong, 0, 0.05), "path", _unit(card.path_m, "m")),
        ("pixel error", _pixels(card), "turn-rate change", _unit(card.mean_abs_domega, "rad/s", 3)),
        ("target lost", f"{card.lost}×" if card.lost else "never", "jerk", _unit(card.jerk_mean, "m/s³")),
        ("found within 3 s", _percent(card.found_again), "time to find again", _unit(card.time_to_find_again_s, "s")),
        ("target switches", switches, "", ""),
        ("near anybody", f"intimate {_percent(near[0])}", "", f"personal {_percent(near[1])}"),
    ):
        figures.add_row(*row)
    reasons = Table.grid(padding=(0, 2))
    reasons.add_column(justify="right", style="dim", no_wrap=True)
    reasons.add_column(overflow="fold")
    for reason, share in list(card.reasons.items())[:5]:
        reasons.add_row(_percent(share), Text(reason))
    detection = f"{card.detect_ms_p50:.1f} ms a frame" if card.detect_ms_p50 is not None else "no frame"
    names = (Text(card.scenario, style="bold"), card.controller, card.detector, f"seed {card.seed}")
    return Panel(
        Group(figures, "", _bars(card), "", Text("most frequent reasons", style="bold"), reasons),
        title=Text(" · ").join(Text.assemble(name) for name in names),
        subtitle=f"{card.seconds:g} s, {card.real_time_factor:.1f}× real time · detection {detection}",
        box=box.ROUNDED,
        padding=(1, 2),
        expand=False,
    )


def _bars(card: ScoreCard) -> Table:
    bars = Table.grid(padding=(0, 2))
    for justify in ("left", "left", "right"):
        bars.add_column(justify=justify, no_wrap=True)
    bars.add_row(Text("distance zones", style="bold"), "", "")
    for zone, style in _ZONE_STYLES.items():
        bars.add_row(*_bar(zone, getattr(card, f"zone_{zone}"), style))
    bars.add_row(Text("mode", style="bold"), "", "")
    for mode, share in card.modes.items():
        bars.add_row(*_bar(mode, share, _MODE_STYLES[mode]))
    return bars


def _bar(name: str, share: float | None, style: str) -> tuple[str, Text, str]:
    # A share above 0 has a bar, however small it is.
    full = max(round(_BAR * share), 1) if share else 0
    return f"  {name}", Text("━" * full, style=style) + Text("─" * (_BAR - full), style="dim"), _percent(share)


def _percent(share: float | None) -> str:
    return "–" if share is None else f"{100 * share:.1f} %"


def _share(share: float | None, low: float, high: float) -> Text:
    return Text("–") if share is None else _good(_percent(share), low <= share <= high)


def _good(text: str, good: bool) -> Text:
    return Text(text, style="green" if good else "yellow")


def _unit(value: float | None, unit: str, digits: int = 1) -> str:
    return "–" if value is None else f"{value:.{digits}f} {unit}"


def _success(card: ScoreCard) -> Text | str:
    return "–" if card.success is None else _good("yes" if card.success else "no", card.success)


def _pixels(card: ScoreCard) -> str:
    if card.pixel_error_mean is None or card.pixel_error_p95 is None:
        return "–"
    return f"{card.pixel_error_mean:.0f} px, 95 % < {card.pixel_error_p95:.0f}"
