"""Small labelled pictures of bollards, to train on in a few seconds."""

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

WIDTH, HEIGHT = 320, 240


def draw(rng: np.random.Generator) -> tuple[NDArray[np.uint8], list[list[float]]]:
    """Draw uint8 (240, 320, 3) BGR; return it with x, y, width, height [px] of each of one to three bollards."""
    slope = np.linspace(rng.uniform(60, 200), rng.uniform(60, 200), HEIGHT)[:, None, None]
    canvas = np.broadcast_to(slope, (HEIGHT, WIDTH, 3)) + rng.normal(0, 8, 3)
    for _ in range(rng.integers(10, 30)):
        _clutter(canvas, rng)
    boxes: list[list[float]] = []
    for _ in range(rng.integers(1, 4)):
        height = float(rng.uniform(48, 130))
        width = 0.3 * height
        x, y = float(rng.uniform(4, WIDTH - width - 4)), float(rng.uniform(4, HEIGHT - height - 4))
        # Bollards stand side by side, not in front of each other.
        if all(x + width < bx - 6 or bx + bw + 6 < x for bx, _, bw, _ in boxes):
            _bollard(canvas, rng, x, y, width, height)
            boxes.append([x, y, width, height])
    canvas += rng.normal(0, 4, canvas.shape)
    return np.clip(canvas, 0, 255).astype(np.uint8), boxes


def _clutter(canvas: NDArray[np.float64], rng: np.random.Generator) -> None:
    """Draw a board, a ball or a pole: edges of all directions, none of them a bollard."""
    colour = rng.uniform(20, 235, 3).tolist()
    x, y = int(rng.integers(0, WIDTH)), int(rng.integers(0, HEIGHT))
    size = int(rng.integers(6, 60))
    kind = rng.integers(3)
    if kind == 0:
        cv2.rectangle(canvas, (x, y), (x + size, y + int(size * rng.uniform(0.4, 2.5))), colour, cv2.FILLED)
    elif kind == 1:
        cv2.circle(canvas, (x, y), size // 2, colour, cv2.FILLED)
    else:
        cv2.line(canvas, (x, y), (x + size, y + int(rng.integers(-80, 80))), colour, int(rng.integers(1, 6)))


def _bollard(canvas: Any, rng: np.random.Generator, x: float, y: float, width: float, height: float) -> None:
    """Draw a post with a round head on a broad foot, and two bands."""
    ground = float(canvas[int(y + height / 2), int(x + width / 2)].mean())
    body = ground + rng.choice([-1, 1]) * rng.uniform(50, 90)
    body = float(np.clip(body if 10 < body < 245 else 2 * ground - body, 10, 245))
    post, foot, bands = (0.3, 0.2, 0.9), (0.5, 0.88, 1.0), ((0.3, 0.32, 0.4), (0.3, 0.48, 0.56))
    middle = x + width / 2
    for (half, top, bottom), gray in ((post, body), (foot, body), *((band, 255 - body) for band in bands)):
        left, right, colour = round(middle - half * width), round(middle + half * width), [gray] * 3
        cv2.rectangle(canvas, (left, round(y + top * height)), (right, round(y + bottom * height)), colour, cv2.FILLED)
    head, axes = (round(middle), round(y + 0.14 * height)), (round(0.42 * width), round(0.14 * height))
    cv2.ellipse(canvas, head, axes, 0, 0, 360, [body] * 3, cv2.FILLED)


def write(folder: Path, pictures: int, seed: int) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    labels = {}
    for i in range(pictures):
        image, boxes = draw(np.random.default_rng([seed, i]))
        labels[f"{i:04d}.png"] = boxes
        cv2.imwrite(str(folder / f"{i:04d}.png"), image)
    (folder / "boxes.json").write_text(json.dumps(labels))
