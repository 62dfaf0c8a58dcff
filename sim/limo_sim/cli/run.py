"""`limo-hog run`: an ordinary ROS 2 Python node against the arena, without ROS."""

from __future__ import annotations

import argparse
import contextlib
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from limo_hog.cli.support.arguments import add_json, add_ros_arguments
from limo_hog.cli.support.output import STDOUT, UsageError
from limo_hog.cli.support.progress import progress
from limo_hog.exceptions import LimoHogError
from limo_hog.extras import needed
from limo_sim.cli.watching import add_scenario, add_watching, finish, observing

if TYPE_CHECKING:
    from limo_sim.run.log import Step
    from limo_sim.world.scenario import Scenario

#: Address space of a node [MB], where the system limits it. Chosen: neural networks reserve more than they use.
MEMORY_MB = 32_000


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `run`."""
    parser = subparsers.add_parser(
        "run",
        description="Run an rclpy script against the arena, in lock step: time passes only while the node "
        "waits, so the same file, scenario and seed give the same run. Ends with the score card of `follow`.",
        epilog="What of ROS 2's Python API is offered: https://github.com/limo-hog/limo-hog/blob/main/docs/ros2.md",
    )
    parser.add_argument("node", metavar="NODE.py", type=Path, help="the script")
    add_scenario(parser, None, "simulated time (60, or that of check:NAME)", " or check:NAME, a scene of the checker")
    add_json(parser, "the score card as JSON")
    add_watching(parser)
    add_ros_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Run the node and show its score card."""
    with needed(by="limo-hog run"):
        from limo_sim.ros.runner import Limits, run_node
        from limo_sim.ros.stage import Stage, score_of
    scenario, seconds, ros_args = _scene(args)
    with contextlib.ExitStack() as stack:
        if args.json == STDOUT:
            # What the node prints must not mix with the JSON.
            stack.enter_context(contextlib.redirect_stdout(sys.stderr))
        observers = stack.enter_context(observing(args, scenario))
        bar = stack.enter_context(progress("s"))
        task = bar.add_task("runs", total=seconds)

        def watch(step: Step) -> None:
            bar.update(task, completed=round(step.log.time, 1))
            observers.notify(step)

        def log(time: float, level: str, name: str, message: str) -> None:
            line = f"[{level}] [{time:.9f}] [{name}]: {message}"
            bar.console.print(line, markup=False, highlight=False, soft_wrap=True)

        def said(name: str, text: str) -> None:
            (sys.stdout if name == "stdout" else sys.stderr).write(text)

        stage = Stage(args.node, scenario, seconds, args.seed, log=log, watch=watch)
        limits = Limits(memory_mb=MEMORY_MB)
        ended = run_node(stage, ["--ros-args", *ros_args], limits=limits, said=said)
        card = score_of(ended)
        bar.stop()
        observers.end(ended.episode, card)
    finish(args, card)
    if ended.failure:
        # What was printed before comes first, where both go to one terminal or file.
        sys.stdout.flush()
        sys.stderr.write(ended.traceback)
        raise LimoHogError(ended.failure)
    return 0


def _scene(args: argparse.Namespace) -> tuple[Scenario, float, list[str]]:
    """Return what is run, how long [s], and the node's arguments: of a scene of the checker, its own come first."""
    from limo_sim.workshop.exercises import scene_named
    from limo_sim.world.scenario import Scenario
    from limo_sim.world.variants import of_run

    if args.scenario.startswith("check:"):
        if args.robot:
            raise UsageError(f"--robot {args.robot}: a scene of the checker has a Limo; give another --scenario")
        scene = scene_named(args.scenario.removeprefix("check:"))
        return scene.scenario, args.seconds or scene.seconds, [*scene.arguments, *args.ros_args]
    return of_run(Scenario.load(args.scenario, args.robot), args.seed), args.seconds or 60.0, args.ros_args
