"""What the workshop's checkpoints want of a node's windows, boxes and log lines."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from limo_hog.suppression import intersection_over_union
from limo_sim.workshop.checkpoints import (
    CLEAR_ERROR,
    NOBODY_FOUND,
    RIGHT,
    blocked,
    boxes_of,
    command_of,
    error_of,
    looks_of,
    middle,
    surest,
)
from limo_sim.workshop.mistakes import Finding
from limo_sim.workshop.takes import SILENCE, Look, Picture, Take, is_swapped

#: Boxes of one person, of which a node may keep the surest alone, overlap by more (intersection over union).
_SAME_PERSON = 0.3

GREEN, RED, BLUE = (0, 255, 0), (0, 0, 255), (255, 0, 0)


def shown(takes: Sequence[Take]) -> Finding:
    """Whether a window shows the camera's picture, never older than half a second."""
    for take in takes:
        if blocked(take):
            continue
        for look in take.looks:
            # A timer may show its first picture half a second after the first frame.
            ages = [look.time - of.time for at, _, _, of in take.windows if of and at <= look.time + 1e-6]
            if look.time >= SILENCE - 1e-6 and min(ages, default=9.0) > SILENCE + 1e-6:
                return _not_shown(take, look)
    if not any(look.pictures for _, look in looks_of(takes)):
        return Finding(None, "not tried: no window was shown")
    return Finding(True, "a window shows every frame")


def _not_shown(take: Take, look: Look) -> Finding:
    before = [entry for entry in take.windows if entry[0] <= look.time + 1e-6]
    said = f"{take.at(look)}: "
    if not before:
        return Finding(False, f"{said}no window; show the picture with cv2.imshow and cv2.waitKey(1)", look=look)
    at, name, picture, of = before[-1]
    said += f"the window {name!r} shows "
    if at < look.time - SILENCE or of is not None:
        said += f"a picture of {at if of is None else of.time:.1f} s: call cv2.imshow for every image"
    elif picture.ndim == 2:
        said += f"a grey or depth picture {picture.shape}, not the camera's colour image"
    elif picture.shape != look.image.shape:
        said += f"{picture.shape}; wanted is the camera's size {look.image.shape}"
    elif is_swapped(picture, look.image):
        said += "red and blue swapped: convert with imgmsg_to_cv2(message, 'bgr8')"
    else:
        said += "another picture, or one older than half a second; "
        said += "wanted is the camera's image, and what you draw on it"
    return Finding(False, said, take.calls.windows.get(name), look)


def found(takes: Sequence[Take]) -> Finding:
    """Whether the detector is given pictures in which it finds the people."""
    looks, seeing = list(looks_of(takes)), list(looks_of(takes, seeing=True))
    if not seeing:
        sizes = "; ".join(sorted({str(look.raw.shape) for _, look in looks if look.raw}))
        return Finding(False, f"people stand 2 to 3 m away, and detectMultiScale finds no box in images of {sizes}")
    there = [(take, look) for take, look in seeing if len(look.people)]
    off = [(take, look) for take, look in there if not look.on_person(look.found.windows[surest(look)])]
    if not there or len(off) > (1 - RIGHT) * len(there):
        take, look = (off or seeing)[0]
        return Finding(False, f"{take.at(look)}: the box {boxes_of(look)} is on nobody", look=look)
    take, look = seeing[0]
    return Finding(True, f"{len(seeing)} of {len(looks)} frames with boxes; {take.at(look)}: {boxes_of(look)}")


def logged(takes: Sequence[Take], of_people: bool = False) -> Finding:
    """Whether a kind of log line tells the number of boxes, be it every frame or every thirtieth.

    `of_people`: the number of people, where the detector returns more boxes than that.
    """
    if not any(looks_of(takes, seeing=True)):
        return NOBODY_FOUND
    kinds: dict[str, list[tuple[bool, int, Finding]]] = defaultdict(list)
    for take, look in looks_of(takes):
        found, people = len(look.found), len(look.people)
        if look.searched is None or (of_people and not found > people > 0):
            continue
        right = {people} if of_people else {found, len(distinct(look))}
        for line in look.said:
            told = {int(number) for number in re.findall(r"\d+", line) if len(number) < 9}
            said = f"{take.at(look)}: {found} boxes of {people} people, logged: {line!r}"
            if told:
                entry = bool(told & right), min(found, 2), Finding(False, said, look=look)
                kinds[re.sub(r"[-+\d.,\s]+", "#", line)].append(entry)
    worst = Finding(False, "boxes are found, and no log line has their number: log len(boxes)")
    for lines in kinds.values():
        # Nobody, one and several are judged each: a line that always says 1 is right for most frames.
        by_number = [[right for right, number, _ in lines if number == wanted] for wanted in (0, 1, 2)]
        if any(by_number[1] + by_number[2]) and all(sum(rights) >= RIGHT * len(rights) for rights in by_number):
            return Finding(True, f"{len(lines)} log lines with the number of {'people' if of_people else 'boxes'}")
        worst = next((finding for right, _, finding in lines if not right), worst)
    return worst


def scaled_back(takes: Sequence[Take]) -> Finding:
    """Whether boxes of a copy of another size are used in the camera's pixels: drawn, and steered by."""
    seeing = list(looks_of(takes, seeing=True))
    if not seeing:
        return NOBODY_FOUND
    copies = [(t, k, k.raw) for t, k in seeing if k.raw and k.raw.shape[:2] != k.image.shape[:2]]
    # (Windows as large as those in the camera's pixels are of a part of the image, at its own size.)
    scaled = [
        (take, look, raw)
        for take, look, raw in copies
        if len(raw.detections) and not np.array_equal(raw.detections.windows[:, 2:], look.found.windows[:, 2:])
    ]
    if not scaled:
        return Finding(True, "the detector is given the camera's own pixels")
    turned = False
    for take, look, raw in scaled:
        best = surest(look)
        here, there = look.found.windows[best], raw.detections.windows[min(best, len(raw.detections) - 1)]
        error, unscaled = error_of(look), look.image.shape[1] // 2 - middle(there)
        turns = [command for command in look.commands if command.twist.angular and abs(error) > CLEAR_ERROR]
        turned |= bool(turns)
        wrong = [c for c in turns if c.twist.angular * error < 0 < c.twist.angular * unscaled]
        drawn = [p for p in look.pictures if _share(p, there, RED) > 0.5 > _share(p, here, RED)]
        if wrong or drawn:
            said = f"{take.at(look)}: the box at x = {middle(there)} of the {raw.shape[1]} px wide copy is at "
            said += f"{middle(here)} in the camera's {look.image.shape[1]} px; "
            said += f"the command is {command_of(wrong[0])}" if wrong else "it is drawn without being scaled back"
            return Finding(False, said, wrong[0].line if wrong else None, look)
    if not turned:
        return Finding(None, "not tried: a copy of another size is searched, and the robot does not turn yet")
    return Finding(True, f"boxes of the copy, {scaled[0][2].shape}, are scaled back")


def best(takes: Sequence[Take]) -> Finding:
    """Whether the surest box is drawn red with a blue middle, and the others green."""
    if not any(looks_of(takes, seeing=True)):
        return NOBODY_FOUND
    judged = False
    for take in takes:
        faults, right = [], 0
        for look in take.looks:
            if not len(look.found) or not look.pictures:
                continue
            # (A picture may have the boxes of an image before: not every one is searched.)
            of = [look, *(k for k in take.looks if 0 < look.time - k.time <= SILENCE and len(k.found))]
            wrong = [_misdrawn(of, picture) for picture in look.pictures]
            right += not all(wrong)
            faults += [(wrong[-1], look)] if all(wrong) else []
        judged |= bool(right or faults)
        if len(faults) > (1 - RIGHT) * (right + len(faults)):
            said, look = faults[0]
            return Finding(False, f"{take.at(look)}: {said}", next(iter(take.calls.windows.values()), None), look)
    if not judged:
        return Finding(None, "not tried: no window shows the camera's picture")
    return Finding(True, "the surest box is red with a blue dot, the others are green")


def _misdrawn(looks: Sequence[Look], picture: Picture) -> str:
    """Return what is wrong with the boxes drawn in a picture of the first look; "" if they are right for one."""
    faults = []
    for look in looks:
        # limo-hog's detectors tell the window as well as the person in it.
        for boxes in (look.found.windows, look.found.boxes):
            faults.append(_fault(look, boxes, picture))
            if not faults[-1]:
                return ""
    return faults[0]


def _fault(look: Look, boxes: NDArray[np.int32], picture: Picture) -> str:
    if np.array_equal(picture, look.image):
        return "the window shows the image with nothing drawn on it; show the picture you drew on"
    first = surest(look)
    reds = [_share(picture, box, RED) for box in boxes]
    if reds[first] < 0.5:
        if max(reds) > 0.5:
            return f"the red box is number {int(np.argmax(reds))} of {boxes_of(look)}; surest is {first}"
        if _share(picture, boxes[first], BLUE) > 0.5:
            return "the surest box is blue: colours are blue, green, red, so red is (0, 0, 255)"
        return f"no red box around the surest of {boxes_of(look)}"
    x, y, w, h = boxes[first].tolist()
    around = picture[max(y + h // 2 - 4, 0) : y + h // 2 + 5, max(x + w // 2 - 4, 0) : x + w // 2 + 5].reshape(-1, 3)
    if not around.size or np.mean((around == BLUE).all(axis=1)) < 0.3:
        return f"no blue dot in the middle of the red box, ({x + w // 2}, {y + h // 2})"
    if any(_share(picture, boxes[i], GREEN) < 0.5 for i in distinct(look) if i != first):
        return f"not every other box of {boxes_of(look)} is green"
    return ""


def distinct(look: Look) -> list[int]:
    """Return the indices of the boxes that are left when of those on one person the surest is kept."""
    kept: list[int] = []
    windows = look.found.windows
    for i in np.argsort(-look.found.scores).tolist():
        if not kept or intersection_over_union(windows[i][None], windows[kept]).max() < _SAME_PERSON:
            kept.append(i)
    return kept


def _share(picture: Picture, box: NDArray[np.int32], colour: tuple[int, int, int]) -> float:
    """Return the share of a box's outline that has a colour, lines of any width; within the picture."""
    x, y, w, h = box.tolist()
    height, width = picture.shape[:2]
    points = [(x + i, r) for i in range(w) for r in (y, y + h)] + [(c, y + i) for i in range(h) for c in (x, x + w)]
    inside = np.array([(r, c) for c, r in points if 0 <= r < height and 0 <= c < width]).reshape(-1, 2)
    return float(np.mean((picture[inside[:, 0], inside[:, 1]] == colour).all(axis=1))) if len(inside) else 0.0
