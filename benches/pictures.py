"""Draw the documentation's pictures, docs/images/*.jpg and follow.webp: `uv run python -m benches.pictures [NAME ...]`.

Five scenarios of rooms and people are seen by the robot's camera at chosen instants, side by side; `follow.webp` moves.
The live page needs Chromium and is left as it is where there is none. `benches/benchmark.py` and
`benches/fit_detector.py` draw the plots.
"""

from __future__ import annotations

import dataclasses
import math
import sys
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from tests.sim.view.browser import CHROMIUM, chromium

from limo_hog.detector import PeopleDetector
from limo_hog.follow.control.naming import controller_named
from limo_hog.follow.robot import LIMO
from limo_hog.live.pace import Pace
from limo_sim.run.arena import Arena
from limo_sim.run.episode import run_episode
from limo_sim.run.log import Step
from limo_sim.sensing.camera import CameraPose
from limo_sim.sensing.renderer import Renderer
from limo_sim.view.reading import annotated, depth_picture
from limo_sim.view.server import View
from limo_sim.view.tuning import Tunable
from limo_sim.world.person import Pose
from limo_sim.world.scenario import Furniture, Person, Robot, Scenario

ROOT = Path(__file__).parents[1]
IMAGES = ROOT / "docs" / "images"
#: For each picture the views: seconds after the start, and where the robot stands (x, y, yaw); None: at its start.
VIEWS: dict[str, list[tuple[float, tuple[float, float, float] | None]]] = {
    "flat": [(2.0, None), (8.0, (1.9, -0.8, 1.3))],
    "side_door": [(3.0, None), (9.5, (-4.0, 0.3, -0.05))],
    "gathering": [(2.0, None), (4.5, None)],
    "tall": [(0.5, None), (2.5, None)],
    "poster_wall": [(1.0, None), (7.0, (1.6, -0.6, 0.35))],
}
SEEN = 400  # rows of a frame; below them there is only floor [px]
WIDTH = 480  # of each view in a picture [px]
QUALITY = 82  # of the JPEG files
PAGE_SHOWN = 880  # rows of the live page; below them are the controller's parameters [px]
FILM_S, SHOWN, FILM_QUALITY = 32.0, 360, 55  # of follow.webp: the run [s], rows of a picture [px], of the file
ROBOT, PERSON = (178, 114, 0), (0, 94, 213)  # blue and orange of Okabe and Ito, blue first
FOLLOWERS = PeopleDetector(model="opencv", min_height=None, nms="group")


def view(scenario: Scenario, seconds: float, place: tuple[float, float, float] | None) -> NDArray[np.uint8]:
    """Return what the camera of a standing robot sees."""
    if place is not None:
        scenario = dataclasses.replace(scenario, robot=Robot(*place))
    arena = Arena(scenario, 0)
    while arena.time < seconds:
        arena.step()
    image = arena.frame().image[:SEEN]
    size = WIDTH, round(image.shape[0] * WIDTH / image.shape[1])
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


def room(name: str) -> NDArray[np.uint8]:
    """Return the views of a scenario, side by side."""
    scenario = Scenario.load(name)
    return np.hstack([view(scenario, *one) for one in VIEWS[name]])


def among_furniture() -> NDArray[np.uint8]:
    """Return colour and depth of one frame of two people among furniture."""
    places = {
        "pillar": (2.6, 1.35, 0.0),
        "cone": (2.0, 0.54, 0.0),
        "bollard": (2.2, -0.1, 0.0),
        "coat_rack": (2.3, -0.72, 0.4),
        "chair": (2.2, -1.4, 2.4),
    }
    people = (
        Person(route=((3.6, 0.9, 0), (3.6, -2.0, 0)), speed=0.5),
        Person(route=((3.4, -1.25, 0), (3.4, 1.0, 0)), speed=0.5, shirt=(150, 40, 44)),
    )
    arena = Arena(Scenario(people=people, furniture=tuple(Furniture(k, *at) for k, at in places.items())), 0)
    while arena.time < 1.0:
        arena.step()
    frame = arena.frame()
    return np.hstack([frame.image, depth_picture(frame.depth, far=8.0)])


def gait() -> NDArray[np.uint8]:
    """Return a walking person in six phases of the gait, a row each from behind, the side, in front and diagonally."""
    renderer = Renderer(Scenario(people=(Person(route=((3, 0, 0),)),)), np.random.default_rng(0))

    def tile(yaw: float, phase: float) -> NDArray[np.uint8]:
        pose = Pose(1.6, 0.0, yaw, phase, 1.0)
        return renderer.render(CameraPose(0, 0, 0), [pose], np.random.default_rng(1))[0][10:310, 240:400]

    phases = [step * math.tau / 6 for step in range(6)]
    return np.vstack(
        [np.hstack([tile(yaw, phase) for phase in phases]) for yaw in (0.0, math.pi / 2, math.pi, math.pi / 4)]
    )


def map_of(steps: list[Step], scenario: Scenario) -> NDArray[np.uint8]:
    """Return the room from above at the last of the steps: the ways so far, the robot with its view, and the people."""
    scale = SHOWN / (2 * scenario.room.half)
    picture = np.full((SHOWN, SHOWN, 3), (246, 244, 242), np.uint8)

    def at(x: float, y: float) -> tuple[int, int]:
        return round(SHOWN / 2 + x * scale), round(SHOWN / 2 - y * scale)

    def way(places: list[tuple[float, float]], colour: tuple[int, int, int]) -> None:
        cv2.polylines(picture, [np.array([at(*place) for place in places])], False, colour, 2, cv2.LINE_AA)

    x, y, yaw = steps[-1].truth.robot
    view = [
        at(x + 3 * math.cos(yaw + turn), y + 3 * math.sin(yaw + turn))
        for turn in (LIMO.field_of_view / 2, -LIMO.field_of_view / 2)
    ]
    cv2.fillPoly(picture, [np.array([at(x, y), *view])], (222, 214, 206), cv2.LINE_AA)
    way([step.truth.robot[:2] for step in steps], ROBOT)
    for i, person in enumerate(steps[-1].truth.people):
        if person is not None:
            way([(one.x, one.y) for step in steps if (one := step.truth.people[i]) is not None], PERSON)
            cv2.circle(picture, at(person.x, person.y), round(0.25 * scale), PERSON, -1, cv2.LINE_AA)
    body = [(0.26, 0.0), (-0.18, 0.17), (-0.18, -0.17)]
    cos, sin = math.cos(yaw), math.sin(yaw)
    corners = [at(x + a * cos - b * sin, y + a * sin + b * cos) for a, b in body]
    cv2.fillPoly(picture, [np.array(corners)], ROBOT, cv2.LINE_AA)
    return picture


def film() -> cv2.Animation:
    """Return a run at twice its speed: what the robot sees with the boxes found, and the room from above."""
    scenario, steps, frames = Scenario.load("workshop"), [], list[NDArray[np.uint8]]()

    def watch(step: Step) -> None:
        steps.append(step.bare())
        if step.log.frame is not None and len(steps) % 2 == 0:
            camera = cv2.resize(annotated(step.log), (SHOWN * 4 // 3, SHOWN), interpolation=cv2.INTER_AREA)
            frames.append(np.hstack([camera, map_of(steps, scenario)]).astype(np.uint8))

    run_episode(scenario, controller_named("tracking", None), FOLLOWERS, FILM_S, 0, watch=watch)
    moving = cv2.Animation()
    moving.frames, moving.durations = frames, [100] * len(frames)
    return moving


def of_the_workshop() -> NDArray[np.uint8]:
    """Return a frame of two people with their boxes, in the colours that the workshop's nodes draw them in."""
    people = (Person(route=((3.0, -0.35, 0),), facing=0.0), Person(route=((4.1, -1.3, 0),), facing=0.3))
    image = Arena(Scenario(people=people), 0).frame().image.copy()
    found = FOLLOWERS.detect(image)
    best = int(np.argmax(found.scores))
    for number, (x, y, w, h) in enumerate(found.windows.tolist()):
        red = number == best
        cv2.rectangle(image, (x, y), (x + w, y + h), (0, 0, 255) if red else (0, 255, 0), 3 if red else 2)
        if red:
            cv2.circle(image, (x + w // 2, y + h // 2), 6, (255, 0, 0), -1)
    return image


def live_page() -> NDArray[np.uint8]:
    """Return what a browser shows of a run of 40 s."""
    controller, scenario, shown = Tunable(controller_named("tracking", None)), Scenario.load("workshop"), 40.0
    with View(scenario, controller, pace=Pace(2)) as page, tempfile.TemporaryDirectory() as folder:
        there, picture = threading.Event(), Path(folder) / "page.png"

        def watch(step: Step) -> None:
            page.watch(step)
            if step.log.time >= shown and not there.is_set():
                there.set()
                page.pace.pause()

        run = threading.Thread(
            target=run_episode, args=(scenario, controller, FOLLOWERS, shown + 1.0, 0), kwargs={"watch": watch}
        )

        with chromium() as browser:
            tab = browser.new_page(viewport={"width": 1400, "height": 845})
            tab.goto(page.url)
            run.start()
            while not there.is_set():
                tab.wait_for_timeout(200)
            tab.wait_for_timeout(2000)
            tab.screenshot(path=picture, full_page=True)
        page.pace.resume()
        run.join()
        return np.asarray(cv2.imread(str(picture))[:PAGE_SHOWN], np.uint8)


def main() -> None:
    """Write the pictures that are named, or all."""
    drawn: dict[str, Callable[[], NDArray[np.uint8]]] = {name: lambda name=name: room(name) for name in VIEWS}
    drawn |= {"arena": among_furniture, "gait": gait, "workshop": of_the_workshop}
    if CHROMIUM is None:
        print("no Chromium: view.jpg stays as it is")
    else:
        drawn["view"] = live_page
    wanted = sys.argv[1:] or [*drawn, "follow"]
    for name in wanted:
        if name == "follow":
            path = IMAGES / "follow.webp"
            cv2.imwriteanimation(str(path), film(), [cv2.IMWRITE_WEBP_QUALITY, FILM_QUALITY])
        else:
            path = IMAGES / f"{name}.jpg"
            cv2.imwrite(str(path), drawn[name](), [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
        print(f"{path.relative_to(ROOT)}: {path.stat().st_size // 1024} KiB")


if __name__ == "__main__":
    main()
