"""The arena: walls, furniture, walking people and a driven robot, in fixed steps of 1/50 s.

Everything depends on the scenario, the seed and the commands alone. Each sensor draws its noise from its own
stream by the number of the reading, so that reading one sensor changes no other.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
import pymunk

from limo_hog.follow.robot import Twist
from limo_hog.follow.sense.observation import Odometry, Scan
from limo_hog.signals import held
from limo_sim.run.log import Passed
from limo_sim.sensing import imu, lidar
from limo_sim.sensing.camera import CameraPose, TrueFrame
from limo_sim.sensing.delivery import Channel, Exposure
from limo_sim.sensing.renderer import Earlier, Renderer, Seen
from limo_sim.world import variants
from limo_sim.world.crowd import STEP_S, Crowd
from limo_sim.world.furniture import KINDS, Disc, Rectangle, placed
from limo_sim.world.movers import Movers
from limo_sim.world.person import Pose, earlier, legs_at, trunk_radius
from limo_sim.world.robot import Drive, integrate, twist_of
from limo_sim.world.scenario import Camera, Furniture, Lidar, Scenario, Wheels
from limo_sim.world.truth import Contacts, PersonTruth, Truth

STEPS_PER_SECOND = round(1 / STEP_S)

_ROBOT, _OBSTACLE, _PERSON = 1, 2, 3
_WALL_HALF = 0.1  # half of the walls' thickness [m]
_SAME_CONTACT = STEPS_PER_SECOND // 2  # touching again within half a second is the same contact; chosen
_SLOP = 0.001  # how deep bodies may overlap before pymunk parts them [m]; its default, 0.1, is for pixels
_MASS = 4.2  # of the robot [kg]; without effect, since everything it can touch is immovable
_FRICTION = 0.3  # of every surface; chosen, the outcome of a contact hardly depends on it


@dataclass(frozen=True, slots=True)
class _State:
    """The end of a step [s]: the robot's pose [m, m, rad], velocity [m/s], turn rate [rad/s], odometry; all others."""

    step: int
    time: float
    x: float
    y: float
    yaw: float
    people: tuple[Pose | None, ...]
    people_before: tuple[Pose | None, ...]
    movers: tuple[Furniture, ...]
    velocity: tuple[float, float] = (0.0, 0.0)
    turn_rate: float = 0.0
    odometry: Odometry = Odometry()  # noqa: RUF009 - frozen
    contacts: Contacts = Contacts()  # noqa: RUF009


@dataclass(frozen=True, slots=True)
class Plan:
    """The arena from above at one instant [s]: the robot's x, y, yaw [m, m, rad], and where each person is."""

    stamp: float
    robot: tuple[float, float, float]
    people: tuple[Pose | None, ...]


class Arena:
    """One run of a scenario, whose `vary` draws people from the seed: `scenario` holds those of this run.

    Raises `ScenarioError` when the scenario cannot be run.
    """

    def __init__(self, scenario: Scenario, seed: int = 0) -> None:
        scenario.check(f"scenario {scenario.name!r}: ")
        self.scenario = scenario = variants.of_run(scenario, seed)
        self.seed = seed
        self._crowd, self._movers = Crowd(scenario, seed), Movers(scenario.movers)
        robot, self.robot = scenario.robot, scenario.robot.geometry
        self._drive = Drive(self.robot.wheel_separation, robot.wheel_speed, robot.wheel_acceleration, robot.watchdog_s)
        self._slip = self._stream(variants.SLIP_STREAM)
        self.time = 0.0  #: since the start [s]
        self.contacts = Contacts()  #: how often the robot has touched a person, and a wall or furniture
        self._touched = {"wall": -STEPS_PER_SECOND, "person": -STEPS_PER_SECOND}
        self._space = pymunk.Space()
        self._space.collision_slop = _SLOP
        self._robot = self._add_robot()
        self._add_obstacles()
        self._people: list[pymunk.Body | None] = [None] * len(scenario.people)
        self._place_people()
        people, movers = self._crowd.poses, self._movers.at(0.0)
        self._moving = [self._add_mover(piece) for piece in movers]
        for other, name in ((_OBSTACLE, "wall"), (_PERSON, "person")):
            self._space.on_collision(_ROBOT, other, pre_solve=self._on_touch, data=name)
        self._state = self._before = _State(0, 0.0, robot.x, robot.y, robot.yaw, people, people, movers)
        drops = {"drop_probability": scenario.camera.drop_probability, "drops": self._stream(variants.DROP_STREAM)}
        self._camera = self._channel(scenario.camera, **drops)
        self._lidar, self._wheels = self._channel(scenario.lidar), self._channel(scenario.odometry)
        self._static_scanned = _scanned(scenario.furniture) + [wall.footprint for wall in scenario.walls]
        self._frame: TrueFrame | None = None
        self._scan: Scan | None = None

    @property
    def rejected_commands(self) -> int:
        """How many commands were not finite numbers; each stopped the robot."""
        return self._drive.rejected

    @property
    def watchdog_stops(self) -> int:
        """How often the watchdog stopped the robot."""
        return self._drive.watchdog_stops

    def command(self, twist: Twist) -> None:
        """Drive with these speeds until the next command, or until the watchdog stops the robot."""
        self._drive.command(twist, self.time)

    def step(self) -> None:
        """Advance by 1/50 s."""
        before = self._state
        self._drive.advance(before.time, STEP_S)
        step = before.step + 1
        self.time = now = step / STEPS_PER_SECOND
        self._crowd.advance(now, (before.x, before.y, before.yaw))
        self._place_people()
        movers = self._movers.at(now)
        for body, piece in zip(self._moving, movers, strict=True):
            body.velocity = (piece.x - body.position.x) / STEP_S, (piece.y - body.position.y) / STEP_S
            body.angular_velocity = math.remainder(piece.yaw - body.angle, math.tau) / STEP_S
        with held():  # an exception in one of pymunk's callbacks would be printed and lost
            self._space.step(STEP_S)
        robot, drive = self._robot, self._drive
        twist, wheels = drive.twist, before.odometry
        left, right = STEP_S * (1.0 + self.scenario.odometry.slip * self._slip.standard_normal(2))
        rolled = twist_of(float(left) * drive.left, float(right) * drive.right, drive.separation)
        x, y, yaw = integrate(wheels.x, wheels.y, wheels.yaw, rolled.linear, rolled.angular)
        self._before = before
        self._state = _State(
            step=step,
            time=now,
            x=robot.position.x,
            y=robot.position.y,
            yaw=robot.angle,
            velocity=(robot.velocity.x, robot.velocity.y),
            turn_rate=robot.angular_velocity,
            odometry=Odometry(now, x, y, yaw, twist.linear, twist.angular),
            contacts=self.contacts,
            people=self._crowd.poses,
            people_before=before.people,
            movers=movers,
        )
        for channel in (self._camera, self._lidar, self._wheels):
            channel.advance(step, self._state)

    def frame(self) -> TrueFrame:
        """Return the newest camera frame that has arrived: the same one until another does."""
        exposure = self._camera.newest
        state = exposure.state
        if self._frame is None or self._frame.stamp != state.time:
            camera = self._camera_at(state)
            image, depth, seen = self._renderer.render(
                camera,
                state.people,
                self._stream(variants.CAMERA_STREAM, exposure),
                state.movers,
                time=state.time,
                past=Earlier(partial(self._earlier, state), state.turn_rate),
            )
            self._frame = TrueFrame(state.time, image, camera.focal_px, depth, self._truth_at(state, camera, seen))
        return self._frame

    def scan(self) -> Scan:
        """Return the newest lidar scan that has arrived."""
        exposure = self._lidar.newest
        state = exposure.state
        if self._scan is None or self._scan.stamp != state.time:
            shapes: list[Disc | Rectangle] = [*self._static_scanned, *_scanned(state.movers)]
            for person, pose in zip(self.scenario.people, state.people, strict=True):
                if pose is not None:
                    shapes += legs_at(person, pose, self.robot.lidar_z)
            x = state.x + self.robot.lidar_x * math.cos(state.yaw)
            y = state.y + self.robot.lidar_x * math.sin(state.yaw)
            ranges = lidar.measure(
                lidar.cast(x, y, state.yaw + self.robot.lidar_yaw, shapes, self.scenario.room.half),
                self.scenario.lidar.noise_m,
                self._stream(variants.LIDAR_STREAM, exposure),
            )
            limits = -lidar.ANGLE_MAX, lidar.ANGLE_MAX, lidar.RANGE_MIN, lidar.RANGE_MAX
            self._scan = Scan(state.time, ranges, *limits)
        return self._scan

    def odometry(self) -> Odometry:
        """Return the newest odometry that has arrived."""
        return self._wheels.newest.state.odometry

    def imu(self) -> tuple[imu.ImuReading, ...]:
        """Return the readings of the last step, oldest first."""
        before, now = self._before, self._state
        (was_x, was_y), (is_x, is_y) = before.velocity, now.velocity
        gained_x, gained_y = (is_x - was_x) / STEP_S, (is_y - was_y) / STEP_S
        cos, sin = math.cos(now.yaw), math.sin(now.yaw)
        forward, sideways = cos * gained_x + sin * gained_y, cos * gained_y - sin * gained_x
        noise = np.random.default_rng([self.seed, variants.IMU_STREAM, now.step])
        return imu.samples(now.time, now.turn_rate, forward, sideways, self.scenario.imu, noise)

    def passed(self) -> Passed:
        """Return what the faster sensors read in the last step."""
        return Passed(self.time, self.odometry(), self.imu())

    def truth(self) -> Truth:
        """Return the truth now (`TrueFrame.truth`: at the frame's stamp); free once this instant's frame is drawn."""
        if self._frame is not None and self._frame.stamp == self.time:
            return self._frame.truth
        state, camera = self._state, self._camera_at(self._state)
        return self._truth_at(state, camera, self._renderer.look(camera, state.people, state.movers))

    def furniture_in_frame(self) -> list[Seen]:
        """Return the visible share and the box [px] of each piece of furniture in the newest frame; movers last."""
        state = self._camera.newest.state
        return self._renderer.look_at_furniture(self._camera_at(state), state.people, state.movers)

    def plan(self, *, of_frame: bool = False) -> Plan:
        """Return where everything is now, or was when the newest frame was taken; quick, since nothing is drawn."""
        state = self._camera.newest.state if of_frame else self._state
        return Plan(state.time, (state.x, state.y, state.yaw), state.people)

    @cached_property
    def _renderer(self) -> Renderer:
        return Renderer(self.scenario, self._stream(variants.PATTERN_STREAM))

    def _earlier(self, state: _State, age: float) -> tuple[CameraPose, list[Pose | None], tuple[Furniture, ...]]:
        """Return what there was some seconds before a state, within a step or a few of it."""
        (speed_x, speed_y), share = state.velocity, age / STEP_S
        x, y, yaw = state.x - age * speed_x, state.y - age * speed_y, state.yaw - age * state.turn_rate
        camera = CameraPose.on_robot(self.robot, x, y, yaw)
        people = [earlier(was, now, share) for was, now in zip(state.people_before, state.people, strict=True)]
        return camera, people, self._movers.at(max(state.time - age, 0.0))

    def _channel(self, sensor: Camera | Lidar | Wheels, **drops: Any) -> Channel[_State]:
        return Channel(sensor.rate_hz, STEPS_PER_SECOND, self._state, latency_s=sensor.latency_s, **drops)

    def _camera_at(self, state: _State) -> CameraPose:
        return CameraPose.on_robot(self.robot, state.x, state.y, state.yaw)

    def _stream(self, sensor: int, exposure: Exposure[_State] | None = None) -> np.random.Generator:
        return np.random.default_rng([self.seed, sensor, exposure.index if exposure else 0])

    def _truth_at(self, state: _State, camera: CameraPose, seen: list[Seen]) -> Truth:
        people: list[PersonTruth | None] = []
        for person, pose, (visible, box) in zip(self.scenario.people, state.people, seen, strict=True):
            if pose is None:
                people.append(None)
                continue
            dx, dy = pose.x - state.x, pose.y - state.y
            bearing = (math.atan2(dy, dx) - state.yaw + math.pi) % math.tau - math.pi
            from_x, from_y = pose.x - camera.x, pose.y - camera.y
            surface = math.hypot(from_x, from_y) - trunk_radius(person, pose, math.atan2(from_y, from_x))
            people.append(PersonTruth(pose.x, pose.y, pose.yaw, math.hypot(dx, dy), bearing, surface, visible, box))
        return Truth(state.time, (state.x, state.y, state.yaw), tuple(people), state.contacts)

    def _add_robot(self) -> pymunk.Body:
        settings = self.scenario.robot
        size = (2 * self.robot.half_length, 2 * self.robot.half_width)
        robot = pymunk.Body(mass=_MASS, moment=pymunk.moment_for_box(_MASS, size))
        robot.position = settings.x, settings.y
        robot.angle = settings.yaw
        robot.velocity_func = self._roll
        shape = pymunk.Poly.create_box(robot, size)
        shape.friction, shape.collision_type = _FRICTION, _ROBOT
        self._space.add(robot, shape)
        return robot

    def _roll(self, robot: pymunk.Body, _gravity: tuple[float, float], _damping: float, _dt: float) -> None:
        """Set the velocity from the wheels; the solver then reduces it where there is contact."""
        twist, yaw = self._drive.twist, robot.angle
        robot.velocity = twist.linear * math.cos(yaw), twist.linear * math.sin(yaw)
        robot.angular_velocity = twist.angular

    def _add_obstacles(self) -> None:
        ground = self._space.static_body
        room = self.scenario.room.half
        middle, half = room + _WALL_HALF, room + 2 * _WALL_HALF
        footprints: list[Disc | Rectangle] = []
        for side in (middle, -middle):
            footprints += [Rectangle(side, 0, _WALL_HALF, half), Rectangle(0, side, half, _WALL_HALF)]
        for footprint in (*footprints, *self.scenario.footprints):
            self._space.add(_obstacle(ground, footprint))

    def _add_mover(self, piece: Furniture) -> pymunk.Body:
        body = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
        body.position, body.angle = (piece.x, piece.y), piece.yaw
        self._space.add(body, _obstacle(body, KINDS[piece.kind].footprint))
        return body

    def _place_people(self) -> None:
        """Give each person the velocity that leads to their place at the end of the step."""
        for index, (pose, person) in enumerate(zip(self._crowd.poses, self._people, strict=True)):
            if pose is None:
                if person is not None:
                    self._space.remove(person, *person.shapes)
                    self._people[index] = None
                continue
            if person is None:
                person = self._people[index] = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
                person.position = pose.x, pose.y
                shape = pymunk.Circle(person, self.scenario.people[index].radius)
                shape.friction, shape.collision_type = _FRICTION, _PERSON
                self._space.add(person, shape)
            x, y = person.position
            person.velocity = (pose.x - x) / STEP_S, (pose.y - y) / STEP_S

    def _on_touch(self, _arbiter: pymunk.Arbiter, _space: pymunk.Space, other: str) -> None:
        step = self._state.step
        if step - self._touched[other] > _SAME_CONTACT:
            self.contacts = replace(self.contacts, **{other: getattr(self.contacts, other) + 1})
        self._touched[other] = step


def _obstacle(body: pymunk.Body, footprint: Disc | Rectangle) -> pymunk.Shape:
    """Return what the robot bumps into, in the body's frame."""
    shape: pymunk.Shape
    if isinstance(footprint, Disc):
        shape = pymunk.Circle(body, footprint.radius, (footprint.x, footprint.y))
    else:
        turned = pymunk.Transform.translation(footprint.x, footprint.y).rotated(footprint.yaw)
        x, y = footprint.half_x, footprint.half_y
        shape = pymunk.Poly(body, [(-x, -y), (x, -y), (x, y), (-x, y)], turned)
    shape.friction, shape.collision_type = _FRICTION, _OBSTACLE
    return shape


def _scanned(pieces: Iterable[Furniture]) -> list[Disc | Rectangle]:
    """Return what the lidar sees of furniture."""
    return [placed(shape, piece.x, piece.y, piece.yaw) for piece in pieces for shape in KINDS[piece.kind].scanned]
