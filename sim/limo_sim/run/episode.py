"""One closed-loop run: sense, detect, decide, drive, log. Two clocks: the arena's and the wall's."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from limo_hog.detections import Detections
from limo_hog.follow.decision import Controller, Decision
from limo_hog.follow.pipeline import CONTROL_PERIOD, Follower, Sensors
from limo_hog.follow.sense.detectors import Detector, Region
from limo_hog.follow.sense.observation import Odometry, Scan
from limo_sim.run.arena import Arena
from limo_sim.run.detector_faults import FaultyDetector
from limo_sim.sensing.camera import FOCAL_PX, Frame
from limo_sim.world.scenario import DetectorFaults, Scenario
from limo_sim.world.truth import Contacts, Truth


@dataclass(frozen=True, slots=True)
class FrameRecord:
    """What was made of one camera frame.

    Attributes
    ----------
    truth
        The arena when the frame was taken.
    detections
        What was found in it.
    region
        Part of the frame that was searched; None where all of it was.
    detect_ms, render_ms
        Wall time of detection and of drawing the frame [ms].
    """

    truth: Truth
    detections: Detections
    region: Region | None = None
    detect_ms: float = 0.0
    render_ms: float = 0.0


@dataclass(frozen=True, slots=True)
class Step:
    """One control period.

    Attributes
    ----------
    time
        Of the arena, when the command was sent [s].
    truth
        The arena at `time`.
    decision
        The command, and what the follower says about it; its `target` is an index into `detections`.
    frame
        The frame that was worked on; None in a period without a new one.
    """

    time: float
    truth: Truth
    decision: Decision[Any]
    frame: FrameRecord | None = None

    @property
    def seen(self) -> Truth | None:
        """The arena when the frame was taken; None without a frame."""
        return None if self.frame is None else self.frame.truth

    @property
    def detections(self) -> Detections:
        """What was found in the frame; nothing without one."""
        return Detections.none() if self.frame is None else self.frame.detections


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
        Every control period; nothing where the run kept none.
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
    controller: Controller[Any],
    detector: Detector,
    seconds: float,
    seed: int,
    *,
    names: tuple[str, str] = ("controller", "detector"),
    watch: Callable[[Moment], None] | None = None,
    keep: bool = True,
) -> Episode:
    """Let a controller drive the robot, behind the safety layer.

    Parameters
    ----------
    scenario, seed
        The arena and its random numbers: the same two give the same run.
    controller
        Steers by what the detector finds.
    detector
        Finds people in uint8 (H, W, 3) BGR images; the scenario's faults come on top. If it raises, the robot stops and
        says so.
    seconds
        Simulated time [s].
    names
        What the log calls the controller and the detector.
    watch
        Called with every control period.
    keep
        Whether the log holds the steps, 4 kB each. Without them a run's memory does not grow, and a `Scorer` that
        `watch` feeds measures it.
    """
    began = time.perf_counter()
    arena = Arena(scenario, seed)
    faulty = None
    if scenario.detector != DetectorFaults():
        rate, people = scenario.camera.rate_hz, len(scenario.people)
        detector = faulty = FaultyDetector(detector, scenario.detector, rate, people, seed)
    follower = Follower(controller, detector)
    region: Region | None = None
    steps: list[Step] = []
    last_frame, last_command = -np.inf, -np.inf
    while arena.time < seconds:
        drawing = time.perf_counter()
        frame = arena.frame()
        render_ms = 1e3 * (time.perf_counter() - drawing)
        fresh = frame.stamp > last_frame
        # Half a physics step of slack: times are sums of steps.
        if fresh or arena.time - last_command > CONTROL_PERIOD - 0.01:
            scan, odometry = arena.scan(), arena.odometry()
            record = None
            if fresh:
                last_frame = frame.stamp
                if faulty is not None:
                    faulty.face(frame.truth, region)
                sighting = follower.see(frame.stamp, frame.image, Sensors(FOCAL_PX, frame.depth, scan, odometry))
                decision = sighting.decision
                region = decision.region
                record = FrameRecord(frame.truth, sighting.detections, sighting.region, sighting.detect_ms, render_ms)
            else:
                decision = follower.recheck(arena.time, scan, odometry)
            arena.command(decision.twist)
            last_command = arena.time
            step = Step(arena.time, arena.truth(), decision, record)
            if keep:
                steps.append(step)
            if watch is not None:
                watch(Moment(step, frame if fresh else None, scan, odometry))
        arena.step()
    return Episode(
        arena.scenario,
        *names,
        seed,
        arena.time,
        tuple(steps),
        arena.contacts,
        time.perf_counter() - began,
        getattr(controller, "target_distance", None),
    )
