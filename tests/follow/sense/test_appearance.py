"""Clothes are told apart by their colours, in whatever light, and not by how a box happens to sit."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.follow.views import BLUE, FOCAL, GREEN, HEIGHT, RED, WIDTH, before_wall, dressed, flat, look, there

from limo_hog.follow.robot import LIMO
from limo_hog.follow.sense.measurement import Visibility
from limo_hog.follow.sense.observation import Appearance, clothes_in

APPEARANCE = Appearance()
OTHER_CLOTHES = APPEARANCE.other
BOX = (200, 100, 120, 240)


def worn(image: NDArray[np.uint8], box: tuple[int, int, int, int] = BOX) -> NDArray[np.float64]:
    clothes: NDArray[np.float64] = clothes_in(image, np.array([box], np.int32))[0]
    return clothes


def test_other_clothes_are_told_the_same_known_again_and_unknown_ones_not_unlike() -> None:
    one, other = worn(dressed(BOX, RED, BLUE)), worn(dressed(BOX, GREEN, BLUE))
    assert APPEARANCE.cost(one, one) == APPEARANCE.cost(None, one) == APPEARANCE.cost(one, None) == 0
    assert APPEARANCE.cost(one, other) > OTHER_CLOTHES


@pytest.mark.parametrize("light", [0.5, 0.7, 1.3])
def test_light_and_noise_make_no_other_clothes(light: float) -> None:
    image = dressed(BOX, RED, BLUE)
    noise = np.random.default_rng(1).normal(0, 3, image.shape)
    other = np.clip(image * light + noise, 0, 255).astype(np.uint8)
    assert APPEARANCE.cost(worn(image), worn(other)) < OTHER_CLOTHES / 2


def test_black_and_white_are_told_apart_though_neither_has_a_hue_and_in_a_grey_image() -> None:
    black, white = (dressed(BOX, (grey, grey, grey), BLUE) for grey in (15, 240))
    assert APPEARANCE.cost(worn(black), worn(white)) > OTHER_CLOTHES
    assert APPEARANCE.cost(worn(black[..., 2]), worn(white[..., 2])) > OTHER_CLOTHES


def test_a_box_that_slipped_down_to_the_trousers_shows_no_other_shirt() -> None:
    image = dressed(BOX, RED, BLUE)
    x, y, w, h = BOX
    slipped = worn(image, (x, y + 60, w, h))
    assert APPEARANCE.cost(worn(image), slipped) < OTHER_CLOTHES < APPEARANCE.cost(worn(image), slipped, slips=False)


def test_a_hand_before_the_trousers_is_not_enough_for_another_person() -> None:
    one, other = worn(dressed(BOX, RED, BLUE)), worn(dressed(BOX, RED, (140, 170, 220)))
    assert 0 < APPEARANCE.cost(one, other) < OTHER_CLOTHES


def test_slow_change_is_learnt_and_another_shirt_is_not() -> None:
    red, blue, green = (worn(dressed(BOX, shirt, BLUE)) for shirt in (RED, BLUE, GREEN))
    dusk = worn((dressed(BOX, RED, BLUE) * 0.6).astype(np.uint8))
    quick = Appearance(rate=0.5)
    after_green, after_blue = quick.learn(red, green), quick.learn(red, blue)
    assert APPEARANCE.cost(quick.learn(red, dusk), dusk) < APPEARANCE.cost(red, dusk)
    assert quick.learn(red, red) == pytest.approx(red)
    for clothes in (after_green, after_blue):
        assert clothes is not None
        assert np.array_equal(clothes[0], red[0])


@pytest.mark.parametrize("box", [(900, 100, 60, 120), (200, -300, 60, 120), (0, 0, 0, 0), (-400, 0, 100, 200)])
def test_clothes_out_of_the_image_are_not_known(box: tuple[int, int, int, int]) -> None:
    assert not np.isfinite(worn(dressed(BOX, RED, BLUE), box)).any()


def test_no_boxes_have_no_clothes_and_what_are_no_boxes_none_known() -> None:
    image = dressed(BOX, RED, BLUE)
    assert clothes_in(image, np.empty((0, 4), np.int32)).shape == (0, 2, 3)
    assert np.isnan(clothes_in(image, np.ones((2, 3), np.int32))).all()


@pytest.mark.parametrize(
    "box", [(-69, 100, 120, 240), (200, -90, 120, 240), (200, -66, 120, 240), (640 - 61, 100, 120, 240)]
)
def test_what_the_images_edge_leaves_of_a_patch_shows_the_clothes(box: tuple[int, int, int, int]) -> None:
    image = np.full((480, 640, 3), RED, np.uint8)
    seen, whole = worn(image, box), worn(image)
    known = np.isfinite(seen)
    assert known[1].all()
    np.testing.assert_array_equal(seen[known], whole[known])


def test_a_shirt_that_is_half_above_the_image_is_seen_all_the_same() -> None:
    # The chest is looked at from .28 to .42 of the box; the image begins within that, or below it.
    image = np.full((480, 640, 3), RED, np.uint8)
    assert [bool(np.isfinite(worn(image, (200, y, 120, 240))[0]).all()) for y in (-85, -200)] == [True, False]


def glimpsed(
    off_px: int = 0, place: tuple[float, float] = (2.084, 0.0), **readings: NDArray[np.generic] | None
) -> NDArray[np.float64] | None:
    """Return what shows of somebody in `BOX`, 2 m before the camera, who is expected at a place but for some pixels."""
    x, y, w, h = BOX
    image, depth = dressed(BOX, RED, BLUE), before_wall(2.0, BOX)
    window, middle, aside = 2.0 * h, 2.0 * (y + h / 2 - HEIGHT / 2), 2.0 * (WIDTH / 2 - x - w / 2 - off_px) / FOCAL
    seen = replace(look(), **{"image": image, "depth": depth, **readings})  # type: ignore[arg-type]
    return Visibility().glimpse((place[0], place[1] + aside), window, middle, seen, LIMO)


@pytest.mark.parametrize("off_px", [0, 25, -25])
def test_of_a_person_who_was_not_found_a_glimpse_shows_the_clothes_where_their_body_is(off_px: int) -> None:
    assert there(glimpsed(off_px)) == pytest.approx(worn(dressed(BOX, RED, BLUE)))


def test_there_is_no_glimpse_of_a_person_hidden_gone_too_near_or_out_of_the_image() -> None:
    assert glimpsed(image=None) is None
    assert glimpsed(depth=None) is None
    assert glimpsed(depth=before_wall(1.7, BOX)) is None
    assert glimpsed(depth=flat(8.0)) is None
    assert glimpsed(depth=np.full((HEIGHT, WIDTH), np.nan, np.float32)) is None
    for place in ((0.4, 0.0), (-2.0, 0.0), (2.084, 2.0), (0.2, 1.0)):
        assert glimpsed(place=place) is None


def test_a_strip_as_far_away_as_the_person_is_no_body() -> None:
    depth = flat(8.0)
    depth[:, 258:261] = 2.0
    assert glimpsed(depth=depth) is None
