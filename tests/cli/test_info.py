"""`limo-hog info` tells what is here."""

from __future__ import annotations

import cv2
import pytest

from limo_hog.cli.main import main


def test_info_names_versions_backend_and_opencv(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info"]) == 0
    shown = capsys.readouterr().out
    for words in ("limo-hog", "backend", "CPU features", "threads", f"{cv2.__version__} (with HOGDescriptor)"):
        assert words in shown
