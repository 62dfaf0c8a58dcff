"""Ask OpenCV 4.14 every case anew and write `answers.json`: `uv run python -m tests.parity.goldens.record`.

The digests are those of an x86-64 CPU with AVX2 and FMA; on others OpenCV rounds a few gradients differently.
"""

import hashlib
import json
import multiprocessing
import sys
from pathlib import Path
from typing import Any

import numpy as np
from tests.parity.goldens.case import RETURNS, Case, ask
from tests.parity.goldens.specified import specified
from tests.parity.goldens.varied import varied

ANSWERS = Path(__file__).with_name("answers.json")
CASES = [*specified(), *varied()]
#: Values of an array that are recorded themselves, at equal distances: CPUs that round differently compare them.
SAMPLES = 12


def digest(array: Any) -> str:
    return hashlib.md5(np.ascontiguousarray(array).tobytes()).hexdigest()


def sample(array: Any) -> list[float]:
    values = array.ravel()
    return [round(float(value), 8) for value in values[:: max(len(values) // SAMPLES, 1)][:SAMPLES]]


def summary(array: Any) -> dict[str, Any] | None:
    """Shorten an array; `None` stands for `()`, which OpenCV gives for nothing."""
    if isinstance(array, tuple):
        return None
    return {"shape": array.shape, "dtype": str(array.dtype), "md5": digest(array), "sample": sample(array)}


def recorded(case: Case) -> dict[str, Any]:
    """Put a case to OpenCV: places and weights in full, arrays in short."""
    import cv2

    image = case.image()
    found = ask(case, image, cv2)
    answer: dict[str, Any] = {"image": digest(image)}
    if case.method.startswith("compute"):
        return answer | {name: summary(array) for name, array in found.items()}
    places, weights = RETURNS[case.method]
    if isinstance(found[places], tuple):
        return answer | {places: None, weights: None}
    rounded = [round(float(weight), 9) for weight in found[weights].ravel()]
    return answer | {places: found[places].tolist(), weights: rounded}


def recorded_with(clip: float) -> dict[str, Any]:
    import cv2

    cv2.setNumThreads(1)  # with more, rectangles come in another order each time
    return {case.name: recorded(case) for case in CASES if case.clip == clip}


def opencv_answers() -> dict[str, Any]:
    """Record all cases, each `L2HysThreshold` in a process of its own, whose first block fixes OpenCV's."""
    with multiprocessing.get_context("spawn").Pool(1, maxtasksperchild=1) as pool:
        parts = pool.map(recorded_with, sorted({case.clip for case in CASES}), chunksize=1)
    by_name = {name: answer for part in parts for name, answer in part.items()}
    plain: dict[str, Any] = json.loads(json.dumps({case.name: by_name[case.name] for case in CASES}))
    return plain


if __name__ == "__main__":
    import cv2

    if not cv2.__version__.startswith("4.14."):
        sys.exit(f"OpenCV is {cv2.__version__}, but the answers are those of 4.14: install opencv-python-headless 4.14")
    told = opencv_answers().items()
    lines = [f"{json.dumps(name)}: {json.dumps(answer, separators=(',', ':'))}" for name, answer in told]
    ANSWERS.write_text("{\n" + ",\n".join(lines) + "\n}\n")
