"""Scripts written for OpenCV 4 run under OpenCV 5 after `limo_hog.install_into_cv2()`, and unchanged under 4."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import limo_hog

SCRIPTS = Path(__file__).with_name("opencv5.py")


def run_scripts(python: Path | str, directory: Path, *more: str) -> str:
    environment = os.environ | {"PYTHONPATH": str(Path(limo_hog.__file__).parents[1])}
    command = [str(python), str(SCRIPTS), str(directory), *more]
    return subprocess.run(command, stdout=subprocess.PIPE, text=True, env=environment, timeout=120, check=True).stdout


def test_under_opencv_4_its_own_detector_stays_and_the_scripts_run(tmp_path: Path) -> None:
    assert "installed 0 names" in run_scripts(sys.executable, tmp_path)


@pytest.mark.parametrize(("kind", "more"), [("python", ()), ("contrib-python", ("replace",))])
def test_under_opencv_5_the_scripts_run_on_limo_hog(tmp_path: Path, kind: str, more: tuple[str, ...]) -> None:
    wanted = f"opencv-{kind}-headless>=5"
    uv = os.environ.get("UV") or shutil.which("uv")
    if uv is None:
        pytest.skip("needs uv, to make an environment with OpenCV 5")
    python = tmp_path / "venv" / ("Scripts" if os.name == "nt" else "bin") / "python"
    subprocess.run([uv, "venv", "--quiet", "--python", sys.executable, tmp_path / "venv"], check=True, timeout=60)
    command = [uv, "pip", "install", "--quiet", "--python", str(python), wanted]
    install = subprocess.run(command, capture_output=True, text=True, timeout=240)
    if install.returncode != 0:
        pytest.skip(f"{wanted} cannot be installed here: {install.stderr.strip().splitlines()[-1:]}")
    assert "OpenCV 5" in run_scripts(python, tmp_path, *more)
