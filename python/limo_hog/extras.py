"""Optional libraries: the error where one is missing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from limo_hog.exceptions import LimoHogError


class MissingExtraError(LimoHogError):
    """An optional library is not installed; the message names the line that installs it."""


#: Libraries of the extras, by the name they are imported by: what they are called, and the extra.
_LIBRARIES = {
    "aiohttp": ("aiohttp", "view"),
    "av": ("PyAV", "video"),
    "cv2": ("OpenCV", "cv"),
    "cyclonedds": ("Cyclone DDS", "ros2"),
    "limo_sim": ("the arena", "sim"),
    "lz4": ("LZ4", "record"),
    "matplotlib": ("matplotlib", "plot"),
    "mcap": ("mcap", "record"),
    "pandas": ("pandas", "pandas"),
    "rosbags": ("rosbags", "record"),
    "scipy": ("SciPy", "train"),
    "supervision": ("supervision", "track"),
    "shtab": ("shtab", "completion"),
    "threadpoolctl": ("threadpoolctl", "train"),
    "tomli": ("tomli", "ros2"),
    "trackers": ("trackers", "track"),
    "zstandard": ("Zstandard", "record"),
}


def missing_extra(by: str, error: ImportError) -> MissingExtraError:
    """Return the error that says what to do after a failed import."""
    name = (error.name or "").partition(".")[0]
    library, extra = _LIBRARIES.get(name, (name or "a library", None))
    if not isinstance(error, ModuleNotFoundError):
        # Such as OpenCV with windows, where the system has no libGL.
        return MissingExtraError(f"{by} needs {library}, which is installed but does not load: {error}")
    if extra is None:
        return MissingExtraError(f"{by} needs the module {name}, which is not installed: install limo-hog anew")
    return MissingExtraError(f"{by} needs {library}: pip install 'limo-hog[{extra}]'")


@contextmanager
def needed(by: str) -> Iterator[None]:
    """Raise an error that names what to install when an import inside fails.

    >>> with needed(by="writing H.264 video"):
    ...     import av

    Raises `MissingExtraError`: "writing H.264 video needs PyAV: pip install 'limo-hog[video]'", or that the library is
    there and does not load.
    """
    try:
        yield
    except ImportError as error:
        raise missing_extra(by, error) from error
