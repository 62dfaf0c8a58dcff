"""Programs run in a process of their own: what hangs or dies there fails one test, not the run."""

import resource
import subprocess
import sys
import textwrap

#: What every program begins with.
PRELUDE = """
import faulthandler, os, signal, sys, threading, time
import numpy as np
import limo_hog
from limo_hog import _core

def people(width, height, channels=3, seed=0):
    noise = np.random.default_rng(seed).integers(0, 255, (height, width, channels), np.uint8)
    return np.ascontiguousarray(noise if channels > 1 else noise[:, :, 0])

def armed():
    hog = limo_hog.HOGDescriptor()
    hog.setSVMDetector(hog.getDefaultPeopleDetector())
    return hog

def fine():
    # Cells of 4 px in blocks of 32 px are left to the exact path, which holds the blocks of a whole level.
    hog = limo_hog.HOGDescriptor((64, 128), (32, 32), (8, 8), (4, 4), 9)
    hog.setSVMDetector(np.ones(hog.getDescriptorSize() + 1, np.float32))
    return hog
"""


def run(program: str, timeout: float, limits: dict[int, int] | None = None) -> subprocess.CompletedProcess[str]:
    """Run a program after `PRELUDE`, killed after `timeout` [s], under resource limits (RLIMIT_*: value)."""

    def limit() -> None:
        for kind, value in (limits or {}).items():
            resource.setrlimit(kind, (value, value))

    command = [sys.executable, "-c", PRELUDE + textwrap.dedent(program)]
    return subprocess.run(command, capture_output=True, text=True, timeout=timeout, preexec_fn=limit, check=False)
