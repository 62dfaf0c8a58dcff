"""OpenCV's files of HOG detectors: XML, YAML 1.0 and JSON, plain or gzipped, read and written without OpenCV.

A file is one named object with twelve parameters and, where there is one, the SVM's coefficients. What is written
here is what `cv2.HOGDescriptor.save` writes.
"""

from __future__ import annotations

import gzip
import io
import json
import math
import os
import re
import zlib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from limo_hog.atomic import whole_file
from limo_hog.cv2_api.arguments import shown
from limo_hog.cv2_api.geometry import Geometry
from limo_hog.exceptions import ModelFileError, ModelFormatError, ModelMissingError, ParameterError

#: Each key's values, word by word as they stand in the file.
Entries = dict[str, list[str]]

_TYPE = "opencv-object-detector-hog"
_GZIP_MAGIC = b"\x1f\x8b"
#: Text of a file, unpacked: room for three million coefficients, 800 times the people detector's.
_MOST_BYTES = 64 << 20
#: Pixels that a file's block may have [px]: 256 x 256 in any file, and as many more for each coefficient as cells of
#: 48 x 48 pixels and 9 bins take, 36 times the area of OpenCV's own.
_BLOCK_PIXELS, _PIXELS_PER_COEFFICIENT = 1 << 16, 48 * 48 // 9
#: XML tags inside each other; OpenCV's own files have three.
_MOST_DEPTH = 16
#: A line is broken before it would grow beyond this.
_MARGIN = 71


def load(filename: str | os.PathLike[str], name: str = "") -> tuple[Geometry, list[float]]:
    """Return geometry and coefficients (perhaps none) of the object `name`, by default of the first in the file.

    As in OpenCV, single numbers that are missing count as 0. Raises `ParameterError` where the file's name is empty;
    `ModelFileError` where the file cannot be read; `ModelMissingError` where there is none; `ModelFormatError` where it
    is not one of OpenCV's files, or has no such object, or that is no HOG detector, or its block is far larger than its
    coefficients justify.
    """
    path = _path(filename)
    try:
        objects = _parse(_text(path).lstrip("\ufeff \t\r\n"))
        geometry, svm = _from_entries(_chosen(objects, name))
        _assert_in_proportion(geometry, svm)
    except (ValueError, RecursionError, EOFError, gzip.BadGzipFile, zlib.error, ElementTree.ParseError) as error:
        raise ModelFormatError(f"{path} holds no HOG detector: {error}") from error
    except OSError as error:
        kind = ModelMissingError if isinstance(error, FileNotFoundError) else ModelFileError
        raise kind(error.errno, error.strerror, str(path)) from error
    return geometry, svm


def _assert_in_proportion(geometry: Geometry, svm: list[float]) -> None:
    """Raise ValueError where a small file asks for much memory: a block's tables have up to 160 bytes a pixel."""
    width, height = geometry.blockSize
    most = _BLOCK_PIXELS + _PIXELS_PER_COEFFICIENT * len(svm)
    if width * height > most:
        raise ValueError(
            f"its block of {width} x {height} pixels is too large for a file of {len(svm)} coefficients (at most "
            f"{most} pixels); make the HOGDescriptor with this geometry in the program, and give it the coefficients"
        )


def _text(path: Path) -> str:
    with path.open("rb") as file:
        stream = gzip.GzipFile(fileobj=file) if file.peek(2).startswith(_GZIP_MAGIC) else file
        data = stream.read(_MOST_BYTES + 1)
    if len(data) > _MOST_BYTES:
        raise ValueError(f"it has more than {_MOST_BYTES >> 20} MiB of text")
    return data.decode()


def save(filename: str | os.PathLike[str], geometry: Geometry, svm: NDArray[np.float32] | None, name: str = "") -> None:
    """Write the object `name` (by default the file's stem) in the format of the suffix; YAML where it is no other.

    Raises `ParameterError` where `name` is not a letter or `_` followed by letters, digits, `-` and `_`; or the file's
    name is empty; `OSError` where the file cannot be written; no part of it is left behind.
    """
    path = _path(filename)
    zipped = path.suffix == ".gz"
    plain = path.with_suffix("") if zipped else path
    if name and not re.fullmatch(r"[A-Za-z_][\w-]*", name, re.ASCII):
        raise ParameterError(f"objname is {name!r}; a letter or _, then letters, digits, - and _ are wanted")
    text = _WRITERS.get(plain.suffix.lower(), _yaml)(name or _default_name(plain.stem), _to_entries(geometry, svm))
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path} cannot be saved: there is no directory {path.parent}")
    with whole_file(path) as part:
        part.write_bytes(gzip.compress(text.encode()) if zipped else text.encode())


def _path(filename: str | os.PathLike[str]) -> Path:
    if not os.fspath(filename):
        raise ParameterError("filename is empty; a file's name is wanted")
    return Path(filename)


def _chosen(objects: dict[str, Entries], name: str) -> Entries:
    if not objects or (name and name not in objects):
        raise ValueError(f"no object {name or 'at all'}; it has {', '.join(objects) or 'none'}")
    return objects[name] if name else next(iter(objects.values()))


def _to_entries(geometry: Geometry, svm: NDArray[np.float32] | None) -> Entries:
    numbers: dict[str, Any] = geometry._replace(winSigma=geometry.sigma)._asdict()
    entries = {key: [_word(number, 17) for number in np.ravel(value).tolist()] for key, value in numbers.items()}
    if svm is not None:
        entries["SVMDetector"] = [_word(weight, 9) for weight in svm.tolist()]
    return entries


def _word(value: float, digits: int) -> str:
    """Return a number as the files have it; 9 digits keep a float32 whole, 17 a float64."""
    if isinstance(value, int):
        return str(int(value))
    if not math.isfinite(value):
        return ".Nan" if math.isnan(value) else ".Inf" if value > 0 else "-.Inf"
    if value == int(value) and abs(value) < 2**31:
        return f"{int(value)}."
    return f"{value:.{digits}g}"


def _from_entries(entries: Entries) -> tuple[Geometry, list[float]]:
    def numbers(key: str) -> list[float]:
        # `.Inf` and `.Nan` are written with a dot.
        return [float(re.sub(r"\.(?=inf|nan)", "", word.lower())) for word in entries.get(key, [])]

    def number(key: str) -> float:
        found = numbers(key) or [0.0]
        if len(found) > 1 or not math.isfinite(found[0]):
            raise ValueError(f"{key} is {shown(found)}; one finite number is wanted")
        return found[0]

    def integer(key: str, value: float) -> int:
        if not abs(value) < 2**31:
            raise ValueError(f"{key} is {value:g}; an integer of 32 bits is wanted")
        return int(value)

    def size(key: str) -> tuple[int, int]:
        found = numbers(key)
        if len(found) != 2:
            raise ValueError(f"{key} is {shown(found) if found else 'missing'}; two integers are wanted")
        return integer(key, found[0]), integer(key, found[1])

    geometry = Geometry(
        size("winSize"),
        size("blockSize"),
        size("blockStride"),
        size("cellSize"),
        integer("nbins", number("nbins")),
        integer("derivAperture", number("derivAperture")),
        number("winSigma"),
        integer("histogramNormType", number("histogramNormType")),
        number("L2HysThreshold"),
        bool(number("gammaCorrection")),
        integer("nlevels", number("nlevels")),
        bool(number("signedGradient")),
    )
    return geometry, numbers("SVMDetector")


def _default_name(stem: str) -> str:
    name = re.sub(rb"[^A-Za-z0-9_-]", b"_", os.fsencode(stem)).decode()
    return name if re.match(r"[A-Za-z_]", stem) else f"_{name}"


def _parse(text: str) -> dict[str, Entries]:
    if text.startswith("<?xml"):
        return _parse_xml(text)
    if text.startswith("%YAML"):
        return _parse_yaml(text)
    if text.startswith("{"):
        return _parse_json(text)
    raise ValueError(f"it starts with {text[:20]!r}; OpenCV's XML, YAML (%YAML:1.0) or JSON is wanted")


def _parse_xml(text: str) -> dict[str, Entries]:
    depth, root = 0, None
    # Read tag by tag, so that a tower of tags ends before it stands. Expat itself limits the expansion of entities.
    for event, node in ElementTree.iterparse(io.StringIO(text), ("start", "end")):  # noqa: S314
        root = node if root is None else root
        depth += 1 if event == "start" else -1
        if depth > _MOST_DEPTH:
            raise ValueError(f"more than {_MOST_DEPTH} XML tags lie inside each other")
    if root is None:
        raise ValueError("it has no XML tag")
    if root.tag != "opencv_storage":
        raise ValueError(f"its outermost tag is <{root.tag}>, not <opencv_storage>")
    return {node.tag: {entry.tag: " ".join(entry.itertext()).split() for entry in node} for node in root}


#: An object's line; an entry in one line, over several lines in brackets, or as one `- item` a line.
_YAML_OBJECT = re.compile(r"^([\w-]+):[ \t]*(?:!\S+[ \t]*)?(?:#.*)?$", re.MULTILINE)
_YAML_ENTRY = re.compile(r"^[ \t]+([\w-]+):[ \t]*(\[[^\]:]*\]|(?:\n[ \t]+-[ \t][^\n]*)+|[^\n#]*)", re.MULTILINE)


def _parse_yaml(text: str) -> dict[str, Entries]:
    parts = _YAML_OBJECT.split(text.replace("\r\n", "\n"))
    bodies = zip(parts[1::2], parts[2::2], strict=True)
    return {
        name: {key: re.sub(r"[\[\],]|-[ \t]", " ", value).split() for key, value in _YAML_ENTRY.findall(body)}
        for name, body in bodies
    }


def _parse_json(text: str) -> dict[str, Entries]:
    # OpenCV writes the numbers of YAML: `1.`, `.Nan`, `.Inf`.
    text = re.sub(
        r"(?<=[\s\[:,])(-?)\.(?:(inf)|nan)\b", lambda m: m[1] + "Infinity" if m[2] else "NaN", text, flags=re.IGNORECASE
    )
    text = re.sub(r"(\d\.)(?=[\s,\]}eE])", r"\g<1>0", text)
    objects = json.loads(text, parse_float=str, parse_int=str, parse_constant=str)
    return {
        name: {key: list(map(str, value if isinstance(value, list) else [value])) for key, value in node.items()}
        for name, node in objects.items()
        if isinstance(node, dict)
    }


def _wrapped(start: str, words: Iterable[str], separator: str, indent: int) -> str:
    """Put `words` after `start`, breaking lines as OpenCV does."""
    lines = [start]
    for place, word in enumerate(words):
        if place:
            lines[-1] += separator
        if len(lines[-1]) + len(word) > _MARGIN and len(lines[-1]) + len(word) - indent > 10:
            lines.append(" " * indent + word)
        else:
            lines[-1] += f" {word}"
    return "\n".join(lines)


def _yaml(name: str, entries: Entries) -> str:
    lines = ["%YAML:1.0", "---", f"{name}: !!{_TYPE}"]
    for key, words in entries.items():
        one = len(words) == 1
        lines.append(f"   {key}: {words[0]}" if one else _wrapped(f"   {key}: [", words, ",", 7) + " ]")
    return "\n".join([*lines, ""])


def _json(name: str, entries: Entries) -> str:
    lines = [f'        "type_id": "{_TYPE}"']
    for key, bare in entries.items():
        words = [f"{word}0" if word.endswith(".") else word for word in bare]
        one = len(words) == 1
        lines.append(f'        "{key}": {words[0]}' if one else _wrapped(f'        "{key}": [', words, ",", 12) + " ]")
    return "\n".join(["{", f'    "{name}": {{', ",\n".join(lines), "    }", "}", ""])


def _xml(name: str, entries: Entries) -> str:
    lines = ['<?xml version="1.0"?>', "<opencv_storage>", f'<{name} type_id="{_TYPE}">']
    for key, words in entries.items():
        text = words[0] if len(words) == 1 else "\n" + _wrapped("   ", words, "", 4)
        lines.append(f"  <{key}>{text}</{key}>")
    lines[-1] += f"</{name}>"
    return "\n".join([*lines, "</opencv_storage>", ""])


_WRITERS: dict[str, Callable[[str, Entries], str]] = {".xml": _xml, ".json": _json}
