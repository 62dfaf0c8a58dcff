"""What a node did in a scene: each camera image with the boxes, pictures, commands and lines that belong to it.

A box belongs to the image that was searched, and a picture to the image it shows: both are told by their pixels. A
command and a line of the log belong to the image that was searched last.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from limo_hog.detections import Detections
from limo_hog.suppression import intersection_over_union
from limo_sim.ros.lockstep.calls import LOGGER, Calls
from limo_sim.ros.lockstep.records import Command, Fault, Found, Shown, StubError
from limo_sim.ros.runner import Limits, Said, run_node
from limo_sim.ros.stage import Ended, Stage, Witness
from limo_sim.run.log import Step
from limo_sim.sensing.camera import TrueFrame
from limo_sim.world.scenario import Scenario
from limo_sim.world.truth import Truth

Picture = NDArray[np.uint8]

#: A command is right if it answers an image of this age or younger; a window is as old at most. The watchdog's [s].
SILENCE = 0.5
#: Overlap of a box with a person's outline from which it is on that person. Measured: HOG's boxes, which have a
#: margin, have .3 to .4 (intersection over union), and less than .05 with the other person.
ON_PERSON = 0.2
#: Pixels are alike if no channel differs by more: JPEG's error on this arena's pictures is smaller.
_ALIKE = 16
#: Correlation from which a searched picture is taken for a camera image, or for a part of one. Chosen.
_CORRELATED = 0.9
#: Pictures that may be shown in a second of a scene [bytes]: a hundred of the camera's. All are kept. Chosen.
_MOST_SHOWN = 100 * 640 * 480 * 3
#: A window's picture is looked for among images of this age or younger [s].
_OLDEST = 4.0
_THUMBNAIL = (160, 120)


@dataclass(frozen=True, slots=True)
class Scene:
    """A short run in which a node is tried."""

    name: str
    words: str  #: what happens there
    scenario: Scenario
    seconds: float = 1.0  #: how long it is [s]
    arguments: tuple[str, ...] = ()  #: ROS arguments for the node
    last: bool = False  #: whether it is played only where every checkpoint of the other scenes holds


@dataclass(eq=False)
class Look:
    """One camera image, and what the node made of it."""

    time: float  #: when the node got it [s]
    image: Picture
    truth: Truth  #: the arena when it was taken
    found: Detections = field(default_factory=Detections.none)  #: in the camera's pixels
    #: The detector's newest result, in pixels of the picture it was given; None where the image was not searched.
    raw: Found | None = None
    searched: float | None = None  #: when that was [s]
    #: commands, said: what was published on /cmd_vel, and logged, after this image was searched and before the next
    #: one was.
    commands: list[Command] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    pictures: list[Picture] = field(default_factory=list)  #: what windows showed of this image
    _place: tuple[float, int, int] = (1.0, 0, 0)

    # The image for comparisons: every fourth row and column, without colours, and small.
    thin = cached_property(lambda look: _thin(look.image))
    grey = cached_property(lambda look: _grey(look.image))
    thumbnail = cached_property(lambda look: _thumbnail(look.image))

    @cached_property
    def people(self) -> Detections:
        """The people in the image, by the arena's truth: outlines, and their heights as scores."""
        seen = [p.box for p in self.truth.people if p is not None and p.box is not None and p.visible > 0.5]
        return Detections(np.array(seen, np.int32).reshape(-1, 4), np.array([float(box[3]) for box in seen]))

    def on_person(self, box: NDArray[np.int32], index: int | None = None) -> bool:
        """Whether a box is on a person, or on that of this index."""
        people = self.truth.people if index is None else self.truth.people[index : index + 1]
        outlines = np.array([p.box for p in people if p is not None and p.box is not None]).reshape(-1, 4)
        return bool((intersection_over_union(box[None], outlines) >= ON_PERSON).any())

    def take_boxes(self, found: Found, place: tuple[float, int, int]) -> None:
        """Add what was found in a picture, whose `place` in this image is its scale and its left and upper edge."""
        scale, x, y = place
        windows = np.rint(found.detections.windows * scale + np.array([x, y, 0, 0])).astype(np.int32)
        scores = found.detections.scores
        if self.raw is not None and place != self._place:
            # Another part of the same image.
            windows, scores = np.vstack([self.found.windows, windows]), np.append(self.found.scores, scores)
        self.found, self.raw, self._place = Detections(windows, scores), found, place


@dataclass(eq=False)
class Take(Witness):
    """A node in one scene."""

    scene: Scene
    looks: list[Look] = field(default_factory=list)  #: what it made of each camera image
    #: What windows showed, in order: when [s], the window, the picture, and the look whose image it shows, if any.
    windows: list[tuple[float, str, Picture, Look | None]] = field(default_factory=list)
    #: The time, and the robot's x, y, yaw, in each control period [s, m, m, rad].
    path: list[tuple[float, float, float, float]] = field(default_factory=list)
    #: Each command with the look whose image was searched last, and all looks of the last half second whose image had
    #: been searched; where there are none, the former.
    answers: list[tuple[Command, Look, list[Look]]] = field(default_factory=list)
    unplaced: set[tuple[int, ...]] = field(default_factory=set)  #: sizes of searched pictures, part of no camera image
    _corners: list[tuple[int, int]] = field(default_factory=lambda: [(0, 0)])
    outcome: Ended = field(init=False)  #: how the run ended
    _answered: Look | None = None
    _kept: int = 0  # bytes of all pictures in `windows`

    @property
    def calls(self) -> Calls:
        """What the node called."""
        return self.outcome.stage.calls

    @property
    def failed(self) -> bool:
        """Whether the node ended before the scene did."""
        return self.outcome.fault is not None

    def at(self, look: Look) -> str:
        """Say which image it is."""
        arguments = f" ({' '.join(self.scene.arguments)})" if self.scene.arguments else ""
        return f"{self.scene.words}{arguments}, image of {look.time:.1f} s"

    def recent(self, time: float, seconds: float = SILENCE) -> list[Look]:
        """Return the looks of the last half second before a time [s], the newest first."""
        return [look for look in reversed(self.looks) if time - seconds - 1e-6 <= look.time <= time + 1e-6]

    def frame(self, time: float, frame: TrueFrame) -> None:
        """Note that the node is given an image, and has time to answer it."""
        if time < self.scene.seconds - 1e-6:
            self.looks.append(Look(time, frame.image, frame.truth))

    def found(self, time: float, found: Found, picture: Picture) -> None:
        """Note a search."""
        look, place = _located(picture, self.recent(time), self._corners)
        if look is None:
            self.unplaced.add(found.shape)
            return
        look.take_boxes(found, place)
        look.searched, self._answered = time, look

    def shown(self, window: str, shown: Shown) -> None:
        """Note a picture in a window."""
        self._kept += shown.picture.nbytes
        if self._kept > _MOST_SHOWN * (1.0 + shown.time):
            raise ValueError(f"more than {_MOST_SHOWN // 10**6} MB of pictures a second")
        look = _shown_in(shown.picture, self.recent(shown.time, _OLDEST))
        self.windows.append((shown.time, window, shown.picture, look))
        if look is not None:
            look.pictures.append(shown.picture)

    def command(self, command: Command) -> None:
        """Note a command."""
        if self.looks:
            answered = self._answered or self.looks[-1]
            answered.commands.append(command)
            # (Now: a later search may bear the same time.)
            recent = [look for look in self.recent(command.time) if look.searched is not None]
            if not recent and answered.searched is not None:
                recent = [answered]
            self.answers.append((command, answered, recent))

    def log(self, _time: float, _level: str, name: str, message: str) -> None:
        """Note a line of the log."""
        if self.looks and name != LOGGER:
            (self._answered or self.looks[-1]).said.append(message)


def play(script: Path, scene: Scene, limits: Limits | None = None, said: Said = lambda *_: None) -> Take:
    """Run a node in a scene and note what it does; `said` is given what it prints."""
    take = Take(scene)

    def watch(step: Step) -> None:
        take.path.append((step.log.time, *step.truth.robot))

    stage = Stage(script, scene.scenario, scene.seconds, log=take.log, watch=watch, witness=take)
    try:
        take.outcome = run_node(stage, ("--ros-args", *scene.arguments), limits=limits, said=said, checked=True)
    except StubError as error:  # a node that has deleted its file in an earlier scene
        take.outcome = stage.finish(Fault("was stopped", str(error)))
    return take


def judge_by_truth(takes: list[Take]) -> bool:
    """Where no search could be placed in a camera image, let people's true outlines stand for boxes; return whether."""
    looks = [look for take in takes for look in take.looks]
    if any(look.raw is not None for look in looks):
        return False
    for look in looks:
        look.found, look.searched = look.people, look.time
    for take in takes:
        # (When the commands came none of these images had been searched.)
        take.answers = [(command, look, take.recent(command.time)) for command, look, _ in take.answers]
    return True


def _thin(picture: Picture) -> Picture:
    return np.ascontiguousarray(picture[::4, ::4])


def _share(one: Picture, other: Picture, tolerance: int) -> float:
    """Return the share of pixels no channel of which differs by more."""
    within = cv2.inRange(cv2.absdiff(one, other), (0, 0, 0), (tolerance,) * 3)
    return cv2.countNonZero(within) / within.size


def is_swapped(shown: Picture, image: Picture) -> bool:
    """Whether a picture shows an image with red and blue in each other's place."""
    return _share(_thin(shown), _thin(image[..., ::-1]), _ALIKE) > 0.5


def _shown_in(picture: Picture, looks: list[Look]) -> Look | None:
    """Return the look whose image a picture shows, with things drawn on it; None if it shows none."""
    looks = [look for look in looks if look.image.shape == picture.shape]
    if not looks:
        return None
    thin = _thin(picture)
    swapped = np.ascontiguousarray(thin[..., ::-1])
    for look in looks:
        same = _share(thin, look.thin, 0)
        if same > 0.5 and same >= _share(swapped, look.thin, 0):
            return look
    # Of compressed images no pixel is the same.
    share, best = max(((_share(thin, look.thin, _ALIKE), look) for look in looks), key=lambda pair: pair[0])
    return best if share > 0.5 and share >= _share(swapped, best.thin, _ALIKE) else None


def _thumbnail(picture: Picture) -> Picture:
    return _grey(np.asarray(cv2.resize(picture, _THUMBNAIL, interpolation=cv2.INTER_AREA), np.uint8))


def _grey(picture: Picture) -> Picture:
    grey = picture if picture.ndim == 2 else picture[..., :3].mean(axis=2, dtype=np.float32).astype(np.uint8)
    return np.ascontiguousarray(grey)


def _located(
    picture: Picture, looks: list[Look], corners: list[tuple[int, int]]
) -> tuple[Look | None, tuple[float, int, int]]:
    """Return the look whose image was searched, and the picture's place in it; None if it is part of none.

    `corners`: where parts of earlier images began, the newest last; a part that is found elsewhere is added.
    """
    height, width = picture.shape[:2]
    for look in looks:
        for x, y in reversed(corners):
            if np.array_equal(picture, look.image[y : y + height, x : x + width]):
                return look, (1.0, x, y)
    best: tuple[float, Look | None, tuple[float, int, int]] = (_CORRELATED, None, (1.0, 0, 0))
    whole: Picture | None = None
    for look in looks:
        scale = look.image.shape[0] / height
        if abs(width * scale - look.image.shape[1]) <= max(scale, 1.0):
            whole = _thumbnail(picture) if whole is None else whole
            match = float(cv2.matchTemplate(whole, look.thumbnail, cv2.TM_CCOEFF_NORMED)[0, 0])
            place = (scale, 0, 0)
        elif height <= look.image.shape[0] and width <= look.image.shape[1] and min(height, width) >= 64:
            found = cv2.matchTemplate(look.grey, _grey(picture), cv2.TM_CCOEFF_NORMED)
            _, match, _, (x, y) = cv2.minMaxLoc(found)
            place = (1.0, int(x), int(y))
        else:
            continue
        if match > best[0] + 1e-6:
            best = (match, look, place)
        if place[0] == 1.0 and match > 0.9999:
            corners.append((place[1], place[2]))
            break
    return best[1], best[2]
