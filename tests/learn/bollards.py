"""The example's bollards, for tests: written once for a folder."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

EXAMPLE = Path(__file__).parents[2] / "examples" / "bollards.py"


def example() -> ModuleType:
    """Import the example, which is no module of a package."""
    spec = importlib.util.spec_from_file_location("bollards_example", EXAMPLE)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
