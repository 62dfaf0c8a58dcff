"""The arena behind the topics, in lock step with a node: time passes only while the node waits.

A callback therefore takes no simulated time, unless it sleeps; the same file, scenario and seed give the same run.
"""

from __future__ import annotations

import copy
import math
import sys
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from limo_hog.detections import Detections
from limo_hog.follow.decision import Decision, Mode
from limo_hog.follow.pipeline import FrameLog, Periods
from limo_hog.follow.robot import Twist
from limo_hog.follow.sense.observation import Sensors
from limo_hog.ros2 import names
from limo_hog.ros2.messages import to_twist
from limo_sim.ros.interfaces import Message, from_wire
from limo_sim.ros.lockstep.calls import PUBLISHED, Calls, nearest_topic
from limo_sim.ros.lockstep.patience import Patience
from limo_sim.ros.lockstep.records import Callback, Command, Found, Log, Past, Reader, Shown, StubError
from limo_sim.ros.lockstep.turns import RunOver, ThreadEnded, Turns
from limo_sim.ros.outlet import Outlet
from limo_sim.run.arena import Arena
from limo_sim.run.episode import Episode
from limo_sim.run.log import Passed, Step, Watch
from limo_sim.run.score import Scorer
from limo_sim.sensing.camera import TrueFrame
from limo_sim.world.scenario import Scenario

#: A subscription is warned of when nobody publishes its topic for this time [s]. Chosen: publishers start within it.
UNHEARD_AFTER = 2.0
#: The name under which the run itself logs.
LOGGER = "limo-hog"


class World:
    """One run: the arena, the subscriptions, and the log that is scored.

    Attributes
    ----------
    commands
        Every Twist on /cmd_vel.
    found
        What the script's detector found since the last camera frame.
    detector_inputs
        Types and shapes of the images given to the detector, as "uint8 (480, 640, 3)", each once.
    longest
        The callback that slept longest; None while none has slept.
    parameters
        The newest values of the nodes' parameters, by name.
    fault
        The first exception in the script, even if the script caught it.
    calls
        What the script called, and where.
    shown
        The newest picture of each window with its time; closing a window removes it.
    writers
        The topic of each of the script's publishers.
    services
        What the script's nodes offer, by name.
    kept
        Topics whose messages later subscriptions get, and these messages.
    turns
        The script's threads.
    advances
        How often the arena advanced.
    """

    def __init__(
        self,
        scenario: Scenario,
        seed: int,
        seconds: float,
        *,
        script: Path,
        log: Log,
        watch: Watch = lambda _: None,
        patience: float = 20.0,
        began: float | None = None,
    ) -> None:
        scenario.check_detector_is_plain("a node brings its own detector")
        self.arena = Arena(scenario, seed)
        self.seconds = seconds
        self.log = log
        self.script = script
        self.watch = watch
        self.patience = Patience(patience)
        self.readers: list[Reader] = []
        self.published: dict[str, str] = {}
        self.writers: list[str] = []
        self.services: dict[str, Any] = {}
        self.kept: list[tuple[str, deque[Message]]] = []
        self.commands: list[Command] = []
        self.found: list[Found] = []
        self.shown: dict[str, Shown] = {}
        self.calls = Calls()
        self._unheard: dict[str, float] = {}
        self._unanswered: dict[str, float] = {}
        self.fault: BaseException | None = None
        self.longest: Callback | None = None
        self.detector_inputs: list[str] = []
        self.parameters: dict[str, Any] = {}
        self._outlet = Outlet(self.arena)
        self.scorer = Scorer(self.arena.scenario)
        self._frame: TrueFrame | None = None
        self._render_ms = 0.0
        self._passed: list[Passed] = []
        self._periods = Periods()
        self._seen_before = False
        self._began = time.perf_counter() if began is None else began
        self._collected = False
        self.advances = 0
        self.turns = Turns(self.advance, lambda: self.time, lambda: self.over, self._fail)

    def _fail(self, error: BaseException) -> None:
        self.fault = self.fault or error

    @property
    def windows(self) -> dict[str, NDArray[np.uint8]]:
        """The newest picture of each window."""
        return {name: shown.picture for name, shown in self.shown.items()}

    def line(self) -> int | None:
        """Return the line of the script that runs now; None where the script is not in the call."""
        frame: FrameType | None = sys._getframe(1)
        while frame is not None and frame.f_code.co_filename != str(self.script):
            frame = frame.f_back
        return None if frame is None else frame.f_lineno

    @property
    def time(self) -> float:
        """Seconds since the start of the run."""
        return self.arena.time

    @property
    def over(self) -> bool:
        """Whether the run's time is up."""
        return self.arena.time >= self.seconds - 1e-9

    def advance(self) -> None:
        """Advance the arena by one step; new readings are offered to the subscriptions.

        Raises
        ------
        RunOver
            When the time is up.
        """
        if self.over:
            raise RunOver
        if self._collected:
            self._passed.append(Passed(self.time, self.arena.odometry(), self.arena.imu()))
            self._log()
            self.arena.step()
        self._collected = True
        self.advances += 1
        self._collect()
        self._warn()
        self.patience.progress()

    def sleep(self, seconds: float) -> None:
        """Let simulated time pass, as a script's `time.sleep` does: messages are queued, callbacks wait."""
        self.turns.wait(lambda: False, self.time + seconds)

    def call(self, function: Callable[..., Any], *arguments: Any) -> None:
        """Call back into the script; an exception is kept in `fault`."""
        since = self.time
        try:
            function(*arguments)
        except (RunOver, ThreadEnded, SystemExit):
            raise
        except BaseException as error:
            self.fault = self.fault or error
            raise
        finally:
            slept = self.time - since
            if slept > (0.0 if self.longest is None else self.longest.slept):
                self.longest = Callback(since, slept)

    def show(self, window: str, picture: NDArray[np.uint8]) -> None:
        """Keep the newest picture of a window."""
        self.calls.windows.setdefault(window, self.line())
        self.shown[window] = Shown(self.time, picture)

    def note(self, found: Found) -> None:
        """Take what the script's detector found."""
        self.found.append(found)

    def subscribe(self, reader: Reader) -> None:
        """Add a subscription; it is warned of if nobody publishes its topic."""
        self.readers.append(reader)
        self.calls.readers.setdefault(reader.topic, self.line())
        self._unheard.setdefault(reader.topic, self.time + UNHEARD_AFTER)
        if reader.keeps:
            for message in [m for topic, messages in self.kept if topic == reader.topic for m in messages]:
                reader.offer(copy.deepcopy(message))

    def expect_service(self, name: str) -> None:
        """Note a client; it is warned of if no node offers its service."""
        self.calls.clients.setdefault(name, self.line())
        self._unanswered.setdefault(name, self.time + UNHEARD_AFTER)

    def _warn(self) -> None:
        """Name each subscription to a topic that nobody publishes, once."""
        due = [topic for topic, at in self._unheard.items() if self.time >= at - 1e-9]
        for topic in due:
            del self._unheard[topic]
            if topic in PUBLISHED or topic in self.calls.writers:
                continue
            line = self.calls.readers[topic]
            where = "" if line is None else f", subscribed to at line {line}"
            said = f"nobody publishes {topic!r}{where}; did you mean {nearest_topic(topic)!r}?"
            self.log(self.time, "WARN", LOGGER, said)
        for name in [name for name, at in self._unanswered.items() if self.time >= at - 1e-9]:
            del self._unanswered[name]
            if name not in self.services:
                line = self.calls.clients[name]
                where = "" if line is None else f", asked for at line {line}"
                there = ", ".join(sorted(self.services)) or "none"
                self.log(self.time, "WARN", LOGGER, f"no node offers the service {name!r}{where}; offered: {there}")

    def publish(self, topic: str, message: Message) -> None:
        """Take a message from the script: a command drives the robot, and the script's own subscriptions get it.

        Raises
        ------
        StubError
            If a command is not a number.
        """
        self.published[topic] = message._type_name
        if topic == names.COMMAND:
            self._drive(message.twist if message._type_name == names.STAMPED_COMMAND_TYPE else message)  # type: ignore[attr-defined]
        for reader in self.readers:
            if reader.topic == topic:
                reader.offer(copy.deepcopy(message))

    def take_over(self, past: Past, until: float) -> None:
        """Bring a new world to the time `until` [s] at which another process left its own, by the same commands."""
        arena = self.arena
        for at, linear, angular in zip(*[iter(past.commands)] * 3, strict=True):
            while arena.time < at - 1e-9:
                arena.step()
            arena.command(Twist(linear, angular))
            self.commands = [Command(at, Twist(linear, angular))]
        while arena.time < until - 1e-9:
            arena.step()
        self.scorer, self._periods = past.scorer, past.periods
        self.detector_inputs, self.parameters = list(past.detector_inputs), {"target_distance": past.target_distance}
        self._seen_before = past.found

    def episode(self) -> Episode:
        """Return the log."""
        return Episode(
            scenario=self.arena.scenario,
            controller=self.script.name,
            detector="hog" if self.detector_inputs else "the node's own",
            seed=self.arena.seed,
            seconds=self.time,
            scorer=self.scorer,
            contacts=self.arena.contacts,
            wall_seconds=time.perf_counter() - self._began,
            target_distance=self.target_distance,
        )

    @property
    def target_distance(self) -> float | None:
        """The node's parameter `target_distance` [m], None where no node has one that is a distance."""
        value = self.parameters.get("target_distance")
        return value if isinstance(value, float) and math.isfinite(value) and value > 0 else None

    def _drive(self, message: Any) -> None:
        parts = {
            f"{vector}.{axis}": getattr(getattr(message, vector), axis)
            for vector in ("linear", "angular")
            for axis in "xyz"
        }
        for name, value in parts.items():
            if not math.isfinite(value):
                raise StubError(f"the command's {name} is {value}: a robot can be given finite numbers alone")
        twist = to_twist(message)
        self.commands.append(Command(self.time, twist, self.line()))
        self.arena.command(twist)

    def _collect(self) -> None:
        drawing = time.perf_counter()
        frame = self.arena.frame()
        if self._frame is None or frame.stamp > self._frame.stamp:
            self._render_ms = 1e3 * (time.perf_counter() - drawing)
            self._frame, self.found = frame, []
        wanted = {reader.topic for reader in self.readers}
        for topic, make in self._outlet.new():
            if topic == names.TF_STATIC:
                self.kept.append((topic, deque([from_wire(make())])))
            if topic not in wanted:
                continue
            message = make()
            for reader in self.readers:
                if reader.topic == topic:
                    reader.offer(from_wire(message))

    def _log(self) -> None:
        """Log the control period that ends now."""
        frame = self._frame
        begins, new = self._periods.begins(self.time, frame)
        if frame is None or not begins:
            return
        found = self._in_frame_pixels(frame) if new else Detections.none()
        target = int(np.argmax(found.scores)) if len(found) else None
        twist = self.commands[-1].twist if self.commands else Twist()
        if self.detector_inputs:
            mode = Mode.FOLLOW if target is not None else Mode.LOST if self._seen_before else Mode.SEARCH
        else:
            # Whether a node with a detector of its own searches or follows is not known.
            mode = Mode.STAND if twist == Twist() else Mode.DRIVE
        self._seen_before |= target is not None
        log = FrameLog(
            self.time,
            Decision(twist, None, mode, f"as {self.script.name} says", target),
            Sensors(self.arena.scan(), self.arena.odometry()),
            frame if new else None,
            found,
            detect_ms=sum(found.ms for found in self.found) if new else 0.0,
        )
        seen, passed = frame.truth if new else None, tuple(self._passed)
        step = Step(log, self.arena.truth(), seen, self._render_ms, self.windows, passed)
        self._passed.clear()
        self.scorer.add(step)
        with self.patience.suspended():
            self.watch(step)

    def _in_frame_pixels(self, frame: TrueFrame) -> Detections:
        """Return the boxes found last since the frame came, in its pixels: a smaller copy is scaled back."""
        height, width = frame.image.shape[:2]
        for found in reversed(self.found):
            scale = height / found.shape[0]
            if abs(found.shape[1] * scale - width) <= scale:
                boxes = np.rint(found.detections.boxes * scale).astype(np.int32)
                return Detections(boxes, found.detections.scores)
        return Detections.none()
