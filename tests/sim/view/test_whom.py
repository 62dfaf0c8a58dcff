"""Three people stand before the robot: the one asked for is followed, by a word or by a click on the page."""

from __future__ import annotations

import time
from dataclasses import replace

import pytest
from tests.sim.view.browser import CHROMIUM, chromium, played

from limo_hog.follow.control.naming import ControllerError, controller_named
from limo_hog.follow.sense.detectors import detector_named
from limo_hog.follow.tracks.asking import Whom
from limo_hog.live.controls import apply
from limo_hog.live.pace import Pace
from limo_sim.run.episode import run_episode
from limo_sim.run.log import Step
from limo_sim.view.reading import followed_person
from limo_sim.view.tuning import Tunable
from limo_sim.world.people import Person
from limo_sim.world.scenario import Scenario

WORKSHOP = Scenario.load("workshop")
#: From left to right: the nearest, the largest in the image, and a small one.
THREE = replace(
    WORKSHOP,
    furniture=(),
    robot=replace(WORKSHOP.robot, x=-2.2, y=0.0, yaw=0.0),
    people=tuple(
        Person(((x, y, 0.0),), height=height, shirt=shirt)
        for x, y, height, shirt in (
            (-0.2, 0.55, 0.7, (180, 40, 40)),
            (0.0, 0.0, 0.95, (40, 60, 170)),
            (0.3, -0.65, 0.8, (40, 140, 60)),
        )
    ),
)
#: Two who both stay in the image, whichever is faced.
TWO = replace(THREE, people=tuple(Person(((0.2, y, 0.0),), height=0.75) for y in (0.35, -0.35)))


@pytest.mark.parametrize(("whom", "index"), [("left", 0), ("nearest", 0), ("largest", 1), ("right", 2)])
def test_the_person_asked_for_is_followed(whom: Whom, index: int) -> None:
    steps: list[Step] = []
    detector = detector_named("hog")
    run_episode(THREE, controller_named("tracking", person=whom), detector, 4, 0, watch=steps.append)
    assert steps[0].log.decision.reason.endswith("not found yet")
    assert {followed_person(step) for step in steps[20:] if step.log.decision.target is not None} == {index}


def test_only_the_tracking_controller_can_be_asked() -> None:
    with pytest.raises(ControllerError, match="approach controller follows whoever is detected first"):
        controller_named("approach", person="left")
    for controller, complaint in (
        (None, "this run has no follower of ours"),
        (Tunable(controller_named("proxemic")), "ProxemicController follows nobody in particular"),
        (Tunable(controller_named("tracking")), "got 'leftmost' for the person to follow; want nearest, left"),
    ):
        assert (apply('{"follow": "leftmost"}', Pace(), controller) or "").startswith(complaint)
    assert apply('{"follow": 2}', Pace(), Tunable(controller_named("tracking"))) is None


@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium: apt-get install chromium")
def test_a_click_on_a_person_and_a_button_change_whom_the_robot_follows() -> None:
    controller = Tunable(controller_named("tracking"))
    with played(TWO, controller, detector_named("hog"), 1) as view, chromium() as browser:
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.goto(view.url)
        # The two in turns, by a click and then by the keyboard.
        for side, click in (("0", True), ("1", True), ("0", False)):
            deadline, followed = time.monotonic() + 60, False
            while not followed:
                assert time.monotonic() < deadline
                page.wait_for_timeout(500)
                if page.evaluate("now === null || now.choices.length < 2"):
                    continue
                # While the robot turns, a box of 2 s ago is beside the person: the click is repeated, as people do.
                number, followed, x, y, width, height = page.evaluate(
                    f"[...now.choices].sort((a, b) => a[2] - b[2])[{side}]"
                )
                if followed:
                    assert page.get_attribute(f"#choices button[value='{number}']", "aria-pressed") == "true"
                elif click:
                    box = page.evaluate("(({x, y, width}) => [x, y, width / 640])(camera.getBoundingClientRect())")
                    page.mouse.click(box[0] + (x + width / 2) * box[2], box[1] + (y + height / 4) * box[2])
                else:
                    page.locator(f"#choices button[value='{number}']").press("Enter")
