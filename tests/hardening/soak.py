"""Long runs whose memory, descriptors and times must stay flat.

`python -m tests.hardening.soak view --seconds 3600` follows for so much simulated time, as fast as it can, before 20
clients of the page, 5 of which stop reading; `node` in its place runs a node that only drives, as `limo-hog run` does;
`python -m tests.hardening.soak detect --count 1000000` searches images of changing size. Each prints what it measured
every now and then, and at the end the slope.

A reading of a process's memory holds pictures that are on their way just then, free memory that the C library keeps,
and pages of files that the system drops and reads again: megabytes that come and go. So pages of files are told apart,
the library is to give back what is free, and of each minute the lowest reading counts: the slope is that of a straight
line through these. What could be given back before a reading is told as "free". `--plain` leaves the library as it is.
"""

from __future__ import annotations

import argparse
import asyncio
import ctypes
import gc
import subprocess
import sys
import tempfile
import time
from array import array
from pathlib import Path

import numpy as np

import limo_hog
from limo_hog.detector import PeopleDetector
from limo_hog.follow.control.naming import controller_named
from limo_sim.ros.runner import run_node
from limo_sim.ros.stage import Stage, score_of
from limo_sim.run.episode import run_episode, score
from limo_sim.run.log import Step
from limo_sim.view.pace import Pace
from limo_sim.view.server import View
from limo_sim.world.scenario import Scenario

READERS, STALLED = 15, 5
#: Control periods of a run, at most.
STEPS = 100_000
#: A node that drives in a circle, ten commands a second.
NODE = """
import os
import rclpy
from geometry_msgs.msg import Twist
from rclpy.node import Node

print(os.getpid())
rclpy.init()
node = Node("circle")
commands = node.create_publisher(Twist, "cmd_vel", 10)


def drive():
    twist = Twist()
    twist.linear.x, twist.angular.z = 0.1, 0.3
    commands.publish(twist)


node.create_timer(0.1, drive)
rclpy.spin(node)
"""
#: What comes before is not counted, as caches fill [s of simulated time, share of the detections].
WARM_S, WARM = 600.0, 0.1


def memory_mb(process: int | str = "self") -> tuple[float, float]:
    """Return a process's memory of its own, and its pages of files [MB], which the system drops and reads again."""
    told = dict(line.split(":", 1) for line in Path(f"/proc/{process}/status").read_text().splitlines())
    own, files = (int(told[name].split()[0]) * 1024 / 1e6 for name in ("RssAnon", "RssFile"))
    return own, files


def held_mb() -> tuple[float, float, float]:
    """Return this process's memory of its own, its pages of files, and what glibc kept free and now gives back [MB]."""
    gc.collect()
    before, _ = memory_mb()
    ctypes.CDLL("libc.so.6").malloc_trim(0)
    own, files = memory_mb()
    return own, files, before - own


def keep_nothing_free() -> None:
    """Let glibc give freed blocks of 128 kB and more back at once: by itself it learns to keep them."""
    m_mmap_threshold = -3
    ctypes.CDLL("libc.so.6").mallopt(m_mmap_threshold, 1 << 17)


def descriptors() -> int:
    """Return how many files and connections are open."""
    return len(list(Path("/proc/self/fd").iterdir()))


def slope(times: list[float], values: list[float], of: int = 1) -> float:
    """Return the least-squares slope [of the values' unit per that of the times] of the least of each `of` values."""
    groups = [range(at, min(at + of, len(values))) for at in range(0, len(values), of)]
    least = [min(group, key=values.__getitem__) for group in groups]
    return float(np.polyfit([times[k] for k in least], [values[k] for k in least], 1)[0]) if len(least) > 2 else np.nan


def watch_a_page(seconds: float, seed: int) -> None:
    """Follow before an audience."""
    rows: list[tuple[float, float, float, float, int]] = []
    # Of the thread that simulates, so that what else the machine does counts little; without growing lists.
    times, took = array("d", bytes(8 * STEPS)), array("d", bytes(8 * STEPS))
    made, last = 0, [time.thread_time(), 0.0]
    scenario = Scenario.load("workshop")

    with View(scenario, pace=Pace(0)) as view:
        command = [sys.executable, "-m", "tests.hardening.soak", "clients", "--url", view.url]
        clients = subprocess.Popen(command)

        def watch(step: Step) -> None:
            nonlocal made
            view.watch(step)
            now = time.thread_time()
            times[made], took[made] = step.log.time, 1e3 * (now - last[0])
            made, last[0] = made + 1, now
            if step.log.time - last[1] >= 10.0:
                last[1] = step.log.time
                rows.append((step.log.time, *held_mb(), descriptors()))
                if len(rows) % 6 == 0:
                    p95 = np.percentile(took[max(0, made - 600) : made], 95)
                    at, mb, files, free, open_ = rows[-1]
                    told = f"{mb:.1f} MB, {files:.1f} of files, {free:.1f} free, {open_} descriptors, p95 {p95:.1f} ms"
                    print(f"{at:.0f} s: {told}", flush=True)

        controller = controller_named("tracking", None)
        episode = run_episode(scenario, controller, PeopleDetector(), seconds, seed, watch=watch)
        view.end(score(episode).to_json())
        clients.terminate()
        clients.wait()
    warm = [row for row in rows if row[0] > min(WARM_S, seconds / 4)]
    hours = [row[0] / 3600 for row in warm]
    late = np.array(times[:made]) > seconds / 2
    p95 = [np.percentile(np.array(took[:made])[half], 95) for half in (~late, late)]
    for name, values in zip(("memory", "of files", "free"), [[row[k] for row in warm] for k in (1, 2, 3)], strict=True):
        print(
            f"{name}: {slope(hours, values, 6):+.2f} MB an hour by each minute's least, {slope(hours, values):+.2f} by "
            f"all readings, {min(values):.1f} to {max(values):.1f} MB"
        )
    print(
        f"descriptors {min(row[4] for row in warm)} to {max(row[4] for row in warm)}, p95 of a frame "
        f"{p95[0]:.2f} ms of processor time in the first half and {p95[1]:.2f} ms in the second"
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


def run_a_node(seconds: float, seed: int) -> None:
    """Run a node in a process of its own, and score it as it goes."""
    scenario = Scenario.load("followable")
    rows: list[tuple[float, float, float]] = []
    pid: list[str] = []

    def watch(step: Step) -> None:
        if not rows or step.log.time - rows[-1][0] >= 10.0:
            rows.append((step.log.time, held_mb()[0], memory_mb(int("".join(pid)))[0]))
            if len(rows) % 30 == 0:
                print("{:.0f} s: {:.1f} MB, the node's process {:.1f} MB".format(*rows[-1]), flush=True)

    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder) / "node.py"
        script.write_text(NODE, encoding="utf-8")
        ended = run_node(Stage(script, scenario, seconds, seed, watch=watch), said=lambda _, text: pid.append(text))
    print(f"{score_of(ended).frames} frames {ended.failure}")
    warm = [row for row in rows if row[0] > min(WARM_S, seconds / 4)]
    hours = [row[0] / 3600 for row in warm]
    for name, values in (("here", [row[1] for row in warm]), ("the node's process", [row[2] for row in warm])):
        told = f"{slope(hours, values, 6):+.2f} MB an hour, {min(values):.1f} to {max(values):.1f} MB"
        print(f"{name}: {told}")


def detect(count: int) -> None:
    """Search small images of changing size."""
    limo_hog.set_num_threads(2)
    hog = limo_hog.HOGDescriptor()
    hog.setSVMDetector(hog.getDefaultPeopleDetector())
    rng = np.random.default_rng(0)
    pixels = rng.integers(0, 256, (400, 400, 3), dtype=np.uint8)
    rows: list[tuple[float, float]] = []
    for number in range(count):
        # Most have one to six windows, so that a million takes ten minutes.
        low, high = ((128, 64), (145, 82)) if number % 50 else ((100, 100), (180, 180))
        height, width = (int(side) for side in rng.integers(low, high)) if number % 1000 else (400, 400)
        image = pixels[:height, :width] if number % 2 else pixels[:height, :width, 0]
        hog.detectMultiScale(image, scale=1.3)
        if number % max(count // 100, 1) == 0:
            rows.append((number / 1e6, held_mb()[0]))
    warm = [row for row in rows if row[0] > WARM * count / 1e6]
    print(
        f"{count} detections: {slope([row[0] for row in warm], [row[1] for row in warm]):+.2f} MB a million; "
        f"{min(row[1] for row in warm):.1f} to {max(row[1] for row in warm):.1f} MB, {descriptors()} descriptors"
    )


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("what", choices=["view", "node", "detect", "clients"])
    parser.add_argument("--seconds", type=float, default=3600.0, help="simulated time")
    parser.add_argument("--count", type=lambda text: int(float(text)), default=1_000_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--plain", action="store_true", help="let the C library keep what it wants")
    parser.add_argument("--url", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if not args.plain:
        keep_nothing_free()
    if args.what == "view":
        watch_a_page(args.seconds, args.seed)
    elif args.what == "node":
        run_a_node(args.seconds, args.seed)
    elif args.what == "detect":
        detect(args.count)
    else:
        asyncio.run(read_pages(args.url))


if __name__ == "__main__":
    main()
