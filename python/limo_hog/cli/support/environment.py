"""What this machine is made of, as far as it bears on speed and results."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
import platform
from pathlib import Path

import limo_hog
from limo_hog import _core


def environment() -> dict[str, str | int | float | bool | list[str] | None]:
    """Describe machine and libraries; plain values, for a table or JSON."""
    opencv, has_hog = _opencv()
    return {
        "limo_hog": limo_hog.__version__,
        "backend": _core.backend(),
        "cpu_features": [name for name in _core.available_backends() if name != "scalar"],
        "cpu": _cpu(),
        "cores": cores(),
        "load": round(os.getloadavg()[0], 1) if hasattr(os, "getloadavg") else None,
        "threads": limo_hog.get_num_threads(),
        "opencv": opencv,
        "opencv_has_hog": has_hog,
        "numpy": importlib.metadata.version("numpy"),
        "python": platform.python_version(),
        "platform": platform.platform(terse=True),
        "machine": platform.machine(),
    }


def _opencv() -> tuple[str | None, bool]:
    if importlib.util.find_spec("cv2") is None:
        return None, False
    import cv2

    # OpenCV 5's main wheel has none; install_into_cv2() may have put ours in its place.
    hog = getattr(cv2, "HOGDescriptor", None)
    return cv2.__version__, hog is not None and hog is not limo_hog.HOGDescriptor


def _cpu() -> str:
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def cores() -> int:
    """Count the processor cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
