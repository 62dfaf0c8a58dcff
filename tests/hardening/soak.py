"""Long runs whose memory, descriptors and times must stay flat.

`python -m tests.hardening.soak view --seconds 3600` follows in simulated time before 20 clients of the page, 5 of which
stop reading; `node` runs a node that only drives; `detect --count 1000000` searches images of changing size. The slope
printed at the end is of a straight line through each minute's lowest reading: others hold pictures on their way.
"""

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
from limo_hog.live.pace import Pace
from limo_sim.ros.runner import run_node
from limo_sim.ros.stage import Stage, score_of
from limo_sim.run.episode import run_episode, score
from limo_sim.run.log import Step
from limo_sim.view.server import View
from limo_sim.world.scenario import Scenario

READERS, STALLED = 15, 5
#: Control periods of a run, at most; between two readings [s of simulated time].
STEPS, EVERY_S = 100_000, 10.0
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
#: What comes before is not counted, as caches fill [share of a run].
WARM = 0.2


def memory_mb(process: int | str = "self") -> float:
    """Return the memory that is a process's own [MB]; of this one, after all that is free was given back."""
    if process == "self":
        gc.collect()
        ctypes.CDLL("libc.so.6").malloc_trim(0)
    told = dict(line.split(":", 1) for line in Path(f"/proc/{process}/status").read_text().splitlines())
    return int(told["RssAnon"].split()[0]) * 1024 / 1e6


def descriptors() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


def report(name: str, unit: str, times: list[float], values: list[float], of: int = 6) -> None:
    """Print the least-squares slope of the least of each `of` values, by the times in a unit, and the range."""
    warm = [k for k, at in enumerate(times) if at >= WARM * times[-1]]
    least = [min(warm[k : k + of], key=values.__getitem__) for k in range(0, len(warm), of)]
    slope = np.polyfit([times[k] for k in least], [values[k] for k in least], 1)[0] if len(least) > 2 else np.nan
    kept = [values[k] for k in warm]
    print(f"{name}: {slope:+.2f} MB {unit}, {min(kept):.1f} to {max(kept):.1f} MB, {descriptors()} descriptors")


def watch_a_page(seconds: float, seed: int) -> None:
    hours, memory = list[float](), list[float]()
    # Of the thread that simulates, so that what else the machine does counts little; without growing lists.
    took = array("d", bytes(8 * STEPS))
    made, last = 0, time.thread_time()
    scenario = Scenario.load("workshop")

    with View(scenario, pace=Pace(0)) as view:
        clients = subprocess.Popen([sys.executable, "-m", "tests.hardening.soak", "clients", "--url", view.url])

        def watch(step: Step) -> None:
            nonlocal made, last
            view.watch(step)
            now = time.thread_time()
            took[made], made, last = 1e3 * (now - last), made + 1, now
            if step.log.time / 3600 >= (hours[-1] if hours else 0.0) + EVERY_S / 3600:
                hours.append(step.log.time / 3600)
                memory.append(memory_mb())
                if len(hours) % 6 == 0:
                    print(f"{step.log.time:.0f} s: {memory[-1]:.1f} MB, {descriptors()} descriptors", flush=True)

        controller = controller_named("tracking", None)
        episode = run_episode(scenario, controller, PeopleDetector(), seconds, seed, watch=watch)
        view.end(score(episode).to_json())
        clients.terminate()
        clients.wait()
    report("memory", "an hour", hours, memory)
    halves = np.array_split(np.array(took[:made]), 2)
    first, second = (np.percentile(half, 95) for half in halves)
    print(f"p95 of a frame {first:.2f} ms of processor time in the first half and {second:.2f} ms in the second")


async def read_pages(url: str) -> None:
    """Be the clients: some read for ever, some never."""
    import aiohttp

    async def client(*, reads: bool) -> None:
        while True:
            async with aiohttp.ClientSession() as session, session.ws_connect(url + "live", max_msg_size=0) as page:
                while reads and not page.closed:
                    await page.receive()
                # (The server drops it; then another comes.)
                await asyncio.sleep(20)

    clients = [client(reads=number < READERS) for number in range(READERS + STALLED)]
    await asyncio.gather(*clients, return_exceptions=True)


def run_a_node(seconds: float, seed: int) -> None:
    rows, pid = list[tuple[float, float, float]](), list[str]()

    def watch(step: Step) -> None:
        if not rows or step.log.time / 3600 - rows[-1][0] >= EVERY_S / 3600:
            rows.append((step.log.time / 3600, memory_mb(), memory_mb(int("".join(pid)))))

    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder) / "node.py"
        script.write_text(NODE, encoding="utf-8")
        stage = Stage(script, Scenario.load("followable"), seconds, seed, watch=watch)
        ended = run_node(stage, said=lambda _, text: pid.append(text))
    print(f"{score_of(ended).frames} frames {ended.failure}")
    hours, here, there = (list(column) for column in zip(*rows, strict=True))
    report("here", "an hour", hours, here)
    report("the node's process", "an hour", hours, there)


def detect(count: int) -> None:
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
            rows.append((number / 1e6, memory_mb()))
    report(f"{count} detections", "a million", [row[0] for row in rows], [row[1] for row in rows], of=1)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("what", choices=["view", "node", "detect", "clients"])
    parser.add_argument("--seconds", type=float, default=3600.0, help="simulated time")
    parser.add_argument("--count", type=lambda text: int(float(text)), default=1_000_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--url", help=argparse.SUPPRESS)
    args = parser.parse_args()
    # Let glibc give freed blocks of 128 kB and more back at once: by itself it learns to keep them.
    m_mmap_threshold = -3
    ctypes.CDLL("libc.so.6").mallopt(m_mmap_threshold, 1 << 17)
    if args.what in ("view", "node"):
        {"view": watch_a_page, "node": run_a_node}[args.what](args.seconds, args.seed)
    elif args.what == "detect":
        detect(args.count)
    else:
        asyncio.run(read_pages(args.url))


if __name__ == "__main__":
    main()
