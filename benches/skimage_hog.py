"""`limo_hog.skimage` beside scikit-image, fasthog and hogpp: a Markdown table of the least times.

    uv run --no-sync --with fasthog --with hogpp python benches/skimage_hog.py

One thread; in each round every function runs once on the same image, so that whatever slows the machine down slows all.
Rivals that are not installed are left out.
"""

from __future__ import annotations

import importlib
import importlib.util
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import skimage.feature

import limo_hog
from limo_hog.skimage import hog, hogs

ROUNDS = 15


def least(functions: list[Callable[[], Any]]) -> list[float]:
    """Return the least time of each function, called in turns [ms]."""
    times = []
    for _ in range(ROUNDS):
        for function in functions:
            begun = time.perf_counter()
            function()
            times.append(time.perf_counter() - begun)
    return [1e3 * min(times[index :: len(functions)]) for index in range(len(functions))]


def of_hogpp(image: Any) -> Any:
    """Return hogpp's blocks of 2 × 2 cells."""
    maker = importlib.import_module("hogpp").IntegralHOGDescriptor()
    maker.compute(image)
    return maker.features_


def main() -> None:
    """Print the table."""
    limo_hog.set_num_threads(1)
    random = np.random.default_rng(0)
    large, crop, faces = random.random((512, 512)), random.random((128, 64)), random.random((10, 112, 112, 3))
    crops, small = random.random((100, 128, 64)), {"cells_per_block": (2, 2)}
    coarse = (large * 255).astype(np.uint8)
    of_faces = {"orientations": 8, "cells_per_block": (2, 2), "channel_axis": -1}
    theirs = skimage.feature.hog
    rows: list[tuple[str, str, Callable[[], Any], Callable[[], Any]]] = [
        ("512 × 512, float64", "scikit-image", lambda: theirs(large), lambda: hog(large)),
        ("512 × 512, uint8", "scikit-image", lambda: theirs(coarse), lambda: hog(coarse)),
        ("one crop of 64 × 128", "scikit-image", lambda: theirs(crop), lambda: hog(crop)),
        ("100 crops of 64 × 128", "scikit-image", lambda: [theirs(crop) for crop in crops], lambda: hogs(crops)),
        (
            "10 faces, RGB",
            "scikit-image",
            lambda: [theirs(face, **of_faces) for face in faces],
            lambda: hogs(faces, **of_faces),
        ),
    ]
    rivals: dict[str, Callable[[Any], Any]] = {
        "fasthog": lambda image: importlib.import_module("fasthog").hog(image, signed=False),
        "hogpp": of_hogpp,
    }
    for name, rival in rivals.items():
        if importlib.util.find_spec(name):
            rows += [
                (
                    f"{image.shape[1]} × {image.shape[0]}, blocks of 2 × 2",
                    name,
                    lambda r=rival, i=image: r(i),
                    lambda i=image: hog(i, **small),
                )
                for image in (large, crop)
            ]
    print("| image | rival | rival [ms] | limo-hog [ms] | times as fast |\n|---|---|---|---|---|")
    for image, rival, *functions in rows:
        slow, fast = least(functions)
        print(f"| {image} | {rival} | {slow:.3f} | {fast:.3f} | {slow / fast:.1f} |")


if __name__ == "__main__":
    main()
