"""The live page of `detect --view`."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from limo_hog.cli.support.results import Row
from limo_hog.cv2_api.arguments import shown
from limo_hog.imaging.writing import jpeg
from limo_hog.live.controls import Parameter, ParameterError
from limo_hog.live.server import Live

#: Bounds of the threshold that the page sets [SVM margin].
_LOWEST, _HIGHEST = -1.0, 3.0
#: Pictures over which their rate is taken.
_RATE_OVER = 25


#: A picture that was searched, boxes and numbers drawn into it; and how many of a live source nobody took so far.
Shown = tuple[Row, NDArray[np.uint8], int]


class FilmPage(Live[Shown]):
    """The live page of `detect`: pictures with boxes, their rate, a pause, and the threshold.

    `set_threshold` is called, from the server's thread, with the SVM margin that the page asks for.
    """

    def __init__(self, threshold: float, set_threshold: Callable[[float], None], host: str, port: int) -> None:
        super().__init__("limo_hog.live", self, host, port)
        about = ("SVM margin", "Least margin of a box that is shown.")
        self.threshold, self._use = Parameter("threshold", threshold, _LOWEST, _HIGHEST, *about), set_threshold
        self._times: list[float] = []

    def watch(self, moment: Shown, at: float | None) -> None:
        """Show a picture, and return when the next is wanted: a film is no faster than real time, `at` [s] in it."""
        self._times = [*self._times[1 - _RATE_OVER :], time.monotonic()]
        self._pictured, self._newest = (self._written, moment), moment
        self._written += 1
        self.pace.wait(time.monotonic() if at is None else at)

    def set(self, name: str, value: Any) -> None:
        """Set the threshold; raises `ParameterError`."""
        if name != "threshold":
            raise ParameterError(f"no parameter {shown(name)}; threshold is the only one")
        self.threshold = dataclasses.replace(self.threshold, value=self.threshold.checked(value))
        self._use(self.threshold.value)

    def _welcome(self) -> dict[str, Any]:
        return {"threshold": dataclasses.asdict(self.threshold)}

    def _state(self, moment: Shown) -> dict[str, Any]:
        row, _, dropped = moment
        seconds = self._times[-1] - self._times[0]
        return {
            "source": row.source,
            "frame": row.frame,
            "people": len(row.people),
            "ids": [] if row.people.ids is None else row.people.ids.tolist(),
            "detect_ms": row.ms,
            "rate": (len(self._times) - 1) / seconds if seconds else None,
            "dropped": dropped,
            "threshold": self.threshold.value,
            "paused": self.pace.paused,
        }

    def _pictures(self, moment: Shown) -> list[bytes]:
        return [jpeg(moment[1])]
