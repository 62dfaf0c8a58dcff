"""PeopleDetector: its arguments, the boxes it gives, and their agreement with OpenCV where it asks for OpenCV's."""

import copy
import json
import pickle
import re
from concurrent.futures import ThreadPoolExecutor
from dataclasses import FrozenInstanceError, replace
from decimal import Decimal
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

import limo_hog
from limo_hog import HOGDescriptor, PeopleDetector
from limo_hog.cli.support.scene import street
from limo_hog.models import load_model
from limo_hog.suppression import intersection_over_smaller, nms

PHOTOGRAPHS = Path(__file__).parents[3] / "shared" / "data" / "real" / "pedestrians"
Image = NDArray[np.uint8]


#: Every hit, without grouping.
RAW: Any = {"nms": "group", "group_threshold": 0}
#: What OpenCV calls its models.
OPENCVS = {"opencv": "Default", "default": "Default", "daimler": "Daimler"}


@cache
def picture() -> Image:
    return street(640, 480, 3)


def assert_same(found: limo_hog.Detections, windows: Any, scores: Any) -> None:
    np.testing.assert_array_equal(found.windows, windows)
    np.testing.assert_array_equal(found.scores, scores)


@pytest.mark.parametrize("model", ["opencv", "default", "daimler"])
def test_grouped_and_at_the_images_own_size_the_boxes_are_opencvs(model: str) -> None:
    hog = cv2.HOGDescriptor(*(((48, 96), (16, 16), (8, 8), (8, 8), 9) if model == "daimler" else ()))
    hog.setSVMDetector(np.asarray(getattr(cv2.HOGDescriptor, f"get{OPENCVS[model]}PeopleDetector")()))
    detector = PeopleDetector(model=model, min_height=None, nms="group")
    both = []
    for image in (picture(), street(800, 600, 1)):
        theirs = np.reshape(hog.detectMultiScale(image, padding=(4, 4))[0], (-1, 4)).tolist()
        both.append((sorted(detector.detect(image).windows.tolist()), sorted(theirs)))
    assert any(ours for ours, _ in both) and all(ours == theirs for ours, theirs in both)


def test_people_of_the_height_asked_for_are_found() -> None:
    image = np.asarray(cv2.resize(picture(), None, fx=0.2, fy=0.2, interpolation=cv2.INTER_AREA), np.uint8)
    assert len(PeopleDetector(model="opencv", min_height=None).detect(image)) == 0
    found = PeopleDetector(model="opencv", min_height=40).detect(image)
    assert found.boxes[:, 3].min() >= 40 - 1
    corners = found.windows[:, :2]
    assert (corners >= 0).all() and (corners + found.windows[:, 2:] <= image.shape[1::-1]).all()


def test_searching_at_half_the_size_finds_what_a_half_size_image_holds() -> None:
    half = np.asarray(cv2.resize(picture(), None, fx=0.5, fy=0.5, interpolation=cv2.INTER_LINEAR_EXACT), np.uint8)
    expected = PeopleDetector(model="opencv", min_height=None).detect(half)
    found = PeopleDetector(model="opencv", min_height=2 * 0.78 * 128).detect(picture())
    assert len(found) > 0
    assert_same(found, 2 * expected.windows, expected.scores)
    # Without enlarging, the least height is the model's own.
    own, asked = (PeopleDetector(min_height=h, second_look=False) for h in (None, 0.78 * 128))
    assert own.detect(picture()) == asked.detect(picture())


def test_boxes_of_an_enlarged_image_are_in_pixels_of_the_image_itself() -> None:
    larger = np.asarray(cv2.resize(picture(), (998, 749), interpolation=cv2.INTER_LINEAR_EXACT), np.uint8)
    expected = PeopleDetector(min_height=None, second_look=False).detect(larger)
    found = PeopleDetector(min_height=64, second_look=False).detect(picture())
    assert_same(found, np.rint(expected.windows / ([998 / 640, 749 / 480] * 2)), expected.scores)


def test_people_taller_than_asked_for_are_left_out() -> None:
    all_of_them = PeopleDetector().detect(picture())
    heights = np.unique(all_of_them.boxes[:, 3])
    limits = (heights[:-1] + heights[1:])[np.diff(heights) > 4] / 2
    assert len(limits) > 1
    for limit in limits.tolist():
        assert PeopleDetector(max_height=limit).detect(picture()) == all_of_them[all_of_them.boxes[:, 3] < limit]
    # Those of exactly the greatest height are reported.
    every_window = PeopleDetector(threshold=-9.0, overlap=1, second_look=False)
    for max_height, window_height in ((64, 82), (65, 82), (67, 86)):  # 64 / 0.78, and 1.05 times that
        found = replace(every_window, max_height=max_height).detect(picture()[200:360, 300:400])
        assert found.windows[:, 3].max() == window_height


def test_more_than_64_levels_are_searched_where_the_scale_is_fine() -> None:
    # 1.01**64 is 1.9: the tallest person, 384 px, is beyond.
    found = PeopleDetector(min_height=None, scale=1.01).detect(picture())
    assert found.boxes[:, 3].max() > 300


@pytest.mark.parametrize("shape", [(1, 1), (1, 1000, 3), (127, 63), (60, 40, 1), (128, 64, 3)])
def test_images_of_any_size_are_searched(shape: tuple[int, ...]) -> None:
    for min_height in (8, 64, None, 500):
        found = PeopleDetector(min_height=min_height).detect(np.zeros(shape, np.uint8))
        assert found.windows.shape == (0, 4) and found.windows.dtype == np.int32
        assert found.scores.shape == (0,) and found.scores.dtype == np.float64


def test_an_image_that_would_be_enlarged_beyond_memory_is_refused() -> None:
    with pytest.raises(limo_hog.ImageError, match=r"6000 x 4000 px, would be 56160 x 37440 px.*raise min_height"):
        PeopleDetector(min_height=8).detect(np.broadcast_to(np.uint8(0), (4000, 6000)))
    with pytest.raises(limo_hog.ImageError, match=r"the image is 20000 x 20000 px; at most 268435456 pixels"):
        PeopleDetector(min_height=None).detect(np.broadcast_to(np.uint8(0), (20000, 20000)))


def test_of_hits_on_one_person_the_best_stays_by_the_person_boxes_overlap() -> None:
    detector = PeopleDetector(model="opencv", min_height=None, threshold=-0.7, **RAW)
    hits = detector.detect(picture())
    x, y, w, h = hits.windows.T
    # People are compared, not windows: those of two people side by side share their margins.
    people = np.stack([x + 0.2 * w, y + 0.1 * h, 0.6 * w, 0.78 * h], axis=1)
    kept = nms(people, hits.scores, 0.65, intersection_over_smaller)
    assert len(kept) > len(nms(hits.windows, hits.scores, 0.65, intersection_over_smaller))
    found = replace(detector, nms="overlap", group_threshold=None).detect(picture())
    assert_same(found, hits.windows[kept], hits.scores[kept])


def test_the_limit_of_overlap_can_be_chosen() -> None:
    hits = PeopleDetector(**RAW).detect(picture())
    assert len(PeopleDetector(overlap=1, second_look=False).detect(picture())) == len(hits)
    detectors = (PeopleDetector(threshold=-1.0, overlap=limit, second_look=False) for limit in (0.1, 0.65, 0.95))
    few, some, many = (len(detector.detect(picture())) for detector in detectors)
    assert 0 < few < some < many
    # A threshold below -1 gives more, the surest first.
    fewer, more = (PeopleDetector(threshold=t, second_look=False).detect(picture()) for t in (None, -1.2))
    assert len(more) > len(fewer) and -1.2 <= more.scores.min() < 0 and (np.diff(more.scores) <= 0).all()


def test_a_detector_cannot_be_changed() -> None:
    detector: Any = PeopleDetector()
    with pytest.raises(FrozenInstanceError):
        detector.threshold = 1.0
    with pytest.raises(TypeError):
        untyped.PeopleDetector("opencv")


@pytest.mark.parametrize("again", [copy.copy, copy.deepcopy, lambda d: pickle.loads(pickle.dumps(d)), replace])
@pytest.mark.parametrize("of_a_file", [False, True])
def test_a_copy_is_equal_and_finds_the_same(again: Any, of_a_file: bool, tmp_path: Path) -> None:
    model = saved(tmp_path / "m.yml") if of_a_file else "daimler"
    detector = PeopleDetector(model=model, threshold=0.5, win_stride=(8, 16), overlap=0.4)
    found = detector.detect(picture())
    if of_a_file:
        (tmp_path / "m.yml").unlink()
    twin = again(detector)
    assert twin == detector and hash(twin) == hash(detector) and repr(twin) == repr(detector)
    assert twin.detect(picture()) == found


@pytest.mark.skipif(not PHOTOGRAPHS.is_dir(), reason="photographs lie in ../shared")
def test_on_photographs_a_guided_search_misses_few_hits_and_adds_none() -> None:
    exact, guided = (PeopleDetector(min_height=None, **RAW, search=search) for search in ("exact", "guided"))
    hits, misses = 0, 0
    for file in sorted(PHOTOGRAPHS.iterdir()):
        if cv2.haveImageReader(str(file)):
            every, some = ({*map(tuple, one.detect(file).windows.tolist())} for one in (exact, guided))
            assert some <= every
            hits, misses = hits + len(every), misses + len(every - some)
    assert misses < 0.03 * hits and hits > 100


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_many_images_are_searched_in_their_order(threads: int, threads_put_back: None) -> None:
    images = [street(200 + 40 * number, 240, 1 + 2 * (number % 2)) for number in range(9)]
    detector = PeopleDetector(min_height=None)
    wanted = [detector.detect(image) for image in images]
    limo_hog.set_num_threads(threads)
    assert [*detector.detect_many(iter(images))] == wanted and any(map(len, wanted))


def test_an_image_among_many_that_is_none_is_named_at_its_turn() -> None:
    found = PeopleDetector(min_height=None).detect_many([picture(), np.zeros((4, 4), np.float32), picture()])
    assert len(next(found)) >= 0
    with pytest.raises(limo_hog.ImageTypeError):
        next(found)


def test_threads_share_a_detector() -> None:
    detector = PeopleDetector()
    with ThreadPoolExecutor(4) as pool:
        assert [*pool.map(detector.detect, [picture()] * 8)] == [detector.detect(picture())] * 8


#: Without its types, so that they can be wrong.
untyped: Any = limo_hog

WRONG: list[tuple[dict[str, Any], type[Exception], str]] = [
    ({"model": "bogus"}, ValueError, "model is 'bogus': no such file, and none of the names opencv"),
    ({"model": 7}, TypeError, "model is 7"),
    ({"threshold": Decimal("sNaN")}, TypeError, "threshold is Decimal"),
    ({"threshold": np.complex128(1 + 2j)}, TypeError, "a real number is wanted"),
    ({"min_height": 0}, ValueError, "min_height is 0; 8 or more is wanted"),
    ({"min_height": 300, "max_height": 100}, ValueError, "at least 300 is wanted, the height of the smallest person"),
    ({"min_height": None, "max_height": 70}, ValueError, "max_height is 70; at least 74.88"),
    ({"threshold": float("nan")}, ValueError, "threshold is nan; a finite number is wanted"),
    ({"threshold": 10**400}, ValueError, r"threshold is 1000.*… is wanted|threshold is 10000"),
    ({"threshold": np.zeros(3)}, TypeError, "threshold is array"),
    ({"nms": "bogus"}, ValueError, "nms is 'bogus'; one of overlap, group is wanted"),
    ({"nms": ["group"]}, TypeError, r"nms is \['group'\]"),
    ({"overlap": 7}, ValueError, "overlap is 7; 0 to 1 is wanted"),
    ({"overlap": 0.5, "nms": "group"}, ValueError, "overlap has no meaning"),
    ({"group_threshold": -2, "nms": "group"}, ValueError, "group_threshold is -2; 0 or more"),
    ({"group_threshold": 1.5, "nms": "group"}, TypeError, "group_threshold is 1.5"),
    ({"group_threshold": 0}, ValueError, 'group_threshold has no meaning for nms="overlap"'),
    ({"win_stride": (0, 8)}, ValueError, r"win_stride is \(0, 8\)"),
    ({"win_stride": 8}, TypeError, r"win_stride is 8; two integers \(x, y\) are wanted"),
    ({"padding": -1}, TypeError, "padding is -1; two integers"),
    ({"padding": (-1, 0)}, ValueError, r"padding is \(-1, 0\)"),
    ({"padding": (65, 0)}, ValueError, r"padding is \(65, 0\).*\(64, 128\)"),
    ({"scale": 0.5}, ValueError, "scale is 0.5; 1.005 or more"),
    ({"scale": "1.1"}, TypeError, "scale is '1.1'"),
    # (An array of records cannot be compared with a text.)
    ({"min_height": None, "max_height": 64, "nms": np.zeros(3, "i4,f4")}, TypeError, "nms is"),
]


@pytest.mark.parametrize(("arguments", "kind", "told"), WRONG)
def test_a_wrong_argument_is_named_when_a_detector_is_made(arguments: Any, kind: type[Exception], told: str) -> None:
    with pytest.raises(limo_hog.ParameterError, match=told) as caught:
        untyped.PeopleDetector(**arguments)
    assert isinstance(caught.value, kind) and len(str(caught.value)) < 250


def test_numbers_of_numpy_and_lists_are_arguments_like_others() -> None:
    steps = {"win_stride": [8, 8], "padding": np.array([4, 4])}
    detector = untyped.PeopleDetector(threshold=np.float32(0.5), min_height=np.int64(64), overlap=1, **steps)
    plain = PeopleDetector(threshold=0.5, overlap=1.0)
    assert detector == plain and hash(detector) == hash(plain)


def saved(path: Path, card: Any = None) -> Path:
    hog = HOGDescriptor()
    hog.setSVMDetector(hog.getDefaultPeopleDetector())
    hog.save(path)
    if card is not None:
        path.with_name(path.name + ".json").write_text(card if isinstance(card, str) else json.dumps(card))
    return path


def test_a_model_is_a_name_a_file_or_in_memory(tmp_path: Path) -> None:
    file, memory = saved(tmp_path / "people.xml.gz"), load_model("opencv")
    expected = PeopleDetector(model="opencv").detect(picture()).windows.tolist()
    for model in (file, str(file), memory):
        assert PeopleDetector(model=model).detect(picture()).windows.tolist() == expected
    detector = PeopleDetector(model=memory)
    assert replace(detector) == detector == PeopleDetector(model=load_model("opencv"))
    assert detector != PeopleDetector(model=load_model("daimler"))
    assert len(pickle.loads(pickle.dumps(detector)).detect(picture())) > 0


def test_a_models_card_gives_its_person_box_threshold_and_calibration(tmp_path: Path) -> None:
    card = {"person_box": [0.1, 0.2, 0.5, 0.5], "threshold": 0.75, "calibration": {"slope": 2, "offset": -1}}
    detector = PeopleDetector(model=saved(tmp_path / "m.yml", card), min_height=64)
    found = detector.detect(picture())
    assert len(found) > 0 and found.scores.min() >= 0.75
    x, y, w, h = found.windows[0].tolist()
    assert found.boxes[0].tolist() == [round(x + 0.1 * w), round(y + 0.2 * h), round(0.5 * w), round(0.5 * h)]
    np.testing.assert_allclose(found.probabilities, 1 / (1 + np.exp(-(2 * found.scores - 1))))
    assert replace(detector, threshold=-1.0).detect(picture()).scores.min() < 0.75


@pytest.mark.parametrize(
    ("card", "told"),
    [
        ("{", "is no model card"),
        ("[" * 100_000, "is no model card"),
        ([1], "a JSON object is wanted"),
        ({"person_box": [0.1, 0.1, 1.0, 0.5]}, "person_box"),
        ({"person_box": [0.1, 0.1, 0.5]}, "4 finite numbers"),
        ({"person_box": "0.1"}, "person_box is '0.1'"),
        ({"threshold": float("nan")}, "threshold"),
        ({"threshold": 10**400}, "threshold"),
        ({"calibration": {"slope": 1}}, "slope"),
        ({"calibration": {"slope": "1", "offset": 0}}, "calibration"),
    ],
)
def test_a_damaged_card_is_named(tmp_path: Path, card: Any, told: str) -> None:
    with pytest.raises(limo_hog.ModelFormatError, match=rf"m\.yml\.json.*{told}"):
        PeopleDetector(model=saved(tmp_path / "m.yml", card))


@pytest.mark.parametrize("word", [".Inf", "-.Inf", ".Nan", "1e39"])
def test_a_model_with_a_coefficient_that_is_no_finite_number_is_refused(tmp_path: Path, word: str) -> None:
    path = saved(tmp_path / "m.yml")
    path.write_text(re.sub(r"(?<=SVMDetector: \[)[^,]+", f" {word}", path.read_text()))
    with pytest.raises(limo_hog.ModelFormatError, match=r"m\.yml: a coefficient is infinite or NaN"):
        PeopleDetector(model=path)
    with pytest.raises(limo_hog.ModelFormatError, match="a coefficient is infinite or NaN"):
        replace(load_model("opencv"), coefficients=np.append(load_model("opencv").coefficients[1:], np.inf))


def test_a_file_without_an_svm_is_refused(tmp_path: Path) -> None:
    HOGDescriptor().save(tmp_path / "bare.yml")
    with pytest.raises(limo_hog.ModelFormatError, match=r"bare\.yml holds a geometry without an SVM"):
        PeopleDetector(model=tmp_path / "bare.yml")
