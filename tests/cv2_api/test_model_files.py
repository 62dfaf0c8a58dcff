"""Hostile model files end soon, with a named error."""

from __future__ import annotations

import gzip
import time
from pathlib import Path

import pytest

from limo_hog import HOGDescriptor, ModelFormatError

GOOD = (
    "%YAML:1.0\n---\nh:\n   winSize: [ 16, 16 ]\n   blockSize: [ 8, 8 ]\n   blockStride: [ 8, 8 ]\n"
    "   cellSize: [ 8, 8 ]\n   nbins: 9\n   nlevels: 4\n"
)


@pytest.mark.parametrize(
    "text",
    [
        pytest.param('{"a":' * 200_000, id="deep JSON objects"),
        pytest.param('{"a": ' + "[" * 200_000, id="deep JSON lists"),
        pytest.param("<?xml version='1.0'?>" + "<a>" * 5_000_000, id="XML tags that never close"),
        pytest.param("<?xml version='1.0'?><opencv_storage>" + "<a>" * 50 + "</a>" * 50, id="deep XML"),
        pytest.param("%YAML:1.0\n---\nh:\n" + "   a: [\n" * 200_000, id="YAML brackets that never close"),
        pytest.param(GOOD.replace("winSize: [ 16", "winSize: [ 1e300"), id="a size beyond all integers"),
        pytest.param(GOOD.replace("nbins: 9", "nbins: 1e300"), id="a number beyond all integers"),
        pytest.param(GOOD.replace("nbins: 9", "nbins: " + "9" * 5000), id="a number of 5000 digits"),
    ],
)
def test_a_hostile_file_is_refused_soon(tmp_path: Path, text: str) -> None:
    path = tmp_path / "hostile"
    path.write_text(text)
    start = time.process_time()
    with pytest.raises(ModelFormatError, match="hostile holds no HOG detector") as caught:
        HOGDescriptor(path)
    assert time.process_time() - start < 3
    assert len(str(caught.value)) < 400


def test_a_gzip_bomb_is_not_unpacked(tmp_path: Path) -> None:
    path = tmp_path / "bomb.yml.gz"
    with gzip.open(path, "wb", compresslevel=1) as file:
        file.write(b"%YAML:1.0\n---\n")
        for _ in range(100):
            file.write(b" " * 2**22)
    start = time.process_time()
    with pytest.raises(ModelFormatError, match=r"more than 64 MiB"):
        HOGDescriptor(path)
    assert time.process_time() - start < 3


def test_a_file_larger_than_any_model_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "large.yml"
    with path.open("wb") as file:
        file.truncate(2**40)
    with pytest.raises(ModelFormatError, match=r"more than 64 MiB"):
        HOGDescriptor(path)
