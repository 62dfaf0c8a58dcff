"""What a descriptor is at one instant: replaced whole, so that no thread sees parts of two."""

from __future__ import annotations

import os
import threading
from typing import Any

import numpy as np
from numpy.typing import NDArray

from limo_hog import _core
from limo_hog.cv2_api.geometry import Geometry
from limo_hog.exceptions import DetectorSizeError

#: Held only while one state takes another's place. A child forked meanwhile by another thread would wait for it for
#: ever, and so gets a new one.
_REPLACING = threading.Lock()


def _renew() -> None:
    global _REPLACING
    _REPLACING = threading.Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_renew)


class State:
    """A geometry and the coefficients of an SVM, neither of which changes.

    They are compiled when first needed; two threads that need that at once compile twice.
    """

    __slots__ = ("_compiled", "geometry", "svm")

    def __init__(self, geometry: Geometry, svm: NDArray[np.float32] | None = None) -> None:
        self.geometry = geometry
        self.svm = svm
        self._compiled: _core.Hog | None = None

    @property
    def detecting(self) -> _core.Hog:
        """Geometry and SVM, compiled; `DetectorSizeError` where the SVM does not fit."""
        if self._compiled is None:
            self._compiled = self.geometry.compiled(self.svm)
        return self._compiled

    @property
    def describing(self) -> _core.Hog:
        """As `detecting`, or the geometry alone where the SVM does not fit."""
        try:
            return self.detecting
        except DetectorSizeError:
            return self.geometry.compiled(None)

    def __reduce__(self) -> tuple[type[State], tuple[Geometry, NDArray[np.float32] | None]]:
        return State, (self.geometry, self.svm)  # what is compiled cannot be pickled


def replaced(owner: Any, before: State, after: State) -> bool:
    """Put `after` in the place of the owner's state `before`; false where another thread has replaced that already."""
    with _REPLACING:
        if owner._state is not before:
            return False
        owner._state = after
        return True
