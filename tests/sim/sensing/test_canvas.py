"""The compiled canvas draws solids where a formula says they are, and refuses what does not fit its image."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from limo_hog._core import Canvas
from limo_hog.exceptions import ParameterError

HEIGHT, WIDTH, FOCAL = 60, 80, 50.0
LIGHT = (0.0, -1.0, 0.0, 0.5, 0.5)
PALETTE = np.arange(512, dtype=np.uint32)
#: A capsule 3 m away that leans across the image: from (20, 20) for 30 px, radius 6 px.
STRIP = np.array([[0, 20, 20, 0.8, 0.6, 30, 6, 0, 3, 0, 0.01, 0]], np.float64)
ELLIPSE = np.array([[0, 40, 30, 1 / 20, 0, 1 / 10, 10, 20, 3, 0, 0, 0.5]], np.float64)


def canvas() -> Canvas:
    empty = Canvas(HEIGHT, WIDTH, FOCAL)
    empty.begin((0, 0, WIDTH, HEIGHT))
    return empty


def drawn(full: Canvas) -> np.ndarray:
    depth = np.full((HEIGHT, WIDTH), np.inf, np.float32)
    full.draw(None, depth, PALETTE)
    return depth


def test_a_strip_holds_the_pixels_within_its_radius_of_its_axis() -> None:
    full = canvas()
    full.strips(STRIP, LIGHT)
    y, x = np.mgrid[:HEIGHT, :WIDTH] - np.array([20, 20])[:, None, None]
    along = np.clip(0.8 * x + 0.6 * y, 0, 30)
    away, depth = np.hypot(x - 0.8 * along, y - 0.6 * along), drawn(full)
    assert np.isinf(depth[away > 5.6]).all()
    np.testing.assert_allclose(depth[away < 5.4], 3 - 0.01 * np.sqrt(36 - away[away < 5.4] ** 2), rtol=1e-5)


def test_an_ellipse_holds_the_pixels_within_its_half_axes() -> None:
    full = canvas()
    full.ellipses(ELLIPSE, LIGHT)
    y, x = np.mgrid[:HEIGHT, :WIDTH] - np.array([30, 40])[:, None, None]
    inside, depth = 1 - (x / 20) ** 2 - (y / 10) ** 2, drawn(full)
    assert np.isinf(depth[inside < 0]).all()
    np.testing.assert_allclose(depth[inside > 0.1], 3 - 0.5 * np.sqrt(inside[inside > 0.1]), rtol=1e-5)


def test_only_the_window_is_drawn_into_and_the_count_is_that_of_its_pixels() -> None:
    part = Canvas(HEIGHT, WIDTH, FOCAL)
    part.begin((30, 25, 50, 35))
    part.ellipses(ELLIPSE, LIGHT)
    depth = np.full((HEIGHT, WIDTH), np.inf, np.float32)
    owners = np.full((HEIGHT, WIDTH), -1, np.int16)
    assert part.draw(None, depth, PALETTE, owners, 3) == 200
    whole = canvas()
    whole.ellipses(ELLIPSE, LIGHT)
    np.testing.assert_array_equal(depth[25:35, 30:50], drawn(whole)[25:35, 30:50])
    assert np.count_nonzero(owners == 3) == np.count_nonzero(np.isfinite(depth)) == 200
    assert part.seen(depth) == (200, 200, (30, 25, 50, 35))
    assert part.seen(depth - 1) == (200, 0, (30, 25, 50, 35))


@pytest.mark.parametrize("ugly", [math.nan, math.inf, -math.inf, 0.0, 1e300, -1e300])
def test_any_numbers_are_drawn_without_a_crash(ugly: float) -> None:
    full = canvas()
    for column in range(12):
        for rows, cast in ((STRIP, full.strips), (ELLIPSE, full.ellipses)):
            row = rows.copy()
            row[0, column] = ugly
            cast(row, LIGHT)
    full.frustum([ugly] * 13, LIGHT)
    full.slab([ugly] * 17)
    image = np.zeros((HEIGHT, WIDTH), np.uint32)
    full.draw(image, np.full((HEIGHT, WIDTH), np.inf, np.float32), PALETTE)


FLAT = np.zeros((HEIGHT, WIDTH), np.float32)


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (lambda: Canvas(0, WIDTH, FOCAL), "80 x 0"),
        (lambda: Canvas(HEIGHT, 20_000, FOCAL), "sides of 1 to 16384"),
        (lambda: canvas().begin((0, 0, WIDTH + 1, 5)), "not within 80 x 60"),
        (lambda: canvas().begin((9, 0, 3, 5)), "not within"),
        (lambda: canvas().strips(np.zeros((3, 11)), LIGHT), "11 numbers; 12"),
        (lambda: canvas().draw(None, FLAT[1:].copy(), PALETTE), r"\[59, 80\]; \[60, 80\] in C order"),
        (lambda: canvas().draw(None, np.asfortranarray(FLAT), PALETTE), "C order"),
        (lambda: canvas().draw(FLAT[:9].astype(np.uint32), FLAT.copy(), PALETTE), r"\[9, 80\]"),
        (lambda: canvas().draw(None, FLAT.copy(), PALETTE[:0]), "palette is empty"),
        (lambda: canvas().seen(FLAT[:, 1:].copy()), r"\[60, 79\]"),
    ],
)
def test_what_does_not_fit_the_image_is_refused(wrong: Callable[[], object], told: str) -> None:
    with pytest.raises(ParameterError, match=told):
        wrong()
