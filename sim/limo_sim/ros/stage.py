"""The arena on its side of the link: it drives by the node's commands, notes what the node does, and logs the run.

What a node tells is checked here: nothing that it sends can be more than a command, a picture or a text.
"""

from __future__ import annotations

import math
import time
from array import array
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from limo_hog.detections import Detections
from limo_hog.follow.decision import Decision, Mode
from limo_hog.follow.pipeline import FrameLog, Periods
from limo_hog.follow.robot import Twist
from limo_hog.follow.sense.observation import Sensors
from limo_hog.ros2 import names
from limo_hog.ros2.messages import serialize
from limo_sim.ros.lockstep.calls import LOGGER, PUBLISHED, UNHEARD_AFTER, Calls, nearest_topic
from limo_sim.ros.lockstep.records import Callback, Command, Fault, Found, Log, Shown
from limo_sim.ros.outlet import Outlet
from limo_sim.ros.wire import News
from limo_sim.run.arena import Arena
from limo_sim.run.episode import Episode, score
from limo_sim.run.log import Passed, Step, Watch
from limo_sim.run.score import ScoreCard, Scorer
from limo_sim.sensing.camera import TrueFrame
from limo_sim.world.scenario import Scenario

#: Simulated time after a script's failure, in which the watchdog stops the robot [s]: 0.5 s and 1 m/s over 1 m/s².
_AFTERMATH = 2.0
#: Figures of the score card that are unknown where the node's detector is.
_OF_DETECTIONS = (
    "first_detection_s detected best_box_wrong longest_gap_s found_again time_to_find_again_s follows_first "
    "identity_switches detect_ms_p50 detect_ms_p95 detect_ms_mean"
).split()
#: What a node may tell in one step of the arena; a loop that publishes tells so much in seconds. Chosen.
_MOST_TOLD = 10_000
#: Windows that a node may have open; this process keeps the newest picture of each. Chosen.
_MOST_WINDOWS = 100


class Witness:
    """Is told what a node does, as it does it; this one takes no notice."""

    def frame(self, time: float, frame: TrueFrame) -> None:
        """Note that the node is given an image."""

    def found(self, time: float, found: Found, picture: NDArray[np.uint8]) -> None:
        """Note what was found in a picture, be it by OpenCV's HOG, limo-hog's detectors or a tracker."""

    def shown(self, window: str, shown: Shown) -> None:
        """Note a picture in a window."""

    def command(self, command: Command) -> None:
        """Note a command."""


class Stage:
    """One run: the arena, and the log that is scored.

    Raises `ScenarioError` if the scenario asks for faults of the detector, which is the node's own here.
    """

    def __init__(
        self,
        script: Path,
        scenario: Scenario,
        seconds: float,
        seed: int = 0,
        *,
        log: Log = lambda *_: None,
        watch: Watch = lambda _: None,
        witness: Witness | None = None,
    ) -> None:
        scenario.check_detector_is_plain("a node brings its own detector")
        self._began = time.perf_counter()
        self.script = script
        self.arena = Arena(scenario, seed)
        self.seconds = seconds
        self.log, self.watch = log, watch
        self._witness = witness or Witness()
        # (An hour's: 28 bytes each.)
        self._driven, self._lines = array("d"), array("i")
        self.found: list[Found] = []  #: what the script's detector found since the last camera frame
        self.shown: dict[str, Shown] = {}  #: the newest picture of each window; closing a window removes it
        self.calls = Calls()
        self.longest: Callback | None = None  #: the callback that slept longest; None while none has slept
        #: Types and shapes of the images given to the detector, as "uint8 (480, 640, 3)", each once.
        self.detector_inputs: list[str] = []
        self.published: set[str] = set()  #: the topics on which the script has published
        #: The node's parameter of that name [m]; None where no node has one.
        self.target_distance: float | None = None
        self._due: dict[tuple[str, str], float] = {}
        self._outlet = Outlet(self.arena)
        self.scorer = Scorer(self.arena.scenario)
        self._frame: TrueFrame | None = None
        self._render_ms = 0.0
        self._passed: list[Passed] = []
        self._periods = Periods()
        self._seen_before = False
        self._told = 0

    @property
    def commands(self) -> list[Command]:
        """Every Twist on /cmd_vel."""
        numbers = zip(*[iter(self._driven)] * 3, self._lines, strict=True)
        return [Command(at, Twist(linear, angular), line or None) for at, linear, angular, line in numbers]

    @property
    def over(self) -> bool:
        """Whether the run's time is up."""
        return self.arena.time >= self.seconds - 1e-9

    def tell(self, told: str, *content: Any, data: bytes = b"") -> None:
        """Take what the script does.

        Raises `ValueError`, `TypeError` or `KeyError` if it is nothing that a script can do.
        """
        self._told += 1
        if self._told > _MOST_TOLD:
            raise ValueError(f"{_MOST_TOLD} messages without a step of the arena: the loop that sends them never waits")
        _HANDLERS[told](self, *content, **({"data": data} if data else {}))

    def advance(
        self, wanted: Collection[str] = (), target: float | None = None, until: float = 0.0
    ) -> tuple[float, list[News]]:
        """Advance to `until` [s] or to the next message of a topic that is wanted, at least by a step.

        Returns the time [s], and the new messages of these topics: none when the time is up.
        """
        self.target_distance, self._told = target, 0
        news: list[News] = []
        while not news and not self.over:
            if self._passed:  # after the first collection
                self._log()
                self.arena.step()
            news = self._collect(wanted)
            if self._due:
                self._warn()
            if self.arena.time >= until - 1e-9:
                break
        return self.arena.time, news

    def _called(self, kind: str, name: str, line: int | None, type_name: str = "") -> None:
        lines: dict[str, int | None] = getattr(self.calls, kind)
        lines.setdefault(str(name), line)
        if type_name:
            self.calls.types.setdefault(str(name), str(type_name))
        if kind == "unmatched":
            self.log(self.arena.time, "WARN", LOGGER, str(name))
        if kind in ("readers", "clients"):
            self._due.setdefault((kind, str(name)), self.arena.time + UNHEARD_AFTER)

    def _command(self, linear: float, angular: float, line: int | None) -> None:
        if not (math.isfinite(linear) and math.isfinite(angular)):
            raise ValueError(f"a command of {linear} m/s and {angular} rad/s")
        self._driven.extend((self.arena.time, linear, angular))
        self._lines.append(line or 0)
        self._witness.command(Command(self.arena.time, Twist(float(linear), float(angular)), line))
        self.arena.command(Twist(float(linear), float(angular)))

    def _looked(self, at: str, line: int | None, has_svm: bool) -> None:
        if at not in self.detector_inputs:
            self.detector_inputs.append(str(at))
        if not has_svm:
            self.calls.searched_without_svm = line

    def _find(
        self, shape: list[int], boxes: list[list[int]], scores: list[float], ms: float, hog: bool, *, data: bytes = b""
    ) -> None:
        if len(shape) not in (2, 3) or min(shape) < 1 or len(boxes) != len(scores):
            raise ValueError(f"a picture of {shape} with {len(boxes)} boxes and {len(scores)} scores")
        boxes_, scores_ = np.array(boxes, np.int32).reshape(-1, 4), np.array(scores, np.float64)
        found = Found(tuple(shape), Detections(boxes_, scores_), float(ms))
        if hog:
            self.found.append(found)
        if data:
            self._witness.found(self.arena.time, found, np.frombuffer(data, np.uint8).reshape(shape))

    def _show(self, window: str, line: int | None, shape: list[int], *, data: bytes) -> None:
        if len(self.shown) >= _MOST_WINDOWS and str(window) not in self.shown:
            raise ValueError(f"more than {_MOST_WINDOWS} windows are open")
        self.calls.windows.setdefault(str(window), line)
        self.shown[str(window)] = shown = Shown(self.arena.time, np.frombuffer(data, np.uint8).reshape(shape))
        self._witness.shown(str(window), shown)

    def _closed(self, window: str | None) -> None:
        for name in list(self.shown) if window is None else [window]:
            self.shown.pop(name, None)

    def _slept(self, since: float, seconds: float) -> None:
        if seconds > (0.0 if self.longest is None else self.longest.slept):
            self.longest = Callback(float(since), float(seconds))

    def _warn(self) -> None:
        """Name each subscription to a topic that nobody publishes, and each unanswered client, once."""
        for kind, name in [key for key, at in self._due.items() if self.arena.time >= at - 1e-9]:
            del self._due[kind, name]
            line, how = getattr(self.calls, kind)[name], "subscribed to" if kind == "readers" else "asked for"
            where = "" if line is None else f", {how} at line {line}"
            if kind == "readers" and name not in PUBLISHED and name not in self.calls.writers:
                said = f"nobody publishes {name!r}{where}; did you mean "
                said += f"{nearest_topic(name, self.calls.types.get(name, ''))!r}?"
                self.log(self.arena.time, "WARN", LOGGER, said)
            if kind == "clients" and name not in self.calls.services:
                there = ", ".join(sorted(self.calls.services)) or "none"
                said = f"no node offers the service {name!r}{where}; offered: {there}"
                self.log(self.arena.time, "WARN", LOGGER, said)

    def _collect(self, wanted: Collection[str]) -> list[News]:
        passed = self.arena.passed()
        self._passed.append(passed)
        drawing = time.perf_counter()
        frame = self.arena.frame()
        if self._frame is None or frame.stamp > self._frame.stamp:
            self._render_ms = 1e3 * (time.perf_counter() - drawing)
            self._frame, self.found = frame, []
            self._witness.frame(self.arena.time, frame)
        wanted = {*wanted, names.TF_STATIC}
        return [_news(topic, make()) for topic, make in self._outlet.new(passed) if topic in wanted]

    def _log(self) -> None:
        """Log the control period that ends now."""
        frame = self._frame
        begins, new = self._periods.begins(self.arena.time, frame)
        if frame is None or not begins:
            return
        found = self._in_frame_pixels(frame) if new else Detections.none()
        target = int(np.argmax(found.scores)) if len(found) else None
        twist = Twist(*self._driven[-2:]) if self._driven else Twist()
        if self.detector_inputs:
            mode = Mode.FOLLOW if target is not None else Mode.LOST if self._seen_before else Mode.SEARCH
        else:
            # Whether a node with a detector of its own searches or follows is not known.
            mode = Mode.STAND if twist == Twist() else Mode.DRIVE
        self._seen_before |= target is not None
        log = FrameLog(
            self.arena.time,
            Decision(twist, None, mode, f"as {self.script.name} says", target),
            Sensors(self.arena.scan(), self.arena.odometry()),
            frame if new else None,
            found,
            detect_ms=sum(found.ms for found in self.found) if new else 0.0,
        )
        windows = {name: shown.picture for name, shown in self.shown.items()}
        seen, passed = frame.truth if new else None, tuple(self._passed)
        step = Step(log, self.arena.truth(), seen, self._render_ms, windows, passed)
        self._passed.clear()
        self.scorer.add(step)
        self.watch(step)

    def _in_frame_pixels(self, frame: TrueFrame) -> Detections:
        """Return the boxes found last since the frame came, in its pixels: a smaller copy is scaled back."""
        height, width = frame.image.shape[:2]
        for found in reversed(self.found):
            scale = height / found.shape[0]
            if abs(found.shape[1] * scale - width) <= scale:
                boxes = np.rint(found.detections.windows * scale).astype(np.int32)
                return Detections(boxes, found.detections.scores)
        return Detections.none()

    def finish(self, fault: Fault | None = None) -> Ended:
        """Let the arena go on without commands until the time is up, or the robot stands; return how the run ended."""
        failed_at, self._witness = self.arena.time, Witness()
        if fault is not None:
            self.seconds = failed_at + _AFTERMATH
        while not self.over:
            self.advance((), self.target_distance)
        # (Who listens may hold this run: without this, its pictures stay until Python looks for cycles.)
        self.log, self.watch = (lambda *_: None), (lambda _: None)
        episode = Episode(
            scenario=self.arena.scenario,
            controller=self.script.name,
            detector="hog" if self.detector_inputs else "the node's own",
            seed=self.arena.seed,
            seconds=self.arena.time,
            scorer=self.scorer,
            contacts=self.arena.contacts,
            wall_seconds=time.perf_counter() - self._began,
            target_distance=self.target_distance,
        )
        return Ended(episode, self._failure(fault, failed_at), fault, self)

    def _failure(self, fault: Fault | None, failed_at: float) -> str:
        if fault is not None:
            stopped = self.arena.odometry()
            stands = abs(stopped.linear) < 1e-6 and abs(stopped.angular) < 1e-6
            ending = "the watchdog stopped the robot" if stands else "the robot still moves"
            if not self._driven:
                ending = "the robot never moved"
            message = " ".join(fault.message.split())
            return f"{self.script.name} {fault.how} at {failed_at:.2f} s: {message}; {ending}"
        if not self._driven:
            other = ", ".join(sorted(self.published)) or "nothing at all"
            if not self.calls.nodes:
                other += ", and made no node: is main() called, as by if __name__ == '__main__': main()?"
            other = next(iter(self.calls.unmatched), other)
            never = f"never published on {names.COMMAND} (it published {other})"
            return f"{self.script.name} {never}: the robot never moved"
        return ""


def _news(topic: str, message: Any) -> News:
    if message.__msgtype__ != "sensor_msgs/msg/Image":
        return topic, serialize(message), None
    # (Pixels are not copied into the bytes: the node's process receives them into its message.)
    return topic, serialize(replace(message, data=message.data[:0])), message.data


#: What is done with each message of the node, by its name.
_HANDLERS: dict[str, Callable[..., None]] = {
    "called": Stage._called,
    "closed": Stage._closed,
    "command": Stage._command,
    "found": Stage._find,
    "given": lambda stage: setattr(stage.calls, "given", True),
    "log": lambda stage, *line: stage.log(stage.arena.time, *map(str, line)),
    "looked": Stage._looked,
    "published": lambda stage, topic: stage.published.add(str(topic)),
    "read": lambda stage, line: setattr(stage.calls, "solution_read", int(line or 0)),
    "shown": Stage._show,
    "slept": Stage._slept,
    "spun": lambda stage: setattr(stage.calls, "spun", True),
}


@dataclass(frozen=True)
class Ended:
    """How a run ended."""

    episode: Episode  #: the log that is scored
    failure: str  #: one line that names the fault; "" without one
    fault: Fault | None  #: why the script ended before its time; None where it did not
    stage: Stage  #: the run, with what the node did

    @property
    def traceback(self) -> str:
        """The script's part of the traceback; "" without an exception."""
        return "" if self.fault is None else self.fault.traceback


def score_of(outcome: Ended) -> ScoreCard:
    """Measure a run; where the script does not use cv2's HOG detector, figures of detections are None.

    Whether such a script searches or follows is not known; `modes` then tells whether its commands drive or stand.
    """
    card, driving = score(outcome.episode), outcome.episode.scorer.driving
    if failure := outcome.failure or ("" if driving or not card.success else "the node never moved the robot"):
        card = replace(card, success=False, failure=failure)
    if outcome.stage.detector_inputs:
        return card
    unknown: dict[str, Any] = dict.fromkeys(_OF_DETECTIONS)
    return replace(card, modes={"drive": driving, "stand": 1.0 - driving}, lost=0, **unknown)
