"""Furniture that moves: pieces on timetables of their own."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass

from limo_sim.world.furniture import KINDS, Furniture, reach
from limo_sim.world.people import Person
from limo_sim.world.person import Walk
from limo_sim.world.schema import WIDEST, one_of, required, within


@dataclass(frozen=True, slots=True)
class Mover:
    """A piece of furniture that moves along a closed route, as a person with a timetable walks."""

    kind: str = one_of(tuple(KINDS))  #: as of `Furniture`
    route: tuple[tuple[float, float, float], ...] = required(-WIDEST, 3600.0)  #: corners (x, y, pause) [m, m, s]
    speed: float = within(0.3, 0.05, 2.0)  #: on the way [m/s]

    @property
    def timetable(self) -> Person:
        """A person as broad as the piece, who walks its route."""
        person = Person(route=self.route, speed=self.speed, facing=0.0)
        return dataclasses.replace(person, height=person.height * reach(KINDS[self.kind].footprint) / person.radius)


class Movers:
    """The moving pieces of a run, in the scenario's order."""

    def __init__(self, movers: Iterable[Mover]) -> None:
        self._walks = [(mover.kind, Walk(mover.timetable)) for mover in movers]

    def at(self, time: float) -> tuple[Furniture, ...]:
        """Return the pieces where they are at a time [s]."""
        pieces = []
        for kind, walk in self._walks:
            if pose := walk.pose(time):
                pieces.append(Furniture(kind, pose.x, pose.y, pose.yaw))
        return tuple(pieces)
