"""Long runs whose memory, descriptors and times must stay flat.

`python -m tests.hardening.soak view --seconds 3600` follows for so much simulated time, as fast as it can, before 20
clients of the page, 5 of which stop reading; `python -m tests.hardening.soak detect --count 1000000` searches images
of changing size. Each prints what it measured every now and then, and at the end the slope.
"""

from __future__ import annotations

import argparse
import asyncio
import gc
import os
import subprocess
import sys
import time
from array import array
from pathlib import Path

import numpy as np

import limo_hog
from limo_hog.detector import PeopleDetector
from limo_hog.follow.control.naming import controller_named
from limo_sim.run.catalogue import load
from limo_sim.run.episode import Moment, run_episode
from limo_sim.run.score import Scorer
from limo_sim.view.pace import Pace
from limo_sim.view.server import View

READERS, STALLED = 15, 5
#: Control periods of a run, at most.
STEPS = 100_000
#: What comes before is not counted, as caches fill [s of simulated time, share of the detections].
WARM_S, WARM = 600.0, 0.1


def resident_mb() -> float:
    """Return this process's memory [MB]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def descriptors() -> int:
    """Return how many files and connections are open."""
    return len(list(Path("/proc/self/fd").iterdir()))


def slope(times: list[float], values: list[float]) -> float:
    """Return the least-squares slope [of the values' unit per that of the times]."""
    return float(np.polyfit(times, values, 1)[0]) if len(times) > 2 else float("nan")


def watch_a_page(seconds: float, seed: int) -> None:
    """Follow before an audience."""
    rows: list[tuple[float, float, int]] = []
    # Of the thread that simulates, so that what else the machine does counts little; without growing lists.
    times, took = array("d", bytes(8 * STEPS)), array("d", bytes(8 * STEPS))
    made, last = 0, [time.thread_time(), 0.0]
    scenario = load("workshop")
    scorer = Scorer(scenario)

    with View(scenario, pace=Pace(0)) as view:
        command = [sys.executable, "-m", "tests.hardening.soak", "clients", "--url", view.url]
        clients = subprocess.Popen(command)

        def watch(moment: Moment) -> None:
            nonlocal made
            scorer.add(moment.step)
            view.watch(moment)
            now = time.thread_time()
            times[made], took[made] = moment.step.time, 1e3 * (now - last[0])
            made, last[0] = made + 1, now
            if moment.step.time - last[1] >= 10.0:
                last[1] = moment.step.time
                gc.collect()
                rows.append((moment.step.time, resident_mb(), descriptors()))
                if len(rows) % 6 == 0:
                    p95 = np.percentile(took[max(0, made - 600) : made], 95)
                    at, mb, open_ = rows[-1]
                    print(f"{at:.0f} s: {mb:.1f} MB, {open_} descriptors, p95 of a frame {p95:.1f} ms", flush=True)

        controller = controller_named("tracking", None)
        episode = run_episode(scenario, controller, PeopleDetector(), seconds, seed, watch=watch, keep=False)
        view.end(scorer.card(episode).to_json())
        clients.terminate()
        clients.wait()
    warm = [row for row in rows if row[0] > min(WARM_S, seconds / 4)]
    hours = [row[0] / 3600 for row in warm]
    late = np.array(times[:made]) > seconds / 2
    p95 = [np.percentile(np.array(took[:made])[half], 95) for half in (~late, late)]
    print(
        f"{seconds:.0f} s: {slope(hours, [row[1] for row in warm]):+.2f} MB an hour, descriptors "
        f"{min(row[2] for row in warm)} to {max(row[2] for row in warm)}, p95 of a frame {p95[0]:.2f} ms of "
        f"processor time in the first half and {p95[1]:.2f} ms in the second"
    )


async def read_pages(url: str) -> None:
    """Be the clients: some read for ever, some never."""
    import aiohttp

    async def read() -> None:
        async with aiohttp.ClientSession() as session, session.ws_connect(url + "live", max_msg_size=0) as page:
            async for _ in page:
                pass

    async def stall() -> None:
        while True:
            async with aiohttp.ClientSession() as session, session.ws_connect(url + "live", max_msg_size=0) as page:
                # (The server drops it; then another comes.)
                await asyncio.sleep(20)
                await page.close()

    await asyncio.gather(*[read() for _ in range(READERS)], *[stall() for _ in range(STALLED)], return_exceptions=True)


def detect(count: int) -> None:
    """Search small images of changing size."""
    limo_hog.set_num_threads(2)
    hog = limo_hog.HOGDescriptor()
    hog.setSVMDetector(hog.getDefaultPeopleDetector())
    rng = np.random.default_rng(0)
    pixels = rng.integers(0, 256, (400, 400, 3), dtype=np.uint8)
    rows: list[tuple[float, float]] = []
    for number in range(count):
        height, width = (int(side) for side in rng.integers(100, 180, 2))
        if number % 1000 == 0:
            height, width = 400, 400
        image = pixels[:height, :width] if number % 2 else pixels[:height, :width, 0]
        hog.detectMultiScale(image, scale=1.3)
        if number % max(count // 100, 1) == 0:
            gc.collect()
            rows.append((number / 1e6, resident_mb()))
    warm = [row for row in rows if row[0] > WARM * count / 1e6]
    print(
        f"{count} detections: {slope(*map(list, zip(*warm, strict=True))):+.2f} MB a million; "
        f"{min(row[1] for row in warm):.1f} to {max(row[1] for row in warm):.1f} MB, {descriptors()} descriptors"
    )


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("what", choices=["view", "detect", "clients"])
    parser.add_argument("--seconds", type=float, default=3600.0, help="simulated time")
    parser.add_argument("--count", type=lambda text: int(float(text)), default=1_000_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--url", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.what == "view":
        watch_a_page(args.seconds, args.seed)
    elif args.what == "detect":
        detect(args.count)
    else:
        asyncio.run(read_pages(args.url))


if __name__ == "__main__":
    main()
