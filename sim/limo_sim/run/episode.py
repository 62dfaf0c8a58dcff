"""One closed-loop run: sense, detect, decide, drive, log. Two clocks: the arena's and the wall's."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from limo_hog.detector import Detections
from limo_hog.follow.decision import Controller, Decision, Mode
from limo_hog.follow.safety.guard import Guard, GuardState
from limo_hog.follow.sense.detectors import Detector, detect_in
from limo_hog.follow.sense.observation import Observation, Odometry, Scan, observed
from limo_hog.follow.sense.region import Region
from limo_hog.follow.twist import Twist
from limo_sim.run.arena import Arena
from limo_sim.sensing.camera import FOCAL_PX, Frame
from limo_sim.world.scenario import Scenario
from limo_sim.world.truth import Contacts, Truth

S = TypeVar("S")

#: A command is sent at least this often [s].
CONTROL_PERIOD = 0.1

NOTHING = Detections(np.empty((0, 4), np.int32), np.empty(0))


@dataclass(frozen=True, slots=True)
class Step:
    """One control period.

    Attributes
    ----------
    time
        Of the arena, when the command was sent [s].
    truth
        The arena at `time`.
    seen
        The arena when the frame that was worked on was taken; None in a period without a new frame.
    detections, target
        What was found in that frame and which of it is followed.
    region
        Part of the frame that was searched; None where all of it was.
    twist, mode, reason
        The command, and what the follower said about it.
    detect_ms, render_ms
        Wall time of detection and of drawing the frame [ms]; 0 without a frame.
    """

    time: float
    truth: Truth
    seen: Truth | None
    detections: Detections
    target: int | None
    region: Region | None
    twist: Twist
    mode: Mode
    reason: str
    detect_ms: float
    render_ms: float


@dataclass(frozen=True, slots=True)
class Moment:
    """A step with the pictures it was decided on, for those who watch.

    `windows` are the pictures a node shows with `cv2.imshow`, by name: uint8 (H, W, 3) BGR or (H, W).
    """

    step: Step
    frame: Frame | None
    scan: Scan | None
    odometry: Odometry | None
    windows: Mapping[str, NDArray[np.uint8]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Episode:
    """The log of a run.

    Attributes
    ----------
    scenario, controller, detector, seed
        What was run; the controller and the detector by name.
    seconds
        Simulated time [s].
    steps
        Every control period.
    contacts
        How often the robot touched a person, and a wall or furniture.
    wall_seconds
        How long the run took [s].
    target_distance
        Distance that the controller held at the end, from the camera to the person's surface [m]; None where it holds
        none.
    """

    scenario: Scenario
    controller: str
    detector: str
    seed: int
    seconds: float
    steps: tuple[Step, ...]
    contacts: Contacts
    wall_seconds: float
    target_distance: float | None = None


def run_episode(
    scenario: Scenario,
    controller: Controller[S],
    detector: Detector,
    seconds: float,
    seed: int,
    *,
    names: tuple[str, str] = ("controller", "detector"),
    watch: Callable[[Moment], None] | None = None,
) -> Episode:
    """Let a controller drive the robot, behind the safety layer.

    Parameters
    ----------
    scenario, seed
        The arena and its random numbers: the same two give the same run.
    controller
        Steers by what the detector finds.
    detector
        Finds people in uint8 (H, W, 3) BGR images. If it raises, the robot stops and says so.
    seconds
        Simulated time [s].
    names
        What the log calls the controller and the detector.
    watch
        Called with every control period.
    """
    began = time.perf_counter()
    arena = Arena(scenario, seed)
    guard = Guard(controller)
    state = guard.start()
    region: Region | None = None
    steps = []
    last_frame, last_command = -np.inf, -np.inf
    while arena.time < seconds:
        drawing = time.perf_counter()
        frame = arena.frame()
        render_ms = 1e3 * (time.perf_counter() - drawing)
        fresh = frame.stamp > last_frame
        # Half a physics step of slack: times are sums of steps.
        if fresh or arena.time - last_command > CONTROL_PERIOD - 0.01:
            scan, odometry = arena.scan(), arena.odometry()
            if fresh:
                last_frame = frame.stamp
                decision, observation, detect_ms = _decide(guard, state, detector, frame, region, scan, odometry)
                region = decision.region
                seen, found = frame.truth, observation.detections
                searched, target = observation.region, decision.target
            else:
                decision = guard.recheck(arena.time, scan, odometry, state)
                seen, found, searched, target, detect_ms, render_ms = None, NOTHING, None, None, 0.0, 0.0
            state = decision.state
            arena.command(decision.twist)
            last_command = arena.time
            step = Step(
                arena.time,
                arena.truth(),
                seen,
                found,
                target,
                searched,
                decision.twist,
                decision.mode,
                decision.reason,
                detect_ms,
                render_ms,
            )
            steps.append(step)
            if watch is not None:
                watch(Moment(step, frame if fresh else None, scan, odometry))
        arena.step()
    return Episode(
        scenario,
        *names,
        seed,
        arena.time,
        tuple(steps),
        arena.contacts,
        time.perf_counter() - began,
        getattr(controller, "target_distance", None),
    )


def _decide(
    guard: Guard[S],
    state: GuardState[S],
    detector: Detector,
    frame: Frame,
    region: Region | None,
    scan: Scan | None,
    odometry: Odometry | None,
) -> tuple[Decision[GuardState[S]], Observation, float]:
    """Detect and decide; returns the decision, what it was made on, and how long detection took [ms]."""
    began = time.perf_counter()
    try:
        found, fault = detect_in(detector, frame.image, region), ""
    except Exception as error:  # whatever a detector raises, the robot must stop and the run must go on
        found, fault = NOTHING, f"the detector failed: {error}"
    detect_ms = 1e3 * (time.perf_counter() - began)
    observation = observed(frame.stamp, frame.image, FOCAL_PX, found, region, frame.depth, scan, odometry, fault)
    return guard.step(observation, state), observation, detect_ms
