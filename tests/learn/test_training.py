"""Training: rounds, what they keep, and that the same data give the same detector."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.learn import bollards as drawn

from limo_hog.imaging.writing import write_image
from limo_hog.learn.card import calibrate, calibration_error
from limo_hog.learn.formats import read_labels
from limo_hog.learn.labels import LabelError, LabelWarning
from limo_hog.learn.mining import MiningParameters, hard_negatives
from limo_hog.learn.sources import TrainingData, Wanted, gather
from limo_hog.learn.training import ResumeError, Round, State, TrainingParameters, fingerprint, train
from limo_hog.learn.windows import read_gray

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
    return list(train(data, how, State(fingerprint(data, how)), workers))


def test_the_same_data_give_the_same_bits_on_any_number_of_cores(data: TrainingData) -> None:
    one, many = _train(data, workers=1), _train(data, workers=3)
    assert [done.number for done in one] == [0, 1, 2]
    for a, b in zip(one, many, strict=True):
        assert np.array_equal(a.coefficients, b.coefficients)
        assert (a.negatives, a.new) == (b.negatives, b.new)
    assert one[1].new > 0
    other = _train(data, replace(SMALL, seed=1))
    assert not np.array_equal(one[-1].coefficients, other[-1].coefficients)


def test_a_stopped_run_goes_on_to_the_same_detector(data: TrainingData, tmp_path: Path) -> None:
    whole = _train(data)
    mark = fingerprint(data, SMALL)
    for stop in (0, 1):
        state, path = State(mark), tmp_path / f"{stop}.npz"
        for done in train(data, SMALL, state, 2):
            state.save(path)
            if done.number == stop:
                break
        rest = list(train(data, SMALL, State.load(path, mark), 2))
        assert [done.number for done in rest] == list(range(stop + 1, 3))
        assert np.array_equal(rest[-1].coefficients, whole[-1].coefficients)


def test_a_run_of_other_data_is_not_resumed(data: TrainingData, tmp_path: Path) -> None:
    path = tmp_path / "state.npz"
    with pytest.raises(ResumeError, match="no stopped run"):
        State.load(path, "")
    State(fingerprint(data, SMALL)).save(path)
    with pytest.raises(ResumeError, match="other data or options"):
        State.load(path, fingerprint(data, replace(SMALL, seed=9)))
    path.write_bytes(b"no state")
    with pytest.raises(ResumeError, match="not the state of a stopped run"):
        State.load(path, "")


def test_a_damaged_state_is_told_as_one(data: TrainingData, tmp_path: Path) -> None:
    path, mark = tmp_path / "state.npz", fingerprint(data, SMALL)
    State(mark, [np.ones(50)], [], [{"round": 0}]).save(path)
    whole, rng = path.read_bytes(), np.random.default_rng(0)
    refused = 0
    for number in range(400):
        damaged = bytearray(whole)
        if number % 2:
            damaged[rng.integers(len(whole))] ^= 1 << rng.integers(8)
        else:
            del damaged[rng.integers(len(whole)) :]
        path.write_bytes(damaged)
        try:
            State.load(path, mark)
        except ResumeError as error:
            refused += "not the state of a stopped run" in str(error)
    # Some bits say nothing: when a part was packed, by which system.
    assert refused > 300
    with path.open("wb") as file:
        np.save(file, np.ones(3))
    with pytest.raises(ResumeError, match="not the state of a stopped run"):
        State.load(path, mark)


def test_labels_choose_the_window_and_pictures_are_held_out(data: TrainingData, bollards: Path) -> None:
    width, height = data.shape.size
    assert width % 8 == height % 8 == 0
    box = data.shape.object_box
    assert box.width * width / (box.height * height) == pytest.approx(0.3, abs=0.01)
    assert len(data.validation) == 4
    held = {picture.path for picture in data.validation}
    assert held.isdisjoint(region.path for region in data.regions)
    assert held.isdisjoint(data.negatives.paths)
    assert len(held | set(data.negatives.paths)) == 20
    assert data.min_height <= 70


def test_nothing_is_held_out_where_no_object_can_be(bollards: Path, tmp_path: Path) -> None:
    labels = json.loads((bollards / "boxes.json").read_text())
    first = next(name for name, boxes in labels.items() if boxes)
    (tmp_path / "boxes.json").write_text(json.dumps({name: labels[name] if name == first else [] for name in labels}))
    with pytest.warns(LabelWarning, match="objects only"):
        data = gather(Wanted((tmp_path / "boxes.json",), pictures=bollards))
    assert data.validation == ()
    assert len(data.negatives.paths) == 20


def test_negatives_of_labelled_pictures_are_clear_of_the_objects(data: TrainingData) -> None:
    state = State(fingerprint(data, SMALL))
    list(train(data, SMALL, state, 2))
    assert sum(map(len, state.mined)) > 0
    for mined in state.mined:
        for picture, boxes in mined.items():
            objects = data.negatives.objects[data.negatives.paths[picture]]
            for x, y, w, h in data.shape.object_box.inside(boxes).tolist():
                for ox, oy, ow, oh in objects.tolist():
                    shared = max(0, min(x + w, ox + ow) - max(x, ox)) * max(0, min(y + h, oy + oh) - max(y, oy))
                    assert shared / (w * h + ow * oh - shared) <= 0.3 + 1e-9


def test_memory_is_bounded_by_the_least_hard_negatives(data: TrainingData) -> None:
    free, state = [], State(fingerprint(data, SMALL))
    for done in train(data, SMALL, state, 2):
        free.append(done)
        if done.number == 1:
            break
    every = hard_negatives(free[0].coefficients, data.negatives, {}, data.shape, SMALL.mining, 0, 2)
    margins = {
        (m.picture, *box): margin for m in every for box, margin in zip(m.boxes.tolist(), m.margins, strict=True)
    }
    room = free[0].descriptor_bytes + 10 * 4 * (len(free[0].coefficients) - 1)
    how = replace(SMALL, rounds=1, most_bytes=room)
    state = State(fingerprint(data, how))
    bounded = list(train(data, how, state, 2))
    assert bounded[1].new == 10
    assert bounded[1].left_out == free[1].new - 10
    assert bounded[-1].descriptor_bytes <= room
    places = [(picture, *box) for picture, boxes in state.mined[0].items() for box in boxes.tolist()]
    kept = [margins[where] for where in places]
    assert sorted(kept) == sorted(margins.values())[-10:]


@pytest.fixture
def crops(bollards: Path, tmp_path: Path) -> Path:
    """Bollards cut out, one of them also mirrored, and pictures without any."""
    number = 0
    for picture in read_labels(bollards):
        image = read_gray(picture.path)
        for box in picture.boxes:
            x, y = round(box.x - box.width / 2), round(box.y - box.height / 8)
            crop = np.pad(image, 80, mode="reflect")[y + 80 :, x + 80 :][
                : round(1.25 * box.height), : round(2 * box.width)
            ]
            write_image(tmp_path / "crops" / f"{number:03}.png", crop)
            number += 1
    first = read_gray(tmp_path / "crops" / "000.png")
    write_image(tmp_path / "crops" / "again.png", np.ascontiguousarray(first[:, ::-1]))
    empty = np.random.default_rng(0).integers(0, 256, (3, 30, 40), np.uint8)
    for i, noise in enumerate(empty):
        write_image(tmp_path / "free" / f"{i}.png", np.kron(noise, np.ones((6, 6), np.uint8)))
    return tmp_path


def test_crops_are_learnt_from_once_each(crops: Path) -> None:
    with pytest.warns(LabelWarning, match="objects only"):
        data = gather(Wanted((crops / "crops",), (crops / "free",), window=(48, 96)))
    how = replace(SMALL, rounds=0, held_out=0.25)
    (done,) = train(data, how, State(fingerprint(data, how)), 2)
    count = len(data.regions) - 1
    assert len(data.held_negatives) == 1 and data.held_negatives[0] not in data.negatives.paths
    assert done.objects + len(done.held_out_margins) == count
    assert len(done.held_out_margins) == round(0.25 * count)
    assert (done.held_out_margins > 0).mean() > 0.8


def test_a_class_that_is_missing_is_named(crops: Path, tmp_path: Path) -> None:
    with pytest.raises(LabelError, match=r"nothing that shows no such object.*--negatives DIR"):
        gather(Wanted((crops / "crops",)))
    write_image(tmp_path / "tiny" / "a.png", np.zeros((8, 8), np.uint8))
    with pytest.warns(LabelWarning, match="objects only"):
        data = gather(Wanted((crops / "crops",), (tmp_path / "tiny",)))
    with pytest.raises(LabelError, match="none of the 1 pictures for negatives is as large as the window, 64 x 128"):
        _train(data)


def test_pictures_that_cannot_be_read_are_left_out_with_a_warning(crops: Path) -> None:
    (crops / "crops" / "000.png").write_bytes(b"no")
    (crops / "free" / "0.png").write_bytes(b"")
    with pytest.warns(LabelWarning) as warned:
        data = gather(Wanted((crops / "crops",), (crops / "free",), window=(48, 96)))
        _train(data, replace(SMALL, rounds=0))
    said = " ".join(str(warning.message) for warning in warned)
    assert "000.png: not an image" in said
    assert "0.png: the file is empty" in said


def test_probabilities_are_those_the_scores_were_drawn_from() -> None:
    rng = np.random.default_rng(0)
    scores = rng.normal(0, 1, 20_000)
    likely = 1 / (1 + np.exp(-(3 * scores - 1)))
    right = rng.random(20_000) < likely
    slope, offset = calibrate(scores, right)
    assert slope == pytest.approx(3, abs=0.15)
    assert offset == pytest.approx(-1, abs=0.08)
    assert calibration_error(likely, right) < 0.01
    assert calibration_error(np.full(20_000, 0.9), right) > 0.3


@pytest.mark.parametrize("right", [[True, True], [False, False], [True, False], []])
def test_a_calibration_of_hardly_anything_is_finite(right: list[bool]) -> None:
    found = calibrate(np.arange(len(right), 0, -1, dtype=np.float64), np.array(right, np.bool_))
    assert np.isfinite(found).all()
