"""The workshop's checkpoints: whether each holds, with the frame, the boxes and the command as evidence."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from limo_sim.ros.script import run_script, score_of
from limo_sim.workshop.scenes import FOLLOWER_SCENES, PROXEMIC_SCENES, Look, Take, play
from limo_sim.world.scenario import Scenario

#: A command must follow within this time, or the watchdog stops the robot [s].
SILENCE = 0.5
#: Errors smaller than the dead-band less the detector's jitter must not turn the robot; larger ones surely must [px].
DEAD_BAND, CLEAR_ERROR = 20, 40

GREEN, RED, BLUE = (0, 255, 0), (0, 0, 255), (255, 0, 0)


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether a checkpoint holds; None where it could not be tried, for the reason in `evidence`."""

    task: int
    checkpoint: str
    holds: bool | None
    evidence: str


Check = Callable[[Sequence[Take]], tuple[bool | None, str]]


def check(script: Path, node: str = "follower", patience: float = 20.0) -> list[Verdict]:
    """Try a node in the workshop's scenes, and if all checkpoints hold there, with a walking person for 20 s."""
    takes: list[Take] = []
    for scene in FOLLOWER_SCENES if node == "follower" else PROXEMIC_SCENES:
        takes.append(play(script, scene, patience))
        fault = _fault(takes[-1])
        if fault is not None:
            return [fault]
    checks = FOLLOWER_CHECKS if node == "follower" else PROXEMIC_CHECKS
    verdicts = [Verdict(task, name, *judge(takes)) for task, name, judge in checks]
    name = "the robot follows a walking person"
    if all(verdict.holds for verdict in verdicts):
        verdicts.append(Verdict(checks[-1][0], name, *_walk(script)))
    else:
        verdicts.append(Verdict(checks[-1][0], name, None, "tried when all checkpoints above hold"))
    return verdicts


def _fault(take: Take) -> Verdict | None:
    """Judge a node that raises or hangs: it has no checkpoints to look at."""
    outcome = take.outcome
    if outcome is None or outcome.world.fault is None:
        return None
    not_bytes = [asked for asked in outcome.world.asked if not asked.startswith("uint8")]
    if not_bytes:
        said = f"the detector was given {not_bytes[0]}: it reads uint8, as imgmsg_to_cv2(message, 'bgr8') gives it"
        return Verdict(2, "people are found", False, said)
    return Verdict(1, "the node runs", False, f"{outcome.failure}\n{outcome.traceback}".rstrip())


def _looks(takes: Iterable[Take]) -> Iterator[tuple[str, Look]]:
    for take in takes:
        for look in take.looks:
            yield f"{take.scene.words}, frame at {look.time:.1f} s", look


def _seeing(takes: Iterable[Take]) -> Iterator[tuple[str, Look]]:
    return ((where, look) for where, look in _looks(takes) if len(look.found))


def _picture(look: Look) -> NDArray[np.uint8] | None:
    """Return the window that shows the camera's picture, whatever is drawn on it."""
    for shown in reversed(look.windows.values()):
        if shown.shape == look.image.shape and np.mean(shown == look.image) > 0.5:
            return shown
    return None


def _shown(takes: Sequence[Take]) -> tuple[bool, str]:
    for where, look in _looks(take for take in takes if not _blocked(take)):
        if _picture(look) is None:
            sizes = ", ".join(f"{name!r} {p.shape}" for name, p in look.windows.items()) or "no window"
            return False, f"{where}: {sizes}; wanted is cv2.imshow of the {look.image.shape} camera image"
    return True, f"{sum(1 for _ in _looks(takes))} frames shown"


def _found(takes: Sequence[Take]) -> tuple[bool, str]:
    looks = list(_looks(takes))
    asked = [look for _, look in looks if look.raw is not None]
    if not asked:
        return False, "self.hog.detectMultiScale was never called"
    seeing = list(_seeing(takes))
    if not seeing:
        return False, f"people stand 2 m away and no box was found in {len(asked)} frames, looking at " + "; ".join(
            sorted({str(look.raw.shape) for look in asked if look.raw})
        )
    where, look = seeing[0]
    return True, f"{len(seeing)} of {len(looks)} frames with boxes; {where}: {_boxes(look)}"


def _logged(takes: Sequence[Take]) -> tuple[bool, str]:
    for where, look in _seeing(takes):
        count = str(len(look.found))
        if not any(count in re.findall(r"\d+", line) for line in look.said):
            return False, f"{where}: {count} boxes found, logged: {list(look.said) or 'nothing'}"
    return True, "every frame's number of boxes is logged"


def _stands(takes: Sequence[Take]) -> tuple[bool, str]:
    for where, look in _looks(takes):
        if len(look.found) or look.raw is None:
            continue
        if not look.commands:
            return False, f"{where}: no box, and no command; publish Twist(), which stops the robot"
        twist = look.commands[-1]
        if (twist.linear, twist.angular) != (0.0, 0.0):
            return False, f"{where}: no box, yet the command is {_command(look)}"
    return True, "every frame without a box is answered with a zero Twist"


def _scaled_back(takes: Sequence[Take]) -> tuple[bool | None, str]:
    """Whether the boxes of a smaller image are used in the camera's pixels: by how the robot is steered."""
    small = [(w, k) for w, k in _seeing(takes) if k.raw is not None and k.raw.shape[:2] != k.image.shape[:2]]
    if not small:
        return True, "the detector is given the camera's own size"
    mistaken = [(w, k) for w, k in small if _steers(k, _error(k, scaled=False)) and not _steers(k, _error(k))]
    if mistaken:
        where, look = mistaken[0]
        assert look.raw is not None  # noqa: S101 — `small` holds no other
        best = int(np.argmax(look.found.scores))
        there, here = _middle(look.raw.detections.boxes[best]), _middle(look.found.boxes[best])
        return False, (
            f"{where}: the box at x = {there} of the {look.raw.shape[1]} px wide copy is at {here} in the camera's "
            f"{look.image.shape[1]} px; the command is {_command(look)}"
        )
    return True, f"boxes of the {small[0][1].raw.shape[1] if small[0][1].raw else 0} px wide copy are scaled back"


def _best(takes: Sequence[Take]) -> tuple[bool | None, str]:
    """Whether the surest box is drawn red with a blue middle, and the others green."""
    several = [(where, look) for where, look in _seeing(takes) if len(look.found) > 1]
    telling = [(where, look) for where, look in several if np.argmax(look.found.scores) != 0]
    for where, look in telling or several or list(_seeing(takes)):
        picture = _picture(look)
        if picture is None:
            return None, "no picture of the camera is shown"
        best = int(np.argmax(look.found.scores))
        reds = [_share(picture, box, RED) for box in look.found.boxes]
        if reds[best] < 0.5:
            if max(reds) > 0.5:
                return (
                    False,
                    f"{where}: the red box is number {int(np.argmax(reds))} of {_boxes(look)}; surest is {best}",
                )
            return False, f"{where}: no red box around the surest of {_boxes(look)}"
        x, y, w, h = look.found.boxes[best].tolist()
        around = picture[y + h // 2 - 4 : y + h // 2 + 5, x + w // 2 - 4 : x + w // 2 + 5].reshape(-1, 3)
        if np.mean((around == BLUE).all(axis=1)) < 0.3:
            return False, f"{where}: no blue dot in the middle of the red box, ({x + w // 2}, {y + h // 2})"
        if any(_share(picture, box, GREEN) < 0.5 for i, box in enumerate(look.found.boxes) if i != best):
            return False, f"{where}: not every other box of {_boxes(look)} is green"
    return True, "the surest box is red with a blue dot, the others are green"


def _turns(takes: Sequence[Take]) -> tuple[bool | None, str]:
    wrong = [
        (where, look)
        for where, look in _seeing(takes)
        if look.commands and abs(_error(look)) > CLEAR_ERROR and not _steers(look, _error(look))
    ]
    if wrong:
        where, look = wrong[0]
        side = "left: angular.z > 0" if _error(look) > 0 else "right: angular.z < 0"
        return False, f"{where}: the person is {abs(_error(look))} px to the {side}; the command is {_command(look)}"
    return True, "left of the middle turns left, right turns right"


def _dead_band(takes: Sequence[Take]) -> tuple[bool | None, str]:
    tried = 0
    for where, look in _seeing(takes):
        if not look.commands or abs(_error(look)) >= DEAD_BAND:
            continue
        tried += 1
        if look.commands[-1].angular != 0.0:
            return (
                False,
                f"{where}: {_error(look)} px off the middle, within {DEAD_BAND}; the command is {_command(look)}",
            )
    if not tried:
        return None, "no frame had the person in the middle"
    return True, f"{tried} frames within {DEAD_BAND} px do not turn"


def _drives(takes: Sequence[Take]) -> tuple[bool | None, str]:
    for where, look in _seeing(takes):
        if look.commands and look.commands[-1].linear <= 0:
            return False, f"{where}: a person is in view; the command is {_command(look)}"
    return True, "every frame with a person is answered with a forward command"


def _speaks(takes: Sequence[Take]) -> tuple[bool | None, str]:
    for take in takes:
        world = take.outcome.world if take.outcome else None
        if world is None or not any(len(look.found) for look in take.looks):
            continue
        times = [0.0, *(command.time for command in world.commands), take.scene.seconds]
        gap, at = max((b - a, a) for a, b in itertools.pairwise(times))
        if gap > SILENCE + 1e-6 and not _blocked(take):
            return (
                False,
                f"{take.scene.words}: no command for {gap:.1f} s after {at:.1f} s; the watchdog stops the robot",
            )
    return True, f"never more than {SILENCE} s without a command while a person is in view"


def _returns(takes: Sequence[Take]) -> tuple[bool | None, str]:
    for take in takes:
        blocked = _blocked(take)
        if blocked:
            return False, f"{take.scene.words}: {blocked}; meanwhile no frame is looked at"
    return True, "every callback returns in time"


def _blocked(take: Take) -> str:
    """Return which callback took longer than the watchdog's time, "" if none did."""
    for call in take.outcome.world.callbacks if take.outcome else ():
        if call.slept > SILENCE - 1e-6:
            return f"the callback at {call.time:.1f} s slept for {call.slept:.1f} s"
    return ""


def _keeps(takes: Sequence[Take]) -> tuple[bool | None, str]:
    signs = {"near": -1, "far": 1}
    for take in takes:
        wanted = signs.get(take.scene.name, 0)
        for look in take.looks:
            if wanted and len(look.found) and look.commands and look.commands[-1].linear * wanted <= 0:
                how = "back" if wanted < 0 else "forward"
                where = f"{take.scene.words} ({' '.join(take.scene.arguments)}), frame at {look.time:.1f} s"
                return False, f"{where}: wanted is to drive {how}; the command is {_command(look)}"
    return True, "drives forward when the person is too far, back when too near"


def _limits(takes: Sequence[Take]) -> tuple[bool | None, str]:
    for where, look in _seeing(takes):
        if look.commands and (
            abs(look.commands[-1].linear) > 0.3 + 1e-9 or abs(look.commands[-1].angular) > 0.8 + 1e-9
        ):
            return False, f"{where}: the command is {_command(look)}; the limits are 0.3 m/s and 0.8 rad/s"
    return True, "never faster than 0.3 m/s and 0.8 rad/s"


def _walk(script: Path) -> tuple[bool, str]:
    outcome = run_script(script, Scenario.load("followable"), 20.0)
    card = score_of(outcome)
    said = (
        f"in view {card.in_view or 0:.0%}, {card.pixel_error_mean or 0:.0f} px off the middle, "
        f"nearest {card.distance_min_m or 0:.1f} m, {card.contacts_person + card.contacts_wall} contacts"
    )
    return not outcome.failure and (card.in_view or 0) > 0.7 and card.contacts_person == 0, said


def _error(look: Look, scaled: bool = True) -> int:
    """Return how far left of the middle the surest box is [px]; not `scaled`: taken as camera pixels as it is."""
    boxes = look.found.boxes if scaled or look.raw is None else look.raw.detections.boxes
    return int(look.image.shape[1]) // 2 - _middle(boxes[int(np.argmax(look.found.scores))])


def _steers(look: Look, error: int) -> bool:
    """Whether the command turns to where the error is; small errors need no turn."""
    return bool(look.commands) and (abs(error) <= CLEAR_ERROR or look.commands[-1].angular * error > 0)


def _middle(box: NDArray[np.int32]) -> int:
    return int(box[0] + box[2] // 2)


def _share(picture: NDArray[np.uint8], box: NDArray[np.int32], colour: tuple[int, int, int]) -> float:
    """Return the share of a box's outline that has a colour, lines of any width."""
    x, y, w, h = box.tolist()
    height, width = picture.shape[:2]
    points = [(x + i, r) for i in range(w) for r in (y, y + h)] + [(c, y + i) for i in range(h) for c in (x, x + w)]
    inside = np.array([(r, c) for c, r in points if 0 <= r < height and 0 <= c < width])
    return float(np.mean((picture[inside[:, 0], inside[:, 1]] == colour).all(axis=1)))


def _boxes(look: Look) -> str:
    pairs = zip(look.found.boxes.tolist(), look.found.scores.tolist(), strict=True)
    return ", ".join(f"{tuple(box)} {score:.2f}" for box, score in pairs)


def _command(look: Look) -> str:
    twist = look.commands[-1]
    return f"linear.x {twist.linear:.2f}, angular.z {twist.angular:+.2f}"


_FIRST: tuple[tuple[int, str, Check], ...] = (
    (1, "the camera image is shown", _shown),
    (2, "people are found", _found),
    (2, "the number of boxes is logged", _logged),
    (2, "boxes are in the camera's pixels", _scaled_back),
    (3, "the robot stands while no person is found", _stands),
    (3, "the surest box is chosen and drawn", _best),
    (4, "the robot turns towards the person", _turns),
)
_LAST: tuple[tuple[int, str, Check], ...] = (
    (4, "a command comes at least every 0.5 s", _speaks),
    (4, "callbacks return in time", _returns),
)
FOLLOWER_CHECKS = (
    *_FIRST,
    (4, "a person in the middle does not turn it", _dead_band),
    (4, "it drives to the person", _drives),
    *_LAST,
)
PROXEMIC_CHECKS = (
    *_FIRST,
    *_LAST,
    (5, "it keeps its distance", _keeps),
    (5, "its speeds keep within the limits", _limits),
)
