"""The workshop's checker: runs a node in small scenes, and judges its checkpoints by what the node did."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from limo_sim.ros.runner import Limits, Said
from limo_sim.ros.stage import score_of
from limo_sim.workshop.checkpoints import Checkpoint
from limo_sim.workshop.exercises import EXERCISES, FOUND, STANDS, Exercise
from limo_sim.workshop.mistakes import Finding, Source, camera_read, no_command, no_detection, no_picture
from limo_sim.workshop.scenes import Scene, Take, play
from limo_sim.world.scenario import Scenario


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether a checkpoint holds.

    Attributes
    ----------
    task, checkpoint
        Which it is.
    holds
        None where it could not be tried, for the reason in `evidence`.
    evidence
        What the node did, or its likely mistake.
    points, worth
        Points won, and points to win.
    line
        Line of the student's file that the evidence is about, where it is known.
    hints
        From vague to plain.
    """

    task: int
    checkpoint: str
    holds: bool | None
    evidence: str
    points: int = 0
    worth: int = 0
    line: int | None = None
    hints: tuple[str, ...] = ()


#: The walk's checkpoint.
WALK = "the robot follows a walking person"
WALKING = Scene("walk", "a person walks for 20 s", Scenario.load("followable"), 20.0)


@dataclass(frozen=True, slots=True)
class Examination:
    """A node's verdicts, and its takes: what it did in each scene."""

    verdicts: list[Verdict]
    takes: list[Take]


def check(script: Path, node: str = "follower") -> list[Verdict]:
    """Return the verdicts of `examine`."""
    return examine(script, node).verdicts


def examine(
    script: Path, node: str = "follower", limits: Limits | None = None, said: Said = lambda *_: None
) -> Examination:
    """Try a node in an exercise's scenes, and if all checkpoints hold there, with a walking person for 20 s.

    The points of all verdicts add up to 100. A node that raises, hangs or dies has one more verdict, the first, that
    says so. `limits` are those of all scenes together; `said` is given what the node prints.
    """
    exercise = EXERCISES[node]
    checkpoints = exercise.checkpoints
    limits = replace(limits or Limits(), began=time.monotonic())
    source = Source(script)
    takes: list[Take] = []
    fault: Verdict | None = None

    for scene in exercise.scenes:
        takes.append(play(script, scene, limits, said))
        fault = _fault(source, takes[-1])
        if fault is not None:
            break
    verdicts = []
    for checkpoint in checkpoints:
        worth = 0 if checkpoint in exercise.given else checkpoint.points
        finding = _judged(source, checkpoint, exercise, takes) if fault is None else NOT_REACHED
        verdicts.append(_verdict(checkpoint, finding, worth))
    if exercise.walk:
        walk = Finding(None, "tried when all checkpoints above hold")
        if fault is None and all(verdict.holds for verdict in verdicts):
            walk = _walk(play(script, WALKING, limits, said))
        verdicts.append(_verdict(Checkpoint(checkpoints[-1].task, WALK, 0, lambda _: walk), walk, exercise.walk))
    return Examination(verdicts if fault is None else [fault, *verdicts], takes)


NOT_REACHED = Finding(None, "not tried: see the first mistake above")


def _judged(source: Source, checkpoint: Checkpoint, exercise: Exercise, takes: Sequence[Take]) -> Finding:
    """Judge one checkpoint, or name the mistake that keeps the node from it."""
    first = exercise.checkpoints[0]
    no_image = no_picture(source, takes)
    if no_image is not None:
        return no_image if checkpoint is first else NOT_REACHED
    if checkpoint.task > 1 and exercise.hog:
        blind = no_detection(source, takes)
        if blind is not None:
            return blind if checkpoint in (FOUND, first) else NOT_REACHED
    if checkpoint is STANDS or checkpoint.task > 3:
        silent = no_command(takes)
        if silent is not None:
            return silent if checkpoint in (STANDS, first) else NOT_REACHED
    return checkpoint.judge(takes)


def _verdict(checkpoint: Checkpoint, finding: Finding, worth: int) -> Verdict:
    won = worth if finding.holds else 0
    return Verdict(
        checkpoint.task,
        checkpoint.name,
        finding.holds,
        finding.evidence,
        won,
        worth,
        finding.line,
        checkpoint.hints,
    )


def _fault(source: Source, take: Take) -> Verdict | None:
    """Judge a node that raises, hangs or dies: it has no checkpoints to look at."""
    outcome = take.outcome
    if outcome is None or outcome.fault is None:
        return None
    line = outcome.fault.line
    not_bytes = [asked for asked in outcome.stage.detector_inputs if not asked.startswith("uint8")]
    if not_bytes:
        said = f"the detector was given {not_bytes[0]}: it reads uint8, as imgmsg_to_cv2(message, 'bgr8') gives it"
        return Verdict(2, "people are found", False, said, line=line)
    said = f"{take.scene.words}: {outcome.failure}\n{outcome.traceback}".rstrip()
    if take.calls.readers and take.calls.spun and not camera_read(take.calls):
        # A callback that gets another topic's messages: the wrong topic comes first, then what came of it.
        deaf = no_picture(source, [take])
        if deaf is not None:
            return Verdict(1, "the node runs", False, f"{deaf.evidence}\n{said}", line=deaf.line)
    return Verdict(1, "the node runs", False, said, line=line)


def _walk(take: Take) -> Finding:
    if take.outcome is None:
        return NOT_REACHED
    card = score_of(take.outcome)
    said = (
        f"in view {card.in_view or 0:.0%}, {card.pixel_error_mean or 0:.0f} px off the middle, "
        f"nearest {card.distance_min_m or 0:.1f} m, {card.contacts_person + card.contacts_wall} contacts"
    )
    if take.outcome.failure:
        return Finding(False, take.outcome.failure, take.outcome.fault.line if take.outcome.fault else None)
    return Finding((card.in_view or 0) > 0.7 and card.contacts_person == 0, said)
