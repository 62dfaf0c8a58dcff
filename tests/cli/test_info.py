"""`limo-hog info` shows versions, hardware and extras."""

from __future__ import annotations

import importlib.metadata

import cv2
import pytest

from limo_hog.cli.main import main


def test_info_names_every_extra_and_the_line_that_installs_it(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def lacking(name: str) -> str:
        if name in ("av", "limo-sim"):
            raise importlib.metadata.PackageNotFoundError(name)
        return real_version(name)

    real_version = importlib.metadata.version
    monkeypatch.setattr("limo_hog.cli.support.environment.version", lacking)
    assert main(["info"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    for words in (
        "video not installed: pip install 'limo-hog[video]'",
        "sim not installed: pip install 'limo-hog[sim]'",
        f"plot matplotlib {real_version('matplotlib')}",
        f"cv cv2 {cv2.__version__}",
    ):
        assert words in shown
    extras = importlib.metadata.metadata("limo-hog").get_all("Provides-Extra") or []
    assert len(extras) >= 7 and all(f" {extra} " in shown for extra in extras if extra != "all")


def test_info_names_versions_backend_and_opencv(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info"]) == 0
    shown = capsys.readouterr().out
    for words in ("limo-hog", "backend", "CPU features", "threads", f"{cv2.__version__} (with HOGDescriptor)"):
        assert words in shown
