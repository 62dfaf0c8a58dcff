"""What the live page costs the run it shows: `uv run python benches/view.py`.

The same run as fast as it can: alone, with the page served and not open, and with the page open (a process that
takes all it is sent, as a browser does). Rounds are interleaved, and the least of each counts.
"""

from __future__ import annotations

import argparse
import multiprocessing
import time
from contextlib import nullcontext
from multiprocessing.synchronize import Event
from typing import Any

from limo_hog.follow.control.naming import controller_named
from limo_hog.follow.sense.detectors import detector_named
from limo_sim.run.episode import run_episode
from limo_sim.view.pace import Pace
from limo_sim.view.server import View
from limo_sim.world.scenario import Scenario

SCENARIO = Scenario.load("workshop")


def visitor(url: str, there: Event, messages: Any) -> None:
    """Opens the page's socket and takes what comes, until the run ends."""
    import asyncio

    import aiohttp

    async def look() -> None:
        async with aiohttp.ClientSession() as session, session.ws_connect(url + "live", max_msg_size=0) as page:
            there.set()
            async for message in page:
                messages[message.type is aiohttp.WSMsgType.BINARY] += 1

    asyncio.run(look())


def once(seconds: float, kind: str, messages: Any) -> tuple[float, float]:
    """Wall and processor time [s] of one run."""
    view = None if kind == "alone" else View(SCENARIO, pace=Pace(0))
    with view or nullcontext():
        if view is not None and kind == "open":
            there = multiprocessing.Event()
            page = multiprocessing.Process(target=visitor, args=(view.url, there, messages), daemon=True)
            page.start()
            there.wait(30)
        wall, processor = time.perf_counter(), time.process_time()
        run_episode(
            SCENARIO,
            controller_named("tracking", None),
            detector_named("hog"),
            seconds,
            0,
            watch=view.watch if view is not None else None,
        )
        return time.perf_counter() - wall, time.process_time() - processor


def main() -> None:
    """Print the least times of each, and what they are above the run alone."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=30.0, help="simulated, of each run")
    parser.add_argument("--rounds", type=int, default=6)
    args = parser.parse_args()
    multiprocessing.set_start_method("spawn")
    messages = multiprocessing.Array("l", 2)
    kinds = ("alone", "served", "open")
    found: dict[str, list[tuple[float, float]]] = {kind: [] for kind in kinds}
    for _ in range(args.rounds):
        for kind in kinds:
            found[kind].append(once(args.seconds, kind, messages))
    alone = [min(times) for times in zip(*found["alone"], strict=True)]
    for kind in kinds:
        least = [min(times) for times in zip(*found[kind], strict=True)]
        shares = [100 * (time / base - 1) for time, base in zip(least, alone, strict=True)]
        print(f"{kind:7} {least[0]:.2f} s ({shares[0]:+.1f} %), processor {least[1]:.2f} s ({shares[1]:+.1f} %)")
    texts, pictures = messages[0] / args.rounds, messages[1] / args.rounds
    print(f"a run's page was sent {texts:.0f} texts and {pictures:.0f} pictures")


if __name__ == "__main__":
    main()
