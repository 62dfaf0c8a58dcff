"""The workshop's checker: runs a node in small scenes, and judges its checkpoints by what the node did."""

from __future__ import annotations

import traceback
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from limo_sim.ros.script import run_script, score_of
from limo_sim.workshop import checkpoints as points
from limo_sim.workshop.checkpoints import Checkpoint
from limo_sim.workshop.mistakes import Finding, camera_read, no_command, no_detection, no_picture
from limo_sim.workshop.scenes import FOLLOWER_SCENES, PROXEMIC_SCENES, Take, play
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


SHOWN = Checkpoint(
    1,
    "the camera image is shown",
    10,
    points.shown,
    (
        "Which function of cv2 shows a picture in a window?",
        "Call self.show(picture) once for every image; picture is a copy of image.",
    ),
)
FOUND = Checkpoint(
    2,
    "people are found",
    15,
    points.found,
    (
        "The detector is self.hog; which of its methods searches at many scales?",
        "boxes, weights = self.hog.detectMultiScale(image, winStride=(8, 8), scale=1.05)",
    ),
)
LOGGED = Checkpoint(
    2,
    "the number of boxes is logged",
    5,
    points.logged,
    ("len(boxes) is their number.", "self.get_logger().info(f'Detections: {len(boxes)}')"),
)
SCALED = Checkpoint(
    2,
    "boxes are in the camera's pixels",
    5,
    points.scaled_back,
    ("A box found in an image of half the size has half the coordinates.",),
)
STANDS = Checkpoint(
    3,
    "the robot stands while no person is found",
    10,
    points.stands,
    ("What should the robot do when boxes is empty?", "Publish Twist() and return from the callback."),
)
BEST = Checkpoint(
    3,
    "the surest box is chosen and drawn",
    15,
    points.best,
    (
        "The surest box is the one with the greatest weight.",
        "best = int(np.argmax(weights)); draw it last, in (0, 0, 255), with a dot in (255, 0, 0), and show it.",
    ),
)
TURNS = Checkpoint(
    4,
    "the robot turns towards the person",
    10,
    points.turns,
    (
        "A positive angular.z turns left. What sign has the error of a person on the left?",
        "error = middle - cx; twist.angular.z = 0.005 * float(error)",
    ),
)
DEAD_BAND = Checkpoint(
    4,
    "a person in the middle does not turn it",
    5,
    points.dead_band,
    ("Leave angular.z at 0.0 while abs(error) is smaller than the dead-band.",),
)
DRIVES = Checkpoint(4, "it drives to the person", 5, points.drives, ("Set twist.linear.x to 0.2.",))
SPEAKS = Checkpoint(
    4, "a command comes at least every 0.5 s", 5, points.speaks, ("Publish a command after every image.",)
)
RETURNS = Checkpoint(
    4, "callbacks return in time", 5, points.returns, ("Do not call time.sleep in a callback; use a timer.",)
)
KEEPS = Checkpoint(
    5,
    "it keeps its distance",
    40,
    points.keeps,
    (
        "Take the median of the depths around the box's centre; the error is distance - self.target.",
        "twist.linear.x = float(np.clip(self.linear_gain * (distance - self.target), -0.3, 0.3))",
    ),
)
LIMITS = Checkpoint(
    5, "its speeds keep within the limits", 20, points.limits, ("Clip both speeds with np.clip before publishing.",)
)

FOLLOWER = (SHOWN, FOUND, LOGGED, SCALED, STANDS, BEST, TURNS, DEAD_BAND, DRIVES, SPEAKS, RETURNS)
#: The sequel's template does tasks 1 to 3, which therefore are worth no points there.
GIVEN = (SHOWN, FOUND, LOGGED, SCALED, STANDS, BEST)
PROXEMIC = (*GIVEN, TURNS, SPEAKS, RETURNS, KEEPS, LIMITS)
#: Points for the walk, which is tried when all other checkpoints hold.
WALK, WALK_POINTS = "the robot follows a walking person", {"follower": 10, "proxemic": 20}


def check(script: Path, node: str = "follower", patience: float = 20.0) -> list[Verdict]:
    """Try a node in the workshop's scenes, and if all checkpoints hold there, with a walking person for 20 s.

    The points of all verdicts add up to 100. A node that raises or hangs has one more verdict, the first, that says so.
    """
    checkpoints = FOLLOWER if node == "follower" else PROXEMIC
    takes: list[Take] = []
    fault: Verdict | None = None
    for scene in FOLLOWER_SCENES if node == "follower" else PROXEMIC_SCENES:
        takes.append(play(script, scene, patience))
        fault = _fault(script, takes[-1])
        if fault is not None:
            break
    verdicts = []
    for checkpoint in checkpoints:
        worth = 0 if node == "proxemic" and checkpoint in GIVEN else checkpoint.points
        finding = _judged(script, checkpoint, checkpoints[0], takes) if fault is None else NOT_REACHED
        verdicts.append(_verdict(checkpoint, finding, worth))
    last, worth = checkpoints[-1].task, WALK_POINTS[node]
    walk = Finding(None, "tried when all checkpoints above hold")
    if fault is None and all(verdict.holds for verdict in verdicts):
        walk = _walk(script)
    verdicts.append(_verdict(Checkpoint(last, WALK, worth, lambda _: walk), walk, worth))
    return verdicts if fault is None else [fault, *verdicts]


NOT_REACHED = Finding(None, "not tried: see the first mistake above")


def _judged(script: Path, checkpoint: Checkpoint, first: Checkpoint, takes: Sequence[Take]) -> Finding:
    """Judge one checkpoint, or name the mistake that keeps the node from it."""
    no_image = no_picture(script, takes)
    if no_image is not None:
        return no_image if checkpoint is first else NOT_REACHED
    if checkpoint.task > 1:
        blind = no_detection(script, takes)
        if blind is not None:
            return blind if checkpoint is FOUND else NOT_REACHED
    if checkpoint is STANDS or checkpoint.task > 3:
        silent = no_command(takes)
        if silent is not None:
            return silent if checkpoint is STANDS else NOT_REACHED
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


def _fault(script: Path, take: Take) -> Verdict | None:
    """Judge a node that raises or hangs: it has no checkpoints to look at."""
    outcome = take.outcome
    if outcome is None or outcome.world.fault is None:
        return None
    frames = traceback.extract_tb(outcome.world.fault.__traceback__)
    line = next((frame.lineno for frame in reversed(frames) if frame.filename == str(script)), None)
    not_bytes = [asked for asked in outcome.world.asked if not asked.startswith("uint8")]
    if not_bytes:
        said = f"the detector was given {not_bytes[0]}: it reads uint8, as imgmsg_to_cv2(message, 'bgr8') gives it"
        return Verdict(2, "people are found", False, said, line=line)
    said = f"{outcome.failure}\n{outcome.traceback}".rstrip()
    if take.calls.readers and take.calls.spun and not camera_read(take.calls):
        # A callback that gets another topic's messages: the wrong topic comes first, then what came of it.
        deaf = no_picture(script, [take])
        if deaf is not None:
            return Verdict(1, "the node runs", False, f"{deaf.evidence}\n{said}", line=deaf.line)
    return Verdict(1, "the node runs", False, said, line=line)


def _walk(script: Path) -> Finding:
    outcome = run_script(script, Scenario.load("followable"), 20.0)
    card = score_of(outcome)
    said = (
        f"in view {card.in_view or 0:.0%}, {card.pixel_error_mean or 0:.0f} px off the middle, "
        f"nearest {card.distance_min_m or 0:.1f} m, {card.contacts_person + card.contacts_wall} contacts"
    )
    return Finding(not outcome.failure and (card.in_view or 0) > 0.7 and card.contacts_person == 0, said)
