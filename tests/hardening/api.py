"""Random calls of the public Python API, each made of its number alone: an answer or a named error is wanted.

`python -m tests.hardening.api --calls 10000000 --state FILE` makes the calls in processes of 100,000 each and writes
what it found to FILE; started again, it goes on where it stopped. `--only N` makes call N alone, here.

`tests/parity/test_sweep.py` puts calls with ordinary arguments to OpenCV, too.
"""

from __future__ import annotations

import argparse
import faulthandler
import json
import mmap
import resource
import signal
import struct
import subprocess
import sys
import tempfile
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


def batch(first: int, count: int, here: mmap.mmap) -> dict[str, Any]:
    """Make calls `first` to `first + count - 1`."""

    def late(_signal: int, _frame: FrameType | None) -> None:
        raise RuntimeError(f"longer than {LATEST} s")

    signal.signal(signal.SIGPROF, late)
    ends: Counter[str] = Counter()
    findings: list[str] = []
    for number in range(first, first + count):
        here[:8] = struct.pack("<q", number)
        signal.setitimer(signal.ITIMER_PROF, LATEST)
        try:
            ends[call(number)] += 1
        except Exception as error:
            told = " ".join(str(error).split())[:300]
            findings.append(f"call {number}: {type(error).__name__}: {told}")
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0)
    return {"ends": ends, "findings": findings}


def in_a_process(first: int, count: int) -> dict[str, Any]:
    """Make a batch in a process of its own; where it dies, the call is a finding and the rest follows."""
    with tempfile.TemporaryFile() as marks:
        marks.truncate(8)
        command = [sys.executable, "-m", "tests.hardening.api", "--batch", str(first), str(count)]
        done = subprocess.run(
            [*command, "--marks", str(marks.fileno())],
            capture_output=True,
            text=True,
            pass_fds=[marks.fileno()],
            timeout=7200,
            check=False,
        )
        if done.returncode == 0:
            answer: dict[str, Any] = json.loads(done.stdout)
            return answer
        marks.seek(0)
        (last,) = struct.unpack("<q", marks.read(8))
    told = " ".join(done.stderr.split())[-300:]
    findings = [f"call {last}: the process ended with status {done.returncode}: {told}"]
    before = in_a_process(first, last - first) if last > first else {"ends": {}, "findings": []}
    left = first + count - last - 1
    after = in_a_process(last + 1, left) if left else {"ends": {}, "findings": []}
    ends = Counter(before["ends"]) + Counter(after["ends"])
    return {"ends": ends, "findings": [*before["findings"], *findings, *after["findings"]]}


def main() -> int:
    """Run from the command line; 1 where something was found."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--calls", type=lambda text: int(float(text)), default=200_000)
    parser.add_argument("--first", type=int, default=0, help="number of the first call")
    parser.add_argument("--state", type=Path, help="where counts and findings are kept")
    parser.add_argument("--only", type=int, help="make this call alone, in this process")
    parser.add_argument("--batch", type=int, nargs=2, help=argparse.SUPPRESS)
    parser.add_argument("--marks", type=int, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.only is not None:
        print(call(args.only) or "answered")
        return 0
    if args.batch:
        faulthandler.enable()
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        here = mmap.mmap(args.marks, 8)
        json.dump(batch(args.batch[0], args.batch[1], here), sys.stdout)
        return 0
    state: dict[str, Any] = {"next": args.first, "ends": {}, "findings": [], "seconds": 0.0}
    if args.state and args.state.exists():
        state = json.loads(args.state.read_text())
    last = args.first + args.calls
    while state["next"] < last:
        began, count = time.monotonic(), min(BATCH, last - state["next"])
        found = in_a_process(state["next"], count)
        state["next"] += count
        state["ends"] = Counter(state["ends"]) + Counter(found["ends"])
        state["findings"] += found["findings"]
        state["seconds"] += time.monotonic() - began
        if args.state:
            args.state.write_text(json.dumps(state, indent=1))
    made = state["next"] - args.first
    print(f"{made} calls in {state['seconds']:.0f} s: {dict(state['ends'])}; {len(state['findings'])} findings")
    print(*state["findings"][:20], sep="\n")
    return 1 if state["findings"] else 0


if __name__ == "__main__":
    sys.exit(main())
