"""The workshop's checker: runs a node in small scenes, and judges its checkpoints by what the node did."""

from __future__ import annotations

import ast
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from limo_sim.ros.lockstep.records import StubError
from limo_sim.ros.runner import Limits, Said
from limo_sim.ros.worker import no_nodes
from limo_sim.workshop.exercises import Checkpoint, Exercise, exercise
from limo_sim.workshop.mistakes import Finding, camera_read, no_command, no_detection, no_picture, parsed
from limo_sim.workshop.sights import found
from limo_sim.workshop.stretch import red_on_person
from limo_sim.workshop.takes import Look, Scene, Take, judge_by_truth, play

#: What a verdict tells is no longer [characters].
_LONGEST = 4000


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether a checkpoint holds."""

    task: int
    checkpoint: str
    holds: bool | None  #: None where it could not be tried, for the reason in `evidence`
    evidence: str  #: what the node did, or its likely mistake
    points: int = 0  #: won
    worth: int = 0  #: points to win
    line: int | None = None  #: line of the student's file that the evidence is about, where it is known
    hints: tuple[str, ...] = ()  #: from vague to plain
    look: Look | None = None  #: the image that the evidence is about, where it is one

    def __post_init__(self) -> None:
        # A node's own words: without control characters, which would steer a terminal, and not endless.
        said = "".join(c if c.isprintable() or c == "\n" else f"\\x{ord(c):02x}" for c in self.evidence[:_LONGEST])
        object.__setattr__(self, "evidence", said)


@dataclass(frozen=True, slots=True)
class Examination:
    """A node's verdicts, and its takes: what it did in each scene."""

    verdicts: list[Verdict]
    takes: list[Take]


NOT_REACHED = Finding(None, "not tried: see the first mistake above")
LAST = Finding(None, "tried when all checkpoints above hold")
#: What is judged by a node's boxes; where none could be placed in an image, by the red box and the arena's truth.
_BOXES = ("found", "scaled_back", "best")
#: What is judged by boxes that are on people.
_ON_FOUND = ("logged", "scaled_back", "best", "stands")


def examine(
    script: Path,
    name: str = "follower",
    limits: Limits | None = None,
    said: Said = lambda *_: None,
    *,
    workers: int = 1,
) -> Examination:
    """Try a node in an exercise's scenes, and if all checkpoints hold there, in its last ones.

    A node that raises, hangs or dies in a scene has one more verdict, the first, that says so; its checkpoints are
    judged by what it did before, and in the other scenes. `limits` are those of all scenes together; `said` is given
    what the node prints. `workers` scenes are played at once; with several, no other thread may run a node meanwhile.
    """
    if not script.is_file():
        raise StubError(f"{script}: no such file")
    wanted = exercise(name)
    limits = replace(limits or Limits(), began=time.monotonic())
    # (As it is before it runs. A file that Python refuses has no calls; the run says why.)
    source = parsed(script) or ast.Module([], [])
    takes: list[Take] = []
    with _player(script, wanted.scenes, limits, said, workers) as played:
        for scene in wanted.scenes:
            if not scene.last:
                takes.append(played(scene))
                if _is_hopeless(takes[-1]):
                    break
        by_truth = judge_by_truth(takes)
        fault = _fault(source, takes)
        last = {scene.name for scene in wanted.scenes if scene.last}
        late = [point for point in wanted.checkpoints if last.intersection(point.scenes)]
        first = [point for point in wanted.checkpoints if point not in late]
        verdicts = [_verdict(point, _judged(source, point, wanted, takes, by_truth)) for point in first]
        ready = fault is None and all(verdict.holds for verdict in verdicts)
        takes += [played(scene) for scene in wanted.scenes if ready and scene.last]
    verdicts += [_verdict(point, point.judge(_where(point, wanted, takes)) if ready else LAST) for point in late]
    return Examination(_marked([*([] if fault is None else [fault]), *verdicts], takes), takes)


@contextmanager
def _player(
    script: Path, scenes: Sequence[Scene], limits: Limits, said: Said, workers: int
) -> Iterator[Callable[[Scene], Take]]:
    """Give what returns the take of a scene. Several workers begin all scenes at once; at the end, they are ended."""
    if workers == 1:
        yield lambda scene: play(script, scene, limits, said)
        return
    printed: dict[str, list[tuple[str, str]]] = {scene.name: [] for scene in scenes}

    def played(scene: Scene) -> Take:
        take = ahead[scene.name].result()
        for text in printed[scene.name]:
            said(*text)
        return take

    with ThreadPoolExecutor(workers) as pool:
        # (The first may tell that there is no hope; of the others, the longest first.)
        order = [scenes[0], *sorted(scenes[1:], key=lambda scene: -scene.seconds)]
        ahead = {
            scene.name: pool.submit(play, script, scene, limits, lambda *text, of=scene.name: printed[of].append(text))
            for scene in order
        }
        try:
            yield played
        finally:
            with no_nodes():
                pool.shutdown(cancel_futures=True)


def _is_hopeless(take: Take) -> bool:
    """Whether the node would fail in every scene alike, or has used up its time."""
    fault = take.outcome.fault
    return not take.calls.given or (fault is not None and fault.how in ("hung", "was stopped"))


def _where(checkpoint: Checkpoint, wanted: Exercise, takes: Sequence[Take]) -> list[Take]:
    """Return the takes that a checkpoint is judged by."""
    first = [scene.name for scene in wanted.scenes if not scene.last]
    return [take for take in takes if take.scene.name in (checkpoint.scenes or first)]


def _judged(
    source: ast.Module, checkpoint: Checkpoint, wanted: Exercise, takes: Sequence[Take], by_truth: bool
) -> Finding:
    """Judge one checkpoint, or name the mistake that keeps the node from it."""
    first = wanted.checkpoints[0]
    no_image = no_picture(source, takes)
    if no_image is not None:
        return no_image if checkpoint is first and not takes[0].failed else NOT_REACHED
    if checkpoint.task > 1 and any(point.check == "found" for point in wanted.checkpoints):
        blind = no_detection(source, takes)
        if blind is not None and red_on_person(takes).holds is not True:
            return blind if checkpoint.check == "found" or checkpoint is first else NOT_REACHED
    if checkpoint.check == "stands" or checkpoint.task > 3:
        silent = no_command(takes)
        if silent is not None:
            return silent if checkpoint.check == "stands" or checkpoint is first else NOT_REACHED
    here = _where(checkpoint, wanted, takes)
    if not here:
        return NOT_REACHED
    if by_truth and checkpoint.check in _BOXES:
        sizes = "; ".join(sorted({str(size) for take in takes for size in take.unplaced}))
        why = f"pictures of {sizes} were searched, no part of a camera image" if sizes else "no detector known here ran"
        finding = red_on_person(here)
        return finding._replace(evidence=f"{why}, so the red box is judged by where people are: {finding.evidence}")
    if checkpoint.check in _ON_FOUND and not by_truth and found(takes).holds is False:
        # Boxes on nobody are no evidence of anything.
        return NOT_REACHED
    return checkpoint.judge(here)


def _verdict(checkpoint: Checkpoint, finding: Finding) -> Verdict:
    (holds, said, line, look), worth = finding, checkpoint.points
    won = worth if holds else 0
    return Verdict(checkpoint.task, checkpoint.name, holds, said, won, worth, line, checkpoint.hints, look)


def _marked(verdicts: list[Verdict], takes: Sequence[Take]) -> list[Verdict]:
    """Take the points of a node that reads the model solution."""
    lines = [take.calls.solution_read for take in takes if take.calls.solution_read is not None]
    if not lines:
        return verdicts
    said = "the node reads the workshop's model solution: no points"
    copied = Verdict(1, "the work is the student's own", False, said, line=lines[0] or None)
    return [copied, *(replace(verdict, points=0) for verdict in verdicts)]


def _fault(source: ast.Module, takes: Sequence[Take]) -> Verdict | None:
    """Name the scenes in which the node raises, hangs or dies."""
    failed = [take for take in takes if take.failed]
    if not failed or (fault := failed[0].outcome.fault) is None:
        return None
    line, outcome = fault.line, failed[0].outcome
    not_bytes = [asked for asked in outcome.stage.detector_inputs if not asked.startswith("uint8")]
    if not_bytes:
        said = f"the detector was given {not_bytes[0]}: it reads uint8, as imgmsg_to_cv2(message, 'bgr8') gives it"
        return Verdict(2, "people are found", False, said, line=line)
    said = f"{failed[0].scene.words}: {outcome.failure}"
    if len(failed) > 1:
        said += f"; so it does in {len(failed) - 1} other scenes"
    said = f"{said}\n{outcome.traceback}".rstrip()
    if failed[0].calls.readers and failed[0].calls.spun and not camera_read(failed[0].calls):
        # A callback that gets another topic's messages: the wrong topic comes first, then what came of it.
        deaf = no_picture(source, failed)
        if deaf is not None:
            return Verdict(1, "the node runs", False, f"{deaf.evidence}\n{said}", line=deaf.line)
    return Verdict(1, "the node runs", False, said, line=line)
