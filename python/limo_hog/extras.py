"""Optional libraries: the error where one is missing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from limo_hog.exceptions import LimoHogError


class MissingExtraError(LimoHogError):
    """An optional library is not installed; the message names the line that installs it."""


#: Libraries of the extras, by the name they are imported by: what they are called, and the extra.
_LIBRARIES = {
    "av": ("PyAV", "video"),
    "cv2": ("OpenCV", "cv"),
    "cyclonedds": ("Cyclone DDS", "ros2"),
    "matplotlib": ("matplotlib", "plot"),
    "mcap": ("mcap", "record"),
    "rerun": ("Rerun", "viz"),
    "rosbags": ("rosbags", "record"),
    "scipy": ("SciPy", "train"),
    "sklearn": ("scikit-learn", "train"),
    "threadpoolctl": ("threadpoolctl", "train"),
}


def missing_extra(by: str, error: ModuleNotFoundError) -> MissingExtraError:
    """Return the error that names what to install after a failed import.

    Raises
    ------
    ModuleNotFoundError
        `error` itself, where it is about no library of an extra.
    """
    library, extra = _LIBRARIES.get((error.name or "").partition(".")[0], (None, None))
    if library is None:
        raise error
    return MissingExtraError(f"{by} needs {library}: pip install 'limo-hog[{extra}]'")


@contextmanager
def needed(by: str, what: str, install: str) -> Iterator[None]:
    """Raise an error that names what to install when an import inside fails.

    >>> with needed(by="limo-hog follow", what="the simulator", install="limo-sim"):
    ...     import limo_sim

    Raises
    ------
    MissingExtraError
        "limo-hog follow needs the simulator: pip install limo-sim".
    """
    try:
        yield
    except ModuleNotFoundError as error:
        raise MissingExtraError(f"{by} needs {what}: pip install {install}") from error
