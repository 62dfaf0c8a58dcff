"""`limo-hog run`: an ordinary ROS 2 Python node against the arena, without ROS."""

from __future__ import annotations

import argparse
import contextlib
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from limo_hog.cli.support.output import STDOUT, UsageError, write_json
from limo_hog.cli.support.progress import progress
from limo_hog.exceptions import LimoHogError
from limo_hog.extras import needed
from limo_sim.cli.options import add_json, add_scenario
from limo_sim.cli.watching import add_watching, watching

if TYPE_CHECKING:
    from limo_sim.run.episode import Moment


class ScriptError(LimoHogError):
    """The node failed; its traceback has been printed before."""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `run`."""
    parser = subparsers.add_parser(
        "run",
        description="Run an rclpy script against the arena, in lock step: time passes only while the node "
        "waits, so the same file, scenario and seed give the same run. Ends with the score card of `follow`.",
        epilog="What of ROS 2's Python API is offered: https://github.com/limo-hog/limo-hog/blob/main/docs/ros2.md",
    )
    parser.add_argument("node", metavar="NODE.py", type=Path, help="the script, or a launch file FILE.launch.py")
    parser.add_argument("words", metavar="NAME:=VALUE", nargs="*", help="arguments of a launch file")
    add_scenario(parser, 60.0, "simulated time (60)")
    add_json(parser)
    parser.add_argument("--real", action="store_true", help="with this computer's own rclpy: in real time, no score")
    add_watching(parser)
    parser.add_argument(
        "--ros-args",
        nargs=argparse.REMAINDER,
        default=[],
        metavar="...",
        help="-p name:=value, -r from:=to and --params-file FILE, as ROS 2 takes them; comes last",
    )


def run(args: argparse.Namespace) -> int:
    """Run the node and show its score card."""
    if args.real:
        from limo_sim.cli.real import run_real

        return run_real(args)
    if args.words and not args.node.name.endswith(".launch.py"):
        raise UsageError(f"{args.words[0]}: only a launch file has arguments; a node's come after --ros-args")
    from limo_sim.run.score import Scorer
    from limo_sim.world.scenario import Scenario
    from limo_sim.world.variants import of_run

    with needed(by="limo-hog run", what="rosbags", install="'limo-hog[record]'"):
        from limo_sim.ros.apart import run_apart
        from limo_sim.ros.script import score_of
    scenario = of_run(Scenario.load(args.scenario), args.seed)
    scorer = Scorer(scenario)
    with contextlib.ExitStack() as stack:
        if args.json == STDOUT:
            # What the node prints must not mix with the JSON.
            stack.enter_context(contextlib.redirect_stdout(sys.stderr))
        audience = stack.enter_context(watching(args, scenario))
        bar = stack.enter_context(progress("s"))
        task = bar.add_task("runs", total=args.seconds)

        def watch(moment: Moment) -> None:
            bar.update(task, completed=round(moment.step.time, 1))
            scorer.add(moment.step)
            audience.watch(moment)

        def log(time: float, level: str, name: str, message: str) -> None:
            line = f"[{level}] [{time:.9f}] [{name}]: {message}"
            bar.console.print(line, markup=False, highlight=False, soft_wrap=True)

        ended = run_apart(
            args.node,
            scenario,
            args.seconds,
            args.seed,
            arguments=[*args.words, "--ros-args", *args.ros_args],
            log=log,
            watch=watch,
            pictures=bool(audience),
            # (The figure shows all of them.)
            keep=args.plot is not None,
        )
        card = score_of(ended, scorer)
        bar.stop()
        audience.end(ended.episode, card)
    if args.json:
        write_json(args.json, card.to_json())
    if args.json != STDOUT:
        from limo_sim.cli.card import show

        show(card)
    if ended.failure:
        # What was printed before comes first, where both go to one terminal or file.
        sys.stdout.flush()
        sys.stderr.write(ended.traceback)
        raise ScriptError(ended.failure)
    return 0
