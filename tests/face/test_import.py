"""What `import limo_hog` brings along, and what it leaves to later imports."""

import re
import subprocess
import sys
from importlib.metadata import metadata, requires, version
from pathlib import Path

import pytest

import limo_hog

ROOT = Path(__file__).parents[2]


#: Modules that `import limo_hog` does not need.
UNWANTED = (
    "cv2 rich pathlib gzip json xml argparse importlib.metadata limo_hog.cli limo_hog.follow limo_hog.imaging "
    "limo_hog.ros2 limo_hog.cv2_api.model_files"
).split()


def test_importing_the_detector_imports_little_beside_numpy() -> None:
    code = "import sys, numpy; before = {*sys.modules}; import limo_hog; print(*{*sys.modules} - before)"
    imported = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert "limo_hog" in imported
    assert [name for name in imported for unwanted in UNWANTED if f"{name}.".startswith(f"{unwanted}.")] == []


def test_the_package_imports_nothing_but_its_extension_through_its_own_front_door() -> None:
    for path in Path(limo_hog.__file__).parent.rglob("*.py"):
        names = re.findall(r"^\s*(?:from limo_hog import|import limo_hog$) *(.*)", path.read_text(), re.MULTILINE)
        assert "cli" in path.parts or {*names} <= {"_core"}, path


def test_the_version_is_that_of_the_crate_for_both_distributions() -> None:
    for file in ("Cargo.toml", "sim/pyproject.toml"):
        assert re.findall(r'^version = "(.+)"$', (ROOT / file).read_text(), re.MULTILINE) == [limo_hog.__version__]
    assert version("limo-hog") == version("limo-sim") == limo_hog.__version__


def test_what_the_package_has_not_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match=r"'limo_hog' has no attribute 'nothing'"):
        getattr(limo_hog, "nothing")  # noqa: B009


def test_no_distribution_requires_an_opencv_and_no_extra_but_cv_names_one() -> None:
    lines = [line for name in ("limo-hog", "limo-sim") for line in requires(name) or []]
    named = [line for line in lines if re.search(r"opencv|\[cv|,cv", line)]
    assert named == [line for line in lines if re.match(r"opencv-python-headless.*extra == ['\"]cv['\"]", line)]
    (everything,) = [line for line in lines if line.startswith("limo-hog[")]
    # (`track` brings OpenCV by way of trackers: it is none of `all`.)
    extras = set(metadata("limo-hog").get_all("Provides-Extra") or []) - {"all", "cv", "track"}
    assert set(re.findall(r"\w+", everything.partition("]")[0].partition("[")[2])) == extras


def test_the_extra_train_brings_what_training_imports_and_nothing_else() -> None:
    lines = [line for line in requires("limo-hog") or [] if re.search(r"extra == ['\"]train['\"]", line)]
    brought = {re.split(r"\W", line)[0] for line in lines}
    solver = (ROOT / "python" / "limo_hog" / "learn" / "solver.py").read_text("utf-8")
    assert brought == set(re.findall(r"^ +from (\w+)", solver, re.MULTILINE))
