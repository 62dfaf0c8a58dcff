"""The page of a running episode in a real browser, and whom it is told to follow; pictures are kept in `out/view/`."""

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, Position, expect
from tests.sim.view.browser import CHROMIUM, chromium, played

from limo_hog.detector import PeopleDetector
from limo_hog.follow.control.naming import ControllerError, controller_named
from limo_hog.follow.tracks.asking import Whom
from limo_hog.live.controls import apply
from limo_hog.live.pace import Pace
from limo_hog.named_detectors import detector_named
from limo_sim.run.episode import run_episode
from limo_sim.run.log import Step
from limo_sim.view.reading import followed_person
from limo_sim.view.server import View
from limo_sim.view.tuning import Tunable
from limo_sim.world.people import Person
from limo_sim.world.scenario import Scenario

PICTURES = Path(__file__).parents[3] / "out" / "view"


@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium: apt-get install chromium")
def test_a_browser_sees_the_run_move_and_steers_it() -> None:
    controller: Tunable[Any] = Tunable(controller_named("tracking", None))
    # A coarse search: this is about the page.
    detector = PeopleDetector(scale=1.2, min_height=None, nms="group")
    with played(Scenario.load("workshop"), controller, detector, 2) as view, chromium() as browser:
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.goto(view.url)
        _see_no_icon_of_a_broken_picture(page)
        _see_it_move(page)
        _read_the_words_on_the_map(page)
        _read_why_it_does_that(page)
        _steer_it(page, view)
        _see_it_on_a_phone(browser, view, controller)
        view.pace.set_speed(0)
        page.click("#pause")
        _see_it_end(page)


def _until(page: Page, expression: str, seconds: float = 30) -> None:
    """Wait until JavaScript gives something true. (`wait_for_function` needs an `eval`, which the page forbids.)"""
    deadline = time.monotonic() + seconds
    while not page.evaluate(expression):
        assert time.monotonic() < deadline, f"not within {seconds} s: {expression}"
        page.wait_for_timeout(100)


def _see_no_icon_of_a_broken_picture(page: Page) -> None:
    page.evaluate("document.body.append(Object.assign(new Image(), { id: 'unsent' }))")
    assert page.evaluate("getComputedStyle(unsent).visibility") == "hidden"
    page.evaluate("unsent.remove()")


def _read_the_words_on_the_map(page: Page) -> None:
    """Of a person at either wall: what the percentages are of, and nothing beyond the map's edge."""
    page.evaluate(
        """(() => {
            const pen = document.getElementById("map").getContext("2d");
            window.words = [];
            pen.fillText = (text, x) => {
                const [width, right] = [pen.measureText(text).width, pen.textAlign === "right"];
                words.push([text, right ? x - width : x, right ? x : x + width]);
            };
            now.believed = [[-4.9, 0, 0.99, 1, 1], [4.9, 0, 0.98, 0.5, 2]];
            drawMap();
            delete pen.fillText;
        })()"""
    )
    drawn = {text: (left, right) for text, left, right in page.evaluate("words")}
    assert {"person 1: 99 %", "followed 100 %", "person 2: 98 %", "followed 50 %"} <= set(drawn)
    width = page.evaluate("document.getElementById('map').clientWidth")
    assert all(left >= 0 and right <= width for left, right in drawn.values())


def _read_why_it_does_that(page: Page) -> None:
    """A bar for each critic, as wide as what it adds, and none where the controller has no critics."""
    # In one go: the run goes on, and sends its own.
    bars, hidden = page.evaluate(
        """(() => {
            now.shares = [["walls", 0.5], ["goal_distance", 1.0], ["effort", 0.001]];
            shares();
            const bars = [...document.querySelectorAll("#shares span")].map((bar) => [bar.title, bar.offsetWidth]);
            now.shares = [];
            shares();
            return [bars, document.getElementById("shares").hidden];
        })()"""
    )
    assert [title for title, _ in bars] == ["walls: 0.50", "goal distance: 1.00"]
    assert bars[1][1] == pytest.approx(2 * bars[0][1], rel=0.1)
    assert hidden


def _see_it_move(page: Page) -> None:
    _until(page, "now && document.querySelector('#camera').dataset.count > 2 && now.boxes > 0 && now.time > 5")
    for picture in ("#camera", "#depth"):
        before = page.get_attribute(picture, "src")
        expect(page.locator(picture)).not_to_have_attribute("src", before or "")
    expect(page.locator("#camera")).to_have_js_property("naturalWidth", 640)
    # Boxes: the arena itself has nothing that is as green or as red.
    _until(
        page,
        """(() => {
            const sheet = Object.assign(document.createElement("canvas"), { width: 640, height: 480 });
            const pen = sheet.getContext("2d");
            pen.drawImage(document.querySelector("#camera"), 0, 0);
            const p = pen.getImageData(0, 0, 640, 480).data;
            let coloured = 0;
            for (let i = 0; i < p.length; i += 4) coloured += Math.max(p[i], p[i + 1]) > 2 * Math.min(p[i], p[i + 1]);
            return coloured > 200;
        })()""",
    )
    for canvas in ("map", "plot-error", "plot-distance", "plot-speed", "scale"):
        _until(
            page,
            f"""(() => {{
                const canvas = document.getElementById("{canvas}");
                const {{ data }} = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
                return new Set(new Uint32Array(data.buffer)).size > 5;
            }})()""",
        )


def _step(page: Page) -> float:
    """One control period; return how long it was [s]."""
    stood = page.evaluate("now.time")
    page.click("#step")
    _until(page, f"now.time > {stood}")
    return float(page.evaluate("now.time") - stood)


def _steer_it(page: Page, view: View) -> None:
    page.click("#pause")
    _until(page, "now.paused")
    assert view.pace.paused
    page.wait_for_timeout(300)
    stood = page.evaluate("now.time")
    page.wait_for_timeout(500)
    assert page.evaluate("now.time") == stood
    assert _step(page) == pytest.approx(0.1, abs=0.03)
    # The pictures that are kept show a followed person.
    while page.evaluate("now.error_px") is None:
        _step(page)
    _take_light_and_dark(page, "desk")


def _see_the_controls_in_one_row(page: Page) -> None:
    tops = "[...document.querySelectorAll('.controls > *')].map((c) => c.getBoundingClientRect().height)"
    assert max(page.evaluate(tops)) < 48
    assert page.evaluate("document.querySelector('.controls').getBoundingClientRect().height") < 60
    assert page.evaluate("document.querySelector('.controls label span').offsetWidth") > 20
    # A word of a legend stays with its mark.
    marks = "[...document.querySelectorAll('figcaption span')].map((mark) => mark.getClientRects().length)"
    assert max(page.evaluate(marks)) == 1


def _see_it_on_a_phone(browser: Browser, view: View, controller: Tunable[Any]) -> None:
    page = browser.new_page(viewport={"width": 390, "height": 844}, device_scale_factor=2, is_mobile=True)
    page.goto(view.url)
    _until(page, "now && now.paused")
    expect(page.locator("#camera")).to_have_js_property("naturalWidth", 640)
    _take_light_and_dark(page, "phone")
    _see_the_controls_in_one_row(page)
    # The caption is text, not part of the picture, and every parameter tells what it is.
    assert page.evaluate("parseFloat(getComputedStyle(document.querySelector('#seen')).fontSize)") >= 14
    labels = "[...document.querySelectorAll('#fields label')]"
    fields = page.evaluate(labels + ".map((label) => [label.title, label.querySelector('input').max])")
    assert len(fields) == len(controller.parameters)
    assert all(len(title) > 20 and float(high) > 0 for title, high in fields)
    # Both distances are told, each with a word of its own.
    shown = page.evaluate("['measured', 'distance'].map((id) => document.getElementById(id).parentNode.innerText)")
    assert [text.split("\n")[0] for text in shown] == ["distance seen", "true distance"]
    assert all(0.5 < float(text.split("\n")[1].split()[0]) < 5 for text in shown)
    for value in ("2.5", "-1"):
        page.fill("[name=target_distance]", value)
        page.press("[name=target_distance]", "Tab")
    expect(page.locator("#complaint")).to_contain_text("want a number from")
    assert controller.parameters["target_distance"].value == 2.5
    page.context.close()


def _take_light_and_dark(page: Page, name: str) -> None:
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        page.wait_for_timeout(300)
        page.screenshot(path=PICTURES / f"{name}-{scheme}.png", full_page=True)
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def _see_it_end(page: Page) -> None:
    expect(page.locator("#notice")).to_contain_text("The run has ended", timeout=120_000)
    page.screenshot(path=PICTURES / "ended.png", full_page=True)
    # The timeline goes back over the finished run: numbers, map and camera are those of then.
    page.select_option("#span", "0")
    newest = page.get_attribute("#camera", "src"), page.inner_text("#distance")
    page.fill("#timeline", "5")
    assert page.inner_text("#shown") == "5.0 s"
    then = page.get_attribute("#camera", "src"), page.inner_text("#distance")
    assert then[0] != newest[0] and then[1] != newest[1]
    assert then[1].split()[0] == page.evaluate("number(nearest(history, 5)[DISTANCE], 2)")
    # A cursor on a plot reads the values, the wheel zooms.
    plot = page.locator("#plot-distance")
    left, width = page.evaluate("[LEFT, document.querySelector('#plot-distance').clientWidth]")
    middle = Position(x=left + (width - left - 4) / 2, y=20)
    plot.hover(position=middle)
    begin, end = page.evaluate("shownTimes()")
    assert page.evaluate("cursor") == pytest.approx((begin + end) / 2, abs=0.1)
    # A picture of the whole page resizes the view, and the mouse is on the plot no more.
    page.screenshot(path=PICTURES / "timeline.png", full_page=True)
    plot.hover(position=middle)
    page.mouse.wheel(0, -1)
    _until(page, f"shownTimes()[1] - shownTimes()[0] < {end - begin}")
    assert page.evaluate("shownTimes()[1] - shownTimes()[0]") == pytest.approx((end - begin) * 0.8)
    page.click("#live")
    assert page.inner_text("#shown") == "now"
    # The page keeps what it showed last.
    expect(page.locator("#camera")).to_have_js_property("naturalWidth", 640)
    assert page.is_disabled("#pause")


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
