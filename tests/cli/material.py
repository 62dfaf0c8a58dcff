"""Pictures and films for `detect`, and its JSON lines read back."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import av
import numpy as np

from limo_hog.cli.support.scene import street
from limo_hog.imaging.writing import video_writer

PICTURE = street(192, 256, 3)
LIMO_HOG = Path(sys.executable).with_name("limo-hog")
#: With these `detect` gives OpenCV's rectangles.
OPENCVS = ("--model", "opencv", "--min-height", "none", "--nms", "group")


def film_of(path: Path, frames: int = 12) -> None:
    with video_writer(path, fps=10) as write:
        for i in range(frames):
            write(np.ascontiguousarray(np.roll(PICTURE, 4 * i, axis=1)))


def frames_of(path: Path) -> int:
    with av.open(path) as container:
        return len(list(container.decode(video=0)))


def lines_of(text: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in text.splitlines()]


#: Runs the command line with files that may not grow beyond so many bytes: a full disk, without one.
_FULL_DISK = """
import resource, sys
from limo_hog.cli.main import main
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), resource.RLIM_INFINITY))
sys.exit(main(sys.argv[2:]))
"""


def on_a_full_disk(room: int, *typed: str) -> subprocess.CompletedProcess[str]:
    """Run a command where a file has room for so many bytes."""
    command = [sys.executable, "-c", _FULL_DISK, str(room), *typed]
    return subprocess.run(command, check=False, capture_output=True, text=True, timeout=120)
