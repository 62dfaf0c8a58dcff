"""People found in one image: boxes with their scores, as arrays, pictures and tables."""

from __future__ import annotations

import dataclasses
import os
import weakref
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, overload

import numpy as np
from numpy.typing import NDArray

from limo_hog.cv2_api.arguments import pixels
from limo_hog.exceptions import HogError, LimoHogError
from limo_hog.extras import needed
from limo_hog.models import PERSON_BOX, WHOLE_WINDOW, Calibration, PersonBox

#: Columns of a table, as `detect --csv` has them: x, y, width and height [px] of boxes and of windows.
BOX_COLUMNS, WINDOW_COLUMNS = tuple("xywh"), tuple(f"window_{side}" for side in "xywh")


def people(count: int) -> str:
    """Return "1 person", "2 people"."""
    return f"{count} {'person' if count == 1 else 'people'}"


@dataclass(frozen=True, slots=True, eq=False)
class Detections:
    """People found in one image, best first.

    `len(d)` counts them, iterating and `d[i]` give (box, score), a slice, mask or array of indices gives `Detections`.
    `boxes` are around the people, `windows` what HOG looked through; both are in pixels of the image. Two are equal if
    all that they hold is. `np.asarray(d)` is float64 (N, 5): x, y, w, h of the boxes, score. Jupyter shows a table, and
    the picture as long as the program holds it, or its file is there.

    Attributes
    ----------
    windows
        int32 (N, 4): x, y, w, h [px] of HOG's windows, which hold a margin around the person; `nms="group"` gives
        OpenCV's rectangles.
    scores
        float64 (N,): SVM margin of each window, with a second look and a share of the network's logit; descending.
    person_box
        Where the person stands in a window, as shares of it.
    calibration
        How the model's margins become probabilities; None where that was never measured.
    ids
        int64 (N,): number of each person, the same in all pictures of a film, from 1 on (`limo_hog.tracking`); None
        where nobody is tracked.
    """

    windows: NDArray[np.int32]
    scores: NDArray[np.float64]
    person_box: PersonBox = PERSON_BOX
    calibration: Calibration | None = None
    #: What was searched, for `_repr_html_`: a file's name, or a reference that keeps no image alive.
    _searched: Any = field(default=None, repr=False, compare=False)
    ids: NDArray[np.int64] | None = None

    @classmethod
    def none(cls) -> Detections:
        """Return no detections: arrays of length 0."""
        return cls(np.empty((0, 4), np.int32), np.empty(0))

    def __len__(self) -> int:
        return len(self.scores)

    def __str__(self) -> str:
        return people(len(self)) + (f", best {self.scores[0]:.2f}" if len(self) else "")

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.column_stack([self.boxes, self.scores]).astype(dtype or np.float64, copy=False)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Detections):
            return NotImplemented
        return self._held() == other._held()

    def __hash__(self) -> int:
        return hash(self._held())

    def _held(self) -> tuple[Any, ...]:
        ids = None if self.ids is None else self.ids.tobytes()
        return self.windows.tobytes(), self.scores.tobytes(), self.person_box, self.calibration, ids

    def __iter__(self) -> Iterator[tuple[NDArray[np.int32], float]]:
        for box, score in zip(self.boxes, self.scores, strict=True):
            yield box, float(score)

    @overload
    def __getitem__(self, index: int) -> tuple[NDArray[np.int32], float]: ...

    @overload
    def __getitem__(self, index: slice | NDArray[Any]) -> Detections: ...

    def __getitem__(self, index: int | slice | NDArray[Any]) -> tuple[NDArray[np.int32], float] | Detections:
        scores = self.scores[index]
        if scores.ndim == 0:
            return self.boxes[index], float(scores)
        ids = None if self.ids is None else self.ids[index]
        return dataclasses.replace(self, windows=self.windows[index], scores=scores, ids=ids)

    @property
    def boxes(self) -> NDArray[np.int32]:
        """int32 (N, 4): x, y, w, h [px] of the people, top left corner first: the windows without their margin."""
        return np.rint(self.person_box.inside(self.windows)).astype(np.int32)

    @property
    def xyxy(self) -> NDArray[np.int32]:
        """int32 (N, 4): left, top, right and bottom of the boxes [px]; right and bottom lie just outside."""
        return np.hstack([self.boxes[:, :2], self.boxes[:, :2] + self.boxes[:, 2:]])

    @property
    def probabilities(self) -> NDArray[np.float64]:
        """float64 (N,) in 0..1: probability that each box holds a person, by the model's calibration.

        Raises
        ------
        HogError
            The model has no calibration.
        """
        if self.calibration is None:
            raise HogError("the model has no calibration, so its margins stand for no probabilities: use scores")
        return self.calibration.probabilities(self.scores)

    @property
    def labels(self) -> list[str]:
        """What pictures and tables say of each box: its probability, such as "97 %"; without calibration its margin.

        A person's number comes first, such as "3: 97 %".
        """
        if self.calibration is None:
            said = [f"{score:.2f}" for score in self.scores]
        else:
            said = [f"{100 * share:.0f} %" for share in self.probabilities]
        return said if self.ids is None else [f"{who}: {word}" for who, word in zip(self.ids, said, strict=True)]

    def draw(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Draw the people's boxes and labels into a copy of the image.

        Parameters
        ----------
        image
            uint8 (H, W), (H, W, 1) or (H, W, 3) BGR.

        Returns
        -------
        uint8 (H, W, 3) BGR.

        Raises
        ------
        MissingExtraError
            OpenCV, which draws, is not installed.
        """
        from limo_hog.imaging.drawing import annotate

        return annotate(pixels(image), self.boxes, self.labels)

    def to_dict(self) -> dict[str, list[Any]]:
        """Return lists of plain numbers for JSON: boxes, windows, scores; probabilities and ids where known."""
        held = {"boxes": self.boxes.tolist(), "windows": self.windows.tolist(), "scores": self.scores.tolist()}
        if self.calibration is not None:
            held["probabilities"] = self.probabilities.tolist()
        return held if self.ids is None else {**held, "ids": self.ids.tolist()}

    def to_supervision(self) -> Any:
        """Return them as `supervision.Detections`: boxes, `tracker_id`, class 0, probabilities as `confidence`.

        Without calibration the margins are the `confidence`. Windows and margins are in `data`.
        Raises `MissingExtraError` where supervision is not installed.
        """
        with needed(by="to_supervision"):
            from supervision import Detections as Supervisions
        return Supervisions(
            xyxy=self.xyxy.astype(np.float32),
            confidence=self.scores if self.calibration is None else self.probabilities,
            class_id=np.zeros(len(self), int),
            tracker_id=self.ids,
            data={"class_name": np.full(len(self), "person"), "window": self.windows, "score": self.scores},
            metadata={"person_box": self.person_box, "calibration": self.calibration},
        )

    @classmethod
    def from_supervision(cls, found: Any) -> Detections:
        """Return `supervision.Detections`, best first: what `to_supervision` made, or another detector's.

        Another detector's boxes are their own windows, its `confidence` the scores.
        Raises `HogError` where they have no confidence.
        """
        if {"window", "score"} <= {*found.data} and found.metadata:
            return cls._best_first(found.data["window"], found.data["score"], found.tracker_id, found.metadata)
        if found.confidence is None:
            raise HogError("these supervision.Detections have no confidence; give each box one")
        boxes = np.hstack([found.xyxy[:, :2], found.xyxy[:, 2:] - found.xyxy[:, :2]])
        return cls._best_first(boxes, found.confidence, found.tracker_id, {})

    def to_pandas(self) -> Any:
        """Return a `pandas.DataFrame`, a line a person, with the columns of `detect --csv`.

        Raises `MissingExtraError` where pandas is not installed.
        """
        with needed(by="to_pandas"):
            from pandas import DataFrame
        table = DataFrame(np.hstack([self.boxes, self.windows]), columns=[*BOX_COLUMNS, *WINDOW_COLUMNS])
        shares = np.nan if self.calibration is None else self.probabilities
        table = table.assign(score=self.scores, probability=shares, **({} if self.ids is None else {"id": self.ids}))
        table.attrs |= {"person_box": self.person_box, "calibration": self.calibration}
        return table

    @classmethod
    def from_pandas(cls, table: Any) -> Detections:
        """Return the people of a `pandas.DataFrame`, best first; it needs the columns x, y, w, h and score.

        A table that `to_pandas` did not make tells nothing of a model: its boxes are their own windows.
        Raises `HogError` where a column is missing.
        """
        if missing := [name for name in (*BOX_COLUMNS, "score") if name not in table]:
            raise HogError(f"the table has no column {', '.join(missing)}; x, y, w, h and score are wanted")
        ours = {*WINDOW_COLUMNS} <= {*table} and table.attrs
        windows = table[[*(WINDOW_COLUMNS if ours else BOX_COLUMNS)]]
        return cls._best_first(windows, table["score"], table.get("id"), table.attrs if ours else {})

    @classmethod
    def _best_first(cls, windows: Any, scores: Any, ids: Any, model: Mapping[str, Any]) -> Detections:
        """Return them in the order of their scores; of no model the windows are boxes."""
        scores = np.asarray(scores, np.float64)
        order = np.argsort(-scores, kind="stable")
        windows = np.rint(np.asarray(windows)).astype(np.int32)[order]
        ids = None if ids is None else np.asarray(ids, np.int64)[order]
        return cls(windows, scores[order], model.get("person_box", WHOLE_WINDOW), model.get("calibration"), ids=ids)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the picture that was searched, with the people's boxes; the path's ending says its format.

        Raises
        ------
        HogError
            The picture is gone: the program does not hold it any more, and it has no file.
        MissingExtraError
            OpenCV, which draws, is not installed.
        OSError
            The file cannot be written; no part of it is left behind.
        """
        from pathlib import Path

        from limo_hog.imaging.inputs import as_array
        from limo_hog.imaging.writing import write_image

        searched = self._searched_now()
        if searched is None:
            raise HogError("the picture that was searched is gone: keep it in a variable, or use draw(image)")
        write_image(Path(path), self.draw(as_array(searched)))

    def show(self) -> None:
        """Open what `save` writes with the system's viewer of pictures or its browser."""
        import tempfile
        import webbrowser
        from pathlib import Path

        path = Path(tempfile.mkdtemp(prefix="limo-hog-")) / "people.png"
        self.save(path)
        webbrowser.open(path.as_uri())

    def _searched_now(self) -> Any:
        return self._searched() if isinstance(self._searched, weakref.ref) else self._searched

    def _repr_html_(self) -> str:
        # Imported here: only notebooks need it.
        from limo_hog.imaging.notebook import shown

        name = self._searched if isinstance(self._searched, str) else ""
        caption = f"{people(len(self))}{name and f' in {name}'}"
        rows = [
            [str(i), *map(str, box), label]
            for i, (box, label) in enumerate(zip(self.boxes.tolist(), self.labels, strict=True))
        ]
        meaning = "margin" if self.calibration is None else "probability"
        return shown(caption, ("", "x", "y", "width", "height", meaning), rows, self._jpeg())

    def _jpeg(self) -> bytes | None:
        """Return the small picture with the boxes; None where it is gone, or OpenCV is not installed."""
        from limo_hog.imaging.inputs import as_array
        from limo_hog.imaging.notebook import reduced

        searched = self._searched_now()
        if searched is None:
            return None
        try:
            from limo_hog.imaging.writing import jpeg

            image, divisor = reduced(pixels(as_array(searched)))
            small = dataclasses.replace(self, windows=np.asarray(self.windows // divisor, np.int32))
            return jpeg(small.draw(image))
        except (LimoHogError, OSError):
            return None

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        # A copy in another process does not know the image.
        return Detections, (self.windows, self.scores, self.person_box, self.calibration, None, self.ids)


class Detector(Protocol):
    """Finds people in images: `PeopleDetector`, those of `limo_hog.follow`, or yours."""

    def detect(self, image: NDArray[np.uint8]) -> Detections:
        """Return the people in a uint8 (H, W, 3) BGR image, best first."""
        ...


def remembered(image: Any) -> Any:
    """Return what finds an image again without keeping it alive: its file's name, or a weak reference."""
    if isinstance(image, (str, os.PathLike)):
        return os.fspath(image)
    try:
        return weakref.ref(image)
    except TypeError:
        return None
