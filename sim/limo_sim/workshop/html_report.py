"""A node's report as one HTML page: points, evidence, and the pictures the node showed in each scene."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path

import cv2
import numpy as np

from limo_hog.imaging.notebook import data_uri
from limo_hog.imaging.writing import jpeg
from limo_sim.workshop.check import Examination, Verdict
from limo_sim.workshop.checkpoints import command_of
from limo_sim.workshop.exercises import exercise, task_name
from limo_sim.workshop.report import by_task, evidence, total
from limo_sim.workshop.takes import Look, Take

#: Width of the pictures on the page [px]: half the camera's, enough to see a box.
_WIDTH = 320
_MARKS = {True: ("✓", "holds"), False: ("✗", "missed"), None: ("–", "open")}

_STYLE = Path(__file__).with_name("report.css").read_text(encoding="utf-8")


def to_html(script: Path, node: str, examination: Examination) -> str:
    """Return the page; it needs no other file and no network."""
    verdicts = examination.verdicts
    points, worth = total(verdicts)
    tasks = "".join(
        f'<div>Task {task_name(task)}: {won} of {of}<progress max="{of}" value="{won}"></progress></div>'
        for task, (won, of) in by_task(verdicts).items()
    )
    cited = [verdict.look for verdict in verdicts if verdict.look is not None]
    scenes = "".join(_scene(take, cited) for take in examination.takes)
    return f"""<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{escape(script.name)}: {points} of {worth} points</title>
<style>{_STYLE}</style>
<header>
<h1>{escape(script.name)}</h1>
<p>limo-hog workshop check: {escape(exercise(node).title)}</p>
</header>
<main>
<p class="points">{points} <small>of {worth} points</small></p>
<div class="tasks">{tasks}</div>
<h2>Checkpoints</h2>
<ul>{"".join(_line(verdict) for verdict in verdicts)}</ul>
<h2>What the node showed</h2>
<div class="scenes">{scenes}</div>
</main>
</html>
"""


def _line(verdict: Verdict) -> str:
    mark, kind = _MARKS[verdict.holds]
    won = f"{verdict.points}/{verdict.worth}" if verdict.worth else ""
    name = f"Task {task_name(verdict.task)}: {escape(verdict.checkpoint)}"
    return (
        f'<li class="{kind}"><span class="mark">{mark}</span><span class="name">{name}</span>'
        f'<span class="won">{won}</span><p>{escape(evidence(verdict))}</p></li>'
    )


def _scene(take: Take, cited: Sequence[Look]) -> str:
    """Return the images that verdicts cite, or a telling one, and the way of the robot."""
    words = escape(take.scene.words.capitalize())
    looks = [look for look in take.looks if look in cited][:3]
    # (Else the image with the most boxes and a window, of equals the last.)
    looks = looks or sorted(take.looks, key=lambda look: (bool(look.pictures), len(look.found), look.time))[-1:]
    if not looks:
        return f'<figure><div class="none">no frame</div><figcaption>{words}</figcaption></figure>'
    figures = "".join(_figure(take, look, words) for look in looks)
    return figures + (_map(take, words) if take.scene.last else "")


def _figure(take: Take, look: Look, words: str) -> str:
    picture = look.pictures[-1] if look.pictures else look.image
    window = next((name for _, name, there, _ in take.windows if there is picture), "")
    height = max(round(picture.shape[0] * _WIDTH / picture.shape[1]), 1)
    small = cv2.resize(picture, (_WIDTH * 2, height * 2), interpolation=cv2.INTER_AREA)
    uri = data_uri(jpeg(small.astype(np.uint8, copy=False)))
    command = command_of(look.commands[-1]) if look.commands else "no command"
    count = len(look.found)
    boxes = "" if look.raw is None else f"{count} box{'es' if count != 1 else ''} found; "
    shown = f"window “{window}”; " if look.pictures else "the camera's image, no window shows it; "
    said = escape(f"at {look.time:.1f} s: {shown}{boxes}{command}")
    return f'<figure><img alt="{said}" src="{uri}"><figcaption>{words}<span>{said}</span></figcaption></figure>'


def _map(take: Take, words: str) -> str:
    """Return the way of the robot and of the people, seen from above, as a drawing."""
    half = take.scene.scenario.room.half
    robot = [(x, y) for _, x, y, _ in take.path]
    people = [
        [(p.x, p.y) for look in take.looks if (p := look.truth.people[index]) is not None]
        for index in range(len(take.scene.scenario.people))
    ]
    lines = "".join(
        f'<polyline fill="none" stroke="{colour}" stroke-width=".06" points="'
        + " ".join(f"{x:.2f},{-y:.2f}" for x, y in way)
        + '"/>'
        for colour, way in [*(("#c60", way) for way in people), ("#06c", robot)]
    )
    view = f"{-half} {-half} {2 * half} {2 * half}"
    return (
        f'<figure><svg viewBox="{view}" width="{_WIDTH}" height="{_WIDTH}" role="img">{lines}</svg><figcaption>'
        f"{words}<span>from above: the robot's way blue, the person's orange; the room is {2 * half:g} m wide</span>"
        "</figcaption></figure>"
    )
