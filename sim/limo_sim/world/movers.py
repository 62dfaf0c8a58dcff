"""Furniture that moves: pieces on timetables of their own."""

from __future__ import annotations

from limo_sim.world.person import Walk
from limo_sim.world.scenario import Furniture, Scenario


class Movers:
    """The moving pieces of a run, in the scenario's order."""

    def __init__(self, scenario: Scenario) -> None:
        self._walks = [(mover.kind, Walk(mover.timetable)) for mover in scenario.movers]

    def at(self, time: float) -> tuple[Furniture, ...]:
        """Return the pieces where they are at a time [s]."""
        poses = ((kind, walk.pose(time)) for kind, walk in self._walks)
        return tuple(Furniture(kind, pose.x, pose.y, pose.yaw) for kind, pose in poses if pose is not None)
