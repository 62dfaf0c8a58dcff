"""What a node sees of the arena, in lock step: time passes only while the node waits.

A callback therefore takes no simulated time, unless it sleeps; the same file, scenario and seed give the same run. The
arena itself is on the other side of a link.
"""

from __future__ import annotations

import copy
import inspect
import math
import operator
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

from limo_hog.ros2 import names
from limo_hog.ros2.messages import deserialize, to_twist
from limo_sim.ros.interfaces import Message, from_wire
from limo_sim.ros.lockstep.patience import Patience
from limo_sim.ros.lockstep.records import StubError
from limo_sim.ros.lockstep.turns import RunOver, ThreadEnded, Turns
from limo_sim.ros.wire import SocketLink


class World:
    """One run, as the script's process knows it."""

    def __init__(self, link: SocketLink, seconds: float, *, script: Path, patience: float, checked: bool) -> None:
        self.link = link
        self.checked = checked  #: whether the arena wants to see the pictures that detectors are given
        self.seconds = seconds
        self.script = script
        self.patience = Patience(patience)
        self.time = 0.0  #: since the start of the run [s]
        self.over = seconds <= 0.0  #: whether the run's time is up
        self.readers: list[Any] = []  #: the subscriptions of the script's nodes
        self.published: dict[str, str] = {}  #: types of the topics on which the script has published
        self.writers: list[str] = []  #: the topic of each of the script's publishers
        self.services: dict[str, Any] = {}  #: what the script's nodes offer, by name
        #: Topics whose messages later subscriptions get, and these messages.
        self.kept: list[tuple[str, deque[Message]]] = []
        self.fault: BaseException | None = None  #: the first exception in the script, even if the script caught it
        self.parameters: dict[str, Any] = {}  #: the newest values of the nodes' parameters, by name
        self._told: set[tuple[Any, ...]] = set()
        self.advances = 0  #: how often the arena advanced
        self.turns = Turns(self.advance, lambda: self.time, lambda: self.over, self._fail)

    def _fail(self, error: BaseException) -> None:
        self.fault = self.fault or error

    def line(self) -> int | None:
        """Return the line of the script that runs now; None where the script is not in the call."""
        frame = inspect.currentframe()
        while frame is not None and frame.f_code.co_filename != str(self.script):
            frame = frame.f_back
        return None if frame is None else frame.f_lineno

    def advance(self, until: float = 0.0) -> None:
        """Advance the arena to `until` [s], or to the next reading, at least by a step; offer it to the subscriptions.

        Raises `RunOver` when the time is up.
        """
        if self.over:
            raise RunOver
        with self.patience.suspended():
            wanted = sorted({reader.topic for reader in self.readers})
            self.time, news = self.link.advance(wanted, self._target(), min(until, self.seconds))
        self.over = self.time >= self.seconds - 1e-9
        self.advances += 1
        for topic, data, pixels in news:
            message: Any = from_wire(deserialize(data, names.TYPES[topic]))
            if pixels is not None:
                message.data = pixels
            if topic == names.TF_STATIC:
                self.kept.append((topic, deque([copy.deepcopy(message)])))
            readers = [reader for reader in self.readers if reader.topic == topic]
            for number, reader in enumerate(readers):
                reader.offer(copy.deepcopy(message) if number else message)

    def _target(self) -> float | None:
        """Return the node's parameter `target_distance` [m], None where no node has one that is a distance."""
        value = self.parameters.get("target_distance")
        return value if isinstance(value, float) and math.isfinite(value) and value > 0 else None

    def call(self, function: Callable[[], Any]) -> Any:
        """Call back into the script, return what comes back; an exception is kept in `fault`."""
        since = self.time
        try:
            return function()
        except (RunOver, ThreadEnded, SystemExit):
            raise
        except BaseException as error:
            self._fail(error)
            raise
        finally:
            if self.time > since:
                self.link.tell("slept", since, self.time - since)

    def called(self, kind: str, name: str, type_name: str = "") -> None:
        """Tell that the script makes a node, a subscription and the like, and on which line."""
        self.link.tell("called", kind, name, self.line(), type_name)

    def once(self, *told: Any) -> None:
        """Tell something of which only the first time counts."""
        if told not in self._told:
            self._told.add(told)
            self.link.tell(*told)

    def subscribe(self, reader: Any) -> None:
        """Add a subscription."""
        self.readers.append(reader)
        self.called("readers", reader.topic, reader.msg_type._type_name)
        if reader.keeps:
            for message in [m for topic, messages in self.kept if topic == reader.topic for m in messages]:
                reader.offer(copy.deepcopy(message))

    def publish(self, topic: str, message: Message, *, reliable: bool = True, kept: bool = False) -> None:
        """Take a message from the script: a command drives the robot, and the script's own subscriptions get it.

        The robot, and subscriptions that ask for reliable delivery, get none from a publisher that is not; those that
        ask for what was kept get none from a publisher that keeps none. Raises `StubError` if a command is not a
        number.
        """
        self.once("published", topic)
        self.published[topic] = message._type_name
        if topic == names.COMMAND and reliable:
            self._drive(message.twist if message._type_name == names.STAMPED_COMMAND_TYPE else message)  # type: ignore[attr-defined]
        for reader in self.readers:
            if reader.topic == topic and (reliable or not reader.reliable) and (kept or not reader.keeps):
                reader.offer(copy.deepcopy(message))

    def _drive(self, message: Any) -> None:
        for name in ("linear.x", "linear.y", "linear.z", "angular.x", "angular.y", "angular.z"):
            value = operator.attrgetter(name)(message)
            if not math.isfinite(value):
                raise StubError(f"the command's {name} is {value}: a robot can be given finite numbers alone")
        twist = to_twist(message)
        self.link.tell("command", twist.linear, twist.angular, self.line())
