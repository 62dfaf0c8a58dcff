"""Files that are no model, hostile ones too, are refused soon by a named error, and change nothing."""

import gzip
import time
from pathlib import Path

import numpy as np
import pytest

import limo_hog
from limo_hog import HOGDescriptor, ModelFormatError

GOOD = (
    "%YAML:1.0\n---\nh:\n   winSize: [ 16, 16 ]\n   blockSize: [ 8, 8 ]\n   blockStride: [ 8, 8 ]\n"
    "   cellSize: [ 8, 8 ]\n   nbins: 9\n   nlevels: 4\n"
)


def refused(path: Path, error: type[Exception] = ModelFormatError, told: str = "") -> None:
    hog = HOGDescriptor()
    hog.setSVMDetector(hog.getDefaultPeopleDetector())
    before, start = repr(hog), time.process_time()
    with pytest.raises(error, match=told) as caught:
        hog.load(path)
    assert time.process_time() - start < 3 and len(str(caught.value)) < 400 and repr(hog) == before
    np.testing.assert_array_equal(hog.svmDetector, hog.getDefaultPeopleDetector())


@pytest.mark.parametrize(
    ("text", "error", "told"),
    [
        ("", ModelFormatError, "starts with"),
        ("PK\x03\x04", ModelFormatError, "PK"),
        ("%YAML:1.0\n---\n", ModelFormatError, "no object"),
        (GOOD.replace("winSize", "windowSize"), ModelFormatError, "winSize is missing"),
        (GOOD.replace("cellSize: [ 8, 8 ]", "cellSize: [ 8 ]"), ModelFormatError, "cellSize"),
        (GOOD.replace("nbins: 9", "nbins: nine"), ModelFormatError, "nine"),
        (GOOD.replace("nbins: 9", "nbins: .Inf"), ModelFormatError, "nbins"),
        (GOOD.replace("nbins: 9", "nbins: 0"), limo_hog.GeometryError, "nbins is 0"),
        (GOOD.replace("nlevels: 4", "nlevels: 0"), limo_hog.GeometryError, "nlevels is 0"),
        (GOOD + "   SVMDetector: [ 1., 2. ]\n", limo_hog.DetectorSizeError, "2 coefficients"),
        ('<?xml version="1.0"?>\n<opencv_storage><a>', ModelFormatError, "damaged|holds no"),
        ('<?xml version="1.0"?>\n<html></html>', ModelFormatError, "opencv_storage"),
        ('{"a": {"winSize": [16, 16', ModelFormatError, "holds no"),
        ("[1, 2]", ModelFormatError, "starts with"),
    ],
)
def test_a_file_that_is_no_model_is_refused(tmp_path: Path, text: str, error: type[Exception], told: str) -> None:
    (tmp_path / "bad").write_text(text)
    refused(tmp_path / "bad", error, told)


HOSTILE = {
    "deep JSON objects": '{"a":' * 200_000,
    "deep JSON lists": '{"a": ' + "[" * 200_000,
    "XML tags that never close": "<?xml version='1.0'?>" + "<a>" * 5_000_000,
    "deep XML": "<?xml version='1.0'?><opencv_storage>" + "<a>" * 50 + "</a>" * 50,
    "YAML brackets that never close": "%YAML:1.0\n---\nh:\n" + "   a: [\n" * 200_000,
    "a size beyond all integers": GOOD.replace("winSize: [ 16", "winSize: [ 1e300"),
    "a number beyond all integers": GOOD.replace("nbins: 9", "nbins: 1e300"),
    "a number of 5000 digits": GOOD.replace("nbins: 9", "nbins: " + "9" * 5000),
}


@pytest.mark.parametrize("text", HOSTILE.values(), ids=HOSTILE)
def test_a_hostile_file_is_refused_soon(tmp_path: Path, text: str) -> None:
    (tmp_path / "hostile").write_text(text)
    refused(tmp_path / "hostile", told="hostile holds no HOG detector")


def test_gzip_bombs_truncated_files_and_files_larger_than_any_model_are_refused(tmp_path: Path) -> None:
    with gzip.open(tmp_path / "bomb.yml.gz", "wb", compresslevel=1) as bomb:
        bomb.write(b"%YAML:1.0\n---\n")
        for _ in range(100):
            bomb.write(b" " * 2**22)
    with (tmp_path / "large.yml").open("wb") as large:
        large.truncate(2**40)
    for name in ("bomb.yml.gz", "large.yml"):
        refused(tmp_path / name, told="more than 64 MiB")
    truncated = tmp_path / "model.xml.gz"
    HOGDescriptor().save(truncated)
    truncated.write_bytes(truncated.read_bytes()[:-20])
    refused(truncated, told=r"model\.xml\.gz")


def test_files_that_cannot_be_written_raise_instead_of_passing_silently(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="no directory"):
        HOGDescriptor().save(tmp_path / "nowhere" / "model.yml")
    with pytest.raises(limo_hog.ParameterError, match="a b"):
        HOGDescriptor().save(tmp_path / "model.yml", "a b")
    assert list(tmp_path.iterdir()) == []
