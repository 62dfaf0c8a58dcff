"""Random calls of the public Python API, each made of its number alone: an answer or a named error is wanted.

`python -m tests.hardening.api --calls 10000000 --state FILE` goes on where FILE ends; `--only N` makes call N alone.
"""

import argparse
import faulthandler
import json
import resource
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from types import FrameType
from typing import Any

from tests.hardening.calls import call

#: Calls of one process: each costs a second to start.
BATCH = 100_000
#: A call that computes longer is a finding [s of this process's time].
LATEST = 30
#: Memory that a process may have [bytes]: larger wishes must end in a MemoryError.
MEMORY = 3_000_000_000


def batch(first: int, count: int) -> None:
    """Make calls `first` to `first + count - 1`; print of each how it ended, and what is wrong with it."""

    def late(_signal: int, _frame: FrameType | None) -> None:
        raise RuntimeError(f"longer than {LATEST} s")

    signal.signal(signal.SIGPROF, late)
    for number in range(first, first + count):
        signal.setitimer(signal.ITIMER_PROF, LATEST)
        end = wrong = ""
        try:
            end = call(number)
        except Exception as error:
            wrong = f"{type(error).__name__}: {' '.join(str(error).split())[:300]}"
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0)
        print(json.dumps([end, wrong]), flush=True)


def in_a_process(first: int, count: int) -> list[list[str]]:
    """Make a batch in a process of its own: what it printed, and as the last call's what is wrong where it died."""
    command = [sys.executable, "-m", "tests.hardening.api", "--batch", str(first), str(count)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=7200, check=False)
    answers = [json.loads(line) for line in done.stdout.splitlines()]
    if done.returncode:
        told = " ".join(done.stderr.split())[-300:]
        answers.append(["", f"the process ended with status {done.returncode}: {told}"])
    return answers


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--calls", type=lambda text: int(float(text)), default=200_000)
    parser.add_argument("--first", type=int, default=0, help="number of the first call")
    parser.add_argument("--state", type=Path, help="where counts and findings are kept")
    parser.add_argument("--only", type=int, help="make this call alone, in this process")
    parser.add_argument("--batch", type=int, nargs=2, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.only is not None:
        print(call(args.only) or "answered")
        return 0
    if args.batch:
        faulthandler.enable()
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        batch(*args.batch)
        return 0
    state: dict[str, Any] = {"next": args.first, "ends": {}, "findings": [], "seconds": 0.0}
    if args.state and args.state.exists():
        state = json.loads(args.state.read_text())
    last = args.first + args.calls
    while state["next"] < last:
        began, first = time.monotonic(), state["next"]
        answers = in_a_process(first, min(BATCH, last - first))
        state["next"] += len(answers)
        state["ends"] = Counter(state["ends"]) + Counter(end for end, wrong in answers if not wrong)
        state["findings"] += [f"call {number}: {wrong}" for number, (_, wrong) in enumerate(answers, first) if wrong]
        state["seconds"] += time.monotonic() - began
        if args.state:
            args.state.write_text(json.dumps(state, indent=1))
    made = state["next"] - args.first
    print(f"{made} calls in {state['seconds']:.0f} s: {dict(state['ends'])}; {len(state['findings'])} findings")
    print(*state["findings"][:20], sep="\n")
    return 1 if state["findings"] else 0


if __name__ == "__main__":
    sys.exit(main())
