"""Those who watch a run can hold it, hurry it and turn its knobs, and others cannot."""

from __future__ import annotations

import asyncio
import json
import socket
import threading
import time
from typing import Any

import aiohttp
import pytest

from limo_hog.follow.control.naming import controller_named
from limo_sim.view.pace import Pace
from limo_sim.view.server import ServeError, View
from limo_sim.view.tuning import ParameterError, Tunable
from limo_sim.world.scenario import Scenario

WORKSHOP = Scenario.load("workshop")


def test_real_time_takes_its_time_and_all_it_can_does_not() -> None:
    pace = Pace(speed=4)
    start = time.monotonic()
    for tick in range(5):
        pace.wait(0.2 * tick)
    assert time.monotonic() - start == pytest.approx(0.2, abs=0.1)
    pace.set_speed(0)
    start = time.monotonic()
    for tick in range(1000):
        pace.wait(tick)
    assert time.monotonic() - start < 0.2


def test_a_paused_run_goes_on_one_step_at_a_time() -> None:
    pace, ticks = Pace(0), []
    pace.pause()

    def run() -> None:
        for tick in range(100):
            pace.wait(tick)
            ticks.append(tick)

    thread = threading.Thread(target=run)
    thread.start()
    time.sleep(0.1)
    assert ticks == []
    pace.step()
    time.sleep(0.1)
    assert ticks == [0]
    pace.resume()
    thread.join(5)
    assert len(ticks) == 100


def test_a_knob_changes_the_controller_and_keeps_its_kind() -> None:
    tunable: Tunable[Any] = Tunable(controller_named("tracking", None))
    tunable.set("target_distance", 2)
    tunable.set("full_every", 5.0)
    assert tunable.parameters["target_distance"] == 2.0
    assert type(tunable.parameters["full_every"]) is int
    tunable.set("steering.max_linear", 0.3)
    assert tunable.parameters["steering.max_linear"] == 0.3
    assert tunable.parameters["steering.max_angular"] == 1.5


@pytest.mark.parametrize(
    ("name", "value"), [("nonsense", 1.0), ("target_distance", float("nan")), ("target_distance", -1.0)]
)
def test_a_knob_that_is_none_or_turned_too_far_is_refused(name: str, value: float) -> None:
    with pytest.raises(ParameterError, match=name):
        Tunable(controller_named("tracking", None)).set(name, value)


def test_a_port_in_use_is_named() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(ServeError, match=f"127.0.0.1:{port}.*another port"), View(WORKSHOP, port=port):
            pass


def test_the_page_is_served_on_loopback_alone() -> None:
    with View(WORKSHOP) as view:
        assert view.url.startswith("http://127.0.0.1:")
        port = int(view.url.rsplit(":", 1)[1].strip("/"))
        own = socket.gethostbyname(socket.gethostname())
        if not own.startswith("127."):
            with pytest.raises(OSError, match=r"refused"):
                socket.create_connection((own, port), timeout=2)


@pytest.mark.parametrize("host", [None, "elsewhere.example"])
def test_another_sites_page_may_not_steer(host: str | None) -> None:
    headers = {"Origin": "http://elsewhere.example"} | ({"Host": host} if host else {})

    async def ask(view: View) -> int:
        async with aiohttp.ClientSession() as session, session.get(view.url + "live", headers=headers) as answer:
            return answer.status

    with View(WORKSHOP) as view:
        assert asyncio.run(ask(view)) == 403


@pytest.mark.parametrize(
    "wish", ["", "[]", "{}", '{"do": "fly"}', '{"do": "speed", "value": -1}', '{"set": "x", "value": 1}']
)
def test_a_wish_that_makes_no_sense_is_answered_and_changes_nothing(wish: str) -> None:
    async def ask(view: View) -> dict[str, Any]:
        async with aiohttp.ClientSession() as session, session.ws_connect(view.url + "live") as page:
            assert json.loads((await page.receive()).data)["scenario"] == "workshop"
            await page.send_str(wish)
            answer: dict[str, Any] = await page.receive_json()
            return answer

    with View(WORKSHOP, pace=Pace(2)) as view:
        assert "complaint" in asyncio.run(ask(view))
        assert (view.pace.speed, view.pace.paused) == (2, False)
