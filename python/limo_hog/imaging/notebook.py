"""Pictures in HTML, and detections as Jupyter shows them: a small picture, and a table."""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

#: Longer side of the picture [px], and rows of the table: what a cell's output shows without scrolling.
SIDE_PX, ROWS = 640, 20


def reduced(image: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], int]:
    """Return an image of at most `SIDE_PX` on its longer side, and by what it was divided: the mean of n × n pixels."""
    n = -(-max(image.shape[:2]) // SIDE_PX)
    height, width = (max(1, side // n) for side in image.shape[:2])
    blocks = image[: height * n, : width * n].reshape(height, min(n, image.shape[0]), width, min(n, image.shape[1]), -1)
    return blocks.mean(axis=(1, 3)).astype(np.uint8), n


def data_uri(jpeg: bytes) -> str:
    """Return the bytes of a JPEG file as an address that an HTML page holds itself."""
    return f"data:image/jpeg;base64,{base64.b64encode(jpeg).decode()}"


def shown(caption: str, heads: Sequence[str], rows: Sequence[Sequence[str]], jpeg: bytes | None) -> str:
    """Return HTML: the picture, the caption, and the first rows of the table."""
    parts = []
    if jpeg is not None:
        parts.append(f'<img alt="" src="{data_uri(jpeg)}">')
    left_out = f", the best {ROWS} here" if len(rows) > ROWS else ""
    parts.append(f"<p>{html.escape(caption)}{left_out}</p>")
    if rows:
        parts.append(table(heads, rows[:ROWS]))
    return f"<div>{''.join(parts)}</div>"


def table(heads: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """Return an HTML table; what stands in it is escaped."""

    def line(tag: str, cells: Iterable[object]) -> str:
        return f"<tr>{''.join(f'<{tag}>{html.escape(str(cell))}</{tag}>' for cell in cells)}</tr>"

    return f"<table>{line('th', heads)}{''.join(line('td', row) for row in rows)}</table>"
