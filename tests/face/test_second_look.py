"""The detector's second look: a small network's answers, against the same in plain numpy."""

import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

import limo_hog
from limo_hog import PeopleDetector, _core, models
from limo_hog.cli.support.scene import street
from limo_hog.models import PERSON_BOX, Model, SecondLook, load_model

PHOTOGRAPHS = Path(__file__).parents[3] / "shared" / "data"
WEIGHTS = Path(models.__file__).parent / "weights" / "second_look.f16"
Numbers = NDArray[np.float64]


@cache
def picture() -> NDArray[np.uint8]:
    return street(640, 480, 3)


def network() -> SecondLook:
    look = load_model("limo").second_look
    assert look is not None
    return look


def plain_crop(image: NDArray[np.uint8], x: int, y: int, w: int, h: int) -> Numbers:
    """A window whose sides are multiples of 32 and 64, averaged by OpenCV, normalised."""
    bordered = cv2.copyMakeBorder(image.mean(axis=2), 99, 99, 99, 99, cv2.BORDER_REFLECT_101)
    crop = cv2.resize(bordered[y + 99 : y + 99 + h, x + 99 : x + 99 + w], (32, 64), interpolation=cv2.INTER_AREA)
    return np.asarray((crop - crop.mean()) / (crop.std() + 8))


def plain_answer(look: SecondLook, crop: Numbers) -> Numbers:
    weights = np.frombuffer(look.weights, "<f2").astype(np.float64)

    def take(*shape: int) -> Numbers:
        nonlocal weights
        taken, weights = np.split(weights, [int(np.prod(shape))])
        return taken.reshape(shape)

    x = crop[:, :, None]
    for side, channels in zip((5, 3, 3), look.channels, strict=True):
        kernel, bias = take(side, side, x.shape[2], channels), take(channels)
        padded = np.pad(x, ((side // 2, side // 2), (side // 2, side // 2), (0, 0)))
        around = np.lib.stride_tricks.sliding_window_view(padded, (side, side), (0, 1))[::2, ::2]
        x = np.maximum(np.einsum("yxcij,ijcd->yxd", around, kernel) + bias, 0)
    hidden = np.maximum(x.ravel() @ take(x.size, look.hidden) + take(look.hidden), 0)
    answer = hidden @ take(look.hidden, 5) + take(5)
    assert not len(weights)
    return np.asarray(answer)


def always(logit: float, right: float, down: float, wider: float, higher: float) -> Model:
    """Our model with a network that has this answer to every window."""
    weights = np.zeros(len(network().weights) // 2, "<f2")
    weights[-5:] = logit, right, down, np.log(wider), np.log(higher)
    return replace(load_model("limo"), second_look=network()._replace(weights=weights.tobytes()))


def test_the_network_answers_what_plain_numpy_answers() -> None:
    windows = [(0, 0, 64, 128), (300, 200, 96, 192), (-20, 350, 96, 192), (600, -30, 64, 128), (101, 99, 32, 64)]
    found = network().compiled().answers(picture(), np.array(windows, float))
    expected = [plain_answer(network(), plain_crop(picture(), *window)) for window in windows]
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-5)
    # The order of the colours does not matter.
    other = network().compiled().answers(picture()[:, :, ::-1], np.array(windows, float))
    np.testing.assert_allclose(other, found, atol=1e-5)


def test_a_score_is_the_margin_and_a_share_of_the_networks_logit() -> None:
    alone = PeopleDetector(threshold=-1, scale=1.1, second_look=False).detect(picture())
    found = PeopleDetector(model=always(2, 0, 0, 1, 1), threshold=-9).detect(picture())
    np.testing.assert_allclose(found.scores, (alone.scores + 2 * network().share)[:50], atol=1e-6)
    assert len(found) > 5 and found.calibration == network().calibration


def test_the_network_moves_and_stretches_the_boxes() -> None:
    before, after = (
        PeopleDetector(model=always(9, *answer)).detect(picture()).windows[:1].astype(float)
        for answer in ((0, 0, 1, 1), (0.1, -0.05, 1.2, 0.9))
    )
    (x, y, w, h), (to_x, to_y, to_w, to_h) = (PERSON_BOX.inside(one)[0] for one in (before, after))
    np.testing.assert_allclose([to_w, to_h], [1.2 * w, 0.9 * h], atol=1)
    np.testing.assert_allclose(to_x + to_w / 2, x + w / 2 + 0.1 * before[0, 2], atol=1.5)
    np.testing.assert_allclose(to_y + to_h / 2, y + h / 2 - 0.05 * before[0, 3], atol=1.5)


def test_switched_off_every_score_is_an_svm_margin() -> None:
    alone = PeopleDetector(model=WEIGHTS.with_name("limo_64x128.yml")).detect(picture())
    assert PeopleDetector(second_look=False).detect(picture()) == alone and len(alone) > 0
    assert PeopleDetector(second_look=False).least_score == load_model("limo").threshold


def test_by_default_limo_looks_twice_and_what_cannot_does_not() -> None:
    assert PeopleDetector().detect(picture()) == PeopleDetector(second_look=True, scale=1.1).detect(picture())
    assert PeopleDetector().least_score == network().threshold
    for once in ({"model": "opencv"}, {"nms": "group"}, {"search": "guided"}):
        plain = PeopleDetector(**once, second_look=False, scale=1.05)  # type: ignore[arg-type]
        assert PeopleDetector(**once).detect(picture()) == plain.detect(picture())  # type: ignore[arg-type]


def test_pictures_as_they_are_may_be_looked_at_twice_and_one_without_candidates() -> None:
    detector = PeopleDetector(min_height=None, second_look=True)
    found = detector.detect(picture())
    assert len(found) > 0 and found.calibration == network().calibration
    assert len(detector.detect(np.full((300, 200), 90, np.uint8))) == 0


def test_what_has_no_second_look_refuses_it() -> None:
    for wrong in ({"model": "opencv"}, {"nms": "group"}, {"search": "guided"}):
        with pytest.raises(limo_hog.ParameterError, match=r'one \("limo"\), nms="overlap" and search="exact"'):
            PeopleDetector(second_look=True, **wrong)  # type: ignore[arg-type]
    with pytest.raises(limo_hog.ParameterTypeError, match="second_look is 'yes'; True, False or None is wanted"):
        PeopleDetector(second_look="yes")  # type: ignore[arg-type]


@pytest.fixture
def weights(tmp_path: Path) -> Path:
    """A copy of the network's file, its card beside it."""
    for file in (WEIGHTS, WEIGHTS.with_name(f"{WEIGHTS.name}.json")):
        shutil.copy(file, tmp_path)
    return tmp_path / WEIGHTS.name


def test_weights_cut_short_or_without_a_card_are_a_named_error(weights: Path) -> None:
    assert models._second_look(str(weights)) == network()
    weights.write_bytes(weights.read_bytes()[:-2])
    with pytest.raises(limo_hog.ModelFormatError, match="is not the file that its card describes"):
        models._second_look(str(weights))
    for missing in (weights.with_name(f"{weights.name}.json"), weights):
        missing.unlink()
        with pytest.raises(limo_hog.ModelFormatError, match="the installation is damaged"):
            models._second_look(str(weights))


def test_a_card_without_one_of_its_numbers_is_a_named_error(weights: Path) -> None:
    card = weights.with_name(f"{weights.name}.json")
    whole = card.read_text()
    for key, message in (
        ("share", "2 finite"),
        ("layers", "4 finite"),
        ("slope", "calibration is"),
        ("{", "no model card"),
    ):
        card.write_text(whole.replace(key, "?"))
        with pytest.raises(limo_hog.ModelFormatError, match=message):
            models._second_look(str(weights))


def test_weights_of_other_layers_are_a_named_error() -> None:
    with pytest.raises(limo_hog.ModelFormatError, match=r"the network has .* weights; these layers need"):
        network()._replace(hidden=31).compiled()
    nan = np.full(len(network().weights) // 2, np.nan, "<f2").tobytes()
    with pytest.raises(limo_hog.ModelFormatError, match="infinite or NaN"):
        network()._replace(weights=nan).compiled()


def test_the_card_says_where_the_weights_come_from() -> None:
    card = json.loads(WEIGHTS.with_name(f"{WEIGHTS.name}.json").read_text())
    assert {"made_by", "data", "seed", "epochs", "figures"} <= card.keys()
    assert [source["files"] for source in card["data"]] == [2416, 924, 4146, 3019]
    assert [source["files"] for source in card["streets"]] == [1569, 1569]
    assert WEIGHTS.stat().st_size < 400_000


PROGRAM = """
import sys
from limo_hog import PeopleDetector, set_num_threads
from limo_hog.cli.support.scene import street
from limo_hog.imaging.inputs import as_array
set_num_threads(int(sys.argv[1]))
images = [as_array(name) for name in sys.argv[2:]] or [street(640, 480, 3), street(500, 400, 1)]
for image in images:
    found = PeopleDetector(threshold=-1.0, second_look=True).detect(image)
    print([[*map(float, row), float(score).hex()] for row, score in zip(found.windows, found.scores)])
"""


def answers(backend: str, threads: int) -> list[list[list[float | str]]]:
    photographs = sorted((PHOTOGRAPHS / "real" / "pedestrians").glob("TUD*"))
    command = [sys.executable, "-c", PROGRAM, str(threads), *map(str, photographs)]
    done = subprocess.run(command, env=os.environ | {"LIMO_HOG_BACKEND": backend}, stdout=subprocess.PIPE, check=True)
    return [json.loads(line.replace(b"'", b'"')) for line in done.stdout.splitlines()]


def test_backends_find_the_same_and_processes_and_threads_to_the_bit() -> None:
    first, *others = _core.available_backends()
    wanted = answers(first, 1)
    assert any(wanted) and answers(first, 2) == wanted
    for backend in others:
        for rows in zip(wanted, answers(backend, 1), strict=True):
            assert [row[:4] for row in rows[0]] == [row[:4] for row in rows[1]]
            mine, theirs = ([float.fromhex(str(row[4])) for row in some] for some in rows)
            np.testing.assert_allclose(mine, theirs, atol=1e-4)
