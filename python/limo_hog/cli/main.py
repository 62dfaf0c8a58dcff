"""Routes `limo-hog COMMAND` to the command's module."""

from __future__ import annotations


def main() -> int:
    """Run the command line and return its exit code."""
    raise NotImplementedError
