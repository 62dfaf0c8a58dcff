"""`limo-hog follow`: the workshop in closed loop, and its score card."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from limo_hog.cli.support.arguments import add_follower, add_json
from limo_hog.cli.support.output import STDOUT
from limo_hog.cli.support.page import HERE, PORT
from limo_hog.cli.support.progress import progress
from limo_hog.follow.control.naming import controller_named, detector_of
from limo_hog.follow.decision import made_for
from limo_hog.named_detectors import detector_named
from limo_sim.cli.watching import add_scenario, add_watching, finish, observing, shown_unasked

if TYPE_CHECKING:
    from limo_sim.run.log import Step


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `follow`."""
    parser = subparsers.add_parser(
        "follow",
        description="Let the robot find and follow a walking person in the arena, steered by a people "
        "detector, behind a safety layer; ends with a score card.",
    )
    add_follower(parser)
    add_scenario(parser, 60.0, "simulated time (60)")
    add_json(parser, "the score card as JSON")
    instead = "follow on a ROS 2 robot instead (see `follow --ros2 --help`)"
    parser.add_argument("--ros2", action="store_true", help=instead)
    add_watching(parser)


def run(args: argparse.Namespace) -> int:
    """Run one episode and show its score card."""
    from limo_sim.run.episode import run_episode, score
    from limo_sim.view.tuning import Tunable
    from limo_sim.world.scenario import Scenario
    from limo_sim.world.variants import of_run

    if shown_unasked(args):
        args.view = HERE, 0
    scenario = of_run(Scenario.load(args.scenario, args.robot), args.seed)
    controller = Tunable(made_for(controller_named(args.controller, args.target, args.person), scenario.robot.geometry))
    args.detector = args.detector or detector_of(args.controller)
    detector = detector_named(args.detector)
    with observing(args, scenario, controller) as observers:
        with progress("s") as bar:
            task = bar.add_task("search", total=args.seconds)

            def watch(step: Step) -> None:
                bar.update(task, completed=round(step.log.time, 1), description=step.log.decision.mode.value)
                observers.notify(step)

            names = args.controller, args.detector
            episode = run_episode(scenario, controller, detector, args.seconds, args.seed, names=names, watch=watch)
        card = score(episode)
        observers.end(episode, card)
    finish(args, card)
    if args.json != STDOUT and not args.view and args.video is None:
        print(f"To see the robot follow: limo-hog follow --view, and http://{HERE}:{PORT}/ in a browser")
    return 0
