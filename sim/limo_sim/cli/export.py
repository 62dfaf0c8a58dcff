"""`limo-hog export`: labelled pictures of a run in the arena."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from limo_hog.cli.support.arguments import add_follower
from limo_hog.cli.support.progress import progress
from limo_hog.cli.support.results import refuse_to_overwrite
from limo_hog.cli.support.signals import held
from limo_hog.follow.control.naming import controller_named
from limo_hog.follow.sense.detectors import detector_named
from limo_sim.cli.options import add_scenario

if TYPE_CHECKING:
    from limo_sim.run.episode import Moment


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `export`."""
    parser = subparsers.add_parser(
        "export",
        description="Write the frames of a run in the arena as labelled pictures: colour, depth [mm], and the boxes "
        "and identities of people and furniture, in COCO's JSON, which `limo-hog train` and `evaluate` read.",
    )
    add_follower(parser)
    add_scenario(parser, 60.0, "simulated time (60)")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder to write to")
    parser.add_argument("--format", choices=("coco",), default="coco", help="of the labels (%(default)s)")
    parser.add_argument("--overwrite", action="store_true", help="replace an earlier export")


def run(args: argparse.Namespace) -> int:
    """Run one episode and write its frames."""
    from limo_sim.run.catalogue import load
    from limo_sim.run.episode import run_episode
    from limo_sim.view.labels import ANNOTATIONS, labelled
    from limo_sim.world.variants import of_run

    if not args.overwrite:
        refuse_to_overwrite([args.out / ANNOTATIONS])
    scenario = of_run(load(args.scenario), args.seed)
    controller, detector = controller_named(args.controller, args.target), detector_named(args.detector)
    with labelled(args.out, scenario) as keep, progress("s") as bar:
        task = bar.add_task("draw", total=args.seconds)

        def watch(moment: Moment) -> None:
            bar.update(task, completed=round(moment.step.time, 1))
            with held():
                keep(moment)

        run_episode(
            scenario,
            controller,
            detector,
            args.seconds,
            args.seed,
            names=(args.controller, args.detector),
            watch=watch,
        )
    return 0
