"""The command line of trials: each has a folder of its own, and tells how its attempts ended and what it found."""

import argparse
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path

#: Is given the trial's name, its attempts' numbers, and its folder; returns how these ended, and what was found.
Trial = Callable[[str, range, Path], tuple[Counter[str], list[str]]]


def main(trials: Mapping[str, Trial], about: str, count: int) -> int:
    """Run the trials that the command line names; return 1 where something was found."""
    parser = argparse.ArgumentParser(description=about.splitlines()[0])
    parser.add_argument("trials", nargs="+", choices=trials)
    parser.add_argument("--count", type=lambda text: int(float(text)), default=count)
    parser.add_argument("--first", type=int, default=0, help="number of the first attempt")
    args = parser.parse_args()
    wrong = False
    for name in args.trials:
        began = time.monotonic()
        with tempfile.TemporaryDirectory() as folder:
            ends, findings = trials[name](name, range(args.first, args.first + args.count), Path(folder))
        wrong |= bool(findings)
        taken = time.monotonic() - began
        print(f"{name}: {args.count} in {taken:.0f} s, {len(findings)} findings; {dict(ends)}", flush=True)
        print(*findings, sep="\n", flush=True)
    return 1 if wrong else 0
