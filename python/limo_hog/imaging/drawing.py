"""Detections drawn into the picture."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from limo_hog.extras import needed

with needed(by="drawing on pictures"):
    import cv2

#: Okabe and Ito's vermillion, bluish green and blue, which the colour-blind tell apart, as BGR.
CHOSEN, OTHER, BLUE = (0, 94, 213), (115, 158, 0), (178, 114, 0)
_DARK, _LIGHT = (20, 20, 20), (250, 250, 250)
_FONT = cv2.FONT_HERSHEY_SIMPLEX


def annotate(
    image: NDArray[np.uint8],
    boxes: NDArray[np.int32],
    labels: Sequence[str] = (),
    target: int | None = None,
    caption: str = "",
) -> NDArray[np.uint8]:
    """Draw boxes into a copy of an image, uint8 (height, width, 3) BGR: green, and the target red with its centre blue.

    `image` is uint8 BGR, or (height, width) or (height, width, 1) gray, `boxes` int32 (N, 4): x, y, w, h [px]; `labels`
    are texts above the first of them, `target` is the index of the followed one, `caption` a line at the bottom left.
    """
    colours = image.reshape(*image.shape[:2], -1)
    canvas = np.repeat(colours, 3, axis=2) if colours.shape[2] == 1 else colours.copy()
    # Strokes and letters grow more slowly than the picture: readable in a thumbnail, not coarse at 4K.
    unit = (max(canvas.shape[:2]) / 640) ** 0.7
    thick = max(1, round(2 * unit))
    for i, (x, y, w, h) in enumerate(boxes.tolist()):
        colour = CHOSEN if i == target else OTHER
        cv2.rectangle(canvas, (x, y), (x + w - 1, y + h - 1), colour, thick, cv2.LINE_AA)
        if i == target:
            cv2.circle(canvas, (x + w // 2, y + h // 2), round(5 * unit), BLUE, cv2.FILLED, cv2.LINE_AA)
    # Labels last, so that no box crosses them.
    for label, (x, y, _, _), i in zip(labels, boxes.tolist(), range(len(labels)), strict=False):
        _text(canvas, label, x, y, unit, CHOSEN if i == target else OTHER)
    if caption:
        _text(canvas, caption, 0, canvas.shape[0], unit, _DARK)
    return canvas


def _text(canvas: NDArray[np.uint8], text: str, x: int, y: int, unit: float, ground: tuple[int, int, int]) -> None:
    """Write on a filled strip whose lower left corner is at (x, y), moved so that it stays in the picture."""
    size, stroke, pad = max(0.32, 0.45 * unit), max(1, round(1.2 * unit)), max(2, round(4 * unit))
    (width, height), below = cv2.getTextSize(text, _FONT, size, stroke)
    x = min(max(0, x), max(0, canvas.shape[1] - width - 2 * pad))
    y = min(max(height + below + pad, y), canvas.shape[0])
    cv2.rectangle(canvas, (x, y - height - below - pad), (x + width + 2 * pad, y), ground, cv2.FILLED)
    cv2.putText(canvas, text, (x + pad, y - below), _FONT, size, _LIGHT, stroke, cv2.LINE_AA)
