"""`--view` of the commands that have a live page: where it is served, and whether it opens by itself."""

from __future__ import annotations

import os
import sys
import webbrowser
from argparse import ArgumentParser, ArgumentTypeError, _ArgumentGroup

HERE, PORT = "127.0.0.1", 8488


def address(text: str) -> tuple[str, int] | tuple[()]:
    """Read [HOST:]PORT, or "off", which is ()."""
    if text == "off":
        return ()
    host, _, port = text.rpartition(":")
    if not port.isdecimal() or int(port) > 65535:
        raise ArgumentTypeError(f"{text!r} is no [HOST:]PORT such as {PORT} or 0.0.0.0:{PORT}")
    return host.strip("[]") or HERE, int(port)


def add_view(parser: ArgumentParser | _ArgumentGroup, about: str) -> None:
    """Add --view; `about` is its help."""
    parser.add_argument("--view", nargs="?", const=(HERE, PORT), type=address, metavar="[HOST:]PORT|off", help=about)


def has_display() -> bool:
    """Whether somebody sits at a terminal beside whom a browser's window can open."""
    graphical = sys.platform in ("darwin", "win32") or any(os.environ.get(n) for n in ("DISPLAY", "WAYLAND_DISPLAY"))
    return graphical and sys.stderr.isatty() and "SSH_CONNECTION" not in os.environ


def announce(url: str) -> None:
    """Say where the page is, and open it where there is a display."""
    print(f"watch the run at {url}", file=sys.stderr)
    if has_display():
        webbrowser.open(url)
