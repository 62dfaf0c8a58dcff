"""The arena in real time on ROS 2's network, driven by /cmd_vel."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from limo_hog.follow.decision import Decision, Mode
from limo_hog.follow.pipeline import FrameLog
from limo_hog.follow.robot import Twist
from limo_hog.follow.sense.observation import Sensors
from limo_hog.ros2 import names
from limo_sim.ros.lockstep.calls import PUBLISHED
from limo_sim.run.arena import Arena
from limo_sim.run.log import Passed, Step, Watch
from limo_sim.world.robot import is_finite
from limo_sim.world.scenario import Scenario

if TYPE_CHECKING:
    from limo_hog.ros2.dds import Bus, Subscription
    from limo_sim.ros.outlet import Outlet

#: After a delay the arena runs faster until this much is made up for [s]; more is dropped. Chosen: two camera frames.
_CATCH_UP = 0.2


def run_live(scenario: Scenario, seed: int, seconds: float, bus: Bus | None, watch: Watch | None = None) -> Arena:
    """Run the arena in real time for a duration [s], inf until interrupted, with its topics on the bus.

    Without a bus the arena has no ROS. `watch` is called with every camera frame. Raises `ScenarioError` if the
    scenario asks for faults of the detector: those of the nodes are out of reach.
    """
    scenario.check_detector_is_plain("the nodes on the network bring their own detectors")
    arena = Arena(scenario, seed)
    outlet: Outlet | None = None
    writers = {}
    commands: list[Subscription] = []
    if bus is not None:
        # An arena that is only watched needs neither DDS nor messages.
        from limo_hog.ros2.messages import to_twist
        from limo_sim.ros.outlet import Outlet

        outlet = Outlet(arena)
        writers = {
            topic: bus.publisher(topic, names.TYPES[topic], kept=topic == names.TF_STATIC) for topic in PUBLISHED
        }
        commands = [
            bus.subscription(names.COMMAND, kind) for kind in (names.TYPES[names.COMMAND], names.STAMPED_COMMAND_TYPE)
        ]
    twist, shown = Twist(), -1.0
    passed: list[Passed] = []
    began = time.monotonic()
    while arena.time < seconds:
        now = arena.passed()
        if watch is not None:
            passed.append(now)
        for message in [message for reader in commands for message in reader.take()]:
            twist = to_twist(message)
            arena.command(twist)
        for topic, make in outlet.new(now) if outlet is not None else ():
            if writers[topic].has_readers or topic == names.TF_STATIC:
                writers[topic].publish(make())
        if watch is not None and arena.frame().stamp > shown:
            shown = arena.frame().stamp
            watch(_step(arena, twist, tuple(passed)))
            passed.clear()
        arena.step()
        late = time.monotonic() - began - arena.time
        if late < 0:
            time.sleep(-late)
        elif late > _CATCH_UP:
            # On a machine that is too slow the arena runs slower than real time, instead of falling behind without end.
            began += late - _CATCH_UP
    return arena


def second_publishers(bus: Bus) -> list[str]:
    """Look around for others who publish what a robot has one publisher of; returns these topics."""
    found = bus.topics()
    own = [names.resolved(bus.node, topic) for topic in (names.SCAN, names.ODOMETRY, names.CLOCK)]
    return [topic for topic in own if topic in found and found[topic].publishers]


def _step(arena: Arena, twist: Twist, passed: tuple[Passed, ...]) -> Step:
    frame = arena.frame()
    twist = twist if is_finite(twist) else Twist()
    mode = Mode.STAND if twist == Twist() else Mode.DRIVE
    decision = Decision(twist, None, mode, "driven by /cmd_vel")
    log = FrameLog(arena.time, decision, Sensors(arena.scan(), arena.odometry()), frame)
    return Step(log, arena.truth(), frame.truth, passed=passed)
