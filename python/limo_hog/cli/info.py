"""`limo-hog info`: versions, CPU features, backend, OpenCV and extras."""

from __future__ import annotations

import argparse
import os
from collections.abc import Mapping

from rich.table import Table
from rich.text import Text

from limo_hog.cli.support.console import console
from limo_hog.cli.support.environment import environment, extras


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `info`."""
    subparsers.add_parser(
        "info", description="Show versions, CPU features, the chosen backend, what OpenCV is installed, and the extras."
    )


def run(args: argparse.Namespace) -> int:  # noqa: ARG001
    """Print the environment and the extras as tables."""
    facts = environment()
    opencv = f"{facts['opencv']} ({'with' if facts['opencv_has_hog'] else 'without'} HOGDescriptor)"
    features = facts["cpu_features"]
    forced = os.environ.get("LIMO_HOG_BACKEND")
    rows = {
        "limo-hog": facts["limo_hog"],
        "backend": f"{facts['backend']} (LIMO_HOG_BACKEND={forced})" if forced else facts["backend"],
        "CPU": facts["cpu"],
        "CPU features": ", ".join(features) if isinstance(features, list) and features else "none with kernels",
        "threads": f"{facts['threads']} of {facts['cores']} cores",
        "OpenCV": opencv if facts["opencv"] else "not installed",
        "numpy": facts["numpy"],
        "Python": f"{facts['python']} on {facts['platform']} ({facts['machine']})",
    }
    screen = console()
    screen.print(_table(rows))
    screen.print("\n[bold]extras[/]")
    screen.print(_table(extras()))
    return 0


def _table(rows: Mapping[str, object]) -> Table:
    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    table.add_column(style="bold")
    table.add_column(overflow="fold")
    for name, value in rows.items():
        # As text: rich would take the [cv] of an install line for a style.
        table.add_row(name, Text(str(value)))
    return table
