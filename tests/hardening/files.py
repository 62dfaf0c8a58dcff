"""Damaged files and messages: model files, scenarios, CDR. Each is read, or refused by a named error of one line.

`python -m tests.hardening.files models cdr scenarios --count 10000`; recordings are in tests/ros2/test_recordings.py.
"""

import random
import struct
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from tests.hardening.trials import main

import limo_hog
from limo_hog import HOGDescriptor
from limo_hog.exceptions import LimoHogError
from limo_hog.follow.robot import Twist
from limo_hog.follow.sense.observation import Odometry, Scan
from limo_hog.ros2 import messages
from limo_sim.world.scenario import Scenario

#: The longest that a file of some kilobytes may take [s of this process's time].
LATEST_S = 3.0
WORDS = [b"nan", b"1e999", b"-1", b"[", b"]", b"{", b"<", b">", b'"', b"'", b"\n", b"\0", b"&x;", b"9" * 40, b"&#0;"]
WORDS += [b"\xff", b"true", b"inf", b"[[", b"=", b"!!", b"*a", b"&a", b"<<:", b"-" * 9, b"\t", b"#"]


def damaged(data: bytes, draw: random.Random) -> bytes:
    """Flip, overwrite, cut, repeat or put words in, some times."""
    changed = bytearray(data)
    for _ in range(draw.choice((1, 1, 2, 6))):
        at = draw.randrange(len(changed) + 1)
        kind = draw.randrange(7)
        if kind == 0 and at < len(changed):
            changed[at] ^= 1 << draw.randrange(8)
        elif kind == 1:
            number = draw.choice((0, 1, 127, 2**31 - 1, 2**32 - 1, 2**63, 2**64 - 1))
            changed[at : at + 4] = struct.pack("<Q", number)[: draw.choice((1, 2, 4, 8))]
        elif kind == 2:
            del changed[at:]
        elif kind == 3:
            del changed[at : at + draw.randrange(1, 40)]
        elif kind == 4:
            changed[at:at] = changed[at : at + draw.randrange(1, 200)]
        else:
            changed[at:at] = draw.choice(WORDS)
    return bytes(changed)


def models(folder: Path) -> tuple[list[bytes], Callable[[bytes], None]]:
    hog: Any = HOGDescriptor((16, 24), (8, 8), (8, 8), (8, 8), 9)
    hog.setSVMDetector(np.random.default_rng(0).normal(0, 1, hog.getDescriptorSize() + 1).astype(np.float32))
    whole = []
    for suffix in (".xml", ".yml", ".json", ".xml.gz", ".yml.gz"):
        hog.save(folder / f"model{suffix}")
        whole.append((folder / f"model{suffix}").read_bytes())
    path, image = folder / "damaged", np.zeros((32, 32), np.uint8)

    def read(data: bytes) -> None:
        path.write_bytes(data)
        loaded: Any = HOGDescriptor()
        loaded.load(path)
        if max(loaded.winSize) < 200 and max(loaded.blockSize) < 200:
            loaded.detect(image)

    return whole, read


def scenarios(folder: Path) -> tuple[list[bytes], Callable[[bytes], None]]:
    import limo_sim

    path = folder / "damaged.toml"

    def read(data: bytes) -> None:
        path.write_bytes(data)
        Scenario.load(path)

    return [file.read_bytes() for file in sorted(Path(limo_sim.__file__).parent.glob("scenarios/*.toml"))], read


def cdr(_: Path) -> tuple[list[bytes], Callable[[bytes], None]]:
    """Messages as they come over the network, each with what is made of it here."""
    pixels = np.random.default_rng(0).integers(0, 256, (12, 16, 3), dtype=np.uint8)
    kinds: list[tuple[Any, Callable[[Any], Any]]] = [
        (messages.image(1.0, pixels), messages.pixels_of),
        (messages.image(1.0, np.ones((6, 8), np.float32)), messages.pixels_of),
        (messages.compressed_image(1.0, pixels), messages.decompressed),
        (messages.laser_scan(Scan(0.0, np.ones(40, np.float32), -2.0, 2.0, 0.1, 8.0)), messages.to_scan),
        (messages.odometry(Odometry(0.0, 1.0, 2.0, 0.5, 0.1, 0.2)), messages.to_odometry),
        (messages.twist(Twist(0.1, 0.2)), messages.to_twist),
        (messages.camera_info(1.0, 640, 480, 500.0), lambda message: message.k),
    ]
    # The first byte tells the kind; it is no part of the message.
    whole = [bytes([number]) + messages.serialize(message) for number, (message, _) in enumerate(kinds)]

    def read(data: bytes) -> None:
        message, use = kinds[data[0] % len(kinds)] if data else kinds[0]
        use(messages.deserialize(data[1:], message.__msgtype__))

    return whole, read


KINDS = {"models": models, "scenarios": scenarios, "cdr": cdr}


def run(kind: str, seeds: range, folder: Path) -> tuple[Counter[str], list[str]]:
    """Read one damaged file a seed; return how they ended, and the findings."""
    limo_hog.set_num_threads(1)
    whole, read = KINDS[kind](folder)
    ends: Counter[str] = Counter()
    findings = []
    for data in whole:
        read(data)
    for seed in seeds:
        draw = random.Random(seed)
        data = damaged(draw.choice(whole), draw)
        began = time.process_time()
        try:
            read(data)
            ends["read"] += 1
        except (LimoHogError, OSError, MemoryError) as error:
            ends[type(error).__name__] += 1
            if "\n" in str(error) or len(str(error)) > 800:
                findings.append(f"{kind}, seed {seed}: a long message: {str(error)[:200]!r}")
        except Exception as error:
            findings.append(f"{kind}, seed {seed}: {type(error).__name__}: {str(error)[:200]}")
        if time.process_time() - began > LATEST_S:
            findings.append(f"{kind}, seed {seed}: {time.process_time() - began:.1f} s")
    return ends, findings


if __name__ == "__main__":
    sys.exit(main(dict.fromkeys(KINDS, run), __doc__ or "", 10_000))
