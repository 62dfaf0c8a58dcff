"""The live page's pace, parameters and numbers; and the figure of many runs, on which everything can be read."""

import math
import re
import socket
import statistics
import time
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from tests.sim.logs import card, person, step, steps_of, there
from tests.threads import beside

from limo_hog.detector import PeopleDetector
from limo_hog.follow.control.naming import CONTROLLERS, controller_named
from limo_hog.follow.parameters import param
from limo_hog.follow.robot import LIMO
from limo_hog.live.controls import Parameter, ParameterError
from limo_hog.live.pace import Pace
from limo_sim.run.episode import run_episode
from limo_sim.run.log import Step
from limo_sim.run.sweep import summarise
from limo_sim.view.reading import depth_colours, depth_picture, figures, followed_person, measured_m, rollouts
from limo_sim.view.server import View
from limo_sim.view.sweep_plot import plot
from limo_sim.view.tuning import Tunable
from limo_sim.world.scenario import Scenario

WORKSHOP = Scenario.load("workshop")

#: Quick, and the model whose people the arena was made for.
DETECTOR = PeopleDetector(model="opencv", scale=1.2)


@pytest.mark.parametrize(("speed", "apart_s", "least", "most"), [(4, 0.2, 0.19, 0.8), (0, 250.0, 0.0, 5.0)])
def test_a_run_takes_its_time(speed: float, apart_s: float, least: float, most: float) -> None:
    pace, start = Pace(speed), time.monotonic()
    for tick in range(5):
        pace.wait(apart_s * tick)
    assert least < time.monotonic() - start < most


def test_a_paused_run_goes_on_one_step_at_a_time() -> None:
    pace, ticks = Pace(0), []
    pace.pause()

    def run(_: object) -> None:
        for tick in range(100):
            pace.wait(tick)
            ticks.append(tick)

    with beside(run):
        time.sleep(0.1)
        assert ticks == []
        pace.step()
        time.sleep(0.1)
        assert ticks == [0]
        pace.resume()
    assert len(ticks) == 100


def test_the_page_is_served_on_loopback_alone() -> None:
    own = socket.gethostbyname(socket.gethostname())
    with View(WORKSHOP) as view:
        assert view.url.startswith("http://127.0.0.1:")
        if not own.startswith("127."):
            with pytest.raises(OSError, match=r"refused"):
                socket.create_connection((own, int(view.url.rsplit(":", 1)[1].strip("/"))), timeout=2)


def test_the_rollouts_on_the_map_begin_at_the_robot_and_lead_where_it_drives() -> None:
    sent, driven = [], []

    def watch(step: Step) -> None:
        drawn = rollouts(step)
        assert len(drawn) > 10
        assert len({tuple(way[-1]) for way in drawn[1:]}) > 0.9 * len(drawn)
        x, y, _ = step.truth.robot
        driven.append((step.log.time, x, y))
        # At .6 s, while it drives at one speed and nobody is in the way.
        assert all(math.dist(way[0], (x, y)) < 0.6 for way in drawn)
        sent.append(drawn[0][0])

    run_episode(Scenario.load("followable"), controller_named("tracking", None), DETECTOR, 6, 0, watch=watch)
    late = [math.dist(place, driven[k + 6][1:]) for k, place in enumerate(sent[:-6])]
    assert statistics.median(late) < 0.05


def test_map_and_distance_are_of_the_person_that_the_followed_box_is_on() -> None:
    told, seen = [], []

    def watch(step: Step) -> None:
        followed = followed_person(step)
        if followed is not None and step.seen is not None:
            told.append(followed)
            error_px, person = there(figures(step)["error_px"]), there(step.seen.people[followed])
            # A pinhole camera 8.4 cm ahead of the robot's centre sees them there, give or take an arm.
            ahead = person.distance * math.cos(person.bearing) - LIMO.camera_x
            left = LIMO.focal_px(640) * person.distance * math.sin(person.bearing) / ahead
            assert left == pytest.approx(error_px, abs=LIMO.focal_px(640) * 0.3 / ahead)
            if (measured := measured_m(step.log)) is not None:
                seen.append(person.distance - measured)

    scenario = Scenario.load("two_people")
    run_episode(scenario, controller_named("tracking", None), DETECTOR, 20, 0, watch=watch)
    assert len(told) > 30
    assert len(scenario.people) == 2
    # The camera is 8.4 cm ahead of the centre, a person's front 5 to 25 cm before their axis.
    assert len(seen) > 30
    assert 0.084 < statistics.median(seen) < 0.35


def test_the_depth_scale_has_the_colours_of_the_depth_picture() -> None:
    colours = depth_colours(8.0, 9)
    for metres, colour in enumerate(colours):
        blue, green, red = depth_picture(np.full((1, 1), metres, np.float32), 8.0)[0, 0].tolist()
        assert colour == f"#{red:02x}{green:02x}{blue:02x}"
    assert len(set(colours)) == 9


@dataclass(frozen=True)
class _Inner:
    shown: float = param(2.0, "m", "Has bounds.", 1.0, 3.0)
    hidden: float = param(1.0, "s", "Has none.")


@dataclass(frozen=True)
class _Outer:
    gain: float = param(0.5, "1/s", "Speed for each metre of error.", 0, 5)
    count: int = param(4, "frames", "How many.", 1, 9)
    name: str = "x"
    on: bool = True
    inner: _Inner = _Inner()


def test_a_parameter_brings_its_bounds_unit_and_tooltip() -> None:
    tunable: Tunable[Any] = Tunable(cast("Any", _Outer()))
    assert list(tunable.parameters.values()) == [
        Parameter("gain", 0.5, 0, 5.0, "1/s", "Speed for each metre of error."),
        Parameter("count", 4, 1, 9, "frames", "How many."),
        Parameter("inner.shown", 2.0, 1.0, 3.0, "m", "Has bounds."),
    ]
    for name, value in (("inner.shown", 3), ("count", 5.0)):
        tunable.set(name, value)
        assert tunable.parameters[name].value == value
        assert type(tunable.parameters[name].value) is not type(value)
    wrong = [("inner.shown", 3.1), ("inner.hidden", 1.0), ("count", 2.5), ("count", 0), ("gain", True)]
    for name, value in [*wrong, ("gain", math.nan)]:
        with pytest.raises(ParameterError, match=name):
            tunable.set(name, value)


@pytest.mark.parametrize("name", CONTROLLERS)
def test_every_slider_has_a_unit_bounds_and_one_sentence_of_its_own(name: str) -> None:
    sliders = Tunable(controller_named(name, None)).parameters.values()
    for one in sliders:
        assert re.fullmatch(r"[A-Z][^.]{10,100}\.", one.tooltip), one.name
        assert one.unit and one.low < one.high and one.low <= one.value <= one.high, one.name
    # Two critics measure room alike: their sliders stand under a heading each.
    assert len({(one.name.rpartition(".")[0], one.tooltip) for one in sliders}) == len(sliders)


@pytest.mark.parametrize("bound", ["low", "high"])
@pytest.mark.parametrize("name", CONTROLLERS)
def test_a_run_goes_on_with_every_parameter_at_its_bound(name: str, bound: str) -> None:
    controller: Tunable[Any] = Tunable(controller_named(name, None))
    for one in controller.parameters.values():
        controller.set(one.name, getattr(one, bound))
    steps = steps_of(WORKSHOP, controller, DETECTOR, 6, 0)
    reasons = [step.log.decision.reason for step in steps]
    assert not any("failed" in reason or "finite" in reason for reason in reasons), set(reasons)


def test_the_figure_shows_titles_and_markers_whole_and_says_where_a_panel_is_empty(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[Figure] = []
    save = Figure.savefig

    def kept(self: Figure, *words: Any, **named: Any) -> None:
        drawn.append(self)
        save(self, *words, **named)

    monkeypatch.setattr(Figure, "savefig", kept)
    one = replace(card(step(0, person())), success=False, time_to_find_again_s=None, intrusion_personal=0.0)
    plot(summarise([one, replace(one, seed=1)]), tmp_path / "a.png")
    (figure,) = drawn
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    titles = [axes._left_title.get_window_extent(canvas.get_renderer()) for axes in figure.axes]  # type: ignore[attr-defined]
    assert all(left.x1 < right.x0 for left, right in pairwise(titles))
    assert titles[-1].x1 < figure.bbox.x1
    assert all(axes.get_xlim()[0] < 0 for axes in figure.axes)
    said = [[text.get_text() for text in axes.texts] for axes in figure.axes]
    assert said[3] == ["no data"]
    assert said[0] == said[4] == []
