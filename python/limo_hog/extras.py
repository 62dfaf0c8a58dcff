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
    "limo_sim": ("the arena", "sim"),
    "matplotlib": ("matplotlib", "plot"),
    "mcap": ("mcap", "record"),
    "rosbags": ("rosbags", "record"),
    "scipy": ("SciPy", "train"),
    "shtab": ("shtab", "completion"),
    "sklearn": ("scikit-learn", "train"),
    "threadpoolctl": ("threadpoolctl", "train"),
}


def missing_extra(by: str, error: ImportError) -> MissingExtraError:
    """Return the error that says what to do after a failed import."""
    name = (error.name or "").partition(".")[0]
    library, extra = _LIBRARIES.get(name, (name or "a library", None))
    if not isinstance(error, ModuleNotFoundError):
        return _broken(by, library, error)
    if extra is None:
        return MissingExtraError(f"{by} needs the module {name}, which is not installed: install limo-hog anew")
    return MissingExtraError(f"{by} needs {library}: pip install 'limo-hog[{extra}]'")


def _broken(by: str, library: str, error: ImportError) -> MissingExtraError:
    # Such as OpenCV with windows, where the system has no libGL.
    return MissingExtraError(f"{by} needs {library}, which is installed but does not load: {error}")


@contextmanager
def needed(by: str, what: str, install: str) -> Iterator[None]:
    """Raise an error that names what to install when an import inside fails.

    >>> with needed(by="writing H.264 video", what="PyAV", install="'limo-hog[video]'"):
    ...     import av

    Raises
    ------
    MissingExtraError
        "writing H.264 video needs PyAV: pip install 'limo-hog[video]'"; or that the library is there and does not load.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        raise MissingExtraError(f"{by} needs {what}: pip install {install}") from error
    except ImportError as error:
        raise _broken(by, what, error) from error
