"""What a scenario may say about people, and whether they fit into its room."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from limo_sim.world.furniture import Disc, Rectangle, distance_to
from limo_sim.world.paths import FloorPlan
from limo_sim.world.schema import WIDEST, ScenarioError, misfit, one_of, required, within

# Corners of routes keep this distance from the walls [m]: the first, or a person's radius and the second, if that is
# more. Chosen: the robot's diagonal is 0.364 m, so that a person does not press the robot against a wall.
_WALL_DISTANCE, _WALL_GAP = 0.6, 0.37
# Routes keep this distance from furniture [m]. Chosen: arms swing beyond the cylinder that stands for the body.
_CLEARANCE = 0.2
# Distances from routes to furniture are taken at points this far apart [m]: right to within half of it.
_ROUTE_STEP = 0.02
# Ways that people find by themselves keep this distance from obstacles, in statures. Measured: with the forces of
# `social_force` a person walks through a door of 0.62 statures, and stops before one of 0.58.
_WAY_MARGIN = 0.31
# A place on an outer wall is right to within this [m]. Chosen.
_ON_WALL = 0.01

SOCIAL_FORCE = "social_force"


@dataclass(frozen=True, slots=True)
class Person:
    """A person who walks a closed route again and again."""

    #: Corners (x, y, pause): walked in order, then from the last to the first again, with `pause` seconds at each on
    #: arrival [m, m, s]. One corner: the person stands there.
    route: tuple[tuple[float, float, float], ...] = required(-WIDEST, 3600.0)
    speed: float = within(0.75, 0.05, 2.0)  #: walking speed [m/s]
    height: float = within(0.9, 0.6, 2.0)  #: stature [m]; the whole body scales with it
    girth: float = within(1.0, 0.7, 1.4)  #: breadth of limbs and trunk, relative to that of `person.body`
    arrives_s: float = within(0.0, 0.0, 3600.0)  #: the person is not in the arena before this time [s]
    #: Nor from this time on [s]; with "social_force" it is when the person sets out for the door.
    leaves_s: float = within(math.inf, 0.0, math.inf)
    #: Direction in which a person whose route has a single corner faces [rad].
    facing: float = within(math.pi, -2 * math.pi, 2 * math.pi)
    #: "route": keeps to the timetable, whatever is in the way. "social_force": walks the same corners, finds ways round
    #: obstacles, and gives way to people, walls and the robot (`social_force`).
    behaviour: str = one_of(("route", SOCIAL_FORCE), "route")
    #: To the robot, with "social_force": "avoid" (keeps clear of it, as of any obstacle), "ignore", "approach" (comes
    #: up to it) or "block" (stands in its way).
    reaction: str = one_of(("avoid", "ignore", "approach", "block"), "avoid")
    #: Door in an outer wall, with "social_force": x, y [m]. A person who arrives comes in by it, a person who leaves
    #: goes out by it; without it, by the door nearest to the first corner.
    enters: tuple[float, ...] = within((), -WIDEST, WIDEST)
    sits: bool = False  #: whether a person whose route has a single corner sits there, on a stool
    #: shirt, trousers, skin, hair: colours, red, green, blue, 0 … 255
    shirt: tuple[float, float, float] = within((34, 52, 128), 0, 255)
    trousers: tuple[float, float, float] = within((38, 42, 56), 0, 255)
    skin: tuple[float, float, float] = within((198, 154, 124), 0, 255)
    hair: tuple[float, float, float] = within((56, 38, 28), 0, 255)

    @property
    def radius(self) -> float:
        """Of the upright cylinder the robot can bump into [m]."""
        return (0.24 if self.sits else 0.17) * self.height

    @property
    def yields(self) -> bool:
        """Whether the person feels social forces."""
        return self.behaviour == SOCIAL_FORCE

    @property
    def walks_in(self) -> bool:
        """Whether the person comes through a door, rather than being there at once."""
        return self.yields and (self.arrives_s > 0 or bool(self.enters))

    @property
    def way_margin(self) -> float:
        """Distance from obstacles that the ways keep which the person finds [m]."""
        return _WAY_MARGIN * self.height


@dataclass(frozen=True, slots=True)
class Vary:
    """How much the people of a run differ from the scenario's, drawn from the run's seed."""

    clothes: bool = False  #: whether colours and girth are drawn
    #: height, speed: by up to this share of the scenario's [1]
    height: float = within(0.0, 0.0, 0.5)
    speed: float = within(0.0, 0.0, 0.9)
    place: float = within(0.0, 0.0, 2.0)  #: by how much each corner of a route is moved along x and y, at most [m]


@dataclass(frozen=True, slots=True)
class Group:
    """People who stand in a circle and look at its middle; `[[groups]]` in a file becomes so many `[[people]]`."""

    #: x, y: the circle's middle [m]
    x: float = required(-WIDEST, WIDEST)
    y: float = required(-WIDEST, WIDEST)
    size: int = within(3, 2, 12)  #: how many people
    radius: float = within(0.5, 0.2, 3.0)  #: from the middle to each person [m]
    height: float = within(0.9, 0.6, 2.0)  #: their stature [m]
    #: behaviour, reaction: as of a `Person`; "social_force" steps aside and comes back
    behaviour: str = one_of(("route", SOCIAL_FORCE), "route")
    reaction: str = one_of(("avoid", "ignore", "approach", "block"), "avoid")

    def members(self) -> tuple[Person, ...]:
        """Return the people; their shirts differ."""
        angles = [math.tau * index / self.size for index in range(self.size)]
        return tuple(
            Person(
                route=((self.x + self.radius * math.cos(angle), self.y + self.radius * math.sin(angle), 0.0),),
                facing=math.remainder(angle + math.pi, math.tau),
                height=self.height,
                behaviour=self.behaviour,
                reaction=self.reaction,
                shirt=_SHIRTS[index % len(_SHIRTS)],
            )
            for index, angle in enumerate(angles)
        )


_SHIRTS = ((34, 52, 128), (150, 44, 40), (52, 104, 58), (196, 150, 52), (98, 60, 120), (182, 180, 174))


@dataclass(frozen=True)
class Surroundings:
    """What people have to fit between."""

    half: float  #: the outer walls stand at ± this [m]
    robot: tuple[float, float]  #: where the robot starts, x, y [m]
    robot_radius: float  #: of the circle that holds it [m]
    obstacles: Sequence[tuple[str, Disc | Rectangle]]  #: what stands in the room, by the name that a message gives it
    #: the floor plans that were asked for, by their margin [m]
    _plans: dict[float, FloorPlan] = field(default_factory=dict, init=False, repr=False, compare=False)

    def plan(self, margin: float) -> FloorPlan:
        """Return the floor plan whose ways keep a distance from obstacles [m]."""
        if margin not in self._plans:
            self._plans[margin] = FloorPlan([shape for _, shape in self.obstacles], self.half, margin)
        return self._plans[margin]


def check_person(person: Person, around: Surroundings, where: str) -> None:
    """Raise `ScenarioError`, its message beginning with `where`, unless the person fits in."""
    if not person.route:
        raise ScenarioError(f"{where}.route: is empty, want at least one corner [x, y, pause]")
    # In whole centimetres, as the message shows it.
    half = math.floor(100 * (around.half - max(_WALL_DISTANCE, person.radius + _WALL_GAP))) / 100
    for index, (x, y, pause) in enumerate(person.route):
        if max(abs(x), abs(y)) > half:
            found = f"({x:g}, {y:g}) is in a wall or too near one"
            raise misfit(f"{where}.route[{index}]", found, f"x and y in {-half:g} … {half:g}")
        if pause < 0:
            raise ScenarioError(f"{where}.route[{index}]: pause {pause:g} s, want 0 … 3600")
    if person.leaves_s <= person.arrives_s:
        raise misfit(f"{where}.leaves_s", f"got {person.leaves_s:g}", f"more than arrives_s, {person.arrives_s:g}")
    if person.sits and len(person.route) > 1:
        raise ScenarioError(f"{where}.sits: got true with {len(person.route)} corners, want a route of one corner")
    x, y, _ = person.route[0]
    if person.arrives_s == 0 and not person.walks_in:
        free = math.dist((x, y), around.robot) - person.radius
        if free < around.robot_radius:
            found = f"is {max(free, 0.0):.2f} m from the robot's centre"
            raise misfit(f"{where}.route[0]", found, f"at least {around.robot_radius:.2f} m")
    if person.yields:
        _check_yielding(person, around, where)
    else:
        _check_timetable(person, around, where)


def _check_timetable(person: Person, around: Surroundings, where: str) -> None:
    """Refuse what needs a person who yields, and a route that leads through something."""
    for key, value in (("reaction", person.reaction), ("enters", person.enters)):
        if value and value != "avoid":
            raise ScenarioError(f'{where}.{key}: got {value!r}, want behaviour = "{SOCIAL_FORCE}" with it')
    for index, corner in enumerate(person.route):
        after = person.route[(index + 1) % len(person.route)]
        for name, footprint in around.obstacles:
            gap = _gap(corner, after, footprint) - person.radius
            if gap < _CLEARANCE:
                found = f"the way to the next corner passes {max(gap, 0.0):.2f} m from {name}"
                raise misfit(f"{where}.route[{index}]", found, f"at least {_CLEARANCE} m")


def _check_yielding(person: Person, around: Surroundings, where: str) -> None:
    """Refuse corners that touch something, doors in the middle of the room, and places to which no way leads."""
    least = max(person.radius + _CLEARANCE, person.way_margin)
    for index, (x, y, _) in enumerate(person.route):
        for name, footprint in around.obstacles:
            gap = distance_to(footprint, x, y)
            if gap < least - 1e-9:
                found = f"is {max(gap, 0.0):.2f} m from {name}"
                raise misfit(f"{where}.route[{index}]", found, f"at least {least:.2f} m")
    first = person.route[0][:2]
    ends = [(f"route[{index}]", corner[:2]) for index, corner in enumerate(person.route)]
    if door := person.enters:
        if len(door) != 2 or abs(max(map(abs, door)) - around.half) > _ON_WALL:
            want = f"[x, y] on an outer wall: the one or the other ±{around.half:g}"
            raise misfit(f"{where}.enters", f"got {list(door)}", want)
        ends.append(("enters", before_door((door[0], door[1]), around.half, person.way_margin)))
    plan = around.plan(person.way_margin)
    for key, end in ends:
        if math.isinf(plan.way(first, end)[1]):
            want = f"doors of at least {2 * person.way_margin:.2f} m for a person of {person.height:g} m"
            raise misfit(f"{where}.{key}", "no way leads there from the first corner", want)


def before_door(door: tuple[float, float], half: float, distance: float) -> tuple[float, float]:
    """Return the place before a door in an outer wall, at a distance [m]; behind it, if that is negative."""
    x, y = door
    if abs(x) >= abs(y):
        return math.copysign(half - distance, x), y
    return x, math.copysign(half - distance, y)


def door_of(person: Person, around: Surroundings) -> tuple[float, float]:
    """Return where on the outer walls a person who yields comes in and goes out [m]."""
    if person.enters:
        return person.enters[0], person.enters[1]
    x, y, _ = person.route[0]
    half, plan = around.half, around.plan(person.way_margin)

    def length(door: tuple[float, float]) -> float:
        return plan.way((x, y), before_door(door, half, person.way_margin))[1]

    return min(((half, y), (-half, y), (x, half), (x, -half)), key=length)


def _gap(start: tuple[float, float, float], end: tuple[float, float, float], shape: Disc | Rectangle) -> float:
    """Smallest distance [m] from the straight way between two corners to a shape, to within a centimetre."""
    steps = max(1, math.ceil(math.dist(start[:2], end[:2]) / _ROUTE_STEP))
    ways = (index / steps for index in range(steps + 1))
    return min(
        distance_to(shape, start[0] + way * (end[0] - start[0]), start[1] + way * (end[1] - start[1])) for way in ways
    )
