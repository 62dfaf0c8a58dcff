"""Clients that stop reading cost a run nothing: they are dropped, and the run ends on time."""

from __future__ import annotations

import asyncio
import dataclasses
import gc
import threading
import time
import weakref
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import Any

import aiohttp
import numpy as np
import pytest
from numpy.typing import NDArray
from tests.sim.view.stalled import HANDSHAKE, stalled

from limo_hog.detector import PeopleDetector
from limo_hog.follow.control.naming import controller_named
from limo_hog.live.pace import Pace
from limo_sim.run.episode import run_episode
from limo_sim.run.log import Step
from limo_sim.view.server import View
from limo_sim.world.scenario import Scenario

WORKSHOP = Scenario.load("workshop")


@pytest.fixture(scope="module")
def steps() -> list[Step]:
    """Steps whose pictures are noise: 300 kB each, so that a stalled client's buffers are full at once."""
    seen: list[Step] = []
    run_episode(WORKSHOP, controller_named("tracking", None), PeopleDetector(scale=1.2), 0.5, 0, watch=seen.append)
    noise = np.random.default_rng(0).integers(0, 256, (len(seen), 480, 640, 3), dtype=np.uint8)
    return [pictured(step, image) for step, image in zip(seen, noise, strict=True) if step.log.frame is not None]


def pictured(step: Step, image: NDArray[np.uint8]) -> Step:
    """Return a step whose frame shows another image."""
    assert step.log.frame is not None
    frame = dataclasses.replace(step.log.frame, image=image)
    return dataclasses.replace(step, log=dataclasses.replace(step.log, frame=frame))


@contextmanager
def showing(view: View, steps: list[Step]) -> Iterator[None]:
    """Show the steps over and over, 50 a second, in a thread of their own."""
    over = threading.Event()

    def show() -> None:
        while not over.is_set():
            for step in steps:
                view.watch(step)
                time.sleep(0.02)

    thread = threading.Thread(target=show)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


@pytest.mark.parametrize(
    "request_",
    [HANDSHAKE, "", "GET /live HTTP/1.1\r\nHost: ", "GET / HTTP/1.1\r\nHost: {host}\r\nContent-Length: 9\r\n\r\n"],
    ids=["never reads", "never asks", "asks half", "never sends its body"],
)
def test_a_run_ends_within_2_s_with_50_stalled_clients(request_: str, steps: list[Step]) -> None:
    with ExitStack() as served:
        view = served.enter_context(View(WORKSHOP, pace=Pace(0)))
        with stalled(view.url, 50, request_):
            with showing(view, steps):
                time.sleep(3)
            began = time.monotonic()
            view.end({"in_view": 1.0})
            served.close()
            assert time.monotonic() - began < 2


def test_a_client_that_does_not_read_is_dropped(steps: list[Step], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("limo_hog.live.server.STALL_S", 1.0)

    async def pictures(view: View, seconds: float) -> int:
        async with aiohttp.ClientSession() as session, session.ws_connect(view.url + "live", max_msg_size=0) as page:
            count, until = 0, time.monotonic() + seconds
            while time.monotonic() < until:
                count += (await page.receive(timeout=5)).type is aiohttp.WSMsgType.BINARY
            return count

    with View(WORKSHOP, pace=Pace(0)) as view, stalled(view.url, 5) as clients, showing(view, steps):
        # Ten a second on an idle machine; on busy cores fewer, but not none.
        assert asyncio.run(pictures(view, 4)) > 3
        for client in clients:
            # What was under way when it was dropped, then the end.
            with suppress(ConnectionResetError):
                while client.recv(1 << 20):
                    pass


def test_clients_that_do_not_read_keep_no_frames_of_the_run(steps: list[Step]) -> None:
    images: list[weakref.ref[Any]] = []

    def show(view: View) -> None:
        for step in steps:
            assert step.log.frame
            image = step.log.frame.image.copy()
            images.append(weakref.ref(image))
            view.watch(pictured(step, image))
            del image
            time.sleep(0.05)

    with View(WORKSHOP, pace=Pace(0)) as view, ExitStack() as clients:
        # One after another, so that each stalls at a step of its own.
        for _ in range(12):
            clients.enter_context(stalled(view.url, 1))
            show(view)
        gc.collect()
        # The newest, the one whose pictures were made last, and one that is being encoded.
        assert sum(image() is not None for image in images) <= 3


def test_ten_pages_share_their_pictures(steps: list[Step], monkeypatch: pytest.MonkeyPatch) -> None:
    encoded: list[Step] = []

    def count(_: View, step: Step) -> list[bytes]:
        encoded.append(step)
        return [b"c"]

    monkeypatch.setattr(View, "_pictures", count)

    async def look(view: View) -> None:
        async with aiohttp.ClientSession() as session, session.ws_connect(view.url + "live", max_msg_size=0) as page:
            while (await page.receive(timeout=5)).type is not aiohttp.WSMsgType.BINARY:
                pass

    async def all_look(view: View) -> None:
        await asyncio.gather(*(look(view) for _ in range(10)))

    with View(WORKSHOP, pace=Pace(0)) as view:
        view.watch(steps[0])
        asyncio.run(all_look(view))
    assert encoded == [steps[0]]
