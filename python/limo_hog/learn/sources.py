"""What a detector is to learn from: objects in crops or labelled pictures, negatives, and pictures to measure it on."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from limo_hog.imaging.reading import Kind, ReadError, find_sources
from limo_hog.learn.formats import holds_labels, read_labels
from limo_hog.learn.labels import LabelError, LabelWarning, Picture, choose, inside, sizes_of
from limo_hog.learn.mining import Negatives, readable
from limo_hog.learn.windows import Region, WindowShape, positive_regions, shape_for

#: Fewer objects than this are warned of: a window has thousands of numbers, and so few examples are learnt by heart.
_FEW = 100


@dataclass(frozen=True)
class Provenance:
    """Files of one kind: the folder or file they came from, how many, and the hash of their names and bytes."""

    name: str
    files: int
    sha256: str


@dataclass(frozen=True)
class TrainingData:
    """All that a detector is made of."""

    shape: WindowShape  #: the window
    regions: tuple[Region, ...]  #: a window around each object; one without width is a whole picture, a crop
    negatives: Negatives  #: pictures to take negatives from
    #: Labelled pictures that are not learnt from; where there are none, the detector is not measured.
    validation: tuple[Picture, ...]
    min_height: float  #: height [px] from which objects are sought when the detector is measured
    sources: tuple[Provenance, ...]  #: of each input, what it held


@dataclass(frozen=True)
class Wanted:
    """What the user asked for."""

    #: data, negatives: labels or folders of crops; folders of pictures without the object.
    data: tuple[Path, ...]
    negatives: tuple[Path, ...] = ()
    validation: Path | None = None  #: labels to measure on; None holds back a share of the pictures in `data`
    #: label, window: which label; the window's size [px].
    label: str | None = None
    pictures: Path | None = None
    window: tuple[int, int] | None = None
    held_out: float = 0.2  #: share held back
    seed: int = 0  #: of the choice of what is held back


def gather(wanted: Wanted) -> TrainingData:
    """Read labels, choose the window, and part what is held out.

    Raises `LabelError` where there is no object, or no negative, or the labels cannot be read; `ReadError` where a
    folder holds no picture; `OSError` where a file cannot be read. Warns `LabelWarning` where a part of the data is
    left out, or there is little of it.
    """
    labels = [path for path in wanted.data if holds_labels(path)]
    crops = [path for folder in wanted.data if folder not in labels for path in _pictures(folder)]
    labelled = _clean([picture for path in labels for picture in read_labels(path, wanted.pictures)], wanted.label)
    if wanted.validation is not None:
        validation = _clean(read_labels(wanted.validation), wanted.label)
        training = labelled
    else:
        training, validation = _held_out(labelled, wanted.held_out, wanted.seed)
    if training:
        shape = shape_for(sizes_of(training), wanted.window)
    else:
        shape = WindowShape(wanted.window) if wanted.window else WindowShape()
    regions = (*positive_regions(training, shape), *(Region(path, (0.0, 0.0, 0.0, 0.0)) for path in crops))
    free = [path for folder in wanted.negatives for path in _pictures(folder)]
    if not free and not training:
        raise LabelError(
            "there are crops only, and nothing that shows no such object: name pictures without it by --negatives DIR"
        )
    if len(regions) < _FEW:
        warnings.warn(f"{len(regions)} objects only: a detector wants {_FEW} or more", LabelWarning, stacklevel=2)
    if not validation:
        said = "no labelled picture is left to measure on: the card has no figures; name some by --validate"
        warnings.warn(said, LabelWarning, stacklevel=2)
    objects = {picture.path: picture.arrays()[0] for picture in training}
    sources = [_source(path, crops, labelled, free) for path in (*wanted.data, *wanted.negatives)]
    return TrainingData(
        shape,
        regions,
        Negatives((*free, *objects), objects),
        tuple(validation),
        _min_height(training, shape),
        tuple(sources),
    )


def _pictures(folder: Path) -> list[Path]:
    found = [source.path for source in find_sources(str(folder)) if source.kind is Kind.IMAGE]
    if not found:
        raise ReadError(f"{folder}: no picture in this folder")
    return found


def _clean(pictures: Sequence[Picture], label: str | None) -> list[Picture]:
    """Return pictures that can be read, with the boxes that lie in them."""
    if not pictures:
        return []
    clean = []
    for picture in choose(pictures, label):
        image = readable(picture.path)
        if image is not None:
            clean.append(inside(picture, (image.shape[1], image.shape[0])))
    if not len(sizes_of(clean)):
        raise LabelError(f"no labelled box in the {len(clean)} pictures that can be read; at least one is wanted")
    return clean


def _held_out(pictures: list[Picture], share: float, seed: int) -> tuple[list[Picture], list[Picture]]:
    """Part pictures at random; those with an object are parted on their own, so that both parts have some.

    Where there are too few of them to hold one out, nothing is: no figure can be measured without an object.
    """
    rng = np.random.default_rng([seed, 4])
    held: set[int] = set()
    for holding in (True, False):
        numbers = [i for i, picture in enumerate(pictures) if bool(len(sizes_of([picture]))) == holding]
        count = min(round(share * len(numbers)), len(numbers) - 1)
        if count > 0:
            held.update(rng.choice(numbers, count, replace=False).tolist())
        if not held:
            break
    rest = [picture for i, picture in enumerate(pictures) if i not in held]
    return rest, [pictures[i] for i in sorted(held)]


def _min_height(training: list[Picture], shape: WindowShape) -> float:
    """Return a height that most (95 %) of the objects have; of crops, what `PeopleDetector` has."""
    own = shape.object_box.height * shape.size[1]
    if not training:
        return min(64.0, own)
    return float(max(8, min(own, np.floor(np.percentile(sizes_of(training)[:, 1], 5)))))


def _source(path: Path, crops: list[Path], labelled: list[Picture], free: list[Path]) -> Provenance:
    within = path if path.is_dir() else path.parent
    files = {file for file in (*crops, *free, *(picture.path for picture in labelled)) if file.is_relative_to(within)}
    return Provenance(path.resolve().name, len(files), hash_of(files | ({path} if path.is_file() else set()), within))


def hash_of(files: Iterable[Path], folder: Path) -> str:
    """Return the SHA-256 of files: of each, in the order of their names below `folder`, name, length and bytes."""
    digest = hashlib.sha256()
    for name, file in sorted((file.relative_to(folder).as_posix(), file) for file in files):
        data = file.read_bytes()
        digest.update(f"{name}\0{len(data)}\0".encode())
        digest.update(data)
    return digest.hexdigest()
