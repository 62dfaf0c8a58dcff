"""`limo-hog run --real`: the script with the computer's own rclpy, in real time, against the arena on the network."""

from __future__ import annotations

import argparse
import importlib.util
import os
import runpy
import signal
import subprocess
import sys
import threading

from limo_hog.cli.support.output import UsageError
from limo_hog.extras import MissingExtraError
from limo_sim.world.scenario import Scenario


def run_real(args: argparse.Namespace) -> int:
    """Run the arena beside the script until its time is up; no score card, since its detections are not known."""
    if args.json:
        raise UsageError("--json and --real: a script on the network is not scored")
    for name in ("view", "video", "record", "plot", "rerun"):
        if getattr(args, name):
            raise UsageError(
                f"--{name} and --real: a script on the network is not watched; use `limo-hog arena --ros2`"
            )
    if args.words:
        raise UsageError(f"{args.words[0]} and --real: a launch file's arguments; a node's come after --ros-args")
    if importlib.util.find_spec("rclpy") is None:
        raise MissingExtraError("limo-hog run --real needs ROS 2's rclpy: source /opt/ros/DISTRO/setup.bash first")
    if not args.node.is_file():
        raise UsageError(f"{args.node}: no such file")
    Scenario.load(args.scenario).check_detector_is_plain("a node brings its own detector")
    options = ["--scenario", args.scenario, "--seconds", str(args.seconds), "--seed", str(args.seed)]
    # Every word of the command is ours, or was checked when it was read.
    command = [sys.executable, "-m", "limo_hog.cli.main", "arena", "--ros2", *options]
    arena = subprocess.Popen(command)  # noqa: S603
    ended = threading.Event()

    def interrupt_when_over() -> None:
        arena.wait()
        if not ended.is_set():
            # What Ctrl-C does: the script's own ending runs.
            os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=interrupt_when_over, daemon=True).start()
    argv = sys.argv
    sys.argv = [str(args.node), "--ros-args", *args.ros_args]
    sys.path.insert(0, str(args.node.resolve().parent))
    try:
        runpy.run_path(str(args.node), run_name="__main__")
    except KeyboardInterrupt:
        if arena.poll() is None:
            raise
    finally:
        ended.set()
        arena.terminate()
        arena.wait()
        sys.argv = argv
        sys.path.pop(0)
    return max(0, arena.returncode)
