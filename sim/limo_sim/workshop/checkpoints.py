"""What the workshop's checkpoints want of a node's commands, and of the way that the robot drives.

A checkpoint holds on evidence alone: a call, a picture, a box, or a command that answers the picture. Where the node
gives no occasion for it, the finding is None, and there are no points. A command is judged by the images of the half
second before it, and is wrong only if it is wrong for each of them.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from limo_sim.ros.lockstep.records import Command
from limo_sim.ros.stage import score_of
from limo_sim.workshop.mistakes import Finding
from limo_sim.workshop.takes import SILENCE, Look, Take

#: Errors smaller than the dead-band less the detector's jitter must not turn the robot; larger ones surely must [px].
DEAD_BAND, CLEAR_ERROR = 20, 40
#: Share of lines, pictures and commands that must be right: a timer's may be one frame late. Chosen.
RIGHT = 0.8
#: How far the robot may drive and turn, once nobody has been in view for a while [m, rad]; and that while [s]: half a
#: second of an old image, the watchdog's half second, and braking.
_STILL_M, _STILL_RAD, _GONE_S = 0.03, 0.05, 1.4
NOBODY_FOUND = Finding(None, "not tried: no box was found")
NEVER_MOVES = Finding(None, "not tried: no command with a speed answers a person in view")

#: A command, the image searched last before it, and those of the half second before it.
Answer = tuple[Take, Command, Look, list[Look]]


def looks_of(takes: Iterable[Take], *, seeing: bool = False) -> Iterator[tuple[Take, Look]]:
    """Yield the images of all scenes; with `seeing`, those in which the node found somebody."""
    return ((take, look) for take in takes for look in take.looks if len(look.found) or not seeing)


def _answers(takes: Iterable[Take], *, seeing: bool) -> list[Answer]:
    """Return the commands whose images of the last half second all had a box, or all had none."""
    return [
        (take, command, look, recent)
        for take in takes
        for command, look, recent in take.answers
        if recent and all(bool(len(one.found)) == seeing for one in recent)
    ]


def _wrong(take: Take, command: Command, look: Look, said: str, more: str = "") -> Finding:
    """Return that a command is a wrong answer: what is `said` comes before the command, what is `more` after it."""
    return Finding(False, f"{take.at(look)}: {said}the command is {command_of(command)}{more}", command.line, look)


def moves(takes: Sequence[Take]) -> bool:
    """Whether a person in view is ever answered by a command that moves the robot."""
    return any(c.twist.linear or c.twist.angular for _, c, _, _ in _answers(takes, seeing=True))


def stands(takes: Sequence[Take]) -> Finding:
    """Whether images without a box are answered with a stop that is not the answer to every image."""
    if not any(looks_of(takes, seeing=True)):
        return NOBODY_FOUND
    answers = _answers(takes, seeing=False)
    for take, command, look, _ in answers:
        if command.twist.linear or command.twist.angular:
            return _wrong(take, command, look, "no box, yet ")
    stopped = {id(take) for take, *_ in answers}
    for take in takes:
        empty = [look for look in take.looks if look.searched is not None and not len(look.found)]
        if id(take) not in stopped and empty and (len(empty) > 5 or take.failed):
            said = f"{take.at(empty[-1])}: no box, and no command; publish Twist(), which stops the robot"
            return Finding(False, said, None, empty[-1])
    here = {command.line for _, command, _, _ in answers}
    there = {command.line for _, command, _, _ in _answers(takes, seeing=True)}
    if not answers or not (moves(takes) or here - there):
        return Finding(None, "not tried: the same zero command answers every picture, with a person and without")
    return _rests(takes) or Finding(True, f"{len(answers)} commands without a box are a zero Twist")


def _rests(takes: Sequence[Take]) -> Finding | None:
    """Return where the robot still moves once nobody has been in view for a while; None where it never does."""
    for take in takes:
        seen = max((look.time for look in take.looks if len(look.people)), default=-_GONE_S)
        after = [pose for at, *pose in take.path if at > seen + _GONE_S]
        if len(after) < 2:
            continue
        (x, y, yaw), last = after[0], take.looks[-1]
        way = max(float(np.hypot(u - x, v - y)) for u, v, _ in after)
        turn = max(abs(float(np.arctan2(np.sin(w - yaw), np.cos(w - yaw)))) for _, _, w in after)
        if way > _STILL_M or turn > _STILL_RAD:
            said = f"{take.at(last)}: nobody is in view, and the robot drives {way:.2f} m and turns {turn:.1f} rad"
            return Finding(False, said, last.commands[-1].line if last.commands else None, last)
    return None


def turns(takes: Sequence[Take]) -> Finding:
    """Whether the robot turns to the person's side, on both sides."""
    clear = []
    for take, command, look, recent in _answers(takes, seeing=True):
        errors = [error_of(one) for one in recent]
        # (Of several people, which is the right one is asked elsewhere.)
        alone = all(len(one.found) == 1 for one in recent)
        if alone and (min(errors) > CLEAR_ERROR or max(errors) < -CLEAR_ERROR):
            clear.append((take, command, look, errors[0]))
    if not clear or not moves(takes):
        return NEVER_MOVES
    wrong = [entry for entry in clear if entry[1].twist.angular * entry[3] <= 0]
    if wrong:
        take, command, look, error = wrong[0]
        side = "left: angular.z > 0" if error > 0 else "right: angular.z < 0"
        swapped = all(command.twist.angular * error < 0 for _, command, _, error in clear)
        more = "; the sign is swapped: the error is middle - cx" if swapped else ""
        return _wrong(take, command, look, f"the person is {abs(error)} px to the {side}; ", more)
    if len({error > 0 for *_, error in clear}) < 2:
        return Finding(None, "not tried: the person was found on one side only")
    return Finding(True, "left of the middle turns left, right turns right")


def dead_band(takes: Sequence[Take], pixels: int = DEAD_BAND) -> Finding:
    """Whether a robot that turns otherwise does not turn when the person is in the middle."""
    answers = _answers(takes, seeing=True)
    if not any(command.twist.angular for _, command, _, _ in answers):
        return Finding(None, "not tried: the robot never turns")
    tried = [answer for answer in answers if max(abs(error_of(one)) for one in answer[3]) < pixels]
    for take, command, look, _ in tried:
        if command.twist.angular != 0.0:
            said = f"{error_of(look)} px off the middle, within {pixels}: wanted is angular.z 0; "
            return _wrong(take, command, look, said)
    if not tried:
        return Finding(None, "not tried: no frame had the person in the middle")
    return Finding(True, f"{len(tried)} commands within {pixels} px do not turn")


def drives(takes: Sequence[Take]) -> Finding:
    """Whether the robot drives forward to a person ahead, and never back; off the middle it may turn first."""
    if not moves(takes):
        return NEVER_MOVES
    ahead = []
    for take, command, look, recent in _answers(takes, seeing=True):
        if command.twist.linear < 0:
            return _wrong(take, command, look, "a person is in view: wanted is linear.x > 0; ")
        if max(abs(error_of(one)) for one in recent) <= CLEAR_ERROR:
            ahead.append((take, command, look))
    still = [entry for entry in ahead if entry[1].twist.linear == 0]
    if len(still) > (1 - RIGHT) * len(ahead):
        return _wrong(*still[0], "a person is in view ahead: wanted is linear.x > 0; ")
    if not ahead:
        return Finding(None, "not tried: no person was found ahead")
    return Finding(True, "a person ahead is answered with a forward command")


def speaks(takes: Sequence[Take], seconds: float = SILENCE) -> Finding:
    """Whether commands come often enough while a person is in view."""
    if not moves(takes):
        return NEVER_MOVES
    for take in takes:
        seen = [look.time for look in take.looks if len(look.found)]
        if not seen:
            continue
        times = [command.time for command in take.outcome.stage.commands if command.time < seen[-1]]
        gap, at = max((b - a, a) for a, b in itertools.pairwise([0.0, *times, seen[-1]]))
        if gap > seconds + 1e-6 and not blocked(take):
            said = f"{take.scene.words}: no command for {gap:.1f} s after {at:.1f} s; the watchdog stops the robot"
            return Finding(False, said)
    return Finding(True, f"never more than {seconds:g} s without a command while a person is in view")


def returns(takes: Sequence[Take]) -> Finding:
    """Whether no callback of a node that answers pictures sleeps for longer than from one picture to the next."""
    for take in takes:
        if said := blocked(take, 1 / take.scene.scenario.camera.rate_hz):
            return Finding(False, f"{take.scene.words}: {said}; meanwhile no frame is looked at")
    return Finding(True, "every callback returns in time") if moves(takes) else NEVER_MOVES


def blocked(take: Take, seconds: float = SILENCE) -> str:
    """Return which callback took longer than this, "" if none did; the default is the watchdog's time."""
    call = take.outcome.stage.longest
    if call is None or call.slept <= seconds - 1e-6:
        return ""
    return f"the callback at {call.time:.1f} s slept for {call.slept:.1f} s"


def keeps(
    takes: Sequence[Take], back: Sequence[str] = (), forward: Sequence[str] = (), stop: Sequence[str] = ()
) -> Finding:
    """Whether the robot drives back, forward, or not at all, in the scenes of these names."""
    wanted = {name: sign for sign, names in ((-1, back), (1, forward), (0, stop)) for name in names}
    tried = set()
    for take, command, look, _ in _answers([t for t in takes if t.scene.name in wanted], seeing=True):
        sign, speed = wanted[take.scene.name], command.twist.linear
        tried.add(sign)
        if speed * sign <= 0 and (sign or speed):
            how = {-1: "to drive back", 1: "to drive forward", 0: "to stop, since the depth is unknown"}[sign]
            return _wrong(take, command, look, f"wanted is {how}; ")
    if len(tried) < len(set(wanted.values())):
        return NOBODY_FOUND
    return Finding(True, "drives forward when the person is too far, back when too near")


def limits(takes: Sequence[Take], linear: float = 0.3, angular: float = 0.8) -> Finding:
    """Whether commands keep within the limits [m/s, rad/s]."""
    if not moves(takes):
        return NEVER_MOVES
    for take, look in looks_of(takes):
        for command in look.commands:
            if abs(command.twist.linear) > linear + 1e-9 or abs(command.twist.angular) > angular + 1e-9:
                more = f"; the limits are {linear:g} m/s and {angular:g} rad/s"
                return _wrong(take, command, look, "", more)
    return Finding(True, f"never faster than {linear:g} m/s and {angular:g} rad/s")


def figures(takes: Sequence[Take], **wanted: Sequence[float]) -> Finding:
    """Whether figures of the score card, such as in_view, are between two bounds in each scene."""
    told = []
    for take in takes:
        if take.outcome.failure:
            line = take.outcome.fault.line if take.outcome.fault else None
            return Finding(False, f"{take.scene.words}: {take.outcome.failure}", line)
        card = score_of(take.outcome).to_json()
        for name, (least, most) in wanted.items():
            said = "unknown" if card[name] is None else f"{card[name]:.2f}"
            told.append(f"{name} is {said}, wanted {least:g} to {most:g}")
            if card[name] is None or not least <= card[name] <= most:
                return Finding(False, f"{take.scene.words}: {told[-1]}", None, take.looks[-1] if take.looks else None)
    return Finding(True, "; ".join(told)) if told else Finding(None, "not tried")


def surest(look: Look) -> int:
    """Return the index of the box with the greatest score."""
    return int(np.argmax(look.found.scores))


def error_of(look: Look) -> int:
    """Return how far left of the middle the surest box is [px]."""
    return int(look.image.shape[1]) // 2 - middle(look.found.windows[surest(look)])


def middle(box: NDArray[np.int32]) -> int:
    """Return the column in the middle of a box [px]."""
    return int(box[0] + box[2] // 2)


def boxes_of(look: Look) -> str:
    """Return a frame's boxes and scores in words."""
    pairs = zip(look.found.windows.tolist(), look.found.scores.tolist(), strict=True)
    return ", ".join(f"{tuple(box)} {score:.2f}" for box, score in pairs)


def command_of(command: Command) -> str:
    """Return a command in words."""
    return f"linear.x {command.twist.linear:.2f}, angular.z {command.twist.angular:+.2f}"
