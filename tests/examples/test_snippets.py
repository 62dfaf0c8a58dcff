"""The Python blocks of both READMEs and of docs/coming-from.md run, and do what the pages say."""

from itertools import islice
from pathlib import Path
from typing import Any

import cv2 as typed_cv2
import numpy as np
import pytest
from tests.examples.pages import ROOT, Page

import limo_hog
from limo_hog.cli.support.scene import street
from limo_hog.imaging.writing import video_writer, write_image

cv2: Any = typed_cv2  # its types do not know `ml`

#: Left top corners of windows in the drawn street: on its person of 144 px, and where nobody is.
PERSON, NOBODY = (529, 186), [(x, y) for x in range(420, 460, 4) for y in range(0, 120, 12)]


def crop(image: Any, x: int, y: int) -> Any:
    return np.ascontiguousarray(image[y : y + 128, x : x + 64])


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder that docs/coming-from.md describes, as the working directory."""
    rng, scene = np.random.default_rng(12), street(640, 480, 3)
    write_image(tmp_path / "street.jpg", scene)
    for i in range(30):
        dx, dy = rng.integers(-2, 3, 2)
        write_image(tmp_path / "people" / f"{i}.png", crop(scene, PERSON[0] + dx, PERSON[1] + dy))
    for i, (x, y) in enumerate(NOBODY):
        write_image(tmp_path / "background" / f"{i}.png", crop(scene, x, y))
    write_image(tmp_path / "empty" / "0.png", scene[::-1])  # nobody stands on their head
    monkeypatch.chdir(tmp_path)
    return tmp_path


def saved_svm(path: Path, kind: int, negative: int) -> tuple[Any, Any]:
    """Let OpenCV 4 train and save a linear SVM; return it and the descriptors."""
    hog = cv2.HOGDescriptor()
    paths = sorted(path.glob("people/*")) + sorted(path.glob("background/*"))
    features = np.stack([hog.compute(cv2.imread(str(name))) for name in paths])
    labels = np.array([1 if name.parent.name == "people" else negative for name in paths])
    svm = cv2.ml.SVM_create()
    for name, value in {"Type": kind, "Kernel": cv2.ml.SVM_LINEAR, "C": 0.01, "P": 0.1, "Nu": 0.2}.items():
        getattr(svm, f"set{name}")(value)
    if kind == cv2.ml.SVM_ONE_CLASS:
        features, labels = features[labels == 1], labels[labels == 1]
    regression = kind in (cv2.ml.SVM_EPS_SVR, cv2.ml.SVM_NU_SVR)
    svm.train(features, cv2.ml.ROW_SAMPLE, labels.astype(np.float32 if regression else np.int32))
    svm.save(str(path / "svm.xml"))
    return svm, features


def run(page: str) -> dict[str, Any]:
    """Run the blocks of a page, one after another, and return what they leave behind."""
    names: dict[str, Any] = {}
    for i, block in enumerate(Page(ROOT / page).python):
        exec(compile(block, f"{page}, block {i}", "exec"), names)
    return names


def test_the_readme_finds_people(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert len(run("README.md")["boxes"]) >= 2 and capsys.readouterr().out.count("a person at") >= 2


def test_the_arenas_readme_follows_a_person(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("sim/README.md")["episode"].seconds == 20 and "ScoreCard(" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("kind", "negative"),
    [("C_SVC", -1), ("C_SVC", 0), ("NU_SVC", -1), ("NU_SVC", 0), ("EPS_SVR", -1), ("NU_SVR", -1), ("ONE_CLASS", 0)],
)
def test_a_saved_svm_decides_in_the_detector_as_in_opencv(folder: Path, kind: str, negative: int) -> None:
    svm, features = saved_svm(folder, getattr(cv2.ml, f"SVM_{kind}"), negative)
    (recipe,) = (block for block in Page(ROOT / "docs/coming-from.md").python if "opencv_ml_svm" in block)
    names: dict[str, Any] = {"cv2": cv2, "np": np, "limo_hog": limo_hog}
    exec(recipe, names)
    margins = features @ names["coefficients"][:-1] + names["coefficients"][-1]
    said = svm.predict(features)[1].ravel()
    sure = np.abs(margins) > 1e-3  # support vectors of a one-class SVM lie on the border
    assert np.array_equal(margins[sure] > 0, said[sure] > (1 + negative) / 2)
    assert margins[:30].mean() > 0.1  # people
    assert np.allclose(names["mine"].svmDetector, names["coefficients"].astype(np.float32))


def test_coming_from_other_libraries(folder: Path) -> None:
    saved_svm(folder, cv2.ml.SVM_C_SVC, -1)
    names = run("docs/coming-from.md")
    # scikit-image: the drawing of the photograph, and a row of numbers for each face.
    assert names["drawing"].shape == names["gray"].shape and names["descriptors"].shape == (20, 13 * 13 * 4 * 8)

    # dlib: inclusive corners, best first.
    assert len(names["corners"]) >= 2
    assert all(right > left and bottom > top for left, top, right, bottom, _ in names["corners"])

    # scikit-learn: mined negatives were added, and the file that was written finds the person it was trained on.
    assert len(names["others"]) > len(NOBODY)
    best = names["boxes"][int(np.argmax(names["weights"]))]
    assert np.abs(best[:2] - PERSON).max() < 16
    again = cv2.HOGDescriptor()
    assert again.load(str(folder / "mine.yml"))
    assert np.array_equal(again.svmDetector, limo_hog.HOGDescriptor("mine.yml").svmDetector)


def test_people_in_a_film_of_the_arena_are_counted(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("trackers", reason="needs limo-hog[track]")
    from benches.tracking import arena

    with video_writer(folder / "walk.mp4", fps=10) as write:
        for image, people in islice(arena("sharp_turns"), 150):
            write(image)
            seen = people
    ((_, (left, _, width, _), _),) = seen
    assert left + width < 320
    (block,) = [block for block in Page(ROOT / "docs" / "detect.md").python if "LineZone" in block]
    assert len(block.replace("\n\n", "\n").splitlines()) <= 15
    exec(compile(block, "docs/detect.md", "exec"), {})
    # By the arena's truth the person crosses the middle to the left, to the right, and to the left again.
    assert capsys.readouterr().out == "1 to the right, 2 to the left, 0 on the right\n"
