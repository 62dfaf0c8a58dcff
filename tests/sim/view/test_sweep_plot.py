"""The figure of `limo-hog score --plot`: everything on it can be read."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from tests.sim.logs import card, person, step

from limo_sim.run.sweep import summarise
from limo_sim.view.sweep_plot import plot


@pytest.fixture
def figure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Figure:
    drawn: list[Figure] = []
    save = Figure.savefig

    def kept(self: Figure, *args: object, **options: object) -> None:
        drawn.append(self)
        save(self, *args, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(Figure, "savefig", kept)
    one = replace(card(step(0, person())), success=False, time_to_find_again_s=None, intrusion_personal=0.0)
    plot(summarise([one, replace(one, seed=1)]), tmp_path / "a.png")
    return drawn[0]


def test_no_title_is_cut_off(figure: Figure) -> None:
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    titles = [axes._left_title.get_window_extent(canvas.get_renderer()) for axes in figure.axes]  # type: ignore[attr-defined]
    assert all(left.x1 < right.x0 for left, right in pairwise(titles))
    assert titles[-1].x1 < figure.bbox.x1


def test_a_marker_at_0_is_whole_and_an_empty_panel_says_so(figure: Figure) -> None:
    assert all(axes.get_xlim()[0] < 0 for axes in figure.axes)
    said = [[text.get_text() for text in axes.texts] for axes in figure.axes]
    assert said[3] == ["no data"]
    assert said[0] == said[4] == []
