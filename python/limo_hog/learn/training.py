"""Training of a linear SVM by rounds of hard-negative mining (Dalal and Triggs 2005; Felzenszwalb et al. 2010).

A round searches all negatives with the detector it has, adds what that takes for an object, and solves again.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from limo_hog import _core
from limo_hog.learn.labels import LabelError
from limo_hog.learn.mining import Mined, Miner, MiningParameters, describe_objects, hardest
from limo_hog.learn.solver import Solution, solve
from limo_hog.learn.sources import TrainingData
from limo_hog.learn.windows import Jitter

Item = TypeVar("Item")
#: Told of each step done: the stage, and how many steps it has (None: unknown).
Progress = Callable[[str, int | None], None]


@dataclass(frozen=True)
class TrainingParameters:
    """How a detector is trained; chosen on USC-C and TUD-Stadtmitte, frames 1 to 41."""

    c: float = 0.003  #: weight of the loss against ½‖w‖²; .0003 to .01 were tried
    bias_feature: float = 10.0  #: the constant feature that makes the bias
    rounds: int = 3  #: of hard-negative mining; the first gives most
    mirror: bool = True  #: take each object the other way round, too
    most_bytes: int = 2**31  #: most memory of descriptors [B]; beyond it the least hard new negatives are left out
    seed: int = 0  #: of all that is drawn
    jitter: Jitter = field(default_factory=Jitter)
    mining: MiningParameters = field(default_factory=MiningParameters)


@dataclass(frozen=True)
class Round:
    """What a round came to; round 0 has random negatives only."""

    number: int
    solution: Solution  #: the detector that it ended with
    #: objects, negatives: how many different objects, and how many negatives, were learnt from
    objects: int
    negatives: int
    #: new, left_out: hard negatives that the round added, and those that were too many for the memory
    new: int
    left_out: int
    descriptor_bytes: int  #: memory of all descriptors [B]
    seconds: float  #: since training began


def train(
    data: TrainingData, parameters: TrainingParameters, workers: int, progress: Progress = lambda _stage, _steps: None
) -> Iterator[Round]:
    """Train, and yield each round as it is done.

    The same data, parameters and seed give the same detector, on any number of `workers`. Raises `LabelError` where no
    object or no negative can be read.
    """
    start, threads = time.perf_counter(), _core.get_num_threads()
    # Each worker searches a picture of its own.
    _core.set_num_threads(1)
    try:
        yield from _rounds(data, parameters, workers, progress, start)
    finally:
        _core.set_num_threads(threads)


def _rounds(
    data: TrainingData, how: TrainingParameters, workers: int, progress: Progress, start: float
) -> Iterator[Round]:
    described = describe_objects(data.regions, data.shape, how.jitter, how.mirror, how.seed, workers)
    objects = [block for block in _told(described, "objects", len(data.regions), progress) if len(block)]
    if not objects:
        raise LabelError(f"none of the {len(data.regions)} objects can be read")
    count, positives = len(objects), [np.concatenate(objects)]
    del objects
    miner = Miner(data.negatives, data.shape, how.mining, how.seed, workers)
    negatives = _blocks(_told(miner.random(), "random negatives", len(data.negatives.paths), progress))
    if not negatives:
        raise LabelError(
            f"none of the {len(data.negatives.paths)} pictures for negatives is as large as the window, "
            f"{data.shape.size[0]} x {data.shape.size[1]} px"
        )
    known: dict[int, set[tuple[float, ...]]] = defaultdict(set)
    last: NDArray[np.float64] | None = None
    for number in range(how.rounds + 1):
        new = left_out = 0
        if last is not None:
            hard = miner.hard(last, known)
            stage = f"round {number} of {how.rounds}: searching"
            room = how.most_bytes - sum(block.nbytes for block in (*positives, *negatives))
            found, left_out = hardest(list(_told(hard, stage, len(data.negatives.paths), progress)), room)
            negatives += _blocks(found)
            for mined in found:
                known[mined.picture].update(map(tuple, mined.boxes.tolist()))
                new += len(mined.boxes)
        progress(f"round {number} of {how.rounds}: solving", None)
        solution = solve(positives, negatives, how.c, how.bias_feature, last, workers)
        last = solution.coefficients
        yield Round(
            number,
            solution,
            count,
            sum(map(len, negatives)),
            new,
            left_out,
            sum(block.nbytes for block in (*positives, *negatives)),
            time.perf_counter() - start,
        )


def _told(items: Iterable[Item], stage: str, steps: int, progress: Progress) -> Iterator[Item]:
    for item in items:
        progress(stage, steps)
        yield item


def _blocks(mined: Iterable[Mined]) -> list[NDArray[np.float32]]:
    """Return the descriptors as one block, or none."""
    blocks = [batch.descriptors for batch in mined if len(batch.descriptors)]
    return [np.concatenate(blocks)] if blocks else []


def as_json(done: Round) -> dict[str, Any]:
    """Return what a round came to as plain values."""
    return {
        "round": done.number,
        "objects": done.objects,
        "negatives": done.negatives,
        "new": done.new,
        "left_out": done.left_out,
        "objective": round(done.solution.objective, 4),
        "iterations": done.solution.iterations,
    }
