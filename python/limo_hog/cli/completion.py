"""`limo-hog completion`: what a shell needs to complete commands and options."""

from __future__ import annotations

import argparse

#: The shells that shtab writes for.
SHELLS = ("bash", "zsh", "tcsh")


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `completion`."""
    parser = subparsers.add_parser(
        "completion",
        description="Print the completion of commands, options and their values. For bash: limo-hog completion bash > "
        "~/.local/share/bash-completion/completions/limo-hog",
    )
    parser.add_argument("shell", choices=SHELLS)


def run(args: argparse.Namespace) -> int:
    """Print the shell's script."""
    import shtab

    from limo_hog.cli.main import whole_parser

    print(shtab.complete(whole_parser(), args.shell))
    return 0
