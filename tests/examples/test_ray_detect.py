"""The Ray Data example finds what the detector finds, with one worker and with two."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from limo_hog.cli.support.scene import street
from limo_hog.detector import PeopleDetector
from limo_hog.imaging.writing import write_image

EXAMPLE = Path(__file__).parents[2] / "examples" / "ray_detect.py"


@pytest.mark.parametrize("workers", [1, 2])
def test_people_are_found_on_every_worker(workers: int, tmp_path: Path) -> None:
    pytest.importorskip("ray", reason="needs Ray: pip install 'ray[data]'")
    parquet = pytest.importorskip("pyarrow.parquet")
    picture = street(192, 256, 3)
    for i in range(40):
        write_image(tmp_path / "in" / f"{i:02}.png", np.ascontiguousarray(np.roll(picture, 4 * i, axis=1)))
    (tmp_path / "in" / "broken.png").write_bytes(b"no picture")
    command = [sys.executable, str(EXAMPLE), str(tmp_path / "in"), str(tmp_path / "out"), "--workers", str(workers)]
    said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    assert "41 pictures in " in said and f"on {workers} workers" in said
    rows = {Path(row["path"]).name: row for row in parquet.read_table(tmp_path / "out").to_pylist()}
    assert len(rows) == 41
    assert rows.pop("broken.png")["error"] == "not an image that OpenCV can read"
    expected = PeopleDetector().detect(picture)
    assert rows["00.png"]["boxes"] == expected.boxes.ravel().tolist()
    assert rows["00.png"]["scores"] == expected.scores.tolist()
    assert all(row["error"] == "" for row in rows.values())
