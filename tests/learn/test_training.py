"""Training: rounds, and that the same data give the same detector."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.learn import bollards as drawn

from limo_hog.imaging.writing import write_image
from limo_hog.learn.card import calibrate, calibration_error, measure
from limo_hog.learn.formats import read_labels
from limo_hog.learn.labels import LabelError, LabelWarning
from limo_hog.learn.mining import Miner, MiningParameters, hardest
from limo_hog.learn.sources import TrainingData, Wanted, gather
from limo_hog.learn.training import Round, TrainingParameters, train
from limo_hog.learn.windows import read_gray
from limo_hog.models import PERSON_BOX
from limo_hog.suppression import intersection_over_union

SMALL = TrainingParameters(rounds=2, mining=MiningParameters(random_windows=400))


@pytest.fixture(scope="module")
def bollards(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bollards")
    drawn.write(folder, pictures=20, seed=0)
    return folder


@pytest.fixture
def data(bollards: Path) -> TrainingData:
    with pytest.warns(LabelWarning, match="objects only"):
        return gather(Wanted((bollards,)))


def _train(data: TrainingData, how: TrainingParameters = SMALL, workers: int = 2) -> list[Round]:
    return list(train(data, how, workers))


def test_the_same_data_give_the_same_bits_on_any_number_of_cores(data: TrainingData) -> None:
    one, many = _train(data, workers=1), _train(data, workers=3)
    assert [done.number for done in one] == [0, 1, 2]
    for a, b in zip(one, many, strict=True):
        assert np.array_equal(a.solution.coefficients, b.solution.coefficients)
        assert (a.negatives, a.new) == (b.negatives, b.new)
    assert one[1].new > 0
    other = _train(data, replace(SMALL, seed=1))
    assert not np.array_equal(one[-1].solution.coefficients, other[-1].solution.coefficients)


def test_labels_choose_the_window_and_pictures_are_held_out(data: TrainingData, bollards: Path) -> None:
    width, height = data.shape.size
    assert width % 8 == height % 8 == 0
    box = data.shape.object_box
    assert box.width * width / (box.height * height) == pytest.approx(0.3, abs=0.01)
    assert len(data.validation) == 4
    held = {picture.path for picture in data.validation}
    assert held.isdisjoint([*(region.path for region in data.regions), *data.negatives.paths])
    assert len(held | set(data.negatives.paths)) == 20
    assert data.min_height <= 70


def test_nothing_is_held_out_where_no_object_can_be(bollards: Path, tmp_path: Path) -> None:
    labels = json.loads((bollards / "boxes.json").read_text())
    first = next(name for name, boxes in labels.items() if boxes)
    (tmp_path / "boxes.json").write_text(json.dumps({name: labels[name] if name == first else [] for name in labels}))
    with pytest.warns(LabelWarning, match="objects only|--validate"):
        data = gather(Wanted((tmp_path / "boxes.json",), pictures=bollards))
    assert data.validation == () and measure(_train(data, replace(SMALL, rounds=0))[0], data, final=True) == {}
    assert len(data.negatives.paths) == 20


def test_negatives_of_labelled_pictures_are_clear_of_the_objects(data: TrainingData) -> None:
    (first,) = _train(data, replace(SMALL, rounds=0))
    miner = Miner(data.negatives, data.shape, SMALL.mining, 0, 2)
    negatives = list(miner.hard(first.solution.coefficients, {}))
    assert sum(len(mined.boxes) for mined in negatives) > 0
    for mined in negatives:
        objects = data.negatives.objects[data.negatives.paths[mined.picture]]
        overlaps = intersection_over_union(data.shape.object_box.inside(mined.boxes), objects)
        assert (overlaps <= 0.3 + 1e-9).all()
    # What is known is not found again.
    known = {mined.picture: set(map(tuple, mined.boxes.tolist())) for mined in negatives}
    for mined in miner.hard(first.solution.coefficients, known):
        assert known[mined.picture].isdisjoint(map(tuple, mined.boxes.tolist()))


def test_memory_is_bounded_by_leaving_out_the_least_hard_negatives(data: TrainingData) -> None:
    first, free = _train(data, replace(SMALL, rounds=1))
    room = first.descriptor_bytes + 10 * 4 * (len(first.solution.coefficients) - 1)
    _, bounded = _train(data, replace(SMALL, rounds=1, most_bytes=room))
    assert (bounded.new, bounded.left_out) == (10, free.new - 10) and bounded.descriptor_bytes <= room
    found = list(Miner(data.negatives, data.shape, SMALL.mining, 0, 2).hard(first.solution.coefficients, {}))
    kept, left_out = hardest(found, 10 * found[0].descriptors[0].nbytes)
    margins = np.sort(np.concatenate([mined.margins for mined in found]))
    assert np.sort(np.concatenate([mined.margins for mined in kept])).tolist() == margins[-10:].tolist()
    assert left_out == len(margins) - 10


@pytest.fixture
def crops(bollards: Path, tmp_path: Path) -> Path:
    """Bollards cut out, one of them also mirrored, and pictures without any."""
    boxes = [(picture.path, box) for picture in read_labels(bollards) for box in picture.boxes]
    for number, (path, box) in enumerate(boxes):
        x, y = round(box.x - box.width / 2) + 80, round(box.y - box.height / 8) + 80
        around = np.pad(read_gray(path), 80, mode="reflect")
        crop = around[y : y + round(1.25 * box.height), x : x + round(2 * box.width)]
        write_image(tmp_path / "crops" / f"{number:03}.png", crop)
    first = read_gray(tmp_path / "crops" / "000.png")
    write_image(tmp_path / "crops" / "again.png", np.ascontiguousarray(first[:, ::-1]))
    for i, noise in enumerate(np.random.default_rng(0).integers(0, 256, (3, 30, 40), np.uint8)):
        write_image(tmp_path / "free" / f"{i}.png", np.kron(noise, np.ones((6, 6), np.uint8)))
    return tmp_path


def test_crops_are_learnt_from_once_each(crops: Path) -> None:
    with pytest.warns(LabelWarning, match="objects only|--validate"):
        data = gather(Wanted((crops / "crops",), (crops / "free",), window=(48, 96)))
    (done,) = _train(data, replace(SMALL, rounds=0))
    assert done.objects == len(data.regions) - 1
    # Where crops of people have theirs; what they were cut from is not known, and so nothing can be measured.
    assert data.shape.object_box == PERSON_BOX and measure(done, data, final=True) == {}


def test_a_class_that_is_missing_is_named(crops: Path) -> None:
    with pytest.raises(LabelError, match=r"nothing that shows no such object.*--negatives DIR"):
        gather(Wanted((crops / "crops",)))
    write_image(crops / "tiny" / "a.png", np.zeros((8, 8), np.uint8))
    with pytest.warns(LabelWarning, match="objects only|--validate"):
        data = gather(Wanted((crops / "crops",), (crops / "tiny",)))
    with pytest.raises(LabelError, match="none of the 1 pictures for negatives is as large as the window, 64 x 128"):
        _train(data)


def test_pictures_that_cannot_be_read_are_left_out_with_a_warning(crops: Path) -> None:
    (crops / "crops" / "000.png").write_bytes(b"no")
    (crops / "free" / "0.png").write_bytes(b"")
    with pytest.warns(LabelWarning) as warned:
        data = gather(Wanted((crops / "crops",), (crops / "free",), window=(48, 96)))
        _train(data, replace(SMALL, rounds=0))
    said = " ".join(str(warning.message) for warning in warned)
    assert "000.png: not an image" in said and "0.png: the file is empty" in said


def test_probabilities_are_those_the_scores_were_drawn_from() -> None:
    rng = np.random.default_rng(0)
    scores = rng.normal(0, 1, 20_000)
    likely = 1 / (1 + np.exp(-(3 * scores - 1)))
    right = rng.random(20_000) < likely
    assert (np.abs(np.subtract(calibrate(scores, right), (3, -1))) <= (0.15, 0.08)).all()
    assert calibration_error(likely, right) < 0.01 and calibration_error(np.full(20_000, 0.9), right) > 0.3


@pytest.mark.parametrize("right", [[True, True], [False, False], [True, False], []])
def test_a_calibration_of_hardly_anything_is_finite(right: list[bool]) -> None:
    found = calibrate(np.arange(len(right), 0, -1, dtype=np.float64), np.array(right, np.bool_))
    assert np.isfinite(found).all()
