"""Results of a `detect` run: JSON lines that are whole whatever happens, what an earlier run has done, CSV and COCO."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from limo_hog.atomic import about, json_text, part_of, write_text
from limo_hog.cli.support.output import STDOUT, emit, refuse_to_overwrite
from limo_hog.detections import BOX_COLUMNS, WINDOW_COLUMNS, Detections
from limo_hog.exceptions import LimoHogError

#: One line: source, frame, width, height, boxes, windows, scores, probabilities, ids if tracked, ms, parameters.
Result = dict[str, Any]
#: What of a line is about the picture, and what has an entry for each person.
_PICTURE = ("source", "frame", "width", "height")
_EACH = ("boxes", "windows", "scores", "probabilities")
#: What of a line is read back.
_KINDS: dict[str, type] = {"source": str, "frame": int, "width": int, "height": int, "parameters": dict}
_KINDS |= dict.fromkeys(_EACH, list)


@dataclass(frozen=True)
class Row:
    """The people found in one picture."""

    source: str
    frame: int
    width: int
    height: int
    people: Detections
    ms: float
    at: float  #: its time in the film [s]; that of a clock for a live source

    def result(self) -> Result:
        """Return it as plain values; a model without calibration has None for each probability."""
        people = self.people
        shares = people.probabilities.round(4).tolist() if people.calibration else [None] * len(people)
        picture = {name: getattr(self, name) for name in _PICTURE}
        return picture | people.to_dict() | {"probabilities": shares, "ms": self.ms}


#: A function that writes a result, and the results of an earlier run (None if no file is kept).
Results = tuple[Callable[[Result], None], list[Result] | None]


@contextmanager
def json_lines(
    target: str | None, parameters: dict[str, Any], resume: bool, overwrite: bool, only: bool
) -> Iterator[Results]:
    """Open a file (or "-", or nothing) for one JSON object a line; each gets the run's `parameters`.

    Where the run writes `only` this, a reader of standard output who has left ends it.

    The file gets its name at the end, or when the run is stopped: with every line written so far, and no half line.
    A killed run leaves the unfinished file beside it, which can be resumed, too. A pipe or a device keeps nothing.

    Raises
    ------
    UsageError
        The file is there, and the run neither resumes nor overwrites.
    LimoHogError
        The file is not of an earlier run with the same parameters.
    """
    if target is None or target == STDOUT:
        # Flushed line by line for a reader at the other end of a pipe.
        say = emit if only else partial(print, flush=True)
        show = (lambda result: say(json_text(result | {"parameters": parameters}))) if target else lambda _: None
        yield show, None
        return
    path = Path(target)
    part = part_of(path)
    kept = part != path
    if not resume and not overwrite:
        refuse_to_overwrite([part], ", --resume goes on from it")
    earlier = None if not kept else _continue(path, part, parameters) if resume else []
    with about(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        opened = part.open("ab" if kept and resume else "wb", buffering=0)
    with opened as file:
        whole = file.tell() if kept else 0

        def write(result: Result) -> None:
            nonlocal whole
            line = json_text(result | {"parameters": parameters}).encode() + b"\n"
            written = 0
            with about(path):
                while written < len(line):
                    written += file.write(line[written:])
            whole += len(line)

        try:
            yield write, earlier
        finally:
            if kept:
                # A full disk may have taken half a line.
                file.truncate(whole)
                part.replace(path)


def _continue(path: Path, part: Path, parameters: dict[str, Any]) -> list[Result]:
    """Rename an earlier run's file to `part`, cut half a line off its end, and return its results."""
    found = part if part.exists() else path
    if not found.exists():
        return []
    text = found.read_bytes()
    whole = text.rfind(b"\n") + 1
    try:
        results = [json.loads(line) for line in text[:whole].splitlines()]
    except (ValueError, RecursionError) as error:
        raise LimoHogError(f"{path}: not the JSON lines of an earlier run") from error
    for number, result in enumerate(results, 1):
        if not _is_result(result):
            raise LimoHogError(f"{path}: not the JSON lines of an earlier run: line {number} is another")
        if result["parameters"] != parameters:
            was = result["parameters"]
            names = [name for name in {**parameters, **was} if was.get(name) != parameters.get(name)]
            different = ", ".join(f"{name} {was.get(name)}, now {parameters.get(name)}" for name in names)
            raise LimoHogError(f"{path} was made with other parameters: {different}")
    found.replace(part)
    with part.open("rb+") as file:
        file.truncate(whole)
    return results


def _is_result(line: Any) -> bool:
    """Say whether a line read back is a result whole enough to go on from and to make tables of."""
    return (
        isinstance(line, dict)
        and all(isinstance(line.get(name), kind) for name, kind in _KINDS.items())
        and isinstance(line.get("ids", []), list)
        and len({len(line[name]) for name in (*_EACH, "ids") if name in line}) == 1
        and all(isinstance(number, int) for number in line.get("ids", []))
        and all(isinstance(box, list) and len(box) == 4 for box in (*line["boxes"], *line["windows"]))
        and all(
            isinstance(number, (int, float))
            for numbers in (*line["boxes"], *line["windows"], line["scores"])
            for number in numbers
        )
        and all(share is None or isinstance(share, (int, float)) for share in line["probabilities"])
    )


def _people(result: Result) -> Iterator[tuple[list[int], list[int], float, float | None, int | None]]:
    """Yield box, window, margin, probability and number of each person; without a tracker the number is None."""
    ids = result.get("ids", [None] * len(result["boxes"]))
    return zip(*(result[name] for name in _EACH), ids, strict=True)


def write_csv(path: Path, results: Iterable[Result]) -> None:
    """Write a line a person: source, frame and size of the picture; box and window [px]; score, probability, number."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    results = list(results)
    known = ("id",) if any("ids" in result for result in results) else ()
    heads = (*BOX_COLUMNS, *WINDOW_COLUMNS, "score", "probability", *known)
    table.writerow((*_PICTURE, *heads))
    for result in results:
        about_picture = [result[name] for name in _PICTURE]
        for box, window, score, probability, number in _people(result):
            table.writerow((*about_picture, *box, *window, score, probability, *([number] if known else ())))
    write_text(path, text.getvalue())


def write_coco(path: Path, results: Iterable[Result]) -> None:
    """Write one JSON object of images, annotations and the category person, as COCO has them.

    Each annotation has its `score`, the SVM's margin, and, beyond COCO, its `probability`, HOG's `window` and, where
    people are tracked, `track_id`.
    """
    images: list[Result] = []
    annotations: list[Result] = []
    for number, result in enumerate(results, 1):
        size = {"width": result["width"], "height": result["height"]}
        images.append({"id": number, "file_name": result["source"], "frame": result["frame"], **size})
        for box, window, score, probability, who in _people(result):
            annotation = {"id": len(annotations) + 1, "image_id": number, "category_id": 1, "bbox": box}
            annotation |= {"area": box[2] * box[3], "iscrowd": 0, "score": score}
            annotation |= {} if who is None else {"track_id": who}
            annotations.append(annotation | {"probability": probability, "window": window})
    categories = [{"id": 1, "name": "person"}]
    table = {"images": images, "annotations": annotations, "categories": categories}
    write_text(path, json_text(table) + "\n")


def write_mot(path: Path, results: Iterable[Result]) -> None:
    """Write MOTChallenge's lines: frame, id, left, top, width, height, score, -1, -1, -1; it counts from 1."""
    results = list(results)
    film = any(result["frame"] for result in results)
    lines = [
        f"{result['frame'] + 1 if film else place},{who},{x + 1},{y + 1},{w},{h},{score:.4f},-1,-1,-1\n"
        for place, result in enumerate(results, 1)
        for (x, y, w, h), _, score, _, who in _people(result)
    ]
    write_text(path, "".join(lines))
