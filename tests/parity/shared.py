"""Where photographs and OpenCV's answers to them lie: beside the checkout, for they are not ours to publish."""

from pathlib import Path

SHARED = Path(__file__).parents[2].parent / "shared"
#: Once the folder is there, all that belongs in it is needed: a missing file is an error, not a reason to skip.
PRESENT = SHARED.is_dir()
ABSENT = "needs ../shared beside the checkout"
