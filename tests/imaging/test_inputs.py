"""The detector takes names of files and PIL images, and finds in them what OpenCV's reading of them holds."""

import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from limo_hog import Detections, HOGDescriptor, MissingExtraError, ParameterTypeError, PeopleDetector
from limo_hog.cli.support.scene import street
from limo_hog.exceptions import ImageError, ImageTypeError
from limo_hog.imaging.inputs import as_array


@pytest.fixture(scope="module")
def scene() -> NDArray[np.uint8]:
    return street(640, 480, 3)


@pytest.fixture
def file(tmp_path: Path, scene: NDArray[np.uint8]) -> Path:
    path = tmp_path / "street.png"
    cv2.imwrite(str(path), scene)
    return path


def test_a_file_and_a_pil_image_hold_the_same_people_as_the_array(file: Path, scene: NDArray[np.uint8]) -> None:
    detector = PeopleDetector(min_height=None)
    for image in (file, str(file), Image.open(file)):
        assert detector.detect(image) == detector.detect(scene) != Detections.none()


@pytest.mark.parametrize("mode", ["RGB", "RGBA", "P", "L", "1", "CMYK"])
def test_pil_images_of_8_bits_become_bgr_or_gray(file: Path, mode: str) -> None:
    image = Image.open(file).convert(mode)
    gray = mode in ("L", "1")
    expected = np.asarray(image.convert("L" if gray else "RGB"))
    np.testing.assert_array_equal(as_array(image), expected if gray else expected[..., ::-1])


@pytest.mark.parametrize(
    ("name", "kind", "told"),
    [
        ("text.jpg", ImageError, "text.jpg: not an image"),
        ("none.jpg", FileNotFoundError, "none.jpg"),
        (".", IsADirectoryError, "directory"),
        ("", ImageError, "the name of the picture is empty"),
        *((name, ImageError, "is no file's name") for name in ("a\0b.jpg", "\ud800.jpg")),
    ],
)
def test_a_name_of_no_picture_is_refused(name: str, kind: type[Exception], told: str, here: Path) -> None:
    (here / "text.jpg").write_bytes(b"text")
    with pytest.raises(kind, match=told):
        PeopleDetector().detect(name)


def without(modules: str, code: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    hide = f"import sys; sys.modules.update(dict.fromkeys({modules.split()!r})); import limo_hog;"
    command = [sys.executable, "-c", hide + code, *map(str, arguments)]
    return subprocess.run(command, check=False, capture_output=True, text=True)


def test_without_opencv_pillow_reads_the_file(file: Path, tmp_path: Path, scene: NDArray[np.uint8]) -> None:
    done = without("cv2", "print(limo_hog.PeopleDetector().detect(sys.argv[1]).boxes.tolist())", file)
    assert done.stdout.strip() == str(PeopleDetector().detect(scene).boxes.tolist()), done.stderr

    # Turned by its EXIF data, as OpenCV turns it.
    turned = tmp_path / "turned.jpg"
    exif = Image.Exif()
    exif[0x0112] = 6
    Image.fromarray(scene).save(turned, exif=exif)
    code = "from limo_hog.imaging.inputs import as_array; print(as_array(sys.argv[1]).shape)"
    assert without("cv2", code, turned).stdout.strip() == "(640, 480, 3)" == str(as_array(turned).shape)

    (tmp_path / "text.jpg").write_bytes(b"text")
    code = "limo_hog.PeopleDetector().detect(sys.argv[1])"
    assert without("cv2", code, tmp_path / "text.jpg").stderr.strip().endswith("not an image that Pillow can read")


def test_without_either_the_error_names_what_to_install(file: Path) -> None:
    done = without("cv2 PIL", "limo_hog.PeopleDetector().detect(sys.argv[1])", file)
    assert done.stderr.strip().endswith("reading pictures needs OpenCV or Pillow: pip install 'limo-hog[cv]'")
    assert MissingExtraError.__name__ in done.stderr


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ([], "also a file's name or a PIL image; this is a .*detect_many takes a list"),
        ([[1, 2]], "an image is a uint8 numpy array"),
        (7, "an image is a uint8 numpy array"),
        (None, "did imread find no file"),
        *((Image.new(m, (200, 200)), f"mode {m}; 8 bits a channel are wanted") for m in ("I", "F", "I;16")),
    ],
)
def test_what_is_no_image_is_answered_with_what_was_meant(given: object, told: str) -> None:
    with pytest.raises(ImageTypeError, match=told):
        PeopleDetector().detect(given)  # type: ignore[arg-type]


def test_a_masked_array_is_refused_because_its_mask_would_be_lost() -> None:
    hog = HOGDescriptor()
    for call in (hog.compute, PeopleDetector().detect):
        with pytest.raises(ImageTypeError, match=r"mask would be lost; give its \.filled"):
            call(np.ma.masked_equal(np.zeros((128, 64), np.uint8), 0))
    with pytest.raises(ParameterTypeError, match="mask would be lost"):
        hog.setSVMDetector(np.ma.masked_equal(np.zeros(3781, np.float32), 0))
