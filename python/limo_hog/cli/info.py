"""`limo-hog info`: what is installed here, and what the detector makes of it."""

from __future__ import annotations

import argparse
import os

from rich.console import Console
from rich.table import Table

from limo_hog.cli.support.environment import environment


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `info`."""
    subparsers.add_parser(
        "info", description="Show versions, CPU features, the chosen backend, and what OpenCV is installed."
    )


def run(args: argparse.Namespace) -> int:  # noqa: ARG001
    """Print the environment as a table."""
    facts = environment()
    opencv = f"{facts['opencv']} ({'with' if facts['opencv_has_hog'] else 'without'} HOGDescriptor)"
    features = facts["cpu_features"]
    forced = os.environ.get("LIMO_HOG_BACKEND")
    rows = {
        "limo-hog": facts["limo_hog"],
        "backend": f"{facts['backend']} (LIMO_HOG_BACKEND={forced})" if forced else facts["backend"],
        "CPU": facts["cpu"],
        "CPU features": ", ".join(features) if isinstance(features, list) and features else "none that count",
        "threads": f"{facts['threads']} of {facts['cores']} cores",
        "OpenCV": opencv if facts["opencv"] else "not installed: pip install 'limo-hog[cv]'",
        "numpy": facts["numpy"],
        "Python": f"{facts['python']} on {facts['platform']} ({facts['machine']})",
    }
    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    table.add_column(style="bold")
    table.add_column(overflow="fold")
    for name, value in rows.items():
        table.add_row(name, str(value))
    Console(highlight=False).print(table)
    return 0
