"""The live page of `detect --view`."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from limo_hog.cli.support.results import Row
from limo_hog.cv2_api.arguments import shown
from limo_hog.imaging.writing import jpeg
from limo_hog.live.controls import Parameter, ParameterError
from limo_hog.live.server import Live

#: A picture that was searched, boxes and numbers drawn into it; and how many of a live source nobody took so far.
Shown = tuple[Row, NDArray[np.uint8], int]


class FilmPage(Live[Shown]):
    """The live page of `detect`: pictures with boxes, their rate, a pause, and the threshold.

    `set_threshold` is called, from the server's thread, with the SVM margin that the page asks for.
    """

    def __init__(self, threshold: float, set_threshold: Callable[[float], None], host: str, port: int) -> None:
        super().__init__("limo_hog.live", self, host, port)
        about = "Least margin of a box that is shown."
        self._range = Parameter("threshold", threshold, low=-1.0, high=3.0, unit="SVM margin", tooltip=about)
        self.threshold, self._use = threshold, set_threshold
        # When the last pictures came, over which their rate is taken.
        self._times = deque[float](maxlen=25)

    def watch(self, moment: Shown, at: float | None) -> None:
        """Show a picture, and return when the next is wanted: a film is no faster than real time, `at` [s] in it."""
        self._times.append(time.monotonic())
        self._pictured, self._newest = (self._written, moment), moment
        self._written += 1
        self.pace.wait(time.monotonic() if at is None else at)

    def set(self, name: str, value: Any) -> None:
        """Set the threshold; raises `ParameterError`."""
        if name != "threshold":
            raise ParameterError(f"no parameter {shown(name)}; threshold is the only one")
        self.threshold = self._range.checked(value)
        self._use(self.threshold)

    def _welcome(self) -> dict[str, Any]:
        return {"threshold": {"min": self._range.low, "max": self._range.high, "value": self.threshold}}

    def _state(self, moment: Shown) -> dict[str, Any]:
        """Return what the page's elements say, by their ids."""
        (row, _, dropped), times = moment, list(self._times)
        ids = () if row.people.ids is None else row.people.ids.tolist()
        return {
            "source": row.source,
            "frame": row.frame,
            "people": len(row.people),
            "ids": f"in view: {', '.join(map(str, ids))}" if ids else "",
            "detect": f"{row.ms:.1f} ms",
            "rate": f"{(len(times) - 1) / (times[-1] - times[0]):.1f}/s" if len(times) > 1 else "–",
            "dropped": dropped,
            "margin": f"{self.threshold:.2f}",
            "pause": "Go on" if self.pace.paused else "Pause",
        }

    def _pictures(self, moment: Shown) -> list[bytes]:
        return [jpeg(moment[1])]
