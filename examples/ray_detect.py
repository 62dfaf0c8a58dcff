"""Find people in a folder of pictures on the machines of a Ray cluster: a Ray Data job with the detector in actors.

    pip install "ray[data]" "limo-hog[cv]"
    python ray_detect.py PICTURES OUT --workers 2

OUT gets Parquet files with a row for each picture: path, boxes (x, y, w, h) and scores, best first, or the error.
With RAY_ADDRESS set the job runs on that cluster, otherwise on this machine. PICTURES is a folder or a bucket.
"""

from __future__ import annotations

import argparse
import os
import time
from typing import Any

import cv2
import numpy as np
import ray

import limo_hog


class FindPeople:
    """Detects people in batches of encoded pictures; Ray keeps one on each core, with its detector."""

    def __init__(self) -> None:
        # Ray fills the machine with actors; each stays on its own core.
        limo_hog.set_num_threads(1)
        cv2.setNumThreads(1)
        self._detector = limo_hog.PeopleDetector()

    def __call__(self, batch: dict[str, Any]) -> dict[str, list[Any]]:
        """Turn columns `path` and `bytes` into `path`, `boxes`, `scores` and `error`."""
        found: dict[str, list[Any]] = {"path": list(batch["path"]), "boxes": [], "scores": [], "error": []}
        for data in batch["bytes"]:
            image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR) if data else None
            if image is None:
                row: tuple[Any, ...] = ([], [], "not an image that OpenCV can read")
            else:
                people = self._detector.detect(image.astype(np.uint8, copy=False))
                row = (people.boxes.ravel().tolist(), people.scores.tolist(), "")
            for name, value in zip(("boxes", "scores", "error"), row, strict=True):
                found[name].append(value)
        return found


def main() -> None:
    """Run the job and print its rate."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("pictures")
    parser.add_argument("out")
    parser.add_argument("--workers", type=int, default=2, help="detectors at work at once")
    args = parser.parse_args()
    if "RAY_ADDRESS" not in os.environ:
        # One more core than detectors, for reading.
        ray.init(num_cpus=args.workers + 1, include_dashboard=False, log_to_driver=False)
    # Reading mostly waits: several readers share a core, so that they leave the others to the detectors.
    pictures = ray.data.read_binary_files(args.pictures, include_paths=True, ray_remote_args={"num_cpus": 0.2})
    people = pictures.map_batches(FindPeople, compute=ray.data.ActorPoolStrategy(size=args.workers), batch_size=16)
    start = time.perf_counter()
    people.write_parquet(args.out)
    seconds = time.perf_counter() - start
    count = ray.data.read_parquet(args.out).count()
    print(f"{count} pictures in {seconds:.1f} s on {args.workers} workers: {count / seconds:.0f} a second")


if __name__ == "__main__":
    main()
