"""Training windows are cut where they are said to lie, and as the search sees them."""

from pathlib import Path

import numpy as np
import pytest

from limo_hog._core import resize
from limo_hog.learn.labels import Box, Picture
from limo_hog.learn.windows import Jitter, WindowShape, cut, positive_crops, positive_regions, random_boxes, shape_for
from limo_hog.models import PersonBox

IMAGE = np.random.default_rng(0).integers(0, 256, (120, 160), np.uint8)


def test_a_window_at_its_own_size_is_cut_unchanged_and_mirrored_beyond_the_edges() -> None:
    assert np.array_equal(cut(IMAGE, (10, 20, 64, 96), (64, 96)), IMAGE[20:116, 10:74])
    around = np.pad(IMAGE, 40, mode="reflect")
    assert np.array_equal(cut(IMAGE, (-20, 60, 64, 96), (64, 96)), around[100:196, 20:84])


@pytest.mark.parametrize("size", [(80, 60), (320, 240), (107, 80)])
def test_another_size_is_that_of_the_searchs_levels(size: tuple[int, int]) -> None:
    level = resize(IMAGE, *size)
    seen = cut(IMAGE, (0, 0, 160, 120), size)
    # At the edges one mirrors and the other repeats. OpenCV's warp has 32 steps between pixels, the resize 256.
    difference = np.abs(level.astype(int) - seen)[1:-1, 1:-1]
    assert difference.mean() < 2 and difference.max() <= 10


def test_the_object_stands_in_the_window_where_its_shape_says() -> None:
    shape = WindowShape((64, 128), PersonBox(0.2, 0.1, 0.6, 0.78))
    box = Box("", 100, 50, 38.4, 99.84)
    picture = Picture(Path("a.png"), (box, Box("", 0, 0, 9, 9, ignored=True)))
    (region,) = positive_regions([picture], shape)
    assert region.box == pytest.approx((100 - 12.8, 50 - 12.8, 64, 128))


def test_people_have_the_usual_window_small_objects_a_small_one() -> None:
    shape = shape_for(np.full((20, 2), (41.0, 100.0)), None)
    assert shape.size in ((72, 128), (64, 128))
    assert shape.object_box.height * shape.size[1] == pytest.approx(98, abs=3)
    sizes = np.full((20, 2), (16.0, 16.0))
    assert shape_for(sizes, None).size == (40, 40)
    shape = shape_for(sizes, (64, 64))
    assert shape.size == (64, 64) and shape.object_box == pytest.approx((12 / 64, 12 / 64, 40 / 64, 40 / 64))


def test_an_object_is_taken_plain_and_jittered_both_ways_round() -> None:
    def crops(mirror: bool) -> list[np.ndarray]:
        return positive_crops(IMAGE, (5, 5, 96, 96), (64, 64), Jitter(), mirror, np.random.default_rng(3))

    both = crops(True)
    assert len(both) == 4 and len(crops(False)) == 2
    assert np.array_equal(both[0], cut(IMAGE, (5, 5, 96, 96), (64, 64)))
    assert np.array_equal(both[2], both[0][:, ::-1])
    assert not np.array_equal(both[1], both[0]) and not np.array_equal(both[3], both[1][:, ::-1])
    assert all(np.array_equal(a, b) for a, b in zip(both, crops(True), strict=True))


def test_random_windows_lie_in_the_picture() -> None:
    rng = np.random.default_rng(1)
    boxes = np.array(random_boxes((300, 200), (64, 128), 200, rng))
    assert len(boxes) == 200 and (boxes[:, :2] >= 0).all()
    assert (boxes[:, 0] + boxes[:, 2] <= 300 + 1e-9).all() and (boxes[:, 1] + boxes[:, 3] <= 200 + 1e-9).all()
    assert boxes[:, 2].min() < 70 and boxes[:, 2].max() > 95
    assert random_boxes((63, 500), (64, 128), 10, rng) == []
