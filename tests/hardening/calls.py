"""What the random calls are made of: arguments, each kind of call, and what is wanted of its answer."""

import copy
import math
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
from tests.parity.goldens.case import DAIMLER, coefficients
from tests.searches import SCALES, Draw, some_geometry, some_image, some_padding

import limo_hog
from limo_hog import HOGDescriptor, PeopleDetector
from limo_hog.detections import Detections
from limo_hog.suppression import nms

#: What no argument of the API means; none of them runs code of its own.
UGLY: list[Any] = [
    *(None, (), [], "", "8", b"8", 1.5, math.nan, math.inf, -math.inf, 10**400, -(10**400), -1, 0, 1, 2**31 - 1, 2**31),
    *(-(2**31), 2**63, True, object(), (1,), (1, 2, 3), (1.5, 2), ("a", "b"), (None, 8), (8, -8), (0, 0), (2**31, 8)),
    *(np.array([8, 8]), np.array([8.0, 8.0]), np.int64(8), np.uint8(8), np.float32("nan"), np.array(5), {}, {1, 2}),
    *(1 + 2j, [[]], range(2), np.zeros((0, 4), int), np.zeros((2, 2, 2)), np.array(["a"]), np.array([None]), "\ud800"),
    *(-0.0, 1e-320),
    *((50_000, 50_000), (-(2**31), 3), 1e308, [1, [2]], np.datetime64("NaT"), type, np.zeros(3, "i4,f4")),
]


def detectors() -> list[Any]:
    """A descriptor of each kind: the people models, others that are small, each with and without an SVM."""
    drawn = [some_geometry(Draw(number)) for number in range(30)]
    small = [one for one in drawn if max(one[0]) <= 40 and HOGDescriptor(*one).getDescriptorSize() < 1000]
    # The second's blocks do not fit into the window.
    geometries = [(), DAIMLER, ((8, 8), (16, 16), (8, 8), (8, 8), 9), *small]
    found: list[Any] = []
    for number, geometry in enumerate(geometries):
        hog: Any = HOGDescriptor(*geometry)
        model: str | int = {0: "default", 1: "daimler"}.get(number, number)
        svm = coefficients(model, limo_hog, hog.getDescriptorSize())
        found += [copy.copy(hog), hog]
        hog.setSVMDetector(svm if isinstance(model, str) else svm / 10)
    return found


DETECTORS = detectors()
FINDERS = [
    PeopleDetector(**wanted)
    for wanted in (
        *({}, {"min_height": None}, {"nms": "group"}, {"threshold": -1.0}, {"model": "daimler"}),
        {"model": "limo", "min_height": 40, "padding": (0, 0)},
        {"second_look": True},
    )
]


class Arguments:
    def __init__(self, number: int) -> None:
        self.draw = Draw(number)
        #: How many of a hundred arguments are ugly.
        self.ugliness = self.draw.choice((0, 0, 3, 15))

    def some(self, *values: Any) -> Any:
        if self.ugliness and self.draw.randrange(100) < self.ugliness:
            return self.draw.choice(UGLY)
        return self.draw.choice(values)

    def options(self, **values: Any) -> dict[str, Any]:
        return {name: value() for name, value in values.items() if self.draw.random() < 0.5}

    def image(self) -> Any:
        draw = self.draw
        if self.ugliness and draw.randrange(100) < self.ugliness:
            odd = np.zeros((3, 3, draw.choice((0, 2, 4))), np.uint8)
            others = np.zeros((40, 30), np.float32), np.zeros((5, 0), np.uint8), np.ones(9, np.uint8)
            return draw.choice((*UGLY, odd, *others))
        low, high = draw.choice(((1, 20), (1, 40), (20, 50), (10, 70), (60, 140)))
        return some_image(draw, draw.randint(low, min(high, 100)), draw.randint(low, high))

    def number(self) -> Any:
        return self.some(0.0, -1.0, 0.5, -1e9, 1e9, 1.0, 2, self.draw.gauss(0, 1))

    def stride(self) -> Any:
        return self.some((8, 8), (4, 4), (16, 16), (8, 16), (5, 3), (1, 100), None, (), [8, 8])

    def padding(self) -> Any:
        return self.some(some_padding(self.draw), some_padding(self.draw), ())

    def scale(self) -> Any:
        return self.some(*SCALES, 1.000001)

    def places(self) -> Any:
        count = self.draw.choice((0, 1, 5))
        return self.some([(self.draw.randint(-20, 100), self.draw.randint(-20, 100)) for _ in range(count)], None)

    def rectangles(self) -> Any:
        draw = self.draw
        width = draw.choice((20, 20, 200, 2**31 - 1))
        found = [[draw.randint(-width, width) for _ in range(4)] for _ in range(draw.choice((0, 1, 4, 30)))]
        return self.some(found, found, np.array(found, np.int64).reshape(-1, 4))

    def svm(self, hog: Any) -> Any:
        size = max(hog.getDescriptorSize() + self.draw.choice((0, 1, 1, -1, 2)), 0)
        floats, ones, column = np.full(size, 0.01, np.float32), [1] * min(size, 50), np.full((size, 1), np.nan)
        return self.some(floats, ones, column, np.ones((1, size)), None)


def boxes_and_weights(found: Any, columns: int) -> tuple[Any, Any]:
    """The two arrays of an answer, after a look at their types."""
    assert isinstance(found, tuple) and len(found) == 2, found
    places, weights = found
    if isinstance(places, tuple) or isinstance(weights, tuple):
        assert places == () and weights == (), found
        return np.empty((0, columns), np.int32), np.empty(0)
    assert places.dtype == np.int32 and places.shape == (len(weights), columns) and len(weights), places
    return places, weights


def search(a: Arguments) -> None:
    hog, image = a.draw.choice(DETECTORS), a.image()
    options = a.options(hitThreshold=a.number, winStride=a.stride, padding=a.padding, scale=a.scale)
    options |= a.options(
        groupThreshold=lambda: a.some(0, 1, 2, 2.7, -1, 0.1, 40),
        useMeanshiftGrouping=lambda: a.some(False, False, True),
        finalThreshold=lambda: a.some(0, 2, None),
    )
    if options.get("useMeanshiftGrouping", False) is not False:
        # Its time grows with the square of the hits. (What is no bool may stand for True.)
        options["hitThreshold"] = 1.0
    boxes, weights = boxes_and_weights(hog.detectMultiScale(image, **options), 4)
    assert weights.dtype == np.float64
    if not len(boxes):
        return
    height, width = (*image.shape, 1)[:2]
    assert (boxes[:, :2] >= 0).all() and (boxes[:, 2:] >= 0).all(), boxes
    assert (boxes[:, :2] + boxes[:, 2:] <= (width, height)).all(), (boxes, image.shape)
    if options.get("useMeanshiftGrouping", False) is False:
        assert_reached(weights, options.get("hitThreshold"))


def assert_reached(weights: Any, threshold: Any) -> None:
    assert (weights >= float(0.0 if threshold is None else threshold)).all(), weights


def windows(a: Arguments) -> None:
    hog = a.draw.choice(DETECTORS)
    image = a.image()
    options = a.options(hitThreshold=a.number, winStride=a.stride, padding=a.padding, searchLocations=a.places)
    _, weights = boxes_and_weights(hog.detect(image, **options), 2)
    if len(weights):
        assert_reached(weights, options.get("hitThreshold"))


def descriptors(a: Arguments) -> None:
    hog = a.draw.choice(DETECTORS[:10])
    found = hog.compute(a.image(), **a.options(winStride=a.stride, padding=a.padding, locations=a.places))
    if isinstance(found, tuple):
        assert found == ()
    else:
        assert found.dtype == np.float32 and found.ndim == 1 and len(found) % hog.getDescriptorSize() == 0
        assert np.isfinite(found).all() and (found >= 0).all() and (found <= 1).all()


def gradients(a: Arguments) -> None:
    hog, image = a.draw.choice(DETECTORS), a.image()
    around = a.options(paddingTL=a.padding, paddingBR=a.padding)
    target = a.some(None, None, np.zeros((9, 9, 2), np.float32), np.zeros((4, 4, 2), np.uint8))
    shares, bins = hog.computeGradient(image, target, None, **around)
    if not isinstance(shares, tuple):
        assert shares.dtype == np.float32 and bins.dtype == np.uint8 and shares.shape == bins.shape, (shares, bins)
        assert shares.shape[2] == 2 and (shares >= 0).all() and (bins < hog.nbins).all()


def grouping(a: Arguments) -> None:
    rects, threshold = a.rectangles(), a.some(0, 1, 2, 3, -1, 100)
    eps = a.options(eps=lambda: a.some(0.2, 0.0, -1.0, 5.0, 0.05))
    _, counts = boxes_and_weights(limo_hog.groupRectangles(rects, threshold, **eps), 4)
    assert int(counts.sum()) <= (0 if rects is None else len(rects))
    if isinstance(threshold, int) and threshold > 0:
        assert (counts > threshold).all(), counts


def construction(a: Arguments) -> None:
    size: Callable[[], Any] = lambda: a.some((8, 8), (16, 16), (16, 8), (32, 16), (64, 128), (33, 8), [24, 24])  # noqa: E731
    arguments = [size(), size(), size(), size(), a.some(9, 1, 18, 64, 256)]
    more = [a.some(1, 3), a.some(-1.0, 4, 0.1), a.some(0, 1), a.some(0.2, 0, 5.0)]
    more += [a.some(True, False), a.some(64, 1, 2), a.some(False, True)]
    hog: Any = HOGDescriptor(*arguments, *more[: a.draw.randrange(8)])
    repr(hog), hog.getWinSigma()
    hog.setSVMDetector(a.svm(hog))
    assert hog.checkDetectorSize() is True
    again: Any = pickle.loads(pickle.dumps(copy.deepcopy(hog)))
    assert repr(again) == repr(hog)
    np.testing.assert_array_equal(again.svmDetector, hog.svmDetector)


def svms(a: Arguments) -> None:
    hog = copy.copy(a.draw.choice(DETECTORS[4:]))
    before = np.array(hog.svmDetector)
    try:
        hog.setSVMDetector(a.svm(hog))
    except limo_hog.HogError:
        np.testing.assert_array_equal(np.array(hog.svmDetector), before)
        raise


def finding(a: Arguments) -> None:
    image = a.image()
    found = a.draw.choice(FINDERS).detect(image)
    assert isinstance(found, Detections) and found.windows.dtype == np.int32 and found.windows.shape == (len(found), 4)
    assert (np.diff(found.scores) <= 0).all(), found.scores
    assert found.boxes.shape == (len(found), 4)


def finders(a: Arguments) -> None:
    options = a.options(
        model=lambda: a.some("opencv", "daimler", "limo", "/nowhere"),
        min_height=lambda: a.some(64, 100.0, None, 8, 7),
        max_height=lambda: a.some(None, 500, 64, 1),
        threshold=a.number,
        nms=lambda: a.some("overlap", "group"),
        overlap=lambda: a.some(None, 0.5, 0, 1, 7),
        group_threshold=lambda: a.some(None, 0, 2, -2),
    )
    options |= a.options(win_stride=a.stride, padding=a.padding, scale=a.scale, second_look=lambda: a.some(False, True))
    repr(PeopleDetector(**options))


def detections(a: Arguments) -> None:
    count = a.draw.choice((0, 1, 7))
    boxes = np.array([[a.draw.randint(-5, 90) for _ in range(4)] for _ in range(count)], np.int32).reshape(-1, 4)
    scores = -np.sort(-np.array([a.draw.gauss(0, 1) for _ in range(count)]))
    found = Detections(boxes, scores)
    kept = nms(boxes, scores, a.draw.random())
    assert len(kept) == len(set(kept.tolist())) <= count
    drawn = found.draw(a.image())
    assert drawn.dtype == np.uint8 and drawn.ndim == 3
    assert len(pickle.loads(pickle.dumps(found[kept]))) == len(kept)


def threads(a: Arguments) -> None:
    limo_hog.set_num_threads(a.some(1, 2, 3))
    assert 1 <= limo_hog.get_num_threads() <= 1024
    search(a)


#: Each kind of call, as often as it is made: what takes long is rare.
KINDS = [search] * 8 + [windows] * 16 + [descriptors] * 12 + [gradients] * 14 + [grouping] * 24 + [construction] * 6
KINDS += [svms] * 6 + [threads, finding, finders, detections]


def call(number: int) -> str:
    """Make call `number`; return how it ended, "" or the error's class, or raise what is a finding."""
    limo_hog.set_num_threads(1)
    arguments = Arguments(number)
    kind = arguments.draw.choice(KINDS)
    try:
        kind(arguments)
    except (limo_hog.LimoHogError, MemoryError) as error:
        assert str(error), f"a {type(error).__name__} without a message"
        return type(error).__name__
    except OSError as error:
        # A model's file that is not there.
        assert kind in (finders, finding), kind
        return type(error).__name__
    return ""
