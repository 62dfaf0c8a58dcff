"""A detector's worst mistakes, found and drawn: the surest false alarms and the tallest people missed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from limo_hog import _core
from limo_hog.imaging.drawing import annotate
from limo_hog.learn.evaluation.run import Evaluation
from limo_hog.learn.labels import Picture

#: Mistakes on a sheet, a row of it, and a tile's size [px].
_COUNT, _COLUMNS, _TILE = 24, 8, (180, 270)
#: The height of what a tile shows, in heights of the box.
_SURROUNDINGS = 1.8


@dataclass(frozen=True, slots=True)
class Mistake:
    """One mistake."""

    kind: str  #: "false alarm" or "missed"
    path: Path
    box: tuple[float, float, float, float]  #: x, y, width, height [px] in the picture
    score: float | None  #: the false alarm's; None of what was missed


def worst_mistakes(evaluation: Evaluation, pictures: Sequence[Picture]) -> list[Mistake]:
    """Return the surest false alarms and the tallest people missed at 1 FPPI, half of each as far as there are."""
    alarms: list[Mistake] = []
    missed: list[Mistake] = []
    for picture, (boxes, scores), pairs in zip(pictures, evaluation.found, evaluation.matches, strict=True):
        alarms.extend(
            Mistake("false alarm", picture.path, tuple(boxes[i].tolist()), float(scores[i]))
            for i in np.flatnonzero(pairs.detections == -1)
        )
        for box, by in zip(picture.boxes, pairs.boxes, strict=True):
            if not box.ignored and (by < 0 or scores[by] < evaluation.threshold_1):
                missed.append(Mistake("missed", picture.path, (box.x, box.y, box.width, box.height), None))
    alarms.sort(key=lambda mistake: -(mistake.score or 0.0))
    missed.sort(key=lambda mistake: -mistake.box[3])
    of_missed = min(len(missed), max(_COUNT // 2, _COUNT - len(alarms)))
    return alarms[: _COUNT - of_missed] + missed[:of_missed]


def draw_sheet(mistakes: Sequence[Mistake]) -> NDArray[np.uint8]:
    """Draw mistakes on a sheet, uint8 (height, width, 3) BGR: false alarms with their score, missed people's height."""
    width, height = _TILE
    rows = max(1, -(-len(mistakes) // _COLUMNS))
    sheet = np.full((rows * height, _COLUMNS * width, 3), 255, np.uint8)
    for i, mistake in enumerate(mistakes):
        top, left = height * (i // _COLUMNS), width * (i % _COLUMNS)
        sheet[top : top + height, left : left + width] = _tile(mistake)
    return sheet


def _tile(mistake: Mistake) -> NDArray[np.uint8]:
    image = Picture(mistake.path, ()).read()
    x, y, w, h = mistake.box
    width, height = _TILE
    scale = height / (_SURROUNDINGS * max(h, w * height / width))
    view_w, view_h = width / scale, height / scale
    left, top = round(x + w / 2 - view_w / 2), round(y + h / 2 - view_h / 2)
    columns, rows = np.arange(left, left + round(view_w)), np.arange(top, top + round(view_h))
    view = image[np.ix_(rows.clip(0, len(image) - 1), columns.clip(0, image.shape[1] - 1))]
    view[(rows < 0) | (rows >= len(image))] = 0
    view[:, (columns < 0) | (columns >= image.shape[1])] = 0
    box = np.rint(np.array([[(x - left) * scale, (y - top) * scale, w * scale, h * scale]])).astype(np.int32)
    found = mistake.score is not None
    caption = f"false alarm {mistake.score:.2f}" if found else f"missed, {h:.0f} px"
    return annotate(_core.resize(view, width, height), box, target=0 if found else None, caption=caption)
