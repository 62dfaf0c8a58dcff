"""`limo-hog arena`: the arena alone, in real time, for nodes to drive."""

from __future__ import annotations

import argparse
import math
import sys
from typing import TYPE_CHECKING

from limo_hog.cli.support.arguments import add_ros_arguments, node_of
from limo_hog.cli.support.output import UsageError
from limo_sim.cli.watching import add_scenario, add_watching, observing

if TYPE_CHECKING:
    from limo_hog.ros2.dds import Bus


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `arena`."""
    parser = subparsers.add_parser(
        "arena",
        description="Run the arena in real time, until Ctrl-C. With --ros2 its sensors are ROS 2 topics, and "
        "every publisher of /cmd_vel drives the robot: Humble, Jazzy, or limo-hog follow --ros2.",
    )
    topics = "publish and subscribe to ROS 2 topics over DDS, on this machine alone"
    parser.add_argument("--ros2", action="store_true", help=topics)
    add_scenario(parser, math.inf, "simulated time after which to stop (never)")
    add_watching(parser, plot=False)
    add_ros_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Run the arena."""
    if not args.ros2 and not any((args.view, args.video, args.record)):
        raise UsageError("an arena without any output: give --ros2, --view, --video or --record")
    if args.plot:
        raise UsageError(f"--plot {args.plot}: an arena has no run to draw; use it with follow or run")
    from limo_sim.ros.live import run_live, second_publishers
    from limo_sim.world.scenario import Scenario

    scenario = Scenario.load(args.scenario, args.robot)
    bus: Bus | None = None
    if args.ros2:
        from limo_hog.ros2.dds import Bus

        bus = Bus(node_of(args, "limo_hog_arena"))
        for topic in second_publishers(bus):
            print(f"{topic} has another publisher, a robot or a second arena: nodes will hear both", file=sys.stderr)
        print(f"arena {scenario.name!r} is in {bus.network}; Ctrl-C ends it", file=sys.stderr)
    with observing(args, scenario) as observers:
        arena = run_live(scenario, args.seed, args.seconds, bus, observers.notify if observers else None)
    contacts = arena.contacts
    print(
        f"{arena.time:.1f} s; contacts: person {contacts.person}, wall {contacts.wall}; "
        f"watchdog stops {arena.watchdog_stops}; commands refused {arena.rejected_commands}",
        file=sys.stderr,
    )
    return 0
