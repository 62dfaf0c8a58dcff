"""One seed, one world: whoever looks, whenever, in whichever process."""

import dataclasses
import hashlib
import json
import math
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.sim.logs import drive, there

from limo_hog.follow import detector_named
from limo_hog.follow.robot import LIMO, Twist
from limo_hog.follow.sense.measurement import person_depth
from limo_hog.signals import Stopped, stopping
from limo_sim.run.arena import STEPS_PER_SECOND, Arena
from limo_sim.sensing.camera import CENTRE_X
from limo_sim.world.scenario import ROOM_HALF, Camera, Lidar, Person, Robot, Room, Scenario, Vary, Wall, Wheels
from limo_sim.world.truth import Contacts

FOLLOWABLE = Scenario.load("followable")
YIELDS = Person(route=((1.0, 2.0, 0.0), (3.0, 2.0, 0.0)), behaviour="social_force")


def fingerprint(name: str, seed: int, steps: int = 60) -> str:
    arena, digest = Arena(Scenario.load(name), seed), hashlib.sha256()
    for step in range(steps):
        if step % 5 == 0:
            frame = arena.frame()
            for data in (frame.image, frame.depth, arena.scan().ranges):
                digest.update(data.tobytes())
            digest.update(repr((frame.truth, arena.odometry(), arena.imu(), arena.truth())).encode())
            arena.command(Twist(0.2, 0.4 * math.sin(step)))
        arena.step()
    return digest.hexdigest()


@pytest.mark.parametrize("name", ["occlusion", "furniture"])
def test_the_same_seed_gives_the_same_run_in_another_process_and_another_does_not(name: str) -> None:
    code = f"import sys; sys.path.insert(0, {__file__!r}.rpartition('/')[0]); "
    code += f"from test_arena import fingerprint; print(fingerprint({name!r}, 3))"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.strip() == fingerprint(name, 3) != fingerprint(name, 4)


def test_reading_one_sensor_changes_no_other() -> None:
    busy, idle = Arena(FOLLOWABLE, 1), Arena(FOLLOWABLE, 1)
    for step in range(100):
        for arena in (busy, idle):
            arena.command(Twist(0.2, 0.1))
            arena.step()
        if step % 3 == 0:
            for read in (busy.frame, busy.truth, busy.imu, busy.scan):
                read()
    one, other = busy.frame(), idle.frame()
    for here, same in ((one.image, other.image), (one.depth, other.depth), (busy.scan().ranges, idle.scan().ranges)):
        np.testing.assert_array_equal(here, same)
    assert (busy.odometry(), busy.imu(), busy.truth()) == (idle.odometry(), idle.imu(), idle.truth())


def test_each_sensor_keeps_its_own_rate() -> None:
    arena = Arena(FOLLOWABLE, 0)
    frames, scans, odometry = set(), set(), set()
    for _ in range(50 * 4):
        arena.step()
        frames.add(arena.frame().stamp)
        scans.add(arena.scan().stamp)
        odometry.add(arena.odometry().stamp)
    assert (len(frames), len(scans), len(odometry)) == (40 + 1, 32 + 1, 50 * 4)
    assert np.diff(sorted(frames)) == pytest.approx(0.1)
    assert np.abs(np.diff(sorted(scans)) - 0.125).max() < 0.02


def test_a_reading_arrives_as_late_as_the_scenario_says() -> None:
    crowd = dataclasses.replace(FOLLOWABLE, people=(*FOLLOWABLE.people, YIELDS))
    late = Camera(latency_s=0.4), Lidar(latency_s=0.2), Wheels(latency_s=0.1)
    slow = dataclasses.replace(crowd, camera=late[0], lidar=late[1], odometry=late[2])
    arena, prompt, shown = Arena(slow, 0), Arena(crowd, 0), {}
    for _ in range(100):
        for world in (arena, prompt):
            drive(world, 0.02, Twist(0.3, 0.3))
        frame = prompt.frame()
        shown[frame.stamp] = frame
        stamp = arena.frame().stamp
        assert stamp == pytest.approx(max(0.0, math.floor((arena.time - 0.4) * 10 + 1e-6) / 10))
        assert arena.scan().stamp <= max(0.0, arena.time - 0.2) + 1e-9
        assert arena.odometry().stamp == pytest.approx(max(0.0, arena.time - 0.1))
        if stamp > 0:
            np.testing.assert_array_equal(arena.frame().image, shown[stamp].image)
            assert arena.frame().truth == shown[stamp].truth


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_as_many_frames_are_lost_as_the_scenario_says(share: float) -> None:
    arena = Arena(dataclasses.replace(FOLLOWABLE, camera=Camera(drop_probability=share)), 2)
    stamps = {drive(arena, 0.02)._camera.newest.state.time for _ in range(50 * 60)}
    assert (len(stamps) - 1) / 600 == pytest.approx(1 - share, abs=0.06)


def test_truth_agrees_with_trigonometry() -> None:
    arena = drive(Arena(Scenario.load("two_people"), 0), 8.0, Twist(0.1, 0.2))
    truth = arena.truth()
    x, y, yaw = truth.robot
    assert truth.stamp == arena.time == 8.0
    for person in map(there, truth.people):
        assert person.distance == pytest.approx(math.hypot(person.x - x, person.y - y))
        ahead, left = person.distance * math.cos(person.bearing), person.distance * math.sin(person.bearing)
        assert x + ahead * math.cos(yaw) - left * math.sin(yaw) == pytest.approx(person.x)
        assert y + ahead * math.sin(yaw) + left * math.cos(yaw) == pytest.approx(person.y)
    assert arena.frame().truth == truth


THOUSAND = [pytest.param(seed, 30.0, marks=[pytest.mark.slow, pytest.mark.timeout(900)]) for seed in range(1000)]


@pytest.mark.parametrize(("seed", "seconds"), [*((1000 + seed, 12.0) for seed in range(12)), *THOUSAND])
def test_nothing_goes_through_a_wall(seed: int, seconds: float) -> None:
    names = [name for name in Scenario.names() if Scenario.load(name).room == Room()]
    scenario = dataclasses.replace(Scenario.load(names[seed % len(names)]), vary=Vary(height=0.1, speed=0.5, place=0.3))
    arena, random = Arena(scenario, seed), np.random.default_rng(seed)
    for step in range(round(50 * seconds)):
        if step % 25 == 0:
            arena.command(Twist(*random.uniform((-1, -4), (1, 4)).tolist()))
        arena.step()
        robot = arena._state
        assert math.isfinite(robot.x + robot.y + robot.yaw + robot.turn_rate)
        assert max(abs(robot.x), abs(robot.y)) < ROOM_HALF - 0.1
        assert math.hypot(*robot.velocity) < 3.0
        if step % 6 == 0:
            assert (arena.scan().ranges >= 0.12).all()
            for pose in arena._state.people:
                assert pose is None or max(abs(pose.x), abs(pose.y)) < 4.4


HOUR = pytest.param(60, 3600, 8, marks=[pytest.mark.slow, pytest.mark.timeout(900)], id="an hour")


@pytest.mark.parametrize(("warm_up_s", "seconds", "growth_mb"), [(10, 40, 4), HOUR])
def test_memory_stays_flat(warm_up_s: float, seconds: float, growth_mb: float) -> None:
    arena = Arena(FOLLOWABLE, 0)

    def peak_kb_after(seconds: float) -> float:
        for _ in range(round(10 * seconds)):
            drive(arena, 0.1, Twist(0.1, 0.2)).frame()
            arena.scan()
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    before = peak_kb_after(warm_up_s)
    assert peak_kb_after(seconds) - before < 1024 * growth_mb


@pytest.mark.parametrize("facing", [0.0, 0.8, math.pi / 2, 2.4, math.pi])
@pytest.mark.parametrize("distance", [1.7, 2.5])
def test_the_surface_distance_is_the_depth_in_the_middle_of_a_person(facing: float, distance: float) -> None:
    # 0.3 m/s: the gait goes through its phases, the direction stays
    away = distance + 0.6 * math.cos(facing), 0.6 * math.sin(facing)
    scenario = Scenario(people=(Person(route=((distance, 0.0, 0.0), (*away, 0.0)), speed=0.3),))
    arena, detector, errors = Arena(scenario, 0), detector_named("hog"), []
    while arena.time < 1.8:
        frame = arena.frame()
        for window in detector.detect(frame.image).windows[:1]:
            depth = person_depth(frame.depth, window)
            if depth is not None:
                # depth is along the optical axis, the distance along the ray
                aside = (window[0] + window[2] / 2 - CENTRE_X) / LIMO.focal_px(640)
                errors.append(there(frame.truth.people[0]).surface_distance - depth * math.hypot(1.0, aside))
        drive(arena, 0.1)
    assert len(errors) > 12
    assert abs(np.median(errors)) < 0.02


def test_the_contacts_of_a_frame_are_those_at_its_stamp() -> None:
    standing = Scenario(people=(Person(route=((0.6, 0.0, 0.0),)),), camera=Camera(latency_s=0.4))
    arena = Arena(standing, 0)
    while arena.contacts.person == 0 and arena.time < 5.0:
        drive(arena, 0.02, Twist(0.3, 0.0))
    frame = drive(arena, 0.2).frame()
    assert frame.stamp < arena.time - 0.3
    assert (frame.truth.contacts, arena.truth().contacts) == (Contacts(0, 0), Contacts(1, 0))


def test_a_person_who_left_is_neither_seen_nor_in_the_way_and_who_is_late_comes() -> None:
    late = Arena(Scenario.load("late"), 0)
    assert late.truth().people == (None,)
    assert drive(late, 20.02).truth().people[0] is not None
    arena = Arena(Scenario(people=(Person(route=((0.8, 0.0, 0.0),), height=1.85, leaves_s=1.0),)), 0)
    assert arena.frame().truth.people[0] is not None
    assert arena.scan().ranges[136:156].min() < 0.8
    drive(drive(arena, 1.2), 3.8, Twist(0.5, 0.0))
    assert arena.frame().truth.people == (None,)
    assert arena.truth().robot[0] > 1.2
    assert arena.contacts.person == 0


def test_the_robot_is_stopped_by_an_inner_wall_and_drives_on_in_a_larger_room() -> None:
    free = Scenario(room=Room(8.0), robot=Robot(x=4.0))
    barred = dataclasses.replace(free, walls=(Wall((5.5, -1.0), (5.5, 1.0), 0.2),))
    drives, stops = (drive(Arena(scenario, 0), 4.0, Twist(0.6, 0.0)) for scenario in (free, barred))
    assert drives.truth().robot[0] > 6.0
    assert stops.truth().robot[0] == pytest.approx(5.4 - LIMO.half_length, abs=0.01)
    assert (drives.contacts.wall, stops.contacts.wall) == (0, 1)


def test_a_plan_is_of_now_unless_that_of_the_frame_is_asked_for() -> None:
    arena = drive(Arena(Scenario(camera=Camera(rate_hz=10, latency_s=0.1))), 1.56, Twist(0.5, 0.3))
    now, then = arena.plan(), arena.plan(of_frame=True)
    assert (now.stamp, now.robot) == (arena.time, arena.truth().robot)
    assert arena.truth().stamp == arena.time > arena.frame().truth.stamp == arena.frame().stamp
    assert then.stamp == arena.frame().stamp <= arena.time - 0.1
    assert then.robot == arena.frame().truth.robot != now.robot


def test_a_robot_that_was_never_told_to_drive_is_at_rest_from_the_first_reading_on() -> None:
    arena = Arena(Scenario())
    for _ in range(3):
        for reading in arena.imu():
            assert math.hypot(*reading.angular_velocity) < 0.1
            assert math.hypot(*reading.acceleration[:2]) < 1.0
        arena.step()
    assert drive(arena, 1.0).watchdog_stops == 0


def test_a_wall_touched_again_after_half_a_second_is_another_contact() -> None:
    arena = Arena(Scenario(robot=Robot(x=4.5)))
    furthest, apart = 0.0, 0
    for speed, seconds in ((0.3, 3.0), (-0.3, 0.6), (0.3, 2.0)):
        for _ in range(round(seconds * STEPS_PER_SECOND)):
            drive(arena, 1 / STEPS_PER_SECOND, Twist(speed, 0.0))
            furthest = max(furthest, arena.plan().robot[0])
            apart += arena.contacts.wall > 0 and arena.plan().robot[0] < furthest - 0.005
    assert 0.6 < apart / STEPS_PER_SECOND < 1.8
    assert arena.contacts.wall == 2


def test_a_signal_within_a_step_is_raised_after_it(capfd: pytest.CaptureFixture[str]) -> None:
    arena = Arena(Scenario.load("empty"), 0)
    roll = arena._robot.velocity_func

    def interrupted(*state: Any) -> None:
        os.kill(os.getpid(), signal.SIGTERM)
        roll(*state)

    arena._robot.velocity_func = interrupted
    with pytest.raises(Stopped), stopping():
        arena.step()
    assert capfd.readouterr().err == ""
    # It is told once: the arena can be used on.
    arena._robot.velocity_func = roll
    arena.step()


def test_an_episode_without_detection_runs_many_times_faster_than_real_time() -> None:
    arena, took = Arena(Scenario.load("workshop"), 0), []
    for _ in range(40):
        start = time.thread_time()
        for _ in range(25):
            drive(arena, 0.02, Twist(0.0, 0.3)).frame()
            arena.scan()
        took.append(time.thread_time() - start)
    # The processor's time; the limit is a third of what an idle machine does.
    assert 0.5 / min(took) > 25 / 3


#: Some bytes of five frames of each scenario, recorded before rooms, people and detectors could vary.
RECORDED: dict[str, str] = json.loads(Path(__file__).with_name("frames.json").read_text())


@pytest.mark.parametrize("name", RECORDED)
def test_an_old_scenario_shows_the_frames_it_always_showed(name: str) -> None:
    arena, bytes_ = Arena(Scenario.load(name), 0), []
    for step in range(100):
        if step % 20 == 0:
            # A prime, so that all columns, rows and channels are met.
            bytes_.append(arena.frame().image.ravel()[::20_011].astype(int))
        drive(arena, 0.02, Twist(0.2, 0.4 * math.sin(step)))
    recorded = np.frombuffer(bytes.fromhex(RECORDED[name]), np.uint8)
    # Another CPU or numpy may round a value to the next level; anything else is another picture.
    np.testing.assert_allclose(np.concatenate(bytes_), recorded, rtol=0, atol=1)
