"""Names of the annotated copies that `detect --out` makes."""

from __future__ import annotations

import os
from collections import Counter
from pathlib import Path

from limo_hog.imaging.reading import STDIN, Kind, Source


def real(path: Path) -> Path:
    """Return a path without links; one that leads to itself stays, where `Path.resolve` raises."""
    return Path(os.path.realpath(path))


def copies_of(sources: list[Source], folder: Path, wanted: str | None) -> dict[Source, Path]:
    """Name each source's annotated copy: its place below what all sources have in common, in `folder`.

    Images are of the `wanted` format, or else JPEG where the source is, and PNG where not.
    """
    # Without `..`, which would lead out of `folder`.
    folders = {
        source: Path(os.path.normpath(source.path.absolute().parent)) for source in sources if source.name != STDIN
    }
    root = os.path.commonpath(folders.values()) if folders else ""
    names: dict[Source, Path] = {}
    for source in sources:
        like_source = "jpg" if source.path.suffix.lower() in (".jpg", ".jpeg") else "png"
        suffix = f".{wanted or like_source}" if source.kind is Kind.IMAGE else ".mp4"
        place = folder / folders[source].relative_to(root) if source in folders else folder
        stem = "stdin" if source.name == STDIN else source.path.stem
        names[source] = place / f"{stem}{suffix}"
    # Two pictures of one stem, such as a.jpg and a.png, keep their whole names.
    taken = Counter(names.values())
    return {
        source: path if taken[path] == 1 else path.with_name(source.path.name + path.suffix)
        for source, path in names.items()
    }
