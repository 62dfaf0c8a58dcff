"""The log of a run: what the follower or a node did in each control period, and the truth beside it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.pipeline import FrameLog
from limo_hog.follow.sense.observation import Odometry, Sensors
from limo_sim.sensing.imu import ImuReading
from limo_sim.world.truth import Truth


class Passed(NamedTuple):
    """What the faster sensors read in one step of the arena, at a time [s]."""

    time: float
    odometry: Odometry
    imu: tuple[ImuReading, ...]


@dataclass(frozen=True, slots=True)
class Step:
    """One control period in the arena."""

    log: FrameLog  #: what was sensed, found and commanded
    truth: Truth  #: the arena at `log.time`
    seen: Truth | None = None  #: the arena when the frame was taken; None in a period without a new frame
    render_ms: float = 0.0  #: wall time of drawing the frame [ms]
    #: The pictures that a node shows with `cv2.imshow`, by name: uint8 (H, W, 3) BGR or (H, W).
    windows: Mapping[str, NDArray[np.uint8]] = field(default_factory=dict)
    passed: tuple[Passed, ...] = ()  #: what the faster sensors read since the control period before

    def bare(self) -> Step:
        """Return the step without images, scans and rollouts: 4 kB instead of 3 MB."""
        decision = self.log.decision
        decision = replace(decision, belief=replace(decision.belief, rollouts=None))
        log = replace(self.log, frame=None, sensors=Sensors(), decision=decision)
        return replace(self, log=log, windows={}, passed=())


#: Is given every control period of a run.
Watch = Callable[[Step], None]
