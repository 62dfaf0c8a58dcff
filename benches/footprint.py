"""Import time and peak memory of limo_hog against OpenCV's, each in fresh processes: `python benches/footprint.py`.

For import times, run it where both are installed with their bytecode, as pip does it.
"""

from __future__ import annotations

import subprocess
import sys

ROUNDS = 25
IMPORT = "import time, numpy; start = time.perf_counter(); import {}; print(1e3 * (time.perf_counter() - start))"
CALL = """
import resource, numpy, {0} as hog_of
picture = numpy.random.default_rng(0).integers(0, 256, (1080, 1920, 3), numpy.uint8)
hog = hog_of.HOGDescriptor()
hog.setSVMDetector(hog_of.HOGDescriptor_getDefaultPeopleDetector())
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
hog.detectMultiScale(picture, winStride=(8, 8), padding=(4, 4), scale=1.05)
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024)
"""


def least(code: str, rounds: int) -> dict[str, float]:
    """Run a program for either library in turn; returns the least of what it prints."""
    found: dict[str, list[float]] = {"limo_hog": [], "cv2": []}
    for _ in range(rounds):
        for library, values in found.items():
            command = [sys.executable, "-c", code.format(library)]
            values.append(float(subprocess.run(command, capture_output=True, text=True, check=True).stdout))
    return {library: min(values) for library, values in found.items()}


def main() -> None:
    """Print both tables."""
    for what, unit, values in (
        ("import, beyond numpy's", "ms", least(IMPORT, ROUNDS)),
        ("memory a 1920×1080 colour call adds at its peak", "MB", least(CALL, 3)),
    ):
        ratio = values["limo_hog"] / values["cv2"]
        print(f"{what}: limo_hog {values['limo_hog']:.1f} {unit}, cv2 {values['cv2']:.1f} {unit}, ratio {ratio:.2f}")


if __name__ == "__main__":
    main()
