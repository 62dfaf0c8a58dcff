"""What a descriptor is at one instant: replaced whole, so that no thread sees parts of two."""

from __future__ import annotations

import os
import threading
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from limo_hog import _core
from limo_hog.cv2_api.geometry import Geometry

#: Held only while one state takes another's place. A child forked meanwhile by another thread would wait for it for
#: ever, and so gets a new one.
_REPLACING = threading.Lock()


def _renew() -> None:
    global _REPLACING
    _REPLACING = threading.Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_renew)


class Holder(Protocol):
    """What holds a state."""

    _state: State


class State:
    """A geometry and the coefficients of an SVM, neither of which changes.

    What is compiled of them is made when first needed; two threads that need it at once make the same twice.
    """

    __slots__ = ("_armed", "_bare", "geometry", "svm")

    def __init__(self, geometry: Geometry, svm: NDArray[np.float32] | None = None) -> None:
        self.geometry = geometry
        self.svm = svm
        self._bare: _core.Hog | None = None
        self._armed: _core.Hog | None = None

    @property
    def bare(self) -> _core.Hog:
        """The compiled geometry without the SVM."""
        if self._bare is None:
            self._bare = self.geometry.compiled(None)
        return self._bare

    @property
    def armed(self) -> _core.Hog:
        """The compiled geometry with the SVM."""
        if self._armed is None:
            self._armed = self.geometry.compiled(self.svm)
        return self._armed

    def with_svm(self, svm: NDArray[np.float32] | None) -> State:
        """Return this geometry with another SVM."""
        state = State(self.geometry, svm)
        state._bare = self._bare
        return state


def replaced(owner: Holder, before: State, after: State) -> bool:
    """Put `after` in the place of the owner's state `before`; false where another thread has replaced that already."""
    with _REPLACING:
        if owner._state is not before:
            return False
        owner._state = after
        return True
