"""Our own weights: two windows, each for its sizes, whose margins mean the same."""

import json
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from tests.answers import AnswerTo

from limo_hog import PeopleDetector
from limo_hog.cli.support.scene import street
from limo_hog.models import load_model

WEIGHTS = Path(str(files("limo_hog") / "weights"))
LARGE, SMALL = WEIGHTS / "limo_64x128.yml", WEIGHTS / "limo_48x96.yml"
USC = Path(__file__).parents[3] / "shared" / "data" / "eval" / "usc-c"


def people_of(height: float) -> NDArray[np.uint8]:
    """A drawn street, made so large that its smallest people are about this tall [px]."""
    picture = street(640, 480, 1)
    least = int(PeopleDetector(model=LARGE).detect(picture).boxes[:, 3].min())
    return np.asarray(cv2.resize(picture, None, fx=height / least, fy=height / least), np.uint8)


def test_the_small_windows_margins_are_on_the_scale_of_the_large_ones() -> None:
    small, limo = load_model(SMALL), load_model("limo")
    assert limo.smaller is not None and limo.calibration is not None and small.calibration is not None
    descriptor = np.random.default_rng(0).random(len(small.coefficients) - 1).astype(np.float32)
    own = float(descriptor @ small.coefficients[:-1] + small.coefficients[-1])
    mapped = float(descriptor @ limo.smaller.coefficients[:-1] + limo.smaller.coefficients[-1])
    slope, offset = small.calibration
    assert limo.calibration.slope * mapped + limo.calibration.offset == pytest.approx(slope * own + offset, abs=1e-3)


def test_people_too_small_for_the_large_window_are_found_by_the_small_one() -> None:
    picture = people_of(84)
    limo, large = (PeopleDetector(model=model, min_height=None).detect(picture) for model in ("limo", LARGE))
    assert limo.boxes[:, 3].min() < 95
    assert len(large) == 0 or large.boxes[:, 3].min() >= 99
    assert len(limo) > len(large)


@pytest.mark.parametrize("options", [*({"min_height": h} for h in (64, 96, 200)), {"min_height": None, "nms": "group"}])
def test_from_64_px_on_and_in_opencvs_grouping_the_large_window_alone_is_used(options: dict[str, Any]) -> None:
    picture = street(640, 480, 3)
    first = partial(PeopleDetector, second_look=False, **options)
    limo, large = (first(model=model).detect(picture) for model in ("limo", LARGE))
    assert (limo.boxes.tolist(), limo.scores.tolist()) == (large.boxes.tolist(), large.scores.tolist()) != ([], [])


def test_people_of_48_px_are_found() -> None:
    picture = people_of(52)
    found = PeopleDetector(model="limo", min_height=48).detect(picture)
    assert 46 <= found.boxes[:, 3].min() < 62 and (np.diff(found.scores) <= 0).all()


def test_the_cards_say_where_the_weights_come_from() -> None:
    for model in (LARGE, SMALL):
        card = json.loads(model.with_name(f"{model.name}.json").read_text())
        assert [source["files"] for source in card["data"]] == [2416, 924, 4146, 3019]
        assert all(len(source["sha256"]) == 64 for source in card["data"])
        assert load_model(model).threshold == card["threshold"]
    assert sum(path.stat().st_size for path in WEIGHTS.iterdir()) < 300_000


@pytest.mark.skipif(not USC.is_dir(), reason="the photographs of ../shared are not here")
def test_two_looks_miss_fewer_people_than_one_and_than_opencvs_weights(answer_to: AnswerTo) -> None:
    result = json.loads(answer_to("evaluate", "limo", USC, "--against", "opencv", "--first-look", "--json", "-").out)
    assert (result["pictures"], result["objects"]) == (100, 232)
    twice = json.loads((WEIGHTS / "second_look.f16.json").read_text())["figures"]["USC-C"]["lamr"]
    assert twice < 0.24
    assert [model["lamr"] for model in result["models"]] == pytest.approx([twice, 0.268, 0.298], abs=0.01)
