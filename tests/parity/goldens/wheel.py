"""Prove an installed wheel where there is no OpenCV: `python -m tests.parity.goldens.wheel` needs numpy alone."""

import json
import sys

import numpy as np
from tests.parity.goldens.case import RETURNS, ask
from tests.parity.goldens.record import ANSWERS, CASES, digest

import limo_hog

#: Fewer comparisons prove nothing: drawn images alone make more.
LEAST = 60


def main() -> int:
    """Compare the rectangles of all cases whose image can be made here with OpenCV's recorded ones."""
    answers = json.loads(ANSWERS.read_text())
    equal, wrong = 0, []
    for case in CASES:
        if not case.method.startswith("detect"):
            continue
        try:
            image = case.image()
        except ImportError:  # a photograph of scikit-image, which is not installed
            continue
        answer = answers[case.name]
        if digest(image) != answer["image"]:
            continue
        places, weights = RETURNS[case.method]
        found = ask(case, image, limo_hog)
        same = found[places] == () if answer[places] is None else found[places].tolist() == answer[places]
        if same and answer[places] is not None:
            same = bool(np.allclose(found[weights], answer[weights], rtol=0, atol=1e-5))
        equal += same
        wrong += [] if same else [case.name]
    print(f"limo-hog {limo_hog.__version__}, {limo_hog._core.backend()}: {equal} cases equal OpenCV's", *wrong)
    return int(bool(wrong) or equal < LEAST)


if __name__ == "__main__":
    sys.exit(main())
