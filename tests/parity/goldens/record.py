"""Ask OpenCV 4.14 every case anew and write `answers.json`: `uv run python -m tests.parity.goldens.record`.

The digests are those of an x86-64 CPU with AVX2 and FMA; on others OpenCV rounds a few gradients differently.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from tests.parity.goldens.cases import CASES, RETURNS, Case, ask

ANSWERS = Path(__file__).with_name("answers.json")


def digest(array: Any) -> str:
    """MD5 of the shape, the type and the values in C order."""
    values = np.ascontiguousarray(array)
    return hashlib.md5(f"{values.shape} {values.dtype} ".encode() + values.tobytes()).hexdigest()


def summary(array: Any) -> dict[str, Any] | None:
    """Shorten an array to its digest, and to a few values and their sum, for CPUs that round differently."""
    if isinstance(array, tuple):
        return None
    values = array.ravel()
    some = values[:: max(len(values) // 8, 1)][:8].astype(np.float64)
    total = float(values.sum(dtype=np.float64))
    return {
        "shape": array.shape,
        "dtype": str(array.dtype),
        "md5": digest(array),
        "sum": round(total, 6),
        "some": [round(float(value), 8) for value in some],
    }


def recorded(case: Case) -> dict[str, Any]:
    """Put a case to OpenCV: places and weights in full, arrays in short; `None` where it has `()`."""
    found = ask(case, cv2)
    answer: dict[str, Any] = {"image": digest(case.image())}
    if case.method.startswith("compute"):
        return answer | {name: summary(array) for name, array in found.items()}
    places, weights = (found[name] for name in RETURNS[case.method])
    if isinstance(places, tuple):
        return answer | dict.fromkeys(found)
    listed = [[round(float(weight), 9) for weight in weights.ravel()], places.tolist()]
    return answer | dict(zip(RETURNS[case.method], reversed(listed), strict=True))


def answers_with(clip: float) -> dict[str, Any]:
    """Record the cases of one `L2HysThreshold`: the first block of a process fixes OpenCV's."""
    cv2.setNumThreads(1)  # with more, rectangles come in another order each time
    return {case.name: recorded(case) for case in CASES if case.clip == clip}


def answers() -> dict[str, Any]:
    with multiprocessing.get_context("spawn").Pool(1, maxtasksperchild=1) as pool:
        parts = pool.map(answers_with, sorted({case.clip for case in CASES}), chunksize=1)
    by_name = {name: answer for part in parts for name, answer in part.items()}
    plain: dict[str, Any] = json.loads(json.dumps({case.name: by_name[case.name] for case in CASES}))
    return plain


def write(answers: dict[str, Any]) -> None:
    lines = [f"{json.dumps(name)}: {json.dumps(answer, separators=(',', ':'))}" for name, answer in answers.items()]
    ANSWERS.write_text("{\n" + ",\n".join(lines) + "\n}\n")


if __name__ == "__main__":
    if not cv2.__version__.startswith("4.14."):
        sys.exit(f"OpenCV is {cv2.__version__}, but the answers are those of 4.14: install opencv-python-headless 4.14")
    write(answers())
