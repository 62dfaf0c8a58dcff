"""Every command with closed descriptors, lost readers and an ASCII terminal; long commands killed at random times.

`python -m tests.hardening.processes terminals kills --count 200`. After a kill `--resume` completes the work.
"""

import csv
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path

import cv2
from tests.cli.material import PICTURE, film_of, frames_of
from tests.hardening.trials import main
from tests.learn import bollards

from limo_hog import HOGDescriptor
from limo_hog.imaging.writing import write_image
from limo_hog.ros2.bag import read_bag

LIMO_HOG = [sys.executable, "-m", "limo_hog"]
#: How long a command may take [s], and what it started may run on after a kill [s].
LATEST_S, RUNS_ON_S = 240, 2.0
#: Pictures of the folder `in`, and of a long `export`.
PICTURES, EXPORTED = 60, 40
#: A variable that all processes of one command have.
MARK = "LIMO_HOG_HARDENING"

#: Each command, as it is tried in every terminal.
SHORT = (
    "info",
    "completion bash",
    "detect few",
    "detect few --json found.json --csv found.csv --coco coco.json --out copies",
    "detect film.mp4 --json - --out copies",
    "train bollards --out m.yml --rounds 1",
    "evaluate opencv bollards --json figures.json --report page",
    "bench --size 160x240 --threads 1 --channels gray --json bench.json",
    "replay short.mcap --json replayed.json --video replayed.mp4",
    "topic list",
    "topic info /nothing",
    "follow --seconds 0.5 --json card.json --record r.mcap --plot p.png --video v.mp4",
    "follow --ros2 --seconds 1 --json lines.json",
    "arena --seconds 1 --record r.mcap --video v.mp4",
    "arena --ros2 --seconds 1",
    "run node.py --seconds 1 --json card.json --plot p.png",
    "workshop new follower.py",
    "workshop solution --sequel -",
    "workshop check node.py --json check.json --html check.html --gradescope results.json",
    "workshop grade class --csv points.csv",
    "score --scenario empty --seeds 2 --seconds 1 --controller approach --json s.json --csv s.csv --plot s.png",
    "export --frames 3 --out yard --depth",
    "follow --scenario no_such",
)
#: Those that ask for a robot at work, which is `arena --ros2`.
AT_A_ROBOT = (
    "topic list",
    "topic hz /scan --seconds 2",
    "topic echo /odom --once",
    "topic echo /odom --seconds 2",
    "follow --ros2 --seconds 3 --json lines.json",
)
TERMINALS = (">&-", "2>&-", "<&-", ">&- 2>&-", "| head -1", "ascii")
ASCII = {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}
#: Long commands, to be killed.
LONG = (
    "detect in --json found.json --csv found.csv --coco coco.json --out copies --threads 1",
    "detect film.mp4 --json found.json --out copies --threads 1",
    "train bollards --out m.yml --rounds 8",
    "evaluate opencv bollards --json figures.json --report page",
    "bench --json bench.json",
    "replay short.mcap --json replayed.json --video replayed.mp4",
    "follow --seconds 600 --json card.json --record r.mcap --video v.mp4 --plot p.png",
    "follow --ros2 --json lines.json",
    "arena --record r.mcap --video v.mp4",
    "run node.py --seconds 600 --json card.json --video v.mp4",
    "workshop check node.py --json check.json --html check.html",
    "workshop grade class --csv points.csv",
    "score --scenario empty --seeds 50 --workers 2 --json s.json --csv s.csv --plot s.png",
    f"export --frames {EXPORTED} --every 0.2 --out yard",
)


def material(folder: Path) -> None:
    for number in range(PICTURES):
        write_image(folder / "in" / f"{number:02d}.png", PICTURE)
    for name in ("a", "café"):
        write_image(folder / "few" / f"{name}.png", PICTURE)
    film_of(folder / "film.mp4", 100)
    bollards.write(folder / "bollards", pictures=24, seed=0)
    for typed in ("workshop solution node.py", "follow --seconds 2 --record short.mcap"):
        subprocess.run([*LIMO_HOG, *typed.split()], check=True, capture_output=True, cwd=folder)
    (folder / "class").mkdir()
    for name in ("amy", "bob"):
        shutil.copy(folder / "node.py", folder / "class" / f"{name}.py")


def _place(folder: Path, name: str) -> Path:
    """Make a folder in which a command finds the material, and what it writes is alone."""
    place = folder / "places" / name
    place.mkdir(parents=True)
    for file in folder.iterdir():
        if file.name != "places":
            (place / file.name).symlink_to(file)
    return place


def _written(place: Path) -> dict[str, Path]:
    files = (path for path in place.rglob("[!.]*") if path.is_file() and not path.is_symlink())
    return {str(path.relative_to(place)): path for path in files}


def _json_or_lines(path: Path) -> bool:
    text = path.read_text()
    with suppress(ValueError):
        json.loads(text)
        return True
    return [*map(json.loads, text.splitlines())] == [] or text.endswith("\n")


def _table(path: Path) -> bool:
    rows = csv.reader(path.read_text().splitlines())
    return path.read_text().endswith("\n") and len({len(row) for row in rows}) == 1


#: How a file that a command has written is told to be whole, by its suffix.
WHOLE: dict[str, Callable[[Path], object]] = {
    **dict.fromkeys((".json", ".jsonl"), _json_or_lines),
    **dict.fromkeys((".html", ".py"), lambda path: path.read_text().strip()),
    ".csv": _table,
    ".mp4": frames_of,
    ".mcap": lambda path: sum(1 for _ in read_bag(path)),
    ".yml": lambda path: HOGDescriptor().load(path),
    ".png": lambda path: cv2.imread(str(path)) is not None,
}


def broken(path: Path) -> str:
    """What is wrong with a file that a command has written; nothing where it is whole."""
    try:
        return "" if WHOLE.get(path.suffix, Path.exists)(path) else "empty, or cut off"
    except Exception as error:
        return repr(error)


def terminals(_: str, numbers: range, folder: Path) -> tuple[Counter[str], list[str]]:
    """Each short command in each terminal ends with the code and the files of an ordinary one, and tells as little."""
    material(folder)
    ends: Counter[str] = Counter()
    findings = []
    for number, typed in enumerate((*SHORT, *AT_A_ROBOT)[numbers.start : numbers.stop]):
        ordinary: tuple[int, list[str], int] | None = None
        with _robot() if typed in AT_A_ROBOT else nullcontext():
            for how in ("", *TERMINALS):
                place = _place(folder, f"{number} {how}".replace("/", ""))
                shell, env = ("", os.environ | ASCII) if how == "ascii" else (how, None)
                command = ["bash", "-c", f'set -o pipefail; "$@" {shell}', "-", *LIMO_HOG, *typed.split()]
                done = subprocess.run(command, check=False, capture_output=True, cwd=place, timeout=LATEST_S, env=env)
                told = done.stderr.decode(errors="replace")
                written = _written(place)
                # How often a follower changes its mind in three seconds is the run's.
                lines = [line for line in told.splitlines() if not re.match(r"\d+\.\d s ", line)]
                found = done.returncode, sorted(written), len(lines)
                ordinary = ordinary or found
                # What lists to a reader who leaves has done its work.
                left = how == "| head -1" and not written and found[0] == 1
                wrong = (found[0] != ordinary[0] and not left) or found[1] != ordinary[1]
                if wrong or found[2] > max(1, ordinary[2]):
                    findings.append(f"{typed} {how}: {found}, ordinary {ordinary}: {told[-300:]}")
                if "Traceback" in told or "Error" in told or (how == "ascii" and not done.stdout.isascii()):
                    findings.append(f"{typed} {how}: {told[-300:]}")
                findings += [f"{typed} {how}: {name}: {why}" for name, path in written.items() if (why := broken(path))]
                ends[str(done.returncode)] += 1
                print(f"{typed} {how}: {found}", flush=True)
    return ends, findings


@contextmanager
def _robot() -> Iterator[None]:
    command = [*LIMO_HOG, "arena", "--ros2"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as robot:
        assert robot.stdout is not None and b"is in ROS domain" in robot.stdout.readline()
        yield
        robot.terminate()
        assert robot.wait(RUNS_ON_S) == 128 + signal.SIGTERM


def _running(mark: str) -> Iterator[int]:
    for environ in Path("/proc").glob("[0-9]*/environ"):
        with suppress(OSError):
            if f"{MARK}={mark}\0".encode() in environ.read_bytes():
                yield int(environ.parent.name)


def kills(_: str, numbers: range, folder: Path) -> tuple[Counter[str], list[str]]:
    """Kill a command at a random time, alone or with its group; look at what is left."""
    material(folder)
    # What ignores these, as a shell's background job or nohup does, hands that on, and rightly nothing ends.
    for one in (signal.SIGINT, signal.SIGHUP):
        signal.signal(one, signal.SIG_DFL)
    ends: Counter[str] = Counter()
    findings = []
    slowest = 0.0
    for number in numbers:
        draw = random.Random(number)
        typed = LONG[number % len(LONG)]
        sent = draw.choice((signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP))
        place, mark = _place(folder, f"k{number}"), f"{os.getpid()}.{number}"
        command, env, silent = [*LIMO_HOG, *typed.split()], os.environ | {MARK: mark}, subprocess.DEVNULL
        child = subprocess.Popen(command, cwd=place, env=env, stderr=silent, stdout=silent, start_new_session=True)
        with suppress(subprocess.TimeoutExpired):
            child.wait(draw.uniform(0.2, 4.0))
        told = "ended before" if child.returncode is not None else sent.name
        if child.returncode is None:
            (os.killpg if draw.random() < 0.5 else os.kill)(child.pid, sent)
        began = time.monotonic()
        while child.poll() is None or any(_running(mark)):
            if time.monotonic() - began > RUNS_ON_S:
                findings.append(f"kill {number}: {typed}, {told}: runs on after {RUNS_ON_S} s: {[*_running(mark)]}")
                for process in _running(mark):
                    os.kill(process, signal.SIGKILL)
                break
            time.sleep(0.02)
        taken = time.monotonic() - began
        slowest = max(slowest, taken)
        ends[told] += 1
        print(f"kill {number}: {typed.split()[0]}, {told}, ended with {child.wait()} in {taken:.2f} s", flush=True)
        bad = {name: why for name, path in _written(place).items() if (why := broken(path))}
        findings += [f"kill {number}: {typed}, {told}: {name}: {why}" for name, why in bad.items()]
        if typed.startswith(("detect", "export")) and child.returncode:
            findings += [f"kill {number}: {typed}, {told}: {why}" for why in _resumed(typed, place)]
        shutil.rmtree(place)
    ends[f"slowest {slowest:.2f} s"] += 1
    return ends, findings


def _resumed(typed: str, place: Path) -> list[str]:
    """What is wrong after a killed command has been completed by `--resume`."""
    command = [*LIMO_HOG, *typed.split(), "--resume"]
    done = subprocess.run(command, check=False, capture_output=True, text=True, cwd=place, timeout=LATEST_S)
    if done.returncode:
        return [f"--resume ended with {done.returncode}: {done.stderr[-200:]}"]
    if typed.startswith("export"):
        images = json.loads((place / "yard" / "coco.json").read_text())["images"]
        files = list((place / "yard" / "images").glob("0*.png"))
        return [] if len(images) == len(files) == EXPORTED else [f"{len(images)} labels, {len(files)} of {EXPORTED}"]
    lines = [json.loads(line) for line in (place / "found.json").read_text().splitlines()]
    wanted = 100 if "film" in typed else PICTURES
    different = len({(line["source"], line["frame"]) for line in lines})
    return [] if len(lines) == different == wanted else [f"{len(lines)} lines, {different} different of {wanted}"]


if __name__ == "__main__":
    sys.exit(main({"terminals": terminals, "kills": kills}, __doc__ or "", 200))
