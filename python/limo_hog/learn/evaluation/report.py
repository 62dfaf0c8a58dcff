"""An evaluation as a page: the DET curve, the figures and the worst mistakes."""

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from limo_hog.atomic import about, json_text, whole_file, write_text
from limo_hog.extras import needed
from limo_hog.imaging.notebook import table
from limo_hog.imaging.writing import write_image
from limo_hog.learn.evaluation.mistakes import draw_sheet, worst_mistakes
from limo_hog.learn.evaluation.run import CONFIDENCE, DRAWS, MIN_IOU, Evaluation, as_json, compare, few
from limo_hog.learn.labels import Picture

with needed(by="--report"):
    from matplotlib.figure import Figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Miss rates and FPPI that the plot shows.
_LEAST_MISS_RATE, _FPPI = 0.02, (10**-2.3, 10**1.2)
#: What the page calls each figure.
_FIGURES = {"lamr": "LAMR", "recall_01": "recall at 0.1 FPPI", "recall_1": "recall at 1 FPPI", "ap": "AP"}
_STYLE = """body{font:15px/1.5 system-ui,sans-serif;max-width:62rem;margin:2rem auto;padding:0 1rem;color:#1d2733}
table{border-collapse:collapse;margin:1rem 0;display:block;overflow-x:auto}
td,th{padding:.25rem .8rem;border-bottom:1px solid #d7dde4;text-align:right}
td:first-child,th:first-child{text-align:left}small{color:#66727f}img{max-width:100%}"""


def write_report(folder: Path, pictures: Sequence[Picture], evaluations: Sequence[Evaluation]) -> Path:
    """Write `index.html`, `det.png`, `mistakes.png` (of the first detector) and `figures.json`; return the page.

    Raises `OSError` where a file cannot be written; no part of it is left behind.
    """
    folder.mkdir(parents=True, exist_ok=True)
    _plot(folder / "det.png", evaluations)
    mistakes = worst_mistakes(evaluations[0], pictures)
    if mistakes:
        write_image(folder / "mistakes.png", draw_sheet(mistakes))
    figures = as_json(pictures, evaluations)
    figures["mistakes"] = [
        {"kind": m.kind, "picture": str(m.path), "box": list(m.box), "score": m.score} for m in mistakes
    ]
    write_text(folder / "figures.json", json_text(figures, indent=2) + "\n")
    page = folder / "index.html"
    write_text(page, _page(figures["pictures"], figures["objects"], evaluations, bool(mistakes)))
    return page


def _plot(path: Path, evaluations: Sequence[Evaluation]) -> None:
    figure = Figure(figsize=(7, 5), dpi=120, layout="constrained")
    axes: Axes = figure.add_subplot()
    for evaluation in evaluations:
        miss = np.maximum(1 - evaluation.curve.recall, _LEAST_MISS_RATE / 2)
        label = f"{evaluation.figures.lamr:.3f}  {evaluation.name}"
        axes.step(np.maximum(evaluation.curve.fppi, _FPPI[0]), miss, where="post", label=label)
    curves = [evaluation.curve for evaluation in evaluations]
    if all(curve.recall[curve.fppi <= _FPPI[0]].max(initial=0.0) == 1.0 for curve in curves):
        axes.text(0.5, 0.5, "no misses", transform=axes.transAxes, ha="center", fontsize=16, color="#66727f")
    axes.set(xscale="log", yscale="log", xlim=_FPPI, ylim=(_LEAST_MISS_RATE, 1.02))
    axes.set(xlabel="false positives per image", ylabel="miss rate")
    ticks = [0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0]
    axes.set_yticks(ticks, labels=[f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
    axes.grid(alpha=0.3)
    axes.legend(title="log-average miss rate", loc="lower left")
    with whole_file(path) as part, about(path):
        figure.savefig(part)


def _page(pictures: int, objects: int, evaluations: Sequence[Evaluation], mistakes: bool) -> str:
    rows = [_row(evaluation) for evaluation in evaluations]
    heights = [
        (f"{evaluation.name}, {_range(row.low, row.high)}", row.objects, f"{row.recall_01:.2f}", f"{row.recall_1:.2f}")
        for evaluation in evaluations
        for row in evaluation.by_height
    ]
    differences = [
        (f"{evaluations[0].name} − {d.name}", _FIGURES[d.figure], f"{d.difference:+.3f}", _interval(d.interval, "+.3f"))
        for other in evaluations[1:]
        for d in compare(evaluations[0], other)
    ]
    title = f"{evaluations[0].name} on {pictures} pictures with {objects} objects"
    recalls = ("recall at 0.1 FPPI", "at 1")
    parts = [
        f'<!doctype html><html lang="en"><meta charset="utf-8">'
        f'<meta name="viewport" content="width=device-width"><title>{html.escape(title)}</title>',
        f"<style>{_STYLE}</style><h1>{html.escape(title)}</h1>",
        '<img src="det.png" alt="Miss rate over false positives per image">',
        table(("model", "LAMR", *recalls, "AP", "threshold at 0.1 FPPI", "ms a picture"), rows),
        "<p><small>LAMR: log-average miss rate over 10⁻²…10⁰ false positives per image (FPPI), lower is better. "
        f"A box is found from an IoU of {MIN_IOU:g} on. Intervals: {CONFIDENCE:.0%} of {DRAWS} draws of the pictures."
        "</small></p>",
    ]
    if warning := few(objects):
        parts.insert(2, f"<p><b>{warning}</b></p>")
    if differences:
        parts += [
            "<h2>Differences, paired</h2>",
            table(("models", "figure", "difference", "interval"), differences),
            "<p><small>If the interval excludes 0, the difference is unlikely to be chance.</small></p>",
        ]
    parts += ["<h2>By height</h2>", table(("objects", "how many", *recalls), heights)]
    if mistakes:
        alt = "False alarms in orange with their score and a blue centre, missed people in green with their height"
        parts += [f"<h2>The worst mistakes of {html.escape(evaluations[0].name)}</h2>", f"<p><small>{alt}</small></p>"]
        parts += [f'<img src="mistakes.png" alt="{alt}">']
    return "\n".join([*parts, "</html>", ""])


def _row(evaluation: Evaluation) -> tuple[str, ...]:
    figures = [
        f"{getattr(evaluation.figures, name):.3f} {_interval(evaluation.intervals[name], '.2f')}" for name in _FIGURES
    ]
    return evaluation.name, *figures, f"{evaluation.threshold_01:.2f}", f"{evaluation.ms:.1f}"


def _interval(ends: tuple[float, float], form: str) -> str:
    return f"[{ends[0]:{form}}, {ends[1]:{form}}]"


def _range(low: float, high: float) -> str:
    return f"{low:g}–{high:g} px" if np.isfinite(high) else f"from {low:g} px"
