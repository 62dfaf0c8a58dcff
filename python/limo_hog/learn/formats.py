"""Label files of six kinds, as they are found: VOC XML, CVAT XML, imglab XML, COCO JSON, YOLO text, boxes.json.

Each is a few lines of XML or JSON, which Python itself reads; the libraries that read some of them bring an image
stack of a hundred megabytes and read neither CVAT's nor imglab's.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from limo_hog.cv2_api.arguments import shown
from limo_hog.imaging.reading import IMAGE_SUFFIXES
from limo_hog.learn.labels import Box, LabelError, Picture

_WANTED = (
    "a folder of VOC XML files, a folder of YOLO text files beside pictures or in `labels` beside `images`, a COCO "
    "JSON file, a CVAT or imglab XML file, or boxes.json"
)
#: Where the pictures of a label file may lie, besides what it says: seen from the file's folder.
_PLACES = ("", "images", "JPEGImages", "..", "../images", "../JPEGImages")

#: A picture's name as the labels have it, and its boxes.
_Named = tuple[str, tuple[Box, ...]]

#: No picture is so wide: boxes beyond it are errors [px].
_FARTHEST_PX = 1e6


def read_labels(source: Path, pictures: Path | None = None) -> list[Picture]:
    """Read labelled pictures, in the labels' order, from a label file or a folder; its kind is seen from what it holds.

    VOC: a folder of XML files, or one. YOLO: a folder of pictures with text files beside them, or with the folders
    `images` and `labels`; `classes.txt` names the labels. COCO, CVAT ("for images") and imglab: the file. `boxes.json`:
    {picture: [[x, y, w, h], ...]} [px], the file or its folder. `pictures` is the folder of the pictures; by default
    the labels' own and those usual beside it. Raises `LabelError` where these are no such labels, or a picture is
    missing; `OSError` where a file cannot be read.
    """
    if source.is_dir():
        return _from_folder(source, pictures)
    if source.suffix.lower() == ".json":
        return _found(source, list(_json(source)), pictures)
    if source.suffix.lower() == ".xml":
        return _found(source, list(_xml(source)), pictures)
    if not source.exists():
        raise LabelError(f"{source}: no such file or folder")
    raise LabelError(f"{source} holds no labels; wanted is {_WANTED}")


def holds_labels(source: Path) -> bool:
    """Say whether this looks like labels; a folder that does not is one of crops."""
    if not source.is_dir():
        return True
    beside = (folder for folder in (source, source / "Annotations", source / "annotations") if folder.is_dir())
    return (
        any(path.suffix.lower() in (".json", ".xml", ".txt") for folder in beside for path in folder.iterdir())
        or (source / "labels").is_dir()
    )


def _from_folder(folder: Path, pictures: Path | None) -> list[Picture]:
    if (folder / "boxes.json").is_file():
        return read_labels(folder / "boxes.json", pictures)
    for labels in (folder, folder / "Annotations", folder / "annotations"):
        files = sorted(labels.glob("*.xml"))
        if files:
            return [picture for file in files for picture in _found(file, list(_xml(file)), pictures)]
        coco = sorted(labels.glob("*.json"))
        if len(coco) == 1:
            return read_labels(coco[0], pictures)
        if coco:
            names = ", ".join(path.name for path in coco)
            raise LabelError(f"{labels} holds several label files: {names}; name one of them")
    return _yolo(folder, pictures)


def _found(source: Path, named: list[_Named], pictures: Path | None) -> list[Picture]:
    """Find each picture's file; raise `LabelError` where some are nowhere, or the labels name no picture."""
    if not named:
        raise LabelError(f"{source} names no picture; wanted is {_WANTED}")
    found, missing = [], []
    for name, boxes in named:
        # Labels made under Windows.
        plain = name.replace("\\", "/")
        roots = [pictures] if pictures else [source.parent / place for place in _PLACES]
        tried = (root / what for root in roots for what in (plain, Path(plain).name))
        path = next((path for path in tried if path.is_file()), None)
        if path is None:
            missing.append(name)
        else:
            found.append(Picture(path, boxes))
    if missing:
        raise LabelError(
            f"{source} names {len(named)} pictures, {len(missing)} of which are not there, {missing[0]} for one; "
            "say where they are with --pictures DIR"
        )
    return found


def _json(source: Path) -> Iterator[_Named]:
    try:
        data = json.loads(source.read_text("utf-8"), object_pairs_hook=_once)
        if isinstance(data, dict) and {"images", "annotations"} <= data.keys():
            yield from _coco(data)
        elif isinstance(data, dict):
            for name, boxes in data.items():
                yield str(name), tuple(_box("", box) for box in boxes)
        else:
            raise TypeError(f"it holds a {type(data).__name__}")  # noqa: TRY301 - one place words all that is wrong
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError) as error:
        raise LabelError(f"{source} holds neither COCO labels nor {{picture: [[x, y, w, h]]}}: {error!r}") from error


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        twice = next(key for key in table if sum(key == other for other, _ in pairs) > 1)
        raise ValueError(f"the key {twice!r} is there twice")
    return table


def _box(label: str, numbers: Any, ignored: bool = False) -> Box:
    are_numbers = isinstance(numbers, (list, tuple)) and all(type(number) in (int, float) for number in numbers)
    if not are_numbers or len(numbers) != 4 or not all(abs(number) <= _FARTHEST_PX for number in numbers):
        raise ValueError(f"a box is {shown(numbers)}; four finite numbers are wanted, of at most {_FARTHEST_PX:g} px")
    x, y, width, height = map(float, numbers)
    return Box(label, x, y, width, height, ignored)


def _coco(data: dict[str, Any]) -> Iterator[_Named]:
    for kind in ("images", "categories"):
        ids = [item["id"] for item in data.get(kind, [])]
        if len(set(ids)) < len(ids):
            raise ValueError(f"two of its {kind} have one id")
    labels = {category["id"]: str(category["name"]) for category in data.get("categories", [])}
    boxes = defaultdict(list)
    for note in data["annotations"]:
        marks = [note.get("iscrowd", 0), note.get("ignore", 0)]
        if any(mark not in (0, 1) for mark in marks):
            raise ValueError(f"iscrowd or ignore is {shown(marks)}; 0 or 1 is wanted")
        ignored = any(marks)
        label = labels.get(note.get("category_id"), "")
        boxes[note["image_id"]].append(_box(label, note["bbox"], ignored))
    for image in data["images"]:
        yield str(image["file_name"]), tuple(boxes[image["id"]])


def _xml(source: Path) -> Iterator[_Named]:
    try:
        root = ElementTree.parse(source).getroot()  # noqa: S314 - expat itself limits the expansion of entities
        reader = _XML.get(root.tag)
        if reader is None:
            raise ValueError(f"its outermost tag is <{root.tag}>")  # noqa: TRY301 - one place words all that is wrong
        yield from reader(root)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        wanted = "VOC's <annotation>, CVAT's <annotations> or imglab's <dataset>"
        raise LabelError(f"{source}: {error}; wanted is {wanted}") from error


def _voc(root: ElementTree.Element) -> Iterator[_Named]:
    """PASCAL VOC: corners are pixels, counted from 1, and belong to the box."""
    boxes = []
    for thing in root.iter("object"):
        left, top, right, bottom = (float(_text(thing, f"bndbox/{key}")) for key in ("xmin", "ymin", "xmax", "ymax"))
        ignored = _text(thing, "difficult", "0").strip() == "1"
        numbers = left - 1, top - 1, right - left + 1, bottom - top + 1
        boxes.append(_box(_text(thing, "name", ""), numbers, ignored))
    yield _text(root, "filename").strip(), tuple(boxes)


def _cvat(root: ElementTree.Element) -> Iterator[_Named]:
    for image in root.iter("image"):
        boxes = []
        for box in image.iter("box"):
            left, top, right, bottom = (float(box.attrib[key]) for key in ("xtl", "ytl", "xbr", "ybr"))
            boxes.append(_box(box.get("label", ""), (left, top, right - left, bottom - top)))
        yield image.attrib["name"], tuple(boxes)


def _imglab(root: ElementTree.Element) -> Iterator[_Named]:
    for image in root.iter("image"):
        boxes = []
        for box in image.iter("box"):
            left, top, width, height = (float(box.attrib[key]) for key in ("left", "top", "width", "height"))
            label = (box.findtext("label") or "").strip()
            boxes.append(_box(label, (left, top, width, height), box.get("ignore", "0") == "1"))
        yield image.attrib["file"], tuple(boxes)


_XML: dict[str, Callable[[ElementTree.Element], Iterator[_Named]]] = {
    "annotation": _voc,
    "annotations": _cvat,
    "dataset": _imglab,
}


def _text(node: ElementTree.Element, path: str, default: str | None = None) -> str:
    text = node.findtext(path, default)
    if text is None:
        raise ValueError(f"<{node.tag}> has no <{path}>")
    return text


def _yolo(folder: Path, pictures: Path | None) -> list[Picture]:
    """YOLO: a line is label, centre x, centre y, width, height, as shares of the picture."""
    labels = folder / "labels" if (folder / "labels").is_dir() else folder
    images = pictures or (folder / "images" if (folder / "images").is_dir() else folder)
    paths = sorted(path for path in images.rglob("*") if path.suffix.lower() in IMAGE_SUFFIXES)
    texts = {path: labels / path.relative_to(images).with_suffix(".txt") for path in paths}
    if not any(text.is_file() for text in texts.values()):
        raise LabelError(f"{folder} holds no labels; wanted is {_WANTED}")
    names = next((path for path in (labels / "classes.txt", folder / "classes.txt") if path.is_file()), None)
    classes = _utf8(names).split("\n") if names else []
    read = []
    for path, text in texts.items():
        # A picture without a file has no object.
        lines = _utf8(text).splitlines() if text.is_file() else []
        height, width = Picture(path, ()).read().shape[:2] if lines else (0, 0)
        try:
            boxes = tuple(_yolo_box(line.split(), classes, width, height) for line in lines if line.strip())
        except (ValueError, IndexError) as error:
            wanted = "lines of label, centre x, centre y, width, height are wanted, in shares of the picture"
            raise LabelError(f"{text}: {error}; {wanted}") from error
        read.append(Picture(path, boxes))
    return read


def _utf8(path: Path) -> str:
    try:
        return path.read_text("utf-8")
    except UnicodeDecodeError as error:
        raise LabelError(f"{path} is no text in UTF-8: {error}; save it as UTF-8") from error


def _yolo_box(words: list[str], classes: list[str], width: int, height: int) -> Box:
    number, (x, y, w, h) = int(words[0]), map(float, words[1:5])
    label = classes[number].strip() if 0 <= number < len(classes) else str(number)
    return _box(label, ((x - w / 2) * width, (y - h / 2) * height, w * width, h * height))
