"""The options of every command that runs a scenario."""

from __future__ import annotations

from argparse import ArgumentParser

from limo_hog.cli.support.arguments import seconds, seed


def add_scenario(parser: ArgumentParser, default_seconds: float | None, seconds_help: str, more: str = "") -> None:
    """Add --scenario, --seconds and --seed."""
    parser.add_argument(
        "--scenario", default="workshop", metavar="NAME|FILE.toml", help=f"the scenario to run{more} (%(default)s)"
    )
    parser.add_argument("--seconds", type=seconds, default=default_seconds, metavar="S", help=seconds_help)
    parser.add_argument("--seed", type=seed, default=0, metavar="N", help="of all random numbers (%(default)s)")
