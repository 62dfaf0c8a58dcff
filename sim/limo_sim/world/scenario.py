"""Scenarios: the people and their routes, the furniture, the robot and the errors of the sensors; checked when read.

x forward, y left, yaw counter-clockwise [rad], metres, seconds; the arena's centre is the origin.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path

from limo_hog.follow.robot import LIMO, RobotGeometry, load_robot
from limo_sim.world.furniture import Disc, Furniture, Rectangle, distance_to
from limo_sim.world.movers import Mover
from limo_sim.world.people import Group, Person, Surroundings, Vary, check_person
from limo_sim.world.schema import (
    WIDEST,
    ScenarioError,
    build,
    check_fields,
    from_toml,
    misfit,
    one_of,
    required,
    within,
)

__all__ = [
    "ROOM_HALF",
    "WALL_HEIGHT",
    "Camera",
    "Depth",
    "DetectorFaults",
    "Furniture",
    "Group",
    "Imu",
    "Lidar",
    "Light",
]
__all__ += ["Mover", "Person", "Robot", "Room", "Scenario", "Vary", "Wall", "WallsTexture", "Wheels"]

#: Where the walls' inner faces stand without `room.half`, ± this, and how high they are [m]; as in `hri_world.world`.
ROOM_HALF, WALL_HEIGHT = 4.9, 1.0
# The middle of a piece of furniture, and of the robot at the start, keep these distances from the outer walls [m].
_FURNITURE_DISTANCE, _ROBOT_DISTANCE = 0.2, 0.3
# Inner walls are at least this long [m]: shorter than thick they would have no direction to speak of.
_SHORTEST_WALL = 0.05
_FOLDER = Path(__file__).parents[1] / "scenarios"
#: How many of each a scenario may have: 64 people take some seconds for one of the arena.
_MOST = {"people": 64, "movers": 64, "furniture": 256, "walls": 256}


@dataclass(frozen=True, slots=True)
class WallsTexture:
    """What is on the walls."""

    kind: str = one_of(("plain", "bricks", "boards"), "plain")  #: "boards" are upright
    contrast: float = within(0.15, 0.0, 0.6)  #: by how much tiles and joints are darker than a plain wall, at most [1]
    posters: float = within(0.0, 0.0, 1.5)  #: posters for each metre of wall [1/m]
    seed: int = within(0, 0, 1_000_000)  #: of the tiles' shades and of what the posters show


@dataclass(frozen=True, slots=True)
class Room:
    """A square room around the origin; its outer walls' inner faces stand at ± `half` [m]."""

    half: float = within(ROOM_HALF, 1.5, WIDEST)


@dataclass(frozen=True, slots=True)
class Wall:
    """A straight inner wall, as high as the outer ones, from the middle of one end (x, y) to that of the other [m]."""

    start: tuple[float, float] = required(-WIDEST, WIDEST)
    end: tuple[float, float] = required(-WIDEST, WIDEST)
    thickness: float = within(0.1, 0.02, 1.0)

    @property
    def length(self) -> float:
        """Between its ends [m]."""
        return math.dist(self.start, self.end)

    @property
    def footprint(self) -> Rectangle:
        """What stands on the floor, in the arena's frame."""
        (x0, y0), (x1, y1) = self.start, self.end
        yaw = math.atan2(y1 - y0, x1 - x0)
        return Rectangle((x0 + x1) / 2, (y0 + y1) / 2, self.length / 2, self.thickness / 2, yaw)


@dataclass(frozen=True, slots=True)
class Robot:
    """The robot's start [m, m, rad], its wheels' limits [m/s, m/s²], and the watchdog's time [s]; a Limo by default."""

    x: float = within(0.0, -WIDEST, WIDEST)
    y: float = within(0.0, -WIDEST, WIDEST)
    yaw: float = within(0.0, -2 * math.pi, 2 * math.pi)
    wheel_speed: float = within(1.0, 0.01, 10.0)
    wheel_acceleration: float = within(1.0, 0.05, 20.0)
    watchdog_s: float = within(0.5, 0.05, 60.0)
    geometry: RobotGeometry = LIMO

    @property
    def radius(self) -> float:
        """The circle about the base centre that holds the body [m]; at least what a Limo has been given, 0.19 m."""
        return max(0.19, math.hypot(self.geometry.half_length, self.geometry.half_width))


@dataclass(frozen=True, slots=True)
class Camera:
    """The colour camera."""

    rate_hz: float = within(10.0, 0.5, 50.0)  #: [Hz]
    latency_s: float = within(0.0, 0.0, 5.0)  #: age of a frame on arrival [s]
    drop_probability: float = within(0.0, 0.0, 1.0)  #: share of frames lost
    noise: float = within(1.0, 0.0, 20.0)  #: of brightness [of 255]
    exposure_s: float = within(0.0, 0.0, 0.1)  #: how long each row is exposed: what moves is blurred [s]
    readout_s: float = within(0.0, 0.0, 0.1)  #: between the first row and the last, of a rolling shutter [s]
    #: k1, k2: radial distortion, as in OpenCV's camera model; the limits keep it one to one within the image
    k1: float = within(0.0, -0.15, 0.3)
    k2: float = within(0.0, -0.02, 0.1)


@dataclass(frozen=True, slots=True)
class Depth:
    """The depth image, taken with the colour image: limits [m], relative noise, share of unknown pixels."""

    near_m: float = within(0.15, 0.01, 1.0)
    far_m: float = within(8.0, 1.0, 20.0)
    noise: float = within(0.004, 0.0, 0.2)
    invalid: float = within(0.001, 0.0, 0.5)


@dataclass(frozen=True, slots=True)
class Lidar:
    """The planar lidar: rate [Hz], age of a scan on arrival [s], range noise [m]."""

    rate_hz: float = within(8.0, 0.5, 50.0)
    latency_s: float = within(0.0, 0.0, 5.0)
    noise_m: float = within(0.01, 0.0, 0.5)


@dataclass(frozen=True, slots=True)
class Wheels:
    """The wheel odometry: rate [Hz], age on arrival [s], noise relative to the distance each wheel rolled."""

    rate_hz: float = within(50.0, 0.5, 50.0)
    latency_s: float = within(0.0, 0.0, 5.0)
    slip: float = within(0.005, 0.0, 0.5)


@dataclass(frozen=True, slots=True)
class Imu:
    """The inertial unit, 100 Hz: noise of its gyroscope [rad/s] and accelerometer [m/s²]."""

    gyro_noise: float = within(0.004, 0.0, 1.0)
    accel_noise: float = within(0.05, 0.0, 5.0)


@dataclass(frozen=True, slots=True)
class DetectorFaults:
    """What a less kind detector would do: each person's misses come in bursts, and there are boxes on nothing."""

    #: "opencv" or "limo": misses by the person's height in the image, bursts and false boxes as that model of people
    #: has them on photographs (docs/detector-model.md); the other keys are then left out. "none": those count.
    misses_like: str = one_of(("none", "opencv", "limo"), "none")
    #: Share of the camera's frames in which a person is not missed, in the long run, of those in which the detector
    #: itself finds the person [0 … 1].
    recall: float = within(1.0, 0.0, 1.0)
    burst_s: float = within(0.3, 0.02, 60.0)  #: mean length of an unbroken row of missed frames [s]
    false_rate: float = within(0.0, 0.0, 20.0)  #: mean number of false boxes in a frame that is searched as a whole

    def check(self, rate_hz: float, where: str) -> None:
        """Raise `ScenarioError` unless these keys go together, and a camera of `rate_hz` can show such bursts."""
        for name in ("recall", "burst_s", "false_rate") if self.misses_like != "none" else ():
            if getattr(self, name) != getattr(DetectorFaults(), name):
                both = f"got {getattr(self, name):g} beside misses_like {self.misses_like!r}"
                raise ScenarioError(f"{where}{name}: {both}, which has its own; give one of the two")
        if not 0.0 < self.recall < 1.0:
            return
        # At best every gap between two bursts is one frame long.
        least = max(1.0, (1.0 - self.recall) / self.recall) / rate_hz
        if self.burst_s < least * (1.0 - 1e-9):
            raise ScenarioError(
                f"{where}burst_s: got {self.burst_s:g}, want at least {least:.3g} s: a burst is one frame or longer, "
                f"and recall {self.recall:g} at {rate_hz:g} Hz leaves one frame or more between two bursts"
            )


@dataclass(frozen=True, slots=True)
class Light:
    """The sun's direction and strengths, and the brightness of sky, floor and walls, 0 … 1.

    All of it goes down by the share `swing` and up again, once in `swing_s` [s].
    """

    sun: tuple[float, float, float] = within((-0.5, 0.1, -0.9), -1.0, 1.0)
    diffuse: float = within(0.8, 0.0, 1.2)
    ambient: float = within(0.4, 0.1, 1.0)
    sky: float = within(0.70, 0.2, 1.0)
    floor: float = within(0.45, 0.1, 0.9)
    wall: float = within(0.95, 0.3, 1.0)
    swing: float = within(0.0, 0.0, 0.9)
    swing_s: float = within(20.0, 0.1, 3600.0)

    def strength(self, time: float) -> float:
        """Return the brightness at a time [s], relative to that at the start."""
        return 1.0 - self.swing * (0.5 - 0.5 * math.cos(math.tau * time / self.swing_s))


@dataclass(frozen=True, slots=True)
class Scenario:
    """One test bed; `dataclasses.replace` makes another, checked when an `Arena` is built on it."""

    name: str = ""
    summary: str = ""
    people: tuple[Person, ...] = ()
    furniture: tuple[Furniture, ...] = ()
    robot: Robot = dataclasses.field(default_factory=Robot)
    camera: Camera = dataclasses.field(default_factory=Camera)
    depth: Depth = dataclasses.field(default_factory=Depth)
    lidar: Lidar = dataclasses.field(default_factory=Lidar)
    odometry: Wheels = dataclasses.field(default_factory=Wheels)
    imu: Imu = dataclasses.field(default_factory=Imu)
    detector: DetectorFaults = dataclasses.field(default_factory=DetectorFaults)
    light: Light = dataclasses.field(default_factory=Light)
    room: Room = dataclasses.field(default_factory=Room)
    walls: tuple[Wall, ...] = ()
    vary: Vary = dataclasses.field(default_factory=Vary)
    movers: tuple[Mover, ...] = ()
    walls_texture: WallsTexture = dataclasses.field(default_factory=WallsTexture)

    @property
    def surroundings(self) -> Surroundings:
        """What the people have to fit between."""
        return Surroundings(self.room.half, (self.robot.x, self.robot.y), self.robot.radius, self._obstacles())

    @property
    def footprints(self) -> tuple[Disc | Rectangle, ...]:
        """What furniture and inner walls cover on the floor, in the arena's frame."""
        return (*(piece.footprint for piece in self.furniture), *(wall.footprint for wall in self.walls))

    @staticmethod
    def names() -> tuple[str, ...]:
        """Names of the scenarios that come with limo-sim."""
        return tuple(sorted(path.stem for path in _FOLDER.glob("*.toml")))

    @staticmethod
    def load(name_or_path: str | Path, robot: str | Path | None = None) -> Scenario:
        """Read one of `Scenario.names()`, or a TOML file; `robot` is the file of another than the Limo.

        Raises `ScenarioError` or `RobotError` with the file, the key and what is allowed there.
        """
        path = Path(name_or_path)
        if path.suffix != ".toml":
            path = _FOLDER / f"{name_or_path}.toml"
            if str(name_or_path) not in Scenario.names():
                known = ", ".join(Scenario.names())
                raise ScenarioError(f"unknown scenario {name_or_path}: want one of {known}, or a .toml file")
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise ScenarioError(f"{path}: cannot be read: {getattr(error, 'strerror', error)}") from error
        try:
            table = from_toml(text)
        # Beside its own error, which is a ValueError: numbers of thousands of digits, lists within hundreds of lists.
        except (ValueError, RecursionError) as error:
            raise ScenarioError(f"{path}: not TOML that can be read: {error}") from error
        where = f"{path.name}: "
        groups = build(_Groups, {"groups": table.pop("groups", [])}, where).groups
        scenario = build(Scenario, {"name": path.stem, **table}, where)
        if robot is not None:
            geometry = load_robot(robot)
            limits = {"wheel_speed": geometry.max_speed, "wheel_acceleration": geometry.acceleration}
            driven = dataclasses.replace(scenario.robot, geometry=geometry, **limits)
            scenario = dataclasses.replace(scenario, robot=driven)
        scenario.check(where)
        return scenario._with_groups(groups, where) if groups else scenario

    def check(self, where: str = "") -> None:
        """Raise `ScenarioError`, its message beginning with `where`, unless this scenario can be run."""
        check_fields(self, where)
        for kind, most in _MOST.items():
            if len(getattr(self, kind)) > most:
                raise misfit(f"{where}{kind}", f"{len(getattr(self, kind))} of them", f"at most {most}")
        if math.hypot(*self.light.sun) < 0.1:
            raise ScenarioError(f"{where}light.sun: got {self.light.sun}, want a direction longer than 0.1")
        self.detector.check(self.camera.rate_hz, f"{where}detector.")
        far = max(_ROBOT_DISTANCE, self.robot.radius)
        self._check_inside((self.robot.x, self.robot.y), far, (f"{where}robot.x", f"{where}robot.y"))
        for index, piece in enumerate(self.furniture):
            names = f"{where}furniture[{index}].x", f"{where}furniture[{index}].y"
            self._check_inside((piece.x, piece.y), _FURNITURE_DISTANCE, names)
        for index, wall in enumerate(self.walls):
            for name, place in (("start", wall.start), ("end", wall.end)):
                key = f"{where}walls[{index}].{name}"
                self._check_inside(place, 0.0, (f"{key}[0]", f"{key}[1]"))
            if wall.length < _SHORTEST_WALL:
                raise misfit(f"{where}walls[{index}]", f"is {wall.length:g} m long", f"at least {_SHORTEST_WALL} m")
        for name, footprint in self._obstacles():
            distance = distance_to(footprint, self.robot.x, self.robot.y)
            if distance < self.robot.radius:
                found = f"is {max(distance, 0.0):.2f} m from the robot's centre"
                raise misfit(f"{where}{name.split(' ')[0]}", found, f"at least {self.robot.radius:.2f} m")
        around = self.surroundings
        for index, person in enumerate(self.people):
            check_person(person, around, f"{where}people[{index}]")
        for index, mover in enumerate(self.movers):
            check_person(mover.timetable, around, f"{where}movers[{index}]")

    def _with_groups(self, groups: tuple[Group, ...], where: str) -> Scenario:
        """Return this scenario with the members of groups among its people; refuse groups that do not fit."""
        around = self.surroundings
        grown = len(self.people) + sum(group.size for group in groups)
        if grown > _MOST["people"]:
            raise ScenarioError(f"{where}people: {grown} with those of groups, want at most {_MOST['people']}")
        for index, group in enumerate(groups):
            check_fields(group, f"{where}groups[{index}].")
            for member in group.members():
                check_person(member, around, f"{where}groups[{index}], one of its people")
        return dataclasses.replace(
            self, people=(*self.people, *(person for group in groups for person in group.members()))
        )

    def check_detector_is_plain(self, why: str) -> None:
        """Raise `ScenarioError` if `[detector]` asks for faults where none can be added, which `why` explains."""
        if self.detector != DetectorFaults():
            instead = "leave the table out, or use `limo-hog follow` or `score`"
            raise ScenarioError(f"scenario {self.name!r}: detector: {why}; {instead}")

    def _obstacles(self) -> list[tuple[str, Disc | Rectangle]]:
        """Return what stands in the room, by the name that a message gives it."""
        pieces = ((f"furniture[{index}] ({item.kind})", item.footprint) for index, item in enumerate(self.furniture))
        return [*pieces, *((f"walls[{index}]", wall.footprint) for index, wall in enumerate(self.walls))]

    def _check_inside(self, place: tuple[float, float], distance: float, names: tuple[str, str]) -> None:
        """Refuse a place nearer to the outer walls than a distance [m]."""
        half = self.room.half - distance
        for name, value in zip(names, place, strict=True):
            if abs(value) > half + 1e-9:
                raise ScenarioError(f"{name}: got {value}, want a number in {-half:g} … {half:g}")


@dataclass(frozen=True, slots=True)
class _Groups:
    groups: tuple[Group, ...] = ()
