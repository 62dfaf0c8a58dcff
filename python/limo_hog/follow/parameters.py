"""Numbers of a controller that may be changed while it drives: their bounds stand with their defaults."""

from __future__ import annotations

import dataclasses
from typing import Any


def bounded(default: float, low: float, high: float) -> Any:
    """Return a dataclass field with a default and the bounds it may be set within, both included.

    Unit and meaning stand in the class's docstring, under Attributes.
    """
    return dataclasses.field(default=default, metadata={"low": low, "high": high})
