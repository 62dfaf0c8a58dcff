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

_STYLE = """
:root { color-scheme: light dark; --text: #1c2430; --dim: #5b6675; --back: #f6f7f9; --card: #fff; --line: #dde2e8;
  --good: #00688b; --bad: #b3420e; }
@media (prefers-color-scheme: dark) { :root { --text: #e7ebf0; --dim: #a3adba; --back: #14181d; --card: #1d232a;
  --line: #333c47; --good: #6cc4e8; --bad: #ffa06b; } }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1.25rem; max-width: 62rem; background: var(--back); color: var(--text);
  font: 1rem/1.5 system-ui, sans-serif; }
h1 { font-size: 1.5rem; margin: 0; overflow-wrap: anywhere; }
h2 { font-size: 1.1rem; margin: 2rem 0 .5rem; }
header p { color: var(--dim); margin: .1rem 0 1rem; }
.points { font-size: 2.4rem; font-weight: 650; font-variant-numeric: tabular-nums; }
.points small { font-size: 1rem; font-weight: 400; color: var(--dim); }
.tasks { display: grid; gap: .5rem 1rem; grid-template-columns: repeat(auto-fit, minmax(9rem, 1fr)); }
.tasks div { font-variant-numeric: tabular-nums; }
progress { display: block; width: 100%; height: .5rem; accent-color: var(--good); }
ul { list-style: none; margin: 0; padding: 0; background: var(--card); border: 1px solid var(--line);
  border-radius: .6rem; }
li { display: grid; grid-template-columns: 1.5rem 1fr auto; gap: .1rem .5rem; padding: .6rem .9rem; }
li + li { border-top: 1px solid var(--line); }
li p { grid-column: 2 / -1; margin: 0; color: var(--dim); white-space: pre-wrap; overflow-wrap: anywhere; }
.holds .mark { color: var(--good); } .missed .mark, .missed .name { color: var(--bad); font-weight: 650; }
.won { font-variant-numeric: tabular-nums; color: var(--dim); }
.scenes { display: grid; gap: 1rem; grid-template-columns: repeat(auto-fill, minmax(min(17rem, 100%), 1fr)); }
figure { margin: 0; background: var(--card); border: 1px solid var(--line); border-radius: .6rem; overflow: hidden; }
figure img { display: block; width: 100%; height: auto; }
figure .none { display: grid; place-items: center; aspect-ratio: 4 / 3; color: var(--dim); }
figcaption { padding: .5rem .75rem .7rem; }
figcaption span { display: block; color: var(--dim); font-size: .875rem; overflow-wrap: anywhere; }
"""


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
