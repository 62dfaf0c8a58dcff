"""limo-hog's names put into `cv2` where it lacks them, as OpenCV 5 does."""

from __future__ import annotations

import warnings

from limo_hog.cv2_api import functions
from limo_hog.cv2_api.hog import HOGDescriptor
from limo_hog.exceptions import HogError
from limo_hog.extras import needed


def install_into_cv2(*, replace: bool = False) -> list[str]:
    """Put the HOG detector and `groupRectangles` into `cv2` where it lacks them, so that OpenCV 4 scripts run.

    From then on `except cv2.error` catches every `HogError`, too.

    Parameters
    ----------
    replace
        Whether ours take the place of those that `cv2` has: OpenCV 4's, to be faster; those of opencv-contrib 5, to
        get OpenCV 4's descriptors.

    Returns
    -------
    names
        Those that were put there; none with OpenCV 4, which keeps its own unless `replace`.

    Raises
    ------
    MissingExtraError
        OpenCV is not installed.

    Warns
    -----
    UserWarning
        OpenCV keeps a `HOGDescriptor` that describes otherwise than OpenCV 4's, as opencv-contrib 5 has it.
    """
    with needed(by="limo_hog.install_into_cv2"):
        import cv2
    if not issubclass(HogError, cv2.error):
        HogError.__bases__ += (cv2.error,)
    # With the functions and constants that left OpenCV beside it.
    names = {name: value for name, value in vars(functions).items() if name.startswith(("HOGD", "groupRect"))}
    names["HOGDescriptor"] = HOGDescriptor
    put = [name for name in names if replace or not hasattr(cv2, name)]
    for name in put:
        setattr(cv2, name, names[name])
    if cv2.HOGDescriptor((64, 128), (16, 16), (8, 8), (8, 8), 9).gammaCorrection:
        warnings.warn(
            f"OpenCV {cv2.__version__} keeps its own HOGDescriptor, which with arguments corrects gamma, as OpenCV 4's "
            "does not: its descriptors differ. install_into_cv2(replace=True) puts limo-hog's in its place",
            stacklevel=2,
        )
    return put
