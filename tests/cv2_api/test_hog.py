"""What HOGDescriptor offers beyond OpenCV's, and its errors for wrong arguments."""

import copy
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import limo_hog
from limo_hog import HOGDescriptor, visualize

GEOMETRY = ((48, 96), (16, 16), (8, 8), (8, 8), 9)
IMAGE = np.random.default_rng(1).integers(0, 256, (200, 100), dtype=np.uint8)


def people() -> Any:
    hog = HOGDescriptor()
    hog.setSVMDetector(hog.getDefaultPeopleDetector())
    return hog


def noise(*shape: int) -> np.ndarray[Any, np.dtype[np.uint8]]:
    return np.random.default_rng(1).integers(0, 256, shape, dtype=np.uint8)


def same_people(one: Any, other: Any) -> None:
    assert len(one[0]) > 0
    for first, second in zip(one, other, strict=True):
        np.testing.assert_array_equal(first, second)


in_every_way = pytest.mark.parametrize(
    "again", [copy.copy, copy.deepcopy, lambda hog: pickle.loads(pickle.dumps(hog))], ids=["copy", "deepcopy", "pickle"]
)


@in_every_way
@pytest.mark.parametrize("hog", [HOGDescriptor(), HOGDescriptor(*GEOMETRY, 1, 3.5, 0, 0.3, True, 7, True), people()])
def test_a_copy_holds_and_describes_the_same(hog: HOGDescriptor, again: Any) -> None:
    twin = again(hog)
    assert repr(twin) == repr(hog)
    np.testing.assert_array_equal(twin.svmDetector, hog.svmDetector)
    np.testing.assert_array_equal(twin.compute(noise(140, 80)), hog.compute(noise(140, 80)))
    twin.setSVMDetector(np.ones(hog.getDescriptorSize()))
    assert repr(twin) != repr(hog)


@in_every_way
def test_a_copy_of_a_subclass_keeps_its_attributes_and_its_detector(again: Any) -> None:
    named = _Named("north door")
    named.seen = 7
    twin = again(named)
    assert isinstance(twin, _Named) and (twin.door, twin.seen, repr(twin)) == ("north door", 7, repr(named))


class _Named(HOGDescriptor):
    """A subclass as programs have it: other arguments, attributes, and a slot."""

    __slots__ = ("__dict__", "door")

    def __init__(self, door: str) -> None:
        super().__init__()
        self.door, self.seen = door, 0
        self.setSVMDetector(self.getDefaultPeopleDetector())


def test_the_repr_tells_what_attributes_that_cannot_be_set_hold() -> None:
    hog: Any = people()
    assert "winSize=(64, 128)" in repr(hog) and "3781 coefficients" in repr(hog)
    assert "no detector" in repr(HOGDescriptor())
    for name in ("winSize", "nbins", "svmDetector", "anything"):
        with pytest.raises(AttributeError):
            setattr(hog, name, 1)
    hog.svmDetector[:] = 0
    np.testing.assert_array_equal(hog.svmDetector, hog.getDefaultPeopleDetector())


def test_none_stands_for_every_default() -> None:
    assert repr(HOGDescriptor(*GEOMETRY, *[None] * 7)) == repr(HOGDescriptor(*GEOMETRY))
    same_people(people().detectMultiScale(IMAGE, -3, *[None] * 4), people().detectMultiScale(IMAGE, -3))
    # `finalThreshold` is the old name of `groupThreshold`.
    new, old = ({"groupThreshold": 0}, {"finalThreshold": 0})
    same_people(people().detectMultiScale(IMAGE, -3, **new), people().detectMultiScale(IMAGE, -3, **old))


def test_a_flag_is_a_truth_value_or_an_integer_as_in_opencv() -> None:
    for value in (True, np.bool_(True), 1, 2, np.int64(1), 0):
        assert untyped.HOGDescriptor(*GEOMETRY, _gammaCorrection=value).gammaCorrection == bool(value)


def test_a_model_file_that_is_not_there_is_a_hog_error_and_an_os_error(tmp_path: Path) -> None:
    missing = tmp_path / "none.yml"
    for load, path in ((HOGDescriptor, missing), (HOGDescriptor().load, missing), (HOGDescriptor, tmp_path)):
        with pytest.raises(limo_hog.HogError, match=path.name) as caught:
            load(path)
        assert isinstance(caught.value, FileNotFoundError if path is missing else OSError)


@pytest.mark.parametrize("shape", [(3780,), (3781,), (3781, 1), (1, 3781)])
@pytest.mark.parametrize("kind", [list, np.float64, np.float16, np.int8])
def test_coefficients_come_as_any_row_of_numbers(shape: tuple[int, ...], kind: Any) -> None:
    values: Any = np.arange(np.prod(shape)).reshape(shape) % 100
    hog = HOGDescriptor()
    hog.setSVMDetector(values.tolist() if kind is list else values.astype(kind))
    np.testing.assert_array_equal(hog.svmDetector, values.ravel().astype(np.float32))
    hog.setSVMDetector(None)
    assert hog.svmDetector == ()


#: Without its types, so that they can be wrong.
untyped: Any = limo_hog

WRONG: list[tuple[Any, type[Exception], str]] = [
    (lambda: untyped.HOGDescriptor((64, 128)), TypeError, "_blockSize, _blockStride, _cellSize, _nbins"),
    (lambda: untyped.HOGDescriptor((64.0, 128), *GEOMETRY[1:]), TypeError, "_winSize is"),
    (lambda: untyped.HOGDescriptor((64, 128, 3), *GEOMETRY[1:]), TypeError, "_winSize is"),
    (lambda: untyped.HOGDescriptor(*GEOMETRY[:4], 9.5), TypeError, "_nbins is 9.5"),
    (lambda: untyped.HOGDescriptor((2**40, 8), *GEOMETRY[1:]), ValueError, "_winSize is"),
    (lambda: untyped.HOGDescriptor(*GEOMETRY[:4], 10**5000), ValueError, "_nbins is int of thousands of digits"),
    (lambda: people().detectMultiScale(IMAGE, scale=10**400), ValueError, "scale is 1000"),
    (lambda: people().setSVMDetector([10**400] * 3781), TypeError, "real numbers"),
    (lambda: untyped.groupRectangles([[0, 0, 1, 1]], 10**400), ValueError, "groupThreshold is 1000"),
    (lambda: people().detect(IMAGE, "1"), TypeError, "hitThreshold is '1'"),
    (lambda: people().detectMultiScale(IMAGE, scale="1"), TypeError, "scale is '1'"),
    (lambda: people().detect(IMAGE, 0, (8,)), TypeError, r"winStride is \(8,\)"),
    (lambda: people().compute(IMAGE, locations=[(0.5, 1)]), TypeError, "locations has shape"),
    (lambda: people().compute(IMAGE, locations=[(0, 1), (2,)]), TypeError, "locations has shape"),
    (lambda: people().setSVMDetector(["a"]), TypeError, "real numbers"),
    (lambda: people().setSVMDetector([[1.0], [1.0, 2.0]]), TypeError, "ragged"),
    (lambda: untyped.groupRectangles([[0, 0, 1]], 1), TypeError, r"rectList has shape \(1, 3\)"),
    (lambda: untyped.groupRectangles([[0.5, 0, 1, 1]], 1), TypeError, "float64"),
    (lambda: untyped.groupRectangles([[0, 0, 1, 1]], 1.5), TypeError, "groupThreshold is 1.5"),
    (lambda: untyped.groupRectangles([[0, 0, 1, 2**40]], 1), ValueError, "beyond"),
    (lambda: people().detect(IMAGE, 0, np.array(8)), TypeError, r"winStride is array\(8\)"),
    (lambda: untyped.HOGDescriptor(*GEOMETRY, _gammaCorrection=np.zeros(2)), TypeError, "_gammaCorrection is"),
    (lambda: people().detectMultiScale(IMAGE, useMeanshiftGrouping=np.ones(2)), TypeError, "useMeanshiftGrouping is"),
    # What OpenCV refuses, too.
    (lambda: people().detectMultiScale(None), TypeError, "the image is None: did imread find no file"),
    (lambda: people().detectMultiScale(IMAGE, useMeanshiftGrouping="no"), TypeError, "useMeanshiftGrouping"),
    (lambda: people().detectMultiScale(IMAGE, useMeanshiftGrouping=1.0), TypeError, "useMeanshiftGrouping"),
    (lambda: people().detectMultiScale(IMAGE, scale=True), TypeError, "scale is True"),
    (lambda: people().detectMultiScale(IMAGE, scale=np.bool_(True)), TypeError, "scale is np.True_|scale is True"),
    (lambda: people().detect(IMAGE, winStride=()), TypeError, r"winStride is \(\)"),
    (lambda: people().detect(IMAGE, winStride=(True, 8)), TypeError, r"winStride is \(True, 8\)"),
    (lambda: untyped.HOGDescriptor(*GEOMETRY, _gammaCorrection="x"), TypeError, "_gammaCorrection is 'x'"),
    (lambda: untyped.HOGDescriptor(*GEOMETRY, _nlevels=True), TypeError, "_nlevels is True"),
    (lambda: untyped.groupRectangles([[0, 0, 1, 1]], True), TypeError, "groupThreshold is True"),
    (lambda: untyped.groupRectangles(np.ones((3, 4), bool), 1), TypeError, "type bool"),
    (lambda: people().setSVMDetector(np.ones(3781, bool)), TypeError, "coefficients are bool"),
    (lambda: untyped.HOGDescriptor(""), ValueError, "filename is empty"),
    (lambda: people().save(""), ValueError, "filename is empty"),
    (lambda: untyped.visualize(untyped.HOGDescriptor(), np.ones(36)), ValueError, "there are 36 values"),
    (lambda: untyped.visualize(untyped.HOGDescriptor(), np.ones(3780), zoom=0), ValueError, "zoom is 0"),
    (lambda: untyped.visualize(untyped.HOGDescriptor(), np.ones(3780), zoom=1.5), TypeError, "zoom is 1.5"),
]


@pytest.mark.parametrize(("call", "kind", "told"), WRONG)
def test_a_wrong_argument_is_named_with_what_came(call: Any, kind: type[Exception], told: str) -> None:
    with pytest.raises(limo_hog.HogError, match=told) as caught:
        call()
    assert isinstance(caught.value, kind) and len(str(caught.value)) < 300


def test_arrays_given_to_compute_gradient_are_filled() -> None:
    image, hog = noise(20, 30), HOGDescriptor()
    grad, bins = np.zeros((20, 30, 2), np.float32), np.zeros((20, 30, 2), np.uint8)
    found = hog.computeGradient(image, grad, bins)
    assert found[0] is grad and found[1] is bins
    np.testing.assert_array_equal(grad, hog.computeGradient(image, np.zeros(3, np.float32))[0])
    assert hog.computeGradient(image, None, None, (-30, 0)) == ((), ())


def test_a_picture_shows_vertical_strokes_where_the_window_has_a_vertical_edge() -> None:
    window = np.zeros((128, 64), np.uint8)
    window[:, 36:] = 255
    hog = HOGDescriptor()
    picture = visualize(hog, hog.compute(window), zoom=4).astype(int)
    assert picture.shape == (512, 256, 3)
    cell = picture[256:288, 128:160].sum(2)
    assert cell[:, 12:20].sum() > 10 * max(cell[:8, :8].sum(), cell[12:20, 24:].sum())
    assert picture[:, :96].sum() == 0


def test_a_picture_of_a_detector_tells_for_from_against() -> None:
    hog = HOGDescriptor()
    for sign, strong, weak in ((1, 2, 0), (-1, 0, 2)):
        picture = visualize(hog, np.full(3781, float(sign))).astype(int)
        assert picture[..., strong].sum() > picture[..., weak].sum()
    assert visualize(hog, np.zeros(3780)).sum() == 0
    # None stands for the default, as for every other argument.
    np.testing.assert_array_equal(untyped.visualize(hog, np.ones(3780), zoom=None), visualize(hog, np.ones(3780)))
