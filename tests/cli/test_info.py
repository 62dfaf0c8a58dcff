"""`limo-hog info` shows versions, hardware and extras."""

import importlib.metadata

import cv2
import pytest
from tests.answers import AnswerTo


def test_info_names_versions_hardware_and_extras(answer_to: AnswerTo, monkeypatch: pytest.MonkeyPatch) -> None:
    real_version, lacking = importlib.metadata.version, {"av": "not-there", "limo-sim": "not-there"}
    monkeypatch.setattr("limo_hog.cli.support.environment.version", lambda one: real_version(lacking.get(one) or one))
    shown = " ".join(answer_to("info").out.split())
    wanted = ["limo-hog", "backend", "CPU features", "threads", f"{cv2.__version__} (with HOGDescriptor)"]
    wanted += [f"{extra} not installed: pip install 'limo-hog[{extra}]'" for extra in ("video", "sim")]
    wanted += [f"plot matplotlib {real_version('matplotlib')}", f"cv cv2 {cv2.__version__}"]
    assert [words for words in wanted if words not in shown] == []
    extras = importlib.metadata.metadata("limo-hog").get_all("Provides-Extra") or []
    assert len(extras) >= 7 and all(f" {extra} " in shown for extra in extras if extra != "all")
