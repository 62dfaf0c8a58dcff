"""The likely mistake of a node that gets no picture, finds nobody or moves nothing, with the line it is in."""

from __future__ import annotations

import ast
import hashlib
import threading
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from limo_hog.ros2 import names
from limo_sim.ros.lockstep.calls import Calls, nearest_topic
from limo_sim.workshop.takes import Look, Take

#: Topics that carry the camera's colour image.
_IMAGES = (names.IMAGE, names.IMAGE_COMPRESSED)


class Finding(NamedTuple):
    """Whether a checkpoint holds, None where it could not be tried; why; the student's line; the image it is about."""

    holds: bool | None
    evidence: str
    line: int | None = None
    look: Look | None = None


#: CPython counts the depth of a tree for all threads together (SystemError "recursion depth mismatch" in 3.11).
_PARSING = threading.Lock()


def parsed(node: Path | str) -> ast.Module | None:
    """Return the tree of a file or a text; None where Python refuses it."""
    with suppress(SyntaxError, ValueError, RecursionError, MemoryError, OSError):
        text = node.read_bytes() if isinstance(node, Path) else node
        with _PARSING:
            return ast.parse(text)
    return None


def _first_call(source: ast.Module, function: str) -> int | None:
    """Return the first line that calls a function or a method of this name; None where there is none."""
    calls = (node for node in ast.walk(source) if isinstance(node, ast.Call))
    named = ((call, getattr(call.func, "attr", ""), getattr(call.func, "id", "")) for call in calls)
    return min((call.lineno for call, *names in named if function in names), default=None)


def fingerprint(node: Path | str) -> str:
    """Return what a file or a text has in common with its copies: its code, without comments and names' spelling."""
    tree = parsed(node)
    if tree is None:
        return ""
    names: dict[str, str] = {}
    for part in ast.walk(tree):
        for key in ("id", "arg", "attr", "name"):
            if isinstance(old := getattr(part, key, None), str):
                setattr(part, key, names.setdefault(old, str(len(names))))
        if isinstance(body := getattr(part, "body", None), list):
            # (Docstrings are comments.)
            body[:] = [
                statement for statement in body if not isinstance(getattr(statement, "value", None), ast.Constant)
            ]
    return hashlib.sha256(ast.dump(tree).encode()).hexdigest()


def camera_read(calls: Calls) -> bool:
    """Whether a subscription asks for the camera's colour image."""
    return any(topic in calls.readers for topic in _IMAGES)


def no_picture(source: ast.Module, takes: Sequence[Take]) -> Finding | None:
    """Return why no camera image reaches a callback; None where one does."""
    calls = takes[0].calls
    if calls.given:
        return None
    if not calls.nodes:
        mains = [node.lineno for node in source.body if isinstance(node, ast.FunctionDef) and node.name == "main"]
        if mains and _first_call(source, "main") is None:
            said = "main() is never called; end the file with: if __name__ == '__main__': main()"
            return Finding(False, said, mains[0])
        return Finding(False, "the script makes no node: call rclpy.init(), make the node, and rclpy.spin(node)")
    if not camera_read(calls):
        return Finding(False, *_no_subscription(calls))
    if not calls.spun:
        name, line = next(iter(calls.nodes.items()))
        said = f"the node {name!r} is made and never spun: without rclpy.spin(node) no callback runs"
        return Finding(False, said, line)
    line = next(calls.readers[topic] for topic in _IMAGES if topic in calls.readers)
    for said, there in calls.unmatched.items():
        if any(f"'{topic}'" in said for topic in _IMAGES):
            return Finding(False, said, there)
    return Finding(False, "the callback never ran; is rclpy.spin given the node that has the subscription?", line)


def no_detection(source: ast.Module, takes: Sequence[Take]) -> Finding | None:
    """Return why the detector cannot find anybody; None where it looks at pictures with an SVM."""
    searched_without_svm = takes[0].calls.searched_without_svm
    if searched_without_svm != 0:
        said = "detectMultiScale ran before setSVMDetector, so it finds nothing; in __init__, call\n"
        said += "hog.setSVMDetector(cv2.HOGDescriptor_getDefaultPeopleDetector())"
        return Finding(False, said, searched_without_svm)
    if any(look.raw is not None for take in takes for look in take.looks) or any(take.unplaced for take in takes):
        return None
    if any(take.outcome.stage.detector_inputs for take in takes):
        return Finding(None, "not tried: the detector was asked, and gave no answer")
    line = _first_call(source, "detectMultiScale")
    if line is None:
        return Finding(False, "self.hog.detectMultiScale was never called")
    return Finding(False, "detectMultiScale was never called: this line never runs", line)


def no_command(takes: Sequence[Take]) -> Finding | None:
    """Return why no command reaches the robot; None where one does."""
    if any(take.outcome.stage.commands for take in takes):
        return None
    calls = takes[0].calls
    for said, line in calls.unmatched.items():
        if f"'{names.COMMAND}'" in said:
            return Finding(False, f"the robot gets no command: {said}", line)
    if names.COMMAND in calls.writers:
        return Finding(False, "the publisher is made, but publish is never called", calls.writers[names.COMMAND])
    for topic, line in calls.writers.items():
        if topic not in names.TYPES:
            return Finding(False, f"publishes on {topic!r}; the robot listens to {names.COMMAND!r}", line)
    return Finding(False, f"nothing is published on {names.COMMAND!r}")


def _no_subscription(calls: Calls) -> tuple[str, int | None]:
    for topic, line in calls.readers.items():
        if topic not in (*names.TYPES, *calls.writers):
            nearest = nearest_topic(topic, calls.types.get(topic, ""))
            return f"the topic {topic!r} is not published; did you mean {nearest!r}?", line
    if calls.readers:
        topic, line = next(iter(calls.readers.items()))
        return f"subscribes to {topic!r}; the camera's image is {names.IMAGE!r}", line
    return f"the node has no subscription: call create_subscription(Image, {names.IMAGE!r}, …)", None
