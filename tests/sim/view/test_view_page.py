"""The page of a running episode, in a real browser; its pictures are kept in `out/view/` to look at."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import aiohttp
import pytest
from tests.sim.view.chromium import CHROMIUM, Tab, chromium, open_tab

from limo_hog.detector import PeopleDetector
from limo_hog.follow.control.naming import controller_named
from limo_sim.run.episode import run_episode, score
from limo_sim.view.pace import Pace
from limo_sim.view.server import View
from limo_sim.view.tuning import Tunable
from limo_sim.world.scenario import Scenario

PICTURES = Path(__file__).parents[3] / "out" / "view"
SECONDS = 90.0  # at twice real time: longer than the browser takes to start and look
SCENARIO = Scenario.load("workshop")


@pytest.fixture
def running() -> Iterator[tuple[View, Tunable[Any]]]:
    controller = Tunable(controller_named("tracking", None))
    with View(SCENARIO, controller, pace=Pace(2)) as view:

        def episode() -> None:
            # A coarse search: this is about the page.
            detector = PeopleDetector(scale=1.2, min_height=None, nms="group")
            view.end(score(run_episode(SCENARIO, controller, detector, SECONDS, 0, watch=view.watch)).to_json())

        run = threading.Thread(target=episode)
        run.start()
        try:
            yield view, controller
        finally:
            view.pace.set_speed(0)
            view.pace.resume()
            run.join()


@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium: apt-get install chromium")
def test_a_browser_sees_the_run_move_and_steers_it(running: tuple[View, Tunable[Any]], tmp_path: Path) -> None:
    view, controller = running

    async def look() -> None:
        with chromium(tmp_path / "profile") as port:
            async with aiohttp.ClientSession() as session:
                await _see_it_move(tab := await open_tab(session, port, view.url))
                await _steer_it(tab, view, controller)
                await _see_it_end(tab)

    asyncio.run(look())


async def _see_it_move(tab: Tab) -> None:
    await tab.look(1280, 900)
    await tab.until("document.querySelector('#camera').dataset.count > 2 && now.boxes > 0 && now.time > 5")
    before = await tab.value("[document.querySelector('#camera').src, document.querySelector('#depth').src]")
    await tab.until(f"document.querySelector('#camera').src !== {before[0]!r}")
    await tab.until(f"document.querySelector('#depth').src !== {before[1]!r}")
    await tab.until("document.querySelector('#camera').naturalWidth === 640")
    # Boxes: the arena itself has nothing that is as green or as red.
    await tab.until(
        """(() => {
            const sheet = Object.assign(document.createElement("canvas"), { width: 640, height: 480 });
            const pen = sheet.getContext("2d");
            pen.drawImage(document.querySelector("#camera"), 0, 0);
            const p = pen.getImageData(0, 0, 640, 480).data;
            let coloured = 0;
            for (let i = 0; i < p.length; i += 4) coloured += Math.max(p[i], p[i + 1]) > 2 * Math.min(p[i], p[i + 1]);
            return coloured > 200;
        })()"""
    )
    for canvas in ("map", "plot-error", "plot-distance", "plot-speed", "scale"):
        await tab.until(
            f"""(() => {{
                const canvas = document.querySelector("#{canvas}");
                const {{ data }} = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
                return new Set(new Uint32Array(data.buffer)).size > 5;
            }})()"""
        )


async def _steer_it(tab: Tab, view: View, controller: Tunable[Any]) -> None:
    await tab.value("document.querySelector('#pause').click()")
    await tab.until("now.paused")
    assert view.pace.paused
    await asyncio.sleep(0.3)
    stood = await tab.value("now.time")
    await asyncio.sleep(0.5)
    assert await tab.value("now.time") == stood
    await tab.value("document.querySelector('#step').click()")
    await tab.until(f"now.time > {stood}")
    assert await tab.value("now.time") - stood == pytest.approx(0.1, abs=0.03)
    # The pictures that are kept show a followed person.
    while await tab.value("now.error_px") is None:
        stood = await tab.value("now.time")
        await tab.value("document.querySelector('#step').click()")
        await tab.until(f"now.time > {stood}")
    for width, height, dark in ((1280, 900, False), (1280, 900, True), (390, 844, False), (390, 844, True)):
        await tab.look(width, height, dark)
        await tab.screenshot(PICTURES / f"{'phone' if width < 600 else 'desk'}-{'dark' if dark else 'light'}.png")
        assert await tab.value("document.documentElement.scrollWidth") <= width
        # The controls are in one row, and each says what it is.
        tops = "[...document.querySelectorAll('.controls > *')].map((c) => c.getBoundingClientRect().height)"
        assert max(await tab.value(tops)) < 48
        assert await tab.value("document.querySelector('.controls').getBoundingClientRect().height") < 60
        assert await tab.value("document.querySelector('.controls label span').offsetWidth") > 20
    # On the phone: the caption is text, not part of the picture, and every parameter tells what it is.
    assert await tab.value("parseFloat(getComputedStyle(document.querySelector('#seen')).fontSize)") >= 14
    fields = await tab.value(
        "[...document.querySelectorAll('#fields label')].map((l) => [l.title, l.querySelector('input').max])"
    )
    assert len(fields) == len(controller.parameters)
    assert all(len(title) > 20 and float(high) > 0 for title, high in fields)
    # Both distances are told, each with a word of its own.
    shown = await tab.value("['measured', 'distance'].map((id) => document.getElementById(id).parentNode.innerText)")
    assert [text.split("\n")[0] for text in shown] == ["distance seen", "true distance"]
    assert all(0.5 < float(text.split("\n")[1].split()[0]) < 5 for text in shown)
    set_field = "Object.assign(document.querySelector('[name=target_distance]'), {value: %s}).onchange()"
    await tab.value(set_field % "2.5")
    await tab.value(set_field % "-1")
    await tab.until("document.querySelector('#complaint').textContent.includes('want a number from')")
    assert controller.parameters["target_distance"].value == 2.5
    view.pace.set_speed(0)
    await tab.value("document.querySelector('#pause').click()")


async def _see_it_end(tab: Tab) -> None:
    await tab.until("document.querySelector('#notice').textContent.startsWith('The run has ended')", 60)
    await tab.screenshot(PICTURES / "ended.png")
    # The timeline goes back over the finished run: numbers, map and camera are those of then.
    await tab.value("document.querySelector('#span').onchange({target: {value: '0'}})")
    newest = await tab.value("[document.querySelector('#camera').src, document.querySelector('#distance').innerText]")
    await tab.value("document.querySelector('#timeline').oninput({target: {valueAsNumber: 5}})")
    assert await tab.value("document.querySelector('#shown').textContent") == "5.0 s"
    then = await tab.value("[document.querySelector('#camera').src, document.querySelector('#distance').innerText]")
    assert then[0] != newest[0]
    assert then[1] != newest[1]
    at = await tab.value("number(nearest(history, 5)[DISTANCE], 2)")
    assert then[1].split()[0] == at
    # A cursor on a plot reads the values, the wheel zooms.
    await tab.value(
        "(() => { const c = document.querySelector('#plot-distance'), b = c.getBoundingClientRect();"
        "c.onpointermove({currentTarget: c, clientX: b.left + LEFT + (b.width - LEFT - 4) / 2}); })()"
    )
    await tab.screenshot(PICTURES / "timeline.png")
    begin, end = await tab.value("shownTimes()")
    assert await tab.value("cursor") == pytest.approx((begin + end) / 2, abs=0.1)
    await tab.value("document.querySelector('#plot-speed').dispatchEvent(new WheelEvent('wheel', {deltaY: -1}))")
    assert (end - begin) * 0.8 == pytest.approx(await tab.value("shownTimes()[1] - shownTimes()[0]"))
    await tab.value("document.querySelector('#live').click()")
    assert await tab.value("document.querySelector('#shown').textContent") == "now"
    # The page keeps what it showed last.
    await tab.until("document.querySelector('#camera').naturalWidth === 640")
    assert await tab.value("document.querySelector('#pause').disabled") is True
