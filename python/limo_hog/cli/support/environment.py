"""Facts about this machine and its libraries that affect speed and results."""

from __future__ import annotations

import importlib.util
import os
import platform
import re
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path

import limo_hog
from limo_hog import _core
from limo_hog.parallel import cores


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
        "numpy": version("numpy"),
        "python": platform.python_version(),
        "platform": platform.platform(terse=True),
        "machine": platform.machine(),
    }


def extras() -> dict[str, str]:
    """Say what is installed of each of the package's extras, and the line that installs the rest."""
    wanted: dict[str, list[str]] = {}
    for line in requires("limo-hog") or []:
        found = re.match(r"([\w.-]+).*\bextra == ['\"]([\w-]+)['\"]", line)
        if found and found[1] != "limo-hog":
            wanted.setdefault(found[2], []).append(found[1])
    told = {}
    for name, libraries in sorted(wanted.items()):
        words = [each for library in libraries if (each := _version(library))]
        if len(words) < len(libraries):
            words.append(f"not installed: pip install 'limo-hog[{name}]'")
        told[name] = "; ".join(words)
    return told


def _version(library: str) -> str | None:
    if library.startswith("opencv"):
        # Any of OpenCV's distributions serves.
        found = _opencv()[0]
        return found and f"cv2 {found}"
    try:
        return f"{library} {version(library)}"
    except PackageNotFoundError:
        return None


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
