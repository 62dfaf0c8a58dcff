"""Model files go both ways between limo-hog and OpenCV, coefficient for coefficient."""

import gzip
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import limo_hog
from limo_hog import HOGDescriptor, ModelFormatError

ATTRIBUTES = [
    *("winSize", "blockSize", "blockStride", "cellSize", "nbins", "derivAperture", "histogramNormType"),
    *("L2HysThreshold", "gammaCorrection", "nlevels", "signedGradient"),
]
SUFFIXES = [".xml", ".yml", ".yaml", ".json", ".xml.gz", ".yml.gz", ".json.gz", ".model", ""]


def some_model(seed: int) -> tuple[tuple[Any, ...], np.ndarray[Any, Any]]:
    """Constructor arguments, and coefficients from the tiniest to the infinite."""
    rng = np.random.default_rng(seed)
    threshold, sigma = float(rng.random()), float(rng.choice([-1.0, 2.0, rng.random()]))
    geometry = ((16, 24), (8, 8), (8, 8), (8, 8), 9, 1, sigma, 0, threshold, bool(seed % 2), 13, bool(seed % 3))
    size = HOGDescriptor(*geometry).getDescriptorSize()
    svm = (rng.normal(size=size + 1) * 10.0 ** rng.integers(-40, 35, size + 1)).astype(np.float32)
    svm[:10] = [0, -0.0, 1, -1, 1e10, 3e9, 2**31, np.nan, np.inf, -np.inf]
    return geometry, svm


def pair_of_detectors(seed: int) -> tuple[Any, Any]:
    geometry, svm = some_model(seed)
    both: tuple[Any, Any] = HOGDescriptor(*geometry), cv2.HOGDescriptor(*geometry)
    for hog in both:
        if seed % 5:
            hog.setSVMDetector(svm)
    return both


def assert_same_detector(ours: Any, theirs: Any) -> None:
    for name in ATTRIBUTES:
        assert getattr(ours, name) == getattr(theirs, name), name
    assert ours.getWinSigma() == theirs.getWinSigma()
    np.testing.assert_array_equal(ours.svmDetector, theirs.svmDetector)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_one_of_the_two_saves_the_other_loads_whole(tmp_path: Path, suffix: str) -> None:
    for seed in range(10):
        ours, theirs = pair_of_detectors(seed)
        path, own = (tmp_path / f"{name}{seed}{suffix}" for name in ("theirs", "ours"))
        theirs.save(str(path))
        assert_same_detector(HOGDescriptor(path), theirs)
        ours.save(own)
        again = cv2.HOGDescriptor()
        assert again.load(str(own))
        assert_same_detector(ours, again)


@pytest.mark.parametrize("suffix", [".xml", ".yml", ".json", ".xml.gz"])
@pytest.mark.parametrize("stem", ["model", "9lives", "a b.c", "-", "é"])
def test_files_are_opencvs_own_to_the_byte(tmp_path: Path, suffix: str, stem: str) -> None:
    ours, theirs = pair_of_detectors(1)
    path = tmp_path / f"{stem}{suffix}"
    texts = []
    for hog in (ours, theirs):
        hog.save(str(path))
        data = path.read_bytes()
        texts.append(gzip.decompress(data) if suffix.endswith("gz") else data)
        path.unlink()
    assert texts[0] == texts[1]


def test_an_object_is_found_by_its_name(tmp_path: Path) -> None:
    path = tmp_path / "two.yml"
    first, second = HOGDescriptor(), HOGDescriptor((48, 96), (16, 16), (8, 8), (8, 8), 9)
    first.save(path, "first")
    whole = path.read_text()
    second.save(path, "second")
    path.write_text(whole + path.read_text().split("---\n")[1])
    hog = HOGDescriptor(path)
    assert hog.winSize == (64, 128) and hog.load(path, "second") and hog.winSize == (48, 96)
    with pytest.raises(ModelFormatError, match=r"third.*first, second"):
        hog.load(path, "third")


def test_a_file_written_by_hand_may_use_yamls_other_forms(tmp_path: Path) -> None:
    path = tmp_path / "hand.yml"
    lines = ["winSize:", "   - 16", "   - 16", "blockSize: [8, 8]   # pixels", "blockStride: [", "  8,", "  8 ]"]
    lines += ["cellSize: [8,8]", "nbins: 9", "nlevels: 3"]
    path.write_text("%YAML:1.0\r\n---\r\nmine:\r\n   " + "\r\n   ".join(lines))
    hog = HOGDescriptor(path)
    assert (hog.winSize, hog.blockSize, hog.blockStride, hog.nlevels) == ((16, 16), (8, 8), (8, 8), 3)


def test_missing_values_count_as_zero_and_a_missing_detector_keeps_the_old(tmp_path: Path) -> None:
    path = tmp_path / "bare.yml"
    path.write_text(
        "%YAML:1.0\n---\nbare:\n   winSize: [ 64, 128 ]\n   blockSize: [ 16, 16 ]\n   blockStride: [ 8, 8 ]\n"
        "   cellSize: [ 8, 8 ]\n   nbins: 18\n   nlevels: 4\n"
    )
    hogs: tuple[Any, Any] = HOGDescriptor(), cv2.HOGDescriptor()
    for hog in hogs:
        hog.setSVMDetector(limo_hog.HOGDescriptor_getDefaultPeopleDetector())
        assert hog.load(str(path)) and not hog.checkDetectorSize()
    assert_same_detector(*hogs)
    assert (hogs[0].L2HysThreshold, hogs[0].derivAperture, hogs[0].winSigma) == (0.0, 0, 0.0)
    with pytest.raises(limo_hog.DetectorSizeError, match=r"3781 coefficients.*7560"):
        hogs[0].detect(np.zeros((128, 64), np.uint8))
    assert len(hogs[0].compute(np.zeros((128, 64), np.uint8))) == 7560
