"""Bad inputs by the thousand: `limo-hog` answers each by a line, and does the rest.

`python -m tests.hardening.strangers names pictures films labels models scenarios recordings --count 1000` (minutes).
"""

import importlib
import json
import os
import random
import re
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

# As `detect` sets them before OpenCV is imported.
os.environ |= {"OPENCV_LOG_LEVEL": "SILENT", "OPENCV_FFMPEG_LOGLEVEL": "-8", "OPENCV_VIDEOIO_PRIORITY_CV_MJPEG": "0"}

import cv2
from tests.cli.material import PICTURE, film_of
from tests.hardening.files import damaged
from tests.hardening.trials import main

from limo_hog import HOGDescriptor
from limo_hog.cli.main import main as limo_hog
from limo_hog.imaging.writing import write_image

#: How long a command may take [s].
LATEST_S = 60
#: Bad inputs that a command takes at once, where it takes several.
AT_ONCE = 50
#: Formats of pictures and films that are damaged.
PICTURES, FILMS = (".png", ".jpg", ".bmp", ".webp", ".tiff", ".ppm", ".jp2"), (".mp4", ".mkv", ".avi")


#: A value in a text file, and what else may stand there.
VALUE = re.compile(rb'-?\d+\.?\d*(?:[eE][-+]?\d+)?|"[^"\n]*"|\b(?:true|false|null)\b')
OTHERS = b"nan inf -inf NaN Infinity 1e999 -1 0 -0.0 1 2.5 1e-300 1e300 4294967296 true null [] {} [1,2]".split()
OTHERS += [b"9" * 40, b'""', b'"x"', b'"\\u001b[2J"', b'"../.."']
#: What bytes a file's name may have.
LETTERS = bytes(one for one in range(1, 256) if one != ord("/"))
#: Libraries that a command may import.
LIBRARIES = "limo_hog limo_sim cv2 av numpy rich pymunk rosbags mcap".split()


def _other_values(data: bytes, draw: random.Random) -> bytes:
    """Put other values in place of some: the file is still of its format. Half are among the first hundred."""
    for _ in range(draw.choice((1, 1, 2, 3))):
        places = [found.span() for found in VALUE.finditer(data)] or [(0, 0)]
        first, last = draw.choice(places[: draw.choice((100, len(places)))])
        data = data[:first] + draw.choice(OTHERS) + data[last:]
    return data


def _inputs(kind: str, folder: Path) -> tuple[list[bytes], str, Callable[[Path], list[str]]]:
    """Whole files of a kind, their suffix, and the command that reads one."""
    if kind == "models":
        hog = HOGDescriptor()
        hog.setSVMDetector(hog.getDefaultPeopleDetector())
        for suffix in (".yml", ".xml", ".json"):
            hog.save(folder / f"m{suffix}")
        # The format is found by content, whatever the suffix.
        whole = [path.read_bytes() for path in sorted(folder.glob("m.*"))]
        return whole, ".yml", lambda path: ["detect", "a.png", "--model", str(path)]
    if kind == "scenarios":
        import limo_sim

        whole = [file.read_bytes() for file in sorted(Path(limo_sim.__file__).parent.glob("scenarios/*.toml"))]
        return whole, ".toml", lambda path: ["follow", "--scenario", str(path), "--seconds", "0.1"]
    if kind == "labels":
        image = {"id": 1, "file_name": "a.png", "width": 192, "height": 256}
        one = {"id": 1, "image_id": 1, "category_id": 1, "bbox": [20, 20, 50, 120], "area": 6000, "iscrowd": 0}
        coco = {"images": [image], "annotations": [one], "categories": [{"id": 1, "name": "person"}]}
        return [json.dumps(coco).encode()], ".json", lambda path: ["evaluate", "opencv", str(path)]
    _answer(["follow", "--seconds", "0.2", "--record", "r.mcap"], folder)
    _without_checksums(folder / "r.mcap", folder / "open.mcap")
    whole = [(folder / name).read_bytes() for name in ("r.mcap", "open.mcap")]
    return whole, ".mcap", lambda path: ["replay", str(path)]


def _without_checksums(recording: Path, path: Path) -> None:
    """Write a recording again so that damage reaches its messages: not compressed, no checksums."""
    from mcap.reader import make_reader
    from mcap.writer import CompressionType, Writer

    with recording.open("rb") as source, path.open("wb") as target:
        writer = Writer(target, compression=CompressionType.NONE, enable_crcs=False)
        writer.start("ros2")
        known: dict[str, int] = {}
        for schema, channel, message in make_reader(source).iter_messages():
            if channel.topic not in known and schema is not None:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                known[channel.topic] = writer.register_channel(channel.topic, channel.message_encoding, number)
            writer.add_message(known[channel.topic], message.log_time, message.data, message.publish_time)
        writer.finish()  # type: ignore[no-untyped-call]


def _answer(arguments: list[str], folder: Path) -> tuple[int, str]:
    """Run a command in a fork; returns its exit code (minus its signal) and what it told on standard error."""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as told:
        if not (child := os.fork()):
            signal.alarm(LATEST_S)  # ends it with SIGALRM
            code = 99
            with suppress(BaseException):
                os.chdir(folder)
                for number, file in ((1, out), (2, told)):
                    os.dup2(file.fileno(), number)
                sys.stdout, sys.stderr = (os.fdopen(number, "w", buffering=1) for number in (1, 2))
                try:
                    code = limo_hog(arguments)
                except BaseException:
                    sys.excepthook(*sys.exc_info())
                sys.stdout.flush()
            os._exit(code)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        told.seek(0)
        return code, told.read().decode(errors="replace")


def _import_what_it_needs(arguments: list[str], folder: Path) -> None:
    """Import all that a command imports, so that its forks need not; refuse a command that fails on whole input."""
    code = "import sys; from limo_hog.cli.main import main; code = main(); print(*sys.modules); sys.exit(code)"
    command = [sys.executable, "-c", code, *arguments]
    done = subprocess.run(command, check=False, capture_output=True, text=True, cwd=folder)
    if done.returncode:
        raise RuntimeError(f"a whole file is refused, so that nothing is tried: {done.stderr}")
    for name in done.stdout.splitlines()[-1].split():
        with suppress(Exception):
            if name.partition(".")[0] in LIBRARIES:
                importlib.import_module(name)


def _finding(code: int, told: str) -> str:
    """What is wrong with an answer; nothing where it is a card or lines of ours."""
    if code not in (0, 1, 2):
        return f"ended with {code}: {told[-200:]}"
    if "Traceback" in told or any(not one.isprintable() and one != "\n" for one in told):
        return f"a traceback or control characters: {told[-200:]!r}"
    return "" if code == 0 or "limo-hog: " in told or "error: " in told else f"{code} without a line: {told[-200:]}"


def _whole(kind: str, folder: Path) -> list[tuple[bytes, bytes]]:
    for suffix in FILMS if kind == "films" else PICTURES:
        path = folder / f"whole{suffix}"
        if kind != "films":
            write_image(path, PICTURE)
        elif suffix == ".mp4":
            film_of(path, 4)
        else:
            film = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 10, PICTURE.shape[1::-1])
            for _ in range(4):
                film.write(PICTURE)
            film.release()
    return [(os.fsencode(path.suffix), path.read_bytes()) for path in sorted(folder.glob("whole.*"))]


def many(kind: str, numbers: range, folder: Path) -> tuple[Counter[str], list[str]]:
    """Names, pictures and films, `AT_ONCE` in a folder with a good picture, which must be done."""
    ends: Counter[str] = Counter()
    findings = []
    whole = _whole(kind, folder)
    _import_what_it_needs(["detect", str(folder), "--json", "first"], folder)
    for first in numbers[::AT_ONCE]:
        place = folder / f"{kind}{first}"
        write_image(place / "good.png", PICTURE)
        for number in range(first, min(numbers.stop, first + AT_ONCE)):
            draw = random.Random(number)
            suffix, data = draw.choice(whole)
            bad = bytes(draw.choice(LETTERS) for _ in range(draw.choice((1, 3, 20, 200))))
            name = os.fsencode(place) + b"/" + (bad if kind == "names" else b"%d" % number) + suffix
            with open(name, "wb") as file:  # noqa: PTH123 - a name of bytes
                file.write(data if kind == "names" else damaged(data, draw))
        code, told = _answer(["detect", str(place), "--json", "found", "--overwrite"], folder)
        lines = [json.loads(line) for line in (folder / "found").read_text().splitlines()]
        named = told.count("limo-hog: ")  # libpng writes into our lines
        sources = {line["source"] for line in lines}
        files = len(list(place.iterdir()))
        if problem := _finding(code, told):
            findings.append(f"{kind} {first}: {problem}")
        # Of a film that is cut off, frames are found, and it is named, too.
        right = len(sources) + named == files or (kind == "films" and len(sources) + named > files)
        if str(place / "good.png") not in sources or not right or (code == 1) != (named > 0):
            findings.append(f"{kind} {first}: {len(sources)} done, {named} named of {files}, code {code}")
        ends["done"] += len(sources) - 1
        ends["named"] += named
    return ends, findings


def single(kind: str, numbers: range, folder: Path) -> tuple[Counter[str], list[str]]:
    """Labels, models, scenarios and recordings, one a command."""
    write_image(folder / "a.png", PICTURE)
    whole, suffix, command = _inputs(kind, folder)
    ends: Counter[str] = Counter()
    findings = []
    path = folder / f"bad{suffix}"
    path.write_bytes(whole[0])
    _import_what_it_needs(command(path), folder)
    for number in numbers:
        draw = random.Random(number)
        change = damaged if kind == "recordings" or draw.random() < 0.5 else _other_values
        path.write_bytes(change(draw.choice(whole), draw))
        code, told = _answer(command(path), folder)
        ends[str(code)] += 1
        if problem := _finding(code, told):
            findings.append(f"{kind} {number}: {problem}")
    return ends, findings


if __name__ == "__main__":
    kinds = dict.fromkeys("labels models scenarios recordings".split(), single)
    sys.exit(main(kinds | dict.fromkeys("names pictures films".split(), many), __doc__ or "", 1000))
