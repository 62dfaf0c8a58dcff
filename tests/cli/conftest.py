"""Folders that several tests of the command line read."""

from pathlib import Path

import numpy as np
import pytest
from tests.cli.material import PICTURE

from limo_hog.imaging.writing import write_image


@pytest.fixture
def pictures(tmp_path: Path) -> Path:
    folder = tmp_path / "in"
    write_image(folder / "a.png", PICTURE)
    write_image(folder / "deep" / "b.png", np.ascontiguousarray(PICTURE[:, ::-1]))
    write_image(folder / "c.png", np.zeros((20, 20, 3), np.uint8))
    return folder
