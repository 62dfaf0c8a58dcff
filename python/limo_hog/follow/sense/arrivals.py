"""When each sense's newest reading came: which never did, which stopped, and whose clock is wrong."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from operator import itemgetter

_CAME = itemgetter(1)

CAMERA, DEPTH, SCAN, ODOMETRY = "camera frame", "depth image", "scan", "odometry"


@dataclass(frozen=True, slots=True)
class Arrivals:
    """The newest reading of each sense."""

    #: By the sense's name: the reading's stamp on the sensor's clock, and when it came on the robot's own [s].
    newest: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def after(self, now: float, stamps: Mapping[str, float]) -> Arrivals:
        """Add the readings at hand at `now` [s]: a new one has another stamp than the last, NaN is none."""
        newest = dict(self.newest)
        for name, at in stamps.items():
            if math.isfinite(at) and (name not in newest or newest[name][0] != at):
                newest[name] = at, now
        return Arrivals(newest)

    def missing(self, now: float, needed: tuple[str, ...], max_age: float) -> str:
        """Return which senses never came, though needed, or came longer than `max_age` [s] ago; "" if none.

        A reading from the future came before the robot's clock was set back: nobody knows how old it is.
        """
        ages = {name: abs(now - came) for name, (_, came) in self.newest.items()}
        reasons = [f"no {name} has come" for name in needed if name not in ages]
        if ages.get(CAMERA, 0.0) > max_age:
            ages.pop(DEPTH, None)  # it comes with its frame
        reasons += [f"no {name} for {age:.1f} s" for name, age in ages.items() if age > max_age]
        return "; ".join(reasons)

    def oldest(self, now: float) -> float:
        """Return how long ago the sense that is silent for longest was heard [s]; 0 without any."""
        return now - min(map(_CAME, self.newest.values()), default=now)

    def disagreement(self, max_age: float, max_late: float) -> str:
        """Return which sense's stamps do not fit the others': readings may be `max_age`, images `max_late` [s] late."""
        # A depth image has its camera frame's stamp. What the others' clocks showed when the last reading came:
        now = max(map(_CAME, self.newest.values()), default=0.0)
        clocks = {name: stamp + now - came for name, (stamp, came) in self.newest.items() if name != DEPTH}
        ahead = max(clocks, key=clocks.__getitem__, default="")
        old = [name for name in clocks if clocks[ahead] - clocks[name] > (max_late if name == CAMERA else max_age)]
        if not old:
            return ""
        late = {name: clocks[ahead] - clock for name, clock in clocks.items() if name != ahead}
        if len(old) == len(late):
            return f"the {ahead}'s clock is {min(late.values()):.1f} s ahead of the {' and the '.join(late)}'s"
        return "; ".join(f"the {name} is {late[name]:.1f} s old" for name in old)
