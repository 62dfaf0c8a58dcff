"""Labelled frames of the arena: what stands in each, where, how much of it is seen, and which one it is.

The robot wanders through the room and takes pictures; what it meets depends on the scenario and the seed alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from limo_hog.follow.pipeline import CONTROL_PERIOD
from limo_hog.follow.robot import Twist
from limo_hog.follow.sense.observation import Scan
from limo_sim.run.arena import STEPS_PER_SECOND, Arena
from limo_sim.sensing.camera import TrueFrame
from limo_sim.world.scenario import Scenario
from limo_sim.world.variants import WANDERING_STREAM

# How the robot looks around.
_SPEED = 0.5  # [m/s]; half of what it can, so that pictures differ and little is missed
_TURN = 0.5  # largest turn rate while it drives [rad/s]; drawn anew for every leg
_LEG_S = 3.0  # length of a leg [s]
_TURN_AWAY = 0.9  # turn rate where the way is blocked [rad/s]
_KEEP = 0.7  # nearest obstacle ahead that it drives towards [m]: it stops within less
_CLEAR = 1.0  # what must be free ahead before it drives again [m]
_AHEAD = 0.6  # half of the sector that counts as ahead [rad]


@dataclass(frozen=True, slots=True)
class Thing:
    """A person or a piece of furniture in a frame."""

    label: str  #: "person", or the kind of furniture
    identity: int  #: its number in the scenario, people before furniture, movers last: the same in all frames
    #: x, y, w, h [px] around all that lies within the image, as if nothing stood in front of it.
    box: tuple[int, int, int, int]
    visible: float  #: share of the whole silhouette that is seen: 0 (hidden) … 1


def labelled_frames(
    scenario: Scenario, seed: int, count: int, every_s: float
) -> Iterator[tuple[TrueFrame, tuple[Thing, ...]]]:
    """Take `count` pictures, one every `every_s` seconds of the arena, while the robot wanders.

    Yield each frame, and all of which a part lies within the image, hidden or not.
    """
    arena = Arena(scenario, seed)
    random = np.random.default_rng([seed, WANDERING_STREAM])
    labels = labels_of(scenario)
    steps = round(CONTROL_PERIOD * STEPS_PER_SECOND)
    turn, turning, leg_ends, next_s = 0.0, False, 0.0, 0.0
    while count > 0:
        if arena.time >= leg_ends:
            turn, leg_ends = float(random.uniform(-_TURN, _TURN)), arena.time + _LEG_S
        free = _free_ahead(arena.scan(), _AHEAD)
        turning = free < (_CLEAR if turning else _KEEP)
        away = _TURN_AWAY if turn >= 0 else -_TURN_AWAY
        arena.command(Twist(0.0, away) if turning else Twist(_SPEED, turn))
        for _ in range(steps):
            arena.step()
        if arena.time >= next_s:
            frame = arena.frame()
            seen = [(0.0, None) if person is None else (person.visible, person.box) for person in frame.truth.people]
            everything = enumerate(zip(labels, [*seen, *arena.furniture_in_frame()], strict=True))
            yield frame, tuple(Thing(label, i, box, visible) for i, (label, (visible, box)) in everything if box)
            next_s, count = next_s + every_s, count - 1


def labels_of(scenario: Scenario) -> list[str]:
    """Return the label of every person and piece: people, then furniture, then movers."""
    kinds = [piece.kind for piece in scenario.furniture] + [piece.kind for piece in scenario.movers]
    return ["person"] * len(scenario.people) + kinds


def _free_ahead(scan: Scan, half_sector: float) -> float:
    """Return the least distance within the sector ahead [m]; inf where there is nothing."""
    angles = np.linspace(scan.angle_min, scan.angle_max, len(scan.ranges))
    return float(np.min(scan.ranges[np.abs(angles) <= half_sector], initial=np.inf))
