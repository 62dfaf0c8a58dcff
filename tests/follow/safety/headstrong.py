"""A controller that always wants the same, behind the safety layer."""

from __future__ import annotations

from dataclasses import dataclass

from limo_hog.follow import Decision, Guard, Mode, Observation, Twist


@dataclass(frozen=True)
class Headstrong:
    """Always wants the same."""

    twist: Twist

    def start(self) -> int:
        return 0

    def step(self, observation: Observation, state: int) -> Decision[int]:
        del observation
        return Decision(self.twist, state + 1, Mode.FOLLOW, "because")


def ahead(speed: float = 0.5) -> Guard[int]:
    return Guard(Headstrong(Twist(speed, 0.3)))
