"""The modern face of the detector: immutable, keyword-only, typed."""

from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from limo_hog import _core
from limo_hog.cv2_api.arguments import integer, number, pair, pixels, shown
from limo_hog.detections import Detections, remembered
from limo_hog.exceptions import ImageError, ParameterError, ParameterTypeError
from limo_hog.models import Model, SecondLook, is_named, load_model
from limo_hog.parallel import cores, in_order
from limo_hog.suppression import intersection_over_smaller, nms, voted

if TYPE_CHECKING:
    from PIL.Image import Image as PilImage

#: Ways to make one box of a person's many hits.
_NMS = ("overlap", "group")
#: Default of `overlap`: chosen on street photographs, where 0.5 to 0.75 hardly differ.
_OVERLAP = 0.65
#: Where a model has two windows: from this height of the smallest person [px] on the large window alone is used, the
#: image being enlarged for it. On USC-C, LAMR .27 against .32 with both at 64 px; at 48 px both are better, .29 to .31.
_LARGE_WINDOW_FROM_PX = 64.0
#: What a second look is given: windows of at least this margin, of those whose people share more than this (IoU) the
#: best, and of these the best few. On USC-C, TUD 1-41 and Penn-Fudan lower margins and more windows find nobody more.
_LOOKED_AT_FROM, _LOOKED_AT_IOU, _LOOKED_AT_MOST = -1.0, 0.7, 50
#: Of its boxes, those vote on where a person stands that overlap by this (IoU), and a vote is 1/e where the score is
#: lower by that much; .5 to .7 and .3 to 1 hardly differ on these sets.
_VOTES_FROM_IOU, _VOTE_SOFTNESS = 0.5, 0.3
#: How much a level is smaller than the one before: OpenCV's default, and that of a search which a second look follows.
_SCALE, _SCALE_LOOKED_AT = 1.05, 1.1
#: Hits that OpenCV's sample asks a group to have more than.
_GROUP_THRESHOLD = 2


class Guide(NamedTuple):
    """What of the levels between two that are searched whole is searched."""

    halvings: int  #: how often these levels are halved
    margin: float  #: how much the threshold is lowered for a neighbouring level [SVM margin]
    reach: tuple[float, float]  #: how far around a place windows are searched, across and down [strides]


#: The guide of each search. docs/simd.md shows others.
_GUIDES = {"exact": None, "guided": Guide(halvings=3, margin=0.75, reach=(0.75, 1.25))}
#: More levels than a pyramid of the finest `scale` and the largest image can have.
_LEVELS = 2048
#: Bounds of arguments, so that no image grows, and no pyramid is cut, beyond what memory and `_LEVELS` hold.
_FINEST_SCALE, _LEAST_HEIGHT_PX, _MOST_PIXELS = 1.005, 8.0, 2**28


@dataclass(frozen=True, kw_only=True)
class PeopleDetector:
    """Finds standing and walking people in images; immutable, may be shared between threads.

    All arguments are checked when it is made. The windows of `PeopleDetector(model="opencv", min_height=None,
    nms="group")` are the rectangles of `cv2.HOGDescriptor`'s `detectMultiScale` (winStride 8, padding 4, scale 1.05).

    Attributes
    ----------
    model
        "limo" (our weights, window 64 × 128; people below 64 px are sought with a second one of 48 × 96), "opencv"
        (OpenCV's default, window 64 × 128; also "default"), "daimler" (OpenCV's, window 48 × 96), or the path of a file
        that OpenCV or limo-hog wrote; or a `Model`; see `limo_hog.models.load_model`.
    min_height
        Height of the smallest person to find [px], head to foot: the image is enlarged (or reduced) until they fill
        the model's window. Half the height takes four times the time. None searches the image as it is: people from
        75 px on, for "opencv" 100.
    max_height
        Height of the tallest person to report [px]; None reports all.
    threshold
        Least score of a hit; raise it for fewer false alarms, lower it (to -1 and below) for fewer misses. None
        is the model's own: 0 for OpenCV's.
    nms
        How one window is chosen of a person's many hits, which are compared by the boxes around the person in them.
        "overlap": the best hit stays and removes those that share more than `overlap` of the smaller box's area;
        "group": OpenCV's grouping of the windows.
    overlap
        0..1; None: 0.65.
    group_threshold
        For "group": similar hits must be more than this to make a detection (None: 2); 0 returns every hit.
    win_stride
        Distance of neighbouring windows (x, y) [px of each pyramid level].
    padding
        Mirrored border around each level (x, y) [px], at most the window's size.
    scale
        How much each level is smaller than the one before, 1.005 or more. None: 1.1 with a second look, 1.05 without.
    search
        "exact": all levels, every window. "guided": every eighth level, and those between only around what was found
        on the levels around them: about twice as fast, and a raw hit in two hundred is missed (docs/simd.md).
        Geometries without kernels are searched whole.
    second_look
        A small network looks again at the best 50 windows, the most that are then found in an image; a score is SVM
        margin + a share of the network's logit, and `threshold` applies to it; boxes, and windows with them, are moved
        and stretched to where the network sees the person. For "limo", `nms="overlap"` and `search="exact"` (a guide
        that follows every candidate takes longer). None: where it can be had. False: every step is HOG's.

    Raises
    ------
    ParameterError, ParameterTypeError
        An argument is out of its range or of the wrong type.
    ModelFormatError, GeometryError, DetectorSizeError, OSError
        The model's file is damaged or cannot be read.
    """

    model: str | os.PathLike[str] | Model = "limo"
    min_height: float | None = 64.0
    max_height: float | None = None
    threshold: float | None = None
    nms: Literal["overlap", "group"] = "overlap"
    overlap: float | None = None
    group_threshold: int | None = None
    win_stride: tuple[int, int] = (8, 8)
    padding: tuple[int, int] = (4, 4)
    scale: float | None = None
    search: Literal["exact", "guided"] = "exact"
    second_look: bool | None = None
    _model: Model = field(init=False, repr=False, compare=False)
    _hogs: tuple[_core.Hog, ...] = field(init=False, repr=False, compare=False)
    #: The network and its words, where there is a second look.
    _look: tuple[_core.SecondLook, SecondLook] | None = field(init=False, repr=False, compare=False)
    #: How much images are enlarged, and each level is smaller than the one before.
    _zoom: float = field(init=False, repr=False, compare=False)
    _step: float = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        model = load_model(self.model)
        if not is_named(self.model):
            # Kept, since a file may change: copies and pickles are the same detector.
            self._set(model=model)
        self._check_nms()
        _word("search", self.search, _GUIDES)
        self._set(
            _model=model,
            threshold=None if self.threshold is None else number("threshold", self.threshold),
            scale=None if self.scale is None else number("scale", self.scale, _FINEST_SCALE),
            win_stride=_pair("win_stride", self.win_stride, 1, None),
            padding=_pair("padding", self.padding, 0, model.geometry.winSize),
        )
        if self.min_height is not None:
            self._set(min_height=number("min_height", self.min_height, _LEAST_HEIGHT_PX))
        enlarged_enough = self.min_height is not None and self.min_height >= _LARGE_WINDOW_FROM_PX
        # OpenCV's grouping knows one window only.
        smaller = None if enlarged_enough or self.nms == "group" else model.smaller
        least = (smaller or model).person_height
        zoom = 1.0 if self.min_height is None else least / self.min_height
        if self.min_height is not None and smaller is not None:
            zoom = max(zoom, model.person_height / _LARGE_WINDOW_FROM_PX)
        self._check_max_height(least if self.min_height is None else self.min_height)
        look = self._compiled_look()
        step = self.scale or (_SCALE if look is None else _SCALE_LOOKED_AT)
        self._set(_zoom=zoom, _step=step, _look=look, _hogs=tuple(self._compiled(smaller, step)))

    @property
    def least_score(self) -> float:
        """Least score of a hit: `threshold`, or the default that stands for None."""
        if self.threshold is not None:
            return self.threshold
        return (self._model if self._look is None else self._look[1]).threshold

    def _compiled_look(self) -> tuple[_core.SecondLook, SecondLook] | None:
        """Return the network, where there is to be a second look."""
        if not isinstance(self.second_look, (bool, np.bool_, type(None))):
            raise ParameterTypeError(f"second_look is {shown(self.second_look)}; True, False or None is wanted")
        look = None if self.nms == "group" or self.search != "exact" else self._model.second_look
        if look is None and self.second_look:
            needs = 'a model that has one ("limo"), nms="overlap" and search="exact"'
            raise ParameterError(f"second_look is True; it needs {needs}")
        wanted = self.second_look is None or bool(self.second_look)
        if look is None or not wanted:
            return None
        return look.compiled(), look

    def _compiled(self, smaller: Model | None, step: float) -> Iterator[_core.Hog]:
        """Yield the model's detector and, where it serves, the one for smaller people, up to the size of the former."""
        model = self._model
        yield model.geometry._replace(nlevels=_LEVELS).compiled(model.coefficients)
        if smaller is not None:
            levels = math.ceil(math.log(model.person_height / smaller.person_height) / math.log(step))
            yield smaller.geometry._replace(nlevels=levels).compiled(smaller.coefficients)

    def _check_max_height(self, least: float) -> None:
        if self.max_height is not None:
            self._set(max_height=number("max_height", self.max_height, 0))
            if self.max_height < least:
                raise ParameterError(
                    f"max_height is {self.max_height:g}; at least {least:g} is wanted, the height of the smallest "
                    "person sought (min_height)"
                )

    def _check_nms(self) -> None:
        _word("nms", self.nms, _NMS)
        if self.overlap is not None:
            if self.nms == "group":
                raise ParameterError('overlap has no meaning for nms="group"; leave it out, or choose another nms')
            self._set(overlap=number("overlap", self.overlap, 0, 1))
        if self.group_threshold is not None:
            if self.nms != "group":
                raise ParameterError(f'group_threshold has no meaning for nms="{self.nms}"; it needs nms="group"')
            if integer("group_threshold", self.group_threshold, 0) < 0:
                raise ParameterError(f"group_threshold is {self.group_threshold}; 0 or more is wanted")

    def _set(self, **checked: object) -> None:
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    def detect(self, image: NDArray[np.uint8] | str | os.PathLike[str] | PilImage) -> Detections:
        """People in `image`, best first.

        Parameters
        ----------
        image
            uint8 (H, W), (H, W, 1) or (H, W, 3), colours in any order; the name of a picture's file; or a PIL image.

        Raises
        ------
        ImageError
            It is no such image, or would be too large at the size that `min_height` asks for.
        MissingExtraError
            A file is to be read, and neither OpenCV nor Pillow is installed.
        OSError
            The file cannot be read.
        """
        return self._detect(image, None)

    def detect_many(
        self, images: Iterable[NDArray[np.uint8] | str | os.PathLike[str] | PilImage]
    ) -> Iterator[Detections]:
        """People in each of many images, in their order: as `detect`, but every core works on an image of its own.

        Small images leave cores idle that share one; here they do not. Files are read by the same threads. Images are
        taken as results are, twice as many ahead as there are threads (`set_num_threads`).

        Raises
        ------
        ImageError, MissingExtraError, OSError
            As `detect`, at the image's turn.
        """
        yield from in_order(lambda image: self._detect(image, 1), images, min(_core.get_num_threads(), cores()))

    def _detect(self, image: NDArray[np.uint8] | str | os.PathLike[str] | PilImage, threads: int | None) -> Detections:
        """Return the people in `image`, found by so many threads (None: by as many as `set_num_threads` allows)."""
        searched = remembered(image)
        if not isinstance(image, np.ndarray):
            # Imported here, as programs that read pictures themselves do not need it.
            from limo_hog.imaging.inputs import as_array

            image = as_array(image)
        image = pixels(image)
        size = self._searched_size(image)
        reading = self._model if self._look is None else self._look[1]
        members: int | None = None
        if self.nms == "group":
            members = _GROUP_THRESHOLD if self.group_threshold is None else self.group_threshold
        hits = [
            hog.detect_multi_scale(
                image,
                hit_threshold=self.least_score if self._look is None else _LOOKED_AT_FROM,
                win_stride=self.win_stride,
                padding=self.padding,
                scale=self._step,
                similar=members,
                searched_size=size,
                guide=_GUIDES[self.search],
                threads=threads,
            )
            for hog in self._hogs
        ]
        boxes, scores = (np.concatenate(parts) for parts in zip(*hits, strict=True))
        zoom = np.tile(np.array(size) / image.shape[1::-1], 2)
        if self._look is not None:
            found, scores = self._looked_at_again(self._look, image, boxes / zoom, scores, threads)
        else:
            people = self._model.person_box.inside(boxes)
            kept = np.argsort(-scores, kind="stable") if self.nms == "group" else self._best(people, scores)
            found, scores = boxes[kept] / zoom, scores[kept]
        if self.max_height is not None:
            # A level's window is rounded to whole pixels.
            low = self._model.person_box.height * found[:, 3] <= self.max_height + 0.5
            found, scores = found[low], scores[low]
        boxes = np.rint(found).astype(np.int32)
        return Detections(boxes, scores, self._model.person_box, reading.calibration, searched)

    def _best(self, people: NDArray[np.float64], scores: NDArray[np.float64]) -> NDArray[np.intp]:
        """Return which boxes to keep, one for each person, best first."""
        # Boxes are compared, not windows: those of two people side by side share most of their margins.
        return nms(people, scores, _OVERLAP if self.overlap is None else self.overlap, intersection_over_smaller)

    def _looked_at_again(
        self,
        look: tuple[_core.SecondLook, SecondLook],
        image: NDArray[np.uint8],
        windows: NDArray[np.float64],
        margins: NDArray[np.float64],
        threads: int | None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the people's windows (K, 4) [px], corrected by the network, and their scores, best first."""
        (network, reading), person_box = look, self._model.person_box
        best = nms(person_box.inside(windows), margins, _LOOKED_AT_IOU, most=_LOOKED_AT_MOST)
        windows = windows[best]
        answers = network.answers(image, windows, threads=threads)
        scores = margins[best] + reading.share * answers[:, 0]
        people = reading.moved(person_box.inside(windows), windows, answers)
        kept = self._best(people, scores)
        kept = kept[scores[kept] >= self.least_score]
        return person_box.around(voted(people, scores, kept, _VOTES_FROM_IOU, _VOTE_SOFTNESS)), scores[kept]

    def _searched_size(self, image: NDArray[np.uint8]) -> tuple[int, int]:
        """Return the size (x, y) [px] at which the smallest person in the image fills the model's window."""
        width, height = (max(1, round(side * self._zoom)) for side in image.shape[1::-1])
        if width * height > _MOST_PIXELS:
            came, limit = f"{image.shape[1]} x {image.shape[0]} px", f"at most {_MOST_PIXELS} pixels are allowed"
            if self.min_height is None:
                raise ImageError(f"the image is {came}; {limit}: make it smaller")
            raise ImageError(
                f"the image, {came}, would be {width} x {height} px to find people of {self.min_height:g} px; {limit}: "
                "raise min_height"
            )
        return width, height

    def __reduce__(self) -> tuple[Any, tuple[()]]:
        # Copies and pickles are made anew of the arguments: the compiled detector cannot be pickled.
        arguments = {name.name: getattr(self, name.name) for name in dataclasses.fields(self) if name.init}
        return partial(type(self), **arguments), ()


def _word(name: str, value: Any, words: Collection[str]) -> None:
    if not isinstance(value, str) or value not in words:
        kind = ParameterError if isinstance(value, str) else ParameterTypeError
        raise kind(f"{name} is {shown(value)}; one of {', '.join(words)} is wanted")


def _pair(name: str, value: Any, least: int, most: tuple[int, int] | None) -> tuple[int, int]:
    x, y = pair(name, value, (-1, -1))
    if min(x, y) < least or (most is not None and (x > most[0] or y > most[1])):
        bounds = f"at least {least}" if most is None else f"from ({least}, {least}) to {most}"
        raise ParameterError(f"{name} is {shown(value)}; two integers (x, y) {bounds} are wanted [px]")
    return x, y
