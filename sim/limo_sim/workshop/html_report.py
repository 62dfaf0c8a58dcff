"""A node's report as one HTML page: points, evidence, and the pictures the node showed in each scene."""

from __future__ import annotations

from html import escape
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from limo_hog.imaging.notebook import data_uri
from limo_hog.imaging.writing import jpeg
from limo_sim.workshop.check import Examination, Verdict
from limo_sim.workshop.checkpoints import command_of, task_name
from limo_sim.workshop.exercises import EXERCISES
from limo_sim.workshop.report import by_task, evidence, total
from limo_sim.workshop.scenes import Look, Take

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
    scenes = "".join(_scene(take) for take in examination.takes)
    return f"""<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{escape(script.name)}: {points} of {worth} points</title>
<style>{_STYLE}</style>
<header>
<h1>{escape(script.name)}</h1>
<p>limo-hog workshop check: {escape(EXERCISES[node].words)}</p>
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


def _scene(take: Take) -> str:
    look = _telling(take)
    if look is None:
        return f'<figure><div class="none">no frame</div><figcaption>{escape(take.scene.words)}</figcaption></figure>'
    picture, window = _picture(look)
    seen = (
        f'<img alt="{escape(window, quote=True)}" src="{picture}">' if picture else '<div class="none">no window</div>'
    )
    command = command_of(look) if look.commands else "no command"
    count = len(look.found)
    boxes = "" if look.raw is None else f"{count} box{'es' if count != 1 else ''} found; "
    said = f"at {look.time:.1f} s: {boxes}{command}"
    shown = f"<span>{escape(window)}</span>" if window else ""
    return (
        f"<figure>{seen}<figcaption>{escape(take.scene.words.capitalize())}<span>{escape(said)}</span>{shown}"
        "</figcaption></figure>"
    )


def _telling(take: Take) -> Look | None:
    """Return the frame with the most boxes and a window, of equals the last."""
    return max(take.looks, key=lambda look: (bool(look.windows), len(look.found), look.time), default=None)


def _picture(look: Look) -> tuple[str, str]:
    """Return the newest window's picture as a data URI, and the window's name; empty without a window."""
    if not look.windows:
        return "", ""
    name, shown = max(look.windows.items(), key=lambda entry: entry[1].time)
    picture: NDArray[np.uint8] = shown.picture
    if picture.ndim not in (2, 3) or min(picture.shape[:2]) < 1:
        return "", name
    height = max(round(picture.shape[0] * _WIDTH / picture.shape[1]), 1)
    small = cv2.resize(picture, (_WIDTH * 2, height * 2), interpolation=cv2.INTER_AREA)
    return data_uri(jpeg(small.astype(np.uint8, copy=False))), f"window “{name}”"
