"""Whom a word or a number asks for."""

from dataclasses import replace

import pytest
from tests.follow.tracks.wearers import person

from limo_hog.follow.sense.observation import Odometry
from limo_hog.follow.tracks.asking import WORDS, Whom, WhomError, checked, named, picked
from limo_hog.follow.tracks.person import Person


def standing(number: int, x: float, y: float, window: float = 500.0) -> Person:
    one = person(number, 0.0)
    return replace(one, window=window, track=replace(one.track, mean=(x, y, 0.0, 0.0)))


@pytest.mark.parametrize(
    ("whom", "yaw", "number"),
    [
        *(("left", 0.0, 2), ("right", 0.0, 3), ("nearest", 0.0, 1), ("largest", 0.0, 4), (3, 0.0, 3), (9, 0.0, None)),
        # Left and right are the robot's, whichever way it looks.
        *(("left", 0.3, 2), ("right", 0.3, 3)),
    ],
)
def test_each_word_means_one_of_four_people(whom: Whom, yaw: float, number: int | None) -> None:
    people = standing(1, 1.5, 0.0), standing(2, 2.0, 0.8), standing(3, 2.0, -0.8), standing(4, 1.6, 0.4, 700.0)
    one = picked(whom, people, Odometry(yaw=yaw))
    assert (one and one.number) == number
    assert picked(whom, (), Odometry()) is None


@pytest.mark.parametrize("whom", ["first", "", "-1", "0", "1.5", "LEFT", True, 0, -3, 10**9, "²", "١" * 12])
def test_what_names_nobody_is_refused_with_what_is_wanted(whom: Whom) -> None:
    with pytest.raises(WhomError, match="want nearest, left, right, largest, or a person's number"):
        checked(whom)


def test_a_number_may_be_a_text_and_everything_has_a_name() -> None:
    assert checked(" 7 ") == checked(7) == 7
    assert [checked(word) for word in WORDS] == list(WORDS)
    assert named(7) == "person 7"
    assert len({named(word) for word in WORDS}) == len(WORDS)
