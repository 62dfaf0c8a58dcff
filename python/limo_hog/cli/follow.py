"""`limo-hog follow`: the workshop in closed loop, and its score card."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from limo_hog.cli.arguments import number
from limo_hog.cli.output import STDOUT, write_json
from limo_hog.cli.progress import progress
from limo_hog.cli.watching import add_watching, watching
from limo_hog.extras import needed
from limo_hog.follow.detectors import NAMES, detector_named
from limo_hog.follow.naming import CONTROLLERS, controller_named

if TYPE_CHECKING:
    from limo_sim.episode import Moment


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `follow`."""
    parser = subparsers.add_parser(
        "follow",
        description="Let the robot find and follow a walking person in the arena, steered by a people "
        "detector, behind a safety layer; ends with a score card.",
    )
    parser.add_argument("--controller", choices=CONTROLLERS, default="tracking", help="who steers (%(default)s)")
    parser.add_argument("--target", type=metres, metavar="M", help="distance to hold [m], not for approach (1.5)")
    parser.add_argument("--scenario", default="workshop", metavar="NAME|FILE.toml", help="what happens (%(default)s)")
    parser.add_argument("--seconds", type=seconds, default=60.0, metavar="S", help="simulated time (60)")
    parser.add_argument("--seed", type=seed, default=0, metavar="N", help="of all random numbers (%(default)s)")
    parser.add_argument(
        "--detector",
        default="hog",
        metavar="|".join((*NAMES, "onnx:FILE")),
        help="who finds people: ours, ours on the half image, OpenCV's, or a network (%(default)s)",
    )
    parser.add_argument("--json", metavar="FILE", help="write the score card as JSON; - is standard output")
    parser.add_argument(
        "--ros2", action="store_true", help="follow on a ROS 2 robot, or `limo-hog arena --ros2`, in place of the arena"
    )
    add_watching(parser)


def metres(text: str) -> float:
    """Read a distance [m]."""
    return number(text, 0.1, 8.0, "distance in metres")


def seconds(text: str) -> float:
    """Read a duration [s]."""
    return number(text, 0.1, 86400.0, "duration in seconds")


def seed(text: str) -> int:
    """Read a seed."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r} is no seed; wanted is a whole number from 0 on")
    return int(text)


def run(args: argparse.Namespace) -> int:
    """Run one episode and show how it went."""
    if args.ros2:
        from limo_hog.cli.drive import drive

        return drive(args)
    with needed(by="limo-hog follow", what="the simulator", install="limo-sim"):
        from limo_sim.episode import run_episode
        from limo_sim.scenario import Scenario
        from limo_sim.score import score
        from limo_sim.view.tuning import Tunable
    scenario = Scenario.load(args.scenario)
    controller = Tunable(controller_named(args.controller, args.target))
    detector = detector_named(args.detector)
    with watching(args, scenario, controller) as audience:
        with progress("s") as bar:
            task = bar.add_task("search", total=args.seconds)

            def watch(moment: Moment) -> None:
                bar.update(task, completed=round(moment.step.time, 1), description=moment.step.mode.value)
                audience.watch(moment)

            episode = run_episode(
                scenario,
                controller,
                detector,
                args.seconds,
                args.seed,
                names=(args.controller, args.detector),
                watch=watch,
            )
        card = score(episode)
        audience.end(episode, card)
    if args.json:
        write_json(args.json, card.to_json())
    if args.json != STDOUT:
        from limo_hog.cli.card import show

        show(card)
    return 0
