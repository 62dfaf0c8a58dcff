"""Numbers of a controller as data: each is one entry, with unit, meaning and the bounds it may be set within."""

from __future__ import annotations

import dataclasses
from typing import Any


def param(default: Any, unit: str, meaning: str, low: float | None = None, high: float | None = None) -> Any:
    """Return a dataclass field: default, unit or "1", meaning, and the bounds it may be set within while driving."""
    about: dict[str, Any] = {"unit": "" if unit == "1" else unit, "tooltip": meaning}
    return dataclasses.field(default=default, metadata=about if high is None else about | {"low": low, "high": high})
