"""Training of a linear SVM by rounds of hard-negative mining (Dalal and Triggs 2005; Felzenszwalb et al. 2010).

A round searches all negatives with the detector it has, adds what that takes for an object, and solves again.
"""

from __future__ import annotations

import io
import json
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from limo_hog import _core
from limo_hog.atomic import about, whole_file
from limo_hog.exceptions import LimoHogError
from limo_hog.learn.labels import LabelError
from limo_hog.learn.mining import (
    Mined,
    MiningParameters,
    cut_again,
    describe_objects,
    hard_negatives,
    random_negatives,
)
from limo_hog.learn.solver import solve
from limo_hog.learn.sources import TrainingData
from limo_hog.learn.windows import Jitter

Item = TypeVar("Item")
#: Told of each step done: the stage, and how many steps it has (None: unknown).
Progress = Callable[[str, int | None], None]


class ResumeError(LimoHogError):
    """The run that is to be resumed is not there, or was of other data or parameters."""


@dataclass(frozen=True)
class TrainingParameters:
    """How a detector is trained; chosen on USC-C and TUD-Stadtmitte, frames 1 to 41.

    Attributes
    ----------
    c
        Weight of the loss against ½‖w‖²; .0003 to .01 were tried.
    bias_feature
        The constant feature that makes the bias.
    rounds
        Of hard-negative mining; the first gives most.
    mirror
        Take each object the other way round, too.
    held_out
        Share of crops held back to measure on, where there are no labelled pictures.
    most_bytes
        Most memory of descriptors [B]; beyond it the least hard new negatives are left out.
    seed
        Of all that is drawn.
    """

    c: float = 0.003
    bias_feature: float = 10.0
    rounds: int = 3
    mirror: bool = True
    held_out: float = 0.2
    most_bytes: int = 2**31
    seed: int = 0
    jitter: Jitter = field(default_factory=Jitter)
    mining: MiningParameters = field(default_factory=MiningParameters)


@dataclass(frozen=True)
class Round:
    """What a round came to; round 0 has random negatives only.

    Attributes
    ----------
    coefficients
        float64 (D + 1,): weights and bias.
    objects, negatives
        How many different objects, and how many negatives, were learnt from.
    new, left_out
        Hard negatives that the round added, and those that were too many for the memory.
    descriptor_bytes
        Memory of all descriptors [B].
    held_out_margins
        float64 (n,): SVM margins of the crops held back.
    seconds
        Since training began.
    """

    number: int
    coefficients: NDArray[np.float64]
    objects: int
    negatives: int
    new: int
    left_out: int
    descriptor_bytes: int
    objective: float
    iterations: int
    held_out_margins: NDArray[np.float64]
    seconds: float


@dataclass
class State:
    """What a stopped run needs to go on: the detector of each round, and the negatives each has mined.

    Attributes
    ----------
    fingerprint
        Of the data and parameters, which may not change in between.
    coefficients
        Of each round, float64 (D + 1,).
    mined
        Of each round from 1 on: by picture, the boxes, float64 (n, 4) [px].
    records
        Of each round, what the card says of it.
    """

    fingerprint: str
    coefficients: list[NDArray[np.float64]] = field(default_factory=list)
    mined: list[dict[int, NDArray[np.float64]]] = field(default_factory=list)
    records: list[dict[str, Any]] = field(default_factory=list)

    def save(self, path: Path) -> None:
        """Write the state; no part of it is left where that fails."""
        rows = [
            np.column_stack([np.full(len(boxes), i), np.full(len(boxes), picture), boxes])
            for i, mined in enumerate(self.mined)
            for picture, boxes in mined.items()
        ]
        packed = io.BytesIO()
        np.savez_compressed(
            packed,
            fingerprint=np.array(self.fingerprint),
            coefficients=np.array(self.coefficients),
            records=np.array(json.dumps(self.records)),
            mined=np.concatenate([np.empty((0, 6)), *rows]),
        )
        with whole_file(path) as part, about(path):
            part.write_bytes(packed.getvalue())

    @classmethod
    def load(cls, path: Path, fingerprint: str) -> State:
        """Read the state of a run of the same data and parameters.

        Raises
        ------
        ResumeError
            There is none, or it was of others.
        """
        if not path.is_file():
            raise ResumeError(f"{path}: there is no stopped run to resume; leave out --resume")
        try:
            with np.load(io.BytesIO(path.read_bytes())) as packed:
                known, coefficients, rows = (packed[key] for key in ("fingerprint", "coefficients", "mined"))
                records = json.loads(str(packed["records"]))
        # Damaged bytes in other libraries' parsers: whatever they raise, the file is why.
        except Exception as error:
            raise ResumeError(f"{path}: not the state of a stopped run: {error}") from error
        if str(known) != fingerprint:
            raise ResumeError(f"{path}: the stopped run had other data or options; resume with the same, or start anew")
        mined: list[dict[int, NDArray[np.float64]]] = []
        for i in range(len(coefficients) - 1):
            of_round = rows[rows[:, 0] == i]
            pictures = dict.fromkeys(of_round[:, 1].astype(int).tolist())
            mined.append({picture: of_round[of_round[:, 1] == picture, 2:] for picture in pictures})
        return cls(fingerprint, list(coefficients), mined, records)


def fingerprint(data: TrainingData, parameters: TrainingParameters) -> str:
    """Return what a run that is resumed must have in common with the one that was stopped."""
    facts = asdict(parameters), asdict(data.shape), [asdict(source) for source in data.sources], len(data.regions)
    return json.dumps(facts, sort_keys=True)


def train(
    data: TrainingData,
    parameters: TrainingParameters,
    state: State,
    workers: int,
    progress: Progress = lambda _stage, _steps: None,
) -> Iterator[Round]:
    """Train, and yield each round as it is done; `state` is brought up to date before.

    Rounds that `state` holds are not done again. The same data, parameters and seed give the same detector, on any
    number of `workers`, stopped and resumed or not.

    Raises
    ------
    LabelError
        No object or no negative can be read.
    """
    start, threads = time.perf_counter(), _core.get_num_threads()
    # Each worker searches a picture of its own.
    _core.set_num_threads(1)
    try:
        yield from _rounds(data, parameters, state, workers, progress, start)
    finally:
        _core.set_num_threads(threads)


def _rounds(
    data: TrainingData, how: TrainingParameters, state: State, workers: int, progress: Progress, start: float
) -> Iterator[Round]:
    objects = [
        block
        for block in _told(
            describe_objects(data.regions, data.shape, how.jitter, how.mirror, how.seed, workers),
            "objects",
            len(data.regions),
            progress,
        )
        if len(block)
    ]
    if not objects:
        raise LabelError(f"none of the {len(data.regions)} objects can be read")
    held = _held_back(len(objects), 0.0 if data.validation else how.held_out, how.seed)
    plain = [objects[i][:1] for i in sorted(held)]
    positives = [np.concatenate([block for i, block in enumerate(objects) if i not in held])]
    count = len(objects) - len(held)
    del objects
    drawn = random_negatives(data.negatives, data.shape, how.mining, how.seed, workers)
    negatives = _blocks(_told(drawn, "random negatives", len(data.negatives.paths), progress))
    if not negatives:
        raise LabelError(
            f"none of the {len(data.negatives.paths)} pictures for negatives is as large as the window, "
            f"{data.shape.size[0]} x {data.shape.size[1]} px"
        )
    for mined in state.mined:
        again = cut_again(mined, data.negatives, data.shape, workers)
        negatives += _blocks(_told(again, "negatives of the stopped run", len(mined), progress))
    for number in range(len(state.coefficients), how.rounds + 1):
        new = left_out = 0
        last = state.coefficients[-1] if state.coefficients else None
        if last is not None:
            known: dict[int, set[tuple[float, ...]]] = {}
            for mined in state.mined:
                for picture, boxes in mined.items():
                    known.setdefault(picture, set()).update(map(tuple, boxes.tolist()))
            hard = hard_negatives(last, data.negatives, known, data.shape, how.mining, how.seed, workers)
            stage = f"round {number} of {how.rounds}: searching"
            room = how.most_bytes - sum(block.nbytes for block in (*positives, *negatives))
            found = list(_told(hard, stage, len(data.negatives.paths), progress))
            found, left_out = _hardest(found, room)
            negatives += _blocks(found)
            state.mined.append({mined.picture: mined.boxes for mined in found if len(mined.boxes)})
            new = sum(len(mined.boxes) for mined in found)
        progress(f"round {number} of {how.rounds}: solving", None)
        solution = solve(positives, negatives, how.c, how.bias_feature, last, workers)
        state.coefficients.append(solution.coefficients)
        weights, bias = solution.coefficients[:-1], solution.coefficients[-1]
        yield Round(
            number,
            solution.coefficients,
            count,
            sum(map(len, negatives)),
            new,
            left_out,
            sum(block.nbytes for block in (*positives, *negatives)),
            solution.objective,
            solution.iterations,
            np.array([float(block[0] @ weights + bias) for block in plain]),
            time.perf_counter() - start,
        )


def _told(items: Iterable[Item], stage: str, steps: int, progress: Progress) -> Iterator[Item]:
    for item in items:
        progress(stage, steps)
        yield item


def _held_back(objects: int, share: float, seed: int) -> set[int]:
    count = min(round(share * objects), objects - 1)
    return set(np.random.default_rng([seed, 5]).choice(objects, count, replace=False).tolist()) if count > 0 else set()


def _blocks(mined: Iterable[Mined]) -> list[NDArray[np.float32]]:
    """Return the descriptors as one block, or none."""
    blocks = [one.descriptors for one in mined if len(one.descriptors)]
    return [np.concatenate(blocks)] if blocks else []


def _hardest(found: Sequence[Mined], room: int) -> tuple[list[Mined], int]:
    """Return as many negatives as have room [B], the hardest, in the order they came, and how many were left out."""
    margins = np.concatenate([np.empty(0), *(mined.margins for mined in found)])
    size = max((mined.descriptors[0].nbytes for mined in found if len(mined.descriptors)), default=1)
    most = max(0, room // size)
    if len(margins) <= most:
        return list(found), 0
    kept = np.zeros(len(margins), np.bool_)
    kept[np.argsort(-margins, kind="stable")[:most]] = True
    parts = np.split(kept, np.cumsum([len(mined.margins) for mined in found])[:-1])
    hardest = [
        Mined(mined.picture, mined.boxes[part], mined.margins[part], mined.descriptors[part])
        for mined, part in zip(found, parts, strict=True)
    ]
    return hardest, len(margins) - most


def as_json(done: Round) -> dict[str, Any]:
    """Return what a round came to as plain values."""
    return {
        "round": done.number,
        "objects": done.objects,
        "negatives": done.negatives,
        "new": done.new,
        "left_out": done.left_out,
        "objective": round(done.objective, 4),
        "iterations": done.iterations,
    }
