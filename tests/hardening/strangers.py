"""Bad inputs by the thousand, and kills at random times: `limo-hog` answers each by a line, and leaves nothing behind.

`python -m tests.hardening.strangers names pictures films labels models scenarios recordings kills --count 1000`.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from tests.cli.material import PICTURE, film_of
from tests.hardening.files import damaged

from limo_hog import HOGDescriptor
from limo_hog.imaging.writing import write_image

#: How long a command may take for one bad input [s], and what it started may run on after a kill [s].
LATEST_S, RUNS_ON_S = 60.0, 2.0
#: Bad inputs that a command takes at once, where it takes several.
AT_ONCE = 50
LIMO_HOG = [sys.executable, "-m", "limo_hog"]


def _bad_name(draw: random.Random) -> bytes:
    letters = bytes(one for one in range(1, 256) if one != ord("/"))
    return bytes(draw.choice(letters) for _ in range(draw.choice((1, 3, 20, 200))))


def _inputs(kind: str, folder: Path) -> tuple[list[bytes], str, Callable[[Path], list[str]]]:
    """Whole files of a kind, their suffix, and the command that reads one."""
    if kind == "models":
        hog = HOGDescriptor()
        hog.setSVMDetector(hog.getDefaultPeopleDetector())
        hog.save(folder / "m.yml")
        return [(folder / "m.yml").read_bytes()], ".yml", lambda path: ["detect", "a.png", "--model", str(path)]
    if kind == "scenarios":
        import limo_sim

        whole = [file.read_bytes() for file in sorted(Path(limo_sim.__file__).parent.glob("scenarios/*.toml"))]
        return whole, ".toml", lambda path: ["follow", "--scenario", str(path), "--seconds", "0.1"]
    if kind == "labels":
        image = {"id": 1, "file_name": "a.png", "width": 192, "height": 256}
        one = {"id": 1, "image_id": 1, "category_id": 1, "bbox": [20, 20, 50, 120], "area": 6000, "iscrowd": 0}
        coco = {"images": [image], "annotations": [one], "categories": [{"id": 1, "name": "person"}]}
        return [json.dumps(coco).encode()], ".json", lambda path: ["evaluate", "opencv", str(path)]
    if kind == "recordings":
        made = ["follow", "--seconds", "0.3", "--record", str(folder / "r.mcap")]
        subprocess.run([*LIMO_HOG, *made], check=True, capture_output=True)
        return [(folder / "r.mcap").read_bytes()], ".mcap", lambda path: ["replay", str(path)]
    raise ValueError(kind)


def _answer(arguments: list[str], folder: Path) -> tuple[int, str]:
    done = subprocess.run([*LIMO_HOG, *arguments], check=False, capture_output=True, cwd=folder, timeout=LATEST_S)
    return done.returncode, done.stderr.decode(errors="replace")


def _finding(code: int, told: str) -> str:
    """What is wrong with an answer; nothing where it is a card or lines of ours."""
    if code not in (0, 1, 2):
        return f"ended with {code}: {told[-200:]}"
    if "Traceback" in told or any(not one.isprintable() and one != "\n" for one in told):
        return f"a traceback or control characters: {told[-200:]!r}"
    return "" if code == 0 or "limo-hog: " in told or "error: " in told else f"{code} without a line: {told[-200:]}"


def many(kind: str, count: int, folder: Path) -> tuple[Counter[str], list[str]]:
    """Names, pictures and films, `AT_ONCE` in a folder with a good picture, which must be done."""
    ends: Counter[str] = Counter()
    findings = []
    write_image(folder / "good.png", PICTURE)
    film_of(folder / "good.mp4", 4)
    whole = [(folder / "good.mp4").read_bytes()] if kind == "films" else [(folder / "good.png").read_bytes()]
    suffix = b".mp4" if kind == "films" else b".png"
    for first in range(0, count, AT_ONCE):
        place = folder / f"{kind}{first}"
        place.mkdir()
        write_image(place / "good.png", PICTURE)
        bad = min(AT_ONCE, count - first)
        for number in range(first, first + bad):
            draw = random.Random(number)
            name = os.fsencode(place) + b"/" + (_bad_name(draw) if kind == "names" else b"%d" % number) + suffix
            with open(name, "wb") as file:  # noqa: PTH123 - a name of bytes
                file.write(whole[0] if kind == "names" else damaged(whole[0], draw))
        code, told = _answer(["detect", str(place), "--json", "found", "--overwrite"], folder)
        lines = [json.loads(line) for line in (folder / "found").read_text().splitlines()]
        named = told.count("limo-hog: ")  # libpng writes into our lines
        sources = {line["source"] for line in lines}
        files = len(list(place.iterdir()))
        if problem := _finding(code, told):
            findings.append(f"{kind} {first}: {problem}")
        if str(place / "good.png") not in sources or len(sources) + named < files or (code == 1) != (named > 0):
            findings.append(f"{kind} {first}: {len(sources)} done, {named} named of {files}, code {code}")
        ends["done"] += len(sources) - 1
        ends["named"] += named
    return ends, findings


def single(kind: str, count: int, folder: Path) -> tuple[Counter[str], list[str]]:
    """Labels, models, scenarios and recordings, one a command."""
    write_image(folder / "a.png", PICTURE)
    whole, suffix, command = _inputs(kind, folder)
    ends: Counter[str] = Counter()
    findings = []
    path = folder / f"bad{suffix}"
    path.write_bytes(whole[0])
    if (answer := _answer(command(path), folder))[0]:
        raise RuntimeError(f"a whole file is refused, so that nothing is tried: {answer}")
    for number in range(count):
        draw = random.Random(number)
        path.write_bytes(damaged(draw.choice(whole), draw))
        try:
            code, told = _answer(command(path), folder)
        except subprocess.TimeoutExpired:
            code, told = -1, "no end"
        ends[str(code)] += 1
        if problem := _finding(code, told):
            findings.append(f"{kind} {number}: {problem}")
    return ends, findings


def _processes(group: int) -> set[int]:
    found = set()
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            words = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(words[2]) == group and words[0] != "Z":
            found.add(int(stat.parent.name))
    return found


def kills(count: int, folder: Path) -> tuple[Counter[str], list[str]]:
    """Long commands, killed at a random time, alone or with their group: none runs on, no broken file has its name."""
    for number in range(60):
        write_image(folder / "in" / f"{number:02d}.png", PICTURE)
    commands = (
        ["detect", "in", "--json", "out.json", "--csv", "out.csv", "--out", "copies", "--overwrite", "--threads", "1"],
        ["follow", "--seconds", "600", "--json", "out.json", "--video", "out.mp4"],
        ["score", "--scenario", "empty", "--seeds", "50", "--workers", "2", "--json", "out.json"],
        ["export", "--out", "copies", "--frames", "500"],
    )
    ends: Counter[str] = Counter()
    findings = []
    for number in range(count):
        draw = random.Random(number)
        command, sent = (
            draw.choice(commands),
            draw.choice((signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP)),
        )
        place = folder / str(number)
        place.mkdir()
        (place / "in").symlink_to(folder / "in")
        child = subprocess.Popen(
            [*LIMO_HOG, *command],
            cwd=place,
            stderr=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            start_new_session=True,
        )
        time.sleep(draw.uniform(0.2, 5.0))
        (os.killpg if draw.random() < 0.5 else os.kill)(child.pid, sent)
        began = time.monotonic()
        while _processes(child.pid) - {child.pid} or child.poll() is None:
            if time.monotonic() - began > RUNS_ON_S:
                findings.append(f"kill {number}: {command[0]}, {sent.name}: runs on after {RUNS_ON_S} s")
                os.killpg(child.pid, signal.SIGKILL)
                break
            time.sleep(0.02)
        ends[f"{command[0]} {sent.name}"] += 1
        ends[f"slowest {time.monotonic() - began:.1f} s"] += 0
        child.wait()
        written = [path for path in place.glob("out.*") if path.suffix != ".json" or not _is_json(path)]
        broken = [path.name for path in written if path.suffix == ".json" or not path.stat().st_size]
        findings += [f"kill {number}: {name} of {command[0]} is broken" for name in broken]
        if command[0] == "detect" and child.returncode:
            code, told = _answer([*(word for word in command if word != "--overwrite"), "--resume"], place)
            lines = (place / "out.json").read_text().splitlines() if not code else []
            if code or len({json.loads(line)["source"] for line in lines}) != 60:
                findings.append(f"kill {number}: --resume ended with {code}, {len(lines)} of 60: {told[-200:]}")
    return ends, findings


def _is_json(path: Path) -> bool:
    try:
        json.loads(path.read_text())
    except ValueError:
        return all(map(_is_line, path.read_text().splitlines()))
    return True


def _is_line(line: str) -> bool:
    try:
        return isinstance(json.loads(line), dict)
    except ValueError:
        return False


KINDS = ("names", "pictures", "films", "labels", "models", "scenarios", "recordings", "kills")


def run(kind: str, count: int, folder: Path) -> tuple[Counter[str], list[str]]:
    """Try `count` inputs or kills of a kind; returns how they ended, and the findings."""
    if kind == "kills":
        return kills(count, folder)
    return (many if kind in ("names", "pictures", "films") else single)(kind, count, folder)


def main() -> int:
    """Run from the command line; 1 where something was found."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("kinds", nargs="+", choices=KINDS)
    parser.add_argument("--count", type=int, default=1000)
    args = parser.parse_args()
    wrong = False
    for kind in args.kinds:
        with tempfile.TemporaryDirectory() as folder:
            ends, findings = run(kind, args.count, Path(folder))
        wrong |= bool(findings)
        print(f"{kind}: {args.count} tried, {len(findings)} findings; {dict(ends)}", flush=True)
        print(*findings[:10], sep="\n", flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
