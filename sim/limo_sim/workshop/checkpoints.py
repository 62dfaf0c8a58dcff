"""The workshop's checkpoints: what each looks for in a node's runs, what it is worth, and its hints.

A checkpoint holds on evidence alone: a call, a picture, a box, or a command that answers the picture. Where the node
gives no occasion for it, the finding is None, and there are no points.
"""

from __future__ import annotations

import itertools
import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from limo_sim.workshop.mistakes import Finding
from limo_sim.workshop.scenes import Look, Take

#: A command must follow within this time, or the watchdog stops the robot; a window is as old as this at most [s].
SILENCE = 0.5
#: Errors smaller than the dead-band less the detector's jitter must not turn the robot; larger ones surely must [px].
DEAD_BAND, CLEAR_ERROR = 20, 40
#: Share of the count's log lines that must be right: a timer's line may be one frame late. Chosen.
RIGHT_LINES = 0.8

GREEN, RED, BLUE = (0, 255, 0), (0, 0, 255), (255, 0, 0)

Picture = NDArray[np.uint8]
NOBODY_FOUND = Finding(None, "not tried: no box was found")
NEVER_MOVES = Finding(None, "not tried: no command with a speed answers a person in view")


def task_name(task: int) -> str:
    """Return a task's name: its number; A to E for the stretch tasks, which are numbered from 6 on."""
    return str(task) if task < 6 else "ABCDE"[task - 6]


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """One checkpoint: its task, its name, its points, how it is judged, and hints from vague to plain."""

    task: int
    name: str
    points: int
    judge: Callable[[Sequence[Take]], Finding]
    hints: tuple[str, ...] = ()


def _looks(takes: Iterable[Take]) -> Iterator[tuple[str, Look]]:
    for take in takes:
        for look in take.looks:
            yield f"{take.scene.words}, frame at {look.time:.1f} s", look


def _seeing(takes: Iterable[Take]) -> Iterator[tuple[str, Look]]:
    return ((where, look) for where, look in _looks(takes) if len(look.found))


def _answers(takes: Sequence[Take]) -> bool:
    """Whether a person in view is ever answered by a command that moves the robot."""
    return any(c.twist.linear or c.twist.angular for _, look in _seeing(takes) for c in look.commands)


def _same(shown: Picture, image: Picture) -> float:
    """Return the share of equal pixels, of every fourth row and column."""
    if shown.shape != image.shape:
        return 0.0
    return float(np.mean((shown[::4, ::4] == image[::4, ::4]).all(axis=2)))


def _pictures(take: Take) -> Iterator[tuple[Look, Look, Picture]]:
    """Yield each picture of the camera in a window: when it was seen there, the frame it shows, and the picture."""
    for look in take.looks:
        recent = [k for k in take.looks if look.time - SILENCE - 1e-6 <= k.time <= look.time]
        for shown in look.windows.values():
            if shown.time < look.time - SILENCE - 1e-6:
                continue
            frame = max(recent, key=lambda k: (_same(shown.picture, k.image), k.time))
            share = _same(shown.picture, frame.image)
            if share > 0.5 and share >= _same(shown.picture, frame.image[..., ::-1]):
                yield look, frame, shown.picture


def shown(takes: Sequence[Take]) -> Finding:
    """Whether a window shows the camera's picture, never older than half a second."""
    for take in takes:
        if blocked(take):
            continue
        when = {look.time for look, _, _ in _pictures(take)}
        for look in take.looks:
            # A timer may show its first picture half a second after the first frame.
            if look.time >= SILENCE - 1e-6 and look.time not in when:
                where = f"{take.scene.words}, frame at {look.time:.1f} s"
                return _not_shown(where, look, take)
    return Finding(True, "a window shows every frame")


def _not_shown(where: str, look: Look, take: Take) -> Finding:
    lines = take.calls.windows
    if not look.windows:
        return Finding(False, f"{where}: no window; show the picture with cv2.imshow and cv2.waitKey(1)")
    name, last = list(look.windows.items())[-1]
    said = f"{where}: the window {name!r} shows "
    if last.time < look.time - SILENCE:
        said += f"a picture of {last.time:.1f} s: call cv2.imshow for every image"
    elif last.picture.ndim == 2:
        said += f"a grey or depth picture {last.picture.shape}, not the camera's colour image"
    elif last.picture.shape != look.image.shape:
        said += f"{last.picture.shape}; wanted is the camera's size {look.image.shape}"
    elif _same(last.picture, look.image[..., ::-1]) > 0.5:
        said += "red and blue swapped: convert with imgmsg_to_cv2(message, 'bgr8')"
    else:
        said += "another picture; wanted is the camera's image, with what you draw on it"
    return Finding(False, said, lines.get(name))


def found(takes: Sequence[Take]) -> Finding:
    """Whether the detector is given pictures in which it finds the people."""
    looks = list(_looks(takes))
    seeing = list(_seeing(takes))
    if not seeing:
        sizes = "; ".join(sorted({str(look.raw.shape) for _, look in looks if look.raw}))
        return Finding(False, f"people stand 2 to 3 m away, and detectMultiScale finds no box in images of {sizes}")
    where, look = seeing[0]
    return Finding(True, f"{len(seeing)} of {len(looks)} frames with boxes; {where}: {boxes_of(look)}")


def logged(takes: Sequence[Take]) -> Finding:
    """Whether a kind of log line tells the number of boxes, be it every frame or every thirtieth."""
    if not any(True for _ in _seeing(takes)):
        return NOBODY_FOUND
    kinds: dict[str, list[tuple[str, str, Look]]] = defaultdict(list)
    for where, look in _looks(takes):
        for line in look.said:
            if look.raw is not None and re.search(r"\d", line):
                kinds[re.sub(r"[-+\d.,\s]+", "#", line)].append((line, where, look))
    worst = ""
    for lines in kinds.values():
        wrong = [entry for entry in lines if str(len(entry[2].found)) not in re.findall(r"\d+", entry[0])]
        counted = any(len(look.found) for _, _, look in lines)
        if counted and len(wrong) <= (1 - RIGHT_LINES) * len(lines):
            return Finding(True, f"{len(lines) - len(wrong)} log lines with the number of boxes")
        line, where, look = (wrong or lines)[0]
        worst = f"{where}: {len(look.found)} boxes found, logged: {line!r}"
    return Finding(False, worst or "boxes are found, and no log line has their number: log len(boxes)")


def scaled_back(takes: Sequence[Take]) -> Finding:
    """Whether the boxes of a smaller image are used in the camera's pixels: by how the robot is steered."""
    seeing = list(_seeing(takes))
    if not seeing:
        return NOBODY_FOUND
    small = [(w, k) for w, k in seeing if k.raw is not None and k.raw.shape[:2] != k.image.shape[:2]]
    if not small:
        return Finding(True, "the detector is given the camera's own size")
    for where, look in small:
        if look.raw is None or _steers(look, _error(look)) or not _steers(look, _error(look, scaled=False)):
            continue
        if not look.commands:
            continue
        best = int(np.argmax(look.found.scores))
        there, here = _middle(look.raw.detections.windows[best]), _middle(look.found.windows[best])
        said = f"{where}: the box at x = {there} of the {look.raw.shape[1]} px wide copy is at {here} in the camera's "
        said += f"{look.image.shape[1]} px; the command is {command_of(look)}"
        return Finding(False, said, look.commands[-1].line)
    turned = [k for _, k in small if k.commands and k.commands[-1].twist.angular and abs(_error(k)) > CLEAR_ERROR]
    if not turned:
        return Finding(None, "not tried: a smaller image is searched, and the robot does not turn yet")
    return Finding(
        True, f"boxes of the {small[0][1].raw.shape[1] if small[0][1].raw else 0} px wide copy are scaled back"
    )


def stands(takes: Sequence[Take]) -> Finding:
    """Whether a frame without a box is answered with a stop that is not the answer to every frame."""
    empty = [(where, look) for where, look in _looks(takes) if look.raw is not None and not len(look.found)]
    if not any(True for _ in _seeing(takes)):
        return NOBODY_FOUND
    for where, look in empty:
        if not look.commands:
            return Finding(False, f"{where}: no box, and no command; publish Twist(), which stops the robot")
        last = look.commands[-1]
        if (last.twist.linear, last.twist.angular) != (0.0, 0.0):
            return Finding(False, f"{where}: no box, yet the command is {command_of(look)}", last.line)
    here = {look.commands[-1].line for _, look in empty}
    there = {look.commands[-1].line for _, look in _seeing(takes) if look.commands}
    if not empty or not (_answers(takes) or here - there):
        return Finding(None, "not tried: the same zero command answers every picture, with a person and without")
    return Finding(True, f"{len(empty)} frames without a box are answered with a zero Twist")


def best(takes: Sequence[Take]) -> Finding:
    """Whether the surest box is drawn red with a blue middle, and the others green."""
    judged: dict[int, tuple[str, Look, list[Picture], Take]] = {}
    for take in takes:
        for _, frame, picture in _pictures(take):
            if len(frame.found):
                where = f"{take.scene.words}, frame at {frame.time:.1f} s"
                judged.setdefault(id(frame), (where, frame, [], take))[2].append(picture)
    if not any(True for _ in _seeing(takes)):
        return NOBODY_FOUND
    if not judged:
        return Finding(None, "not tried: no window shows the camera's picture")
    several = [entry for entry in judged.values() if len(entry[1].found) > 1]
    telling = [entry for entry in several if np.argmax(entry[1].found.scores) != 0]
    for where, look, pictures, take in telling or several or list(judged.values()):
        faults = [_misdrawn(look, picture) for picture in pictures]
        if all(faults):
            return Finding(False, f"{where}: {faults[-1]}", next(iter(take.calls.windows.values()), None))
    return Finding(True, "the surest box is red with a blue dot, the others are green")


def _misdrawn(look: Look, picture: Picture) -> str:
    """Return what is wrong with the boxes drawn in a picture, "" if they are right."""
    if np.array_equal(picture, look.image):
        return "the window shows the image with nothing drawn on it; show the picture you drew on"
    surest = int(np.argmax(look.found.scores))
    reds = [_share(picture, box, RED) for box in look.found.windows]
    if reds[surest] < 0.5:
        if max(reds) > 0.5:
            return f"the red box is number {int(np.argmax(reds))} of {boxes_of(look)}; surest is {surest}"
        if _share(picture, look.found.windows[surest], BLUE) > 0.5:
            return "the surest box is blue: colours are blue, green, red, so red is (0, 0, 255)"
        return f"no red box around the surest of {boxes_of(look)}"
    x, y, w, h = look.found.windows[surest].tolist()
    around = picture[max(y + h // 2 - 4, 0) : y + h // 2 + 5, max(x + w // 2 - 4, 0) : x + w // 2 + 5].reshape(-1, 3)
    if not around.size or np.mean((around == BLUE).all(axis=1)) < 0.3:
        return f"no blue dot in the middle of the red box, ({x + w // 2}, {y + h // 2})"
    if any(_share(picture, box, GREEN) < 0.5 for i, box in enumerate(look.found.windows) if i != surest):
        return f"not every other box of {boxes_of(look)} is green"
    return ""


def turns(takes: Sequence[Take]) -> Finding:
    """Whether the robot turns to the person's side, on both sides."""
    clear = [(w, k) for w, k in _seeing(takes) if k.commands and abs(_error(k)) > CLEAR_ERROR]
    if not clear or not _answers(takes):
        return NEVER_MOVES
    wrong = [(where, look) for where, look in clear if not _steers(look, _error(look))]
    if wrong:
        where, look = wrong[0]
        side = "left: angular.z > 0" if _error(look) > 0 else "right: angular.z < 0"
        said = f"{where}: the person is {abs(_error(look))} px to the {side}; the command is {command_of(look)}"
        if all(k.commands[-1].twist.angular * _error(k) < 0 for _, k in clear):
            said += "; the sign is swapped: the error is middle - cx"
        return Finding(False, said, look.commands[-1].line)
    if len({_error(look) > 0 for _, look in clear}) < 2:
        return Finding(None, "not tried: the person was found on one side only")
    return Finding(True, "left of the middle turns left, right turns right")


def dead_band(takes: Sequence[Take]) -> Finding:
    """Whether a robot that turns otherwise does not turn when the person is in the middle."""
    if not any(k.commands and k.commands[-1].twist.angular for _, k in _seeing(takes)):
        return Finding(None, "not tried: the robot never turns")
    tried = 0
    for where, look in _seeing(takes):
        if not look.commands or abs(_error(look)) >= DEAD_BAND:
            continue
        tried += 1
        if look.commands[-1].twist.angular != 0.0:
            said = f"{where}: {_error(look)} px off the middle, within {DEAD_BAND}; the command is {command_of(look)}"
            return Finding(False, said, look.commands[-1].line)
    if not tried:
        return Finding(None, "not tried: no frame had the person in the middle")
    return Finding(True, f"{tried} frames within {DEAD_BAND} px do not turn")


def drives(takes: Sequence[Take]) -> Finding:
    """Whether a person in view is answered by driving forward."""
    if not _answers(takes):
        return NEVER_MOVES
    for where, look in _seeing(takes):
        if look.commands and look.commands[-1].twist.linear <= 0:
            said = f"{where}: a person is in view; the command is {command_of(look)}"
            return Finding(False, said, look.commands[-1].line)
    return Finding(True, "every frame with a person is answered with a forward command")


def speaks(takes: Sequence[Take]) -> Finding:
    """Whether commands come often enough while a person is in view."""
    if not _answers(takes):
        return NEVER_MOVES
    for take in takes:
        stage = take.outcome.stage if take.outcome else None
        if stage is None or not any(len(look.found) for look in take.looks):
            continue
        times = [0.0, *(command.time for command in stage.commands), take.scene.seconds]
        gap, at = max((b - a, a) for a, b in itertools.pairwise(times))
        if gap > SILENCE + 1e-6 and not blocked(take):
            said = f"{take.scene.words}: no command for {gap:.1f} s after {at:.1f} s; the watchdog stops the robot"
            return Finding(False, said)
    return Finding(True, f"never more than {SILENCE} s without a command while a person is in view")


def returns(takes: Sequence[Take]) -> Finding:
    """Whether no callback of a node that answers pictures sleeps for long."""
    for take in takes:
        if blocked(take):
            return Finding(False, f"{take.scene.words}: {blocked(take)}; meanwhile no frame is looked at")
    return Finding(True, "every callback returns in time") if _answers(takes) else NEVER_MOVES


def blocked(take: Take) -> str:
    """Return which callback took longer than the watchdog's time, "" if none did."""
    call = take.outcome.stage.longest if take.outcome else None
    if call is None or call.slept <= SILENCE - 1e-6:
        return ""
    return f"the callback at {call.time:.1f} s slept for {call.slept:.1f} s"


def keeps(takes: Sequence[Take]) -> Finding:
    """Whether the robot drives back from a person who is too near, and forward to one who is too far."""
    signs = {"near": -1, "far": 1}
    tried = set()
    for take in takes:
        wanted = signs.get(take.scene.name, 0)
        for look in take.looks:
            if not wanted or not len(look.found) or not look.commands:
                continue
            tried.add(wanted)
            if look.commands[-1].twist.linear * wanted <= 0:
                how = "back" if wanted < 0 else "forward"
                where = f"{take.scene.words} ({' '.join(take.scene.arguments)}), frame at {look.time:.1f} s"
                said = f"{where}: wanted is to drive {how}; the command is {command_of(look)}"
                return Finding(False, said, look.commands[-1].line)
    if len(tried) < 2:
        return NOBODY_FOUND
    return Finding(True, "drives forward when the person is too far, back when too near")


def limits(takes: Sequence[Take]) -> Finding:
    """Whether commands that move keep within the limits."""
    if not _answers(takes):
        return NEVER_MOVES
    for where, look in _seeing(takes):
        for command in look.commands:
            if abs(command.twist.linear) > 0.3 + 1e-9 or abs(command.twist.angular) > 0.8 + 1e-9:
                said = f"{where}: the command is {command_of(look)}; the limits are 0.3 m/s and 0.8 rad/s"
                return Finding(False, said, command.line)
    return Finding(True, "never faster than 0.3 m/s and 0.8 rad/s")


def _error(look: Look, scaled: bool = True) -> int:
    """Return how far left of the middle the surest box is [px]; not `scaled`: taken as camera pixels as it is."""
    boxes = look.found.windows if scaled or look.raw is None else look.raw.detections.windows
    return int(look.image.shape[1]) // 2 - _middle(boxes[int(np.argmax(look.found.scores))])


def _steers(look: Look, error: int) -> bool:
    """Whether the command turns to where the error is; small errors need no turn."""
    return bool(look.commands) and (abs(error) <= CLEAR_ERROR or look.commands[-1].twist.angular * error > 0)


def _middle(box: NDArray[np.int32]) -> int:
    return int(box[0] + box[2] // 2)


def _share(picture: Picture, box: NDArray[np.int32], colour: tuple[int, int, int]) -> float:
    """Return the share of a box's outline that has a colour, lines of any width."""
    x, y, w, h = box.tolist()
    height, width = picture.shape[:2]
    points = [(x + i, r) for i in range(w) for r in (y, y + h)] + [(c, y + i) for i in range(h) for c in (x, x + w)]
    inside = np.array([(r, c) for c, r in points if 0 <= r < height and 0 <= c < width])
    return float(np.mean((picture[inside[:, 0], inside[:, 1]] == colour).all(axis=1)))


def boxes_of(look: Look) -> str:
    """Return a frame's boxes and scores in words."""
    pairs = zip(look.found.windows.tolist(), look.found.scores.tolist(), strict=True)
    return ", ".join(f"{tuple(box)} {score:.2f}" for box, score in pairs)


def command_of(look: Look) -> str:
    """Return a frame's last command in words."""
    twist = look.commands[-1].twist
    return f"linear.x {twist.linear:.2f}, angular.z {twist.angular:+.2f}"
