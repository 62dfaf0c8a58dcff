"""The live page of `detect --view`."""

from __future__ import annotations

import time
from collections import deque
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from limo_hog.cli.support.results import Row
from limo_hog.cv2_api.arguments import shown
from limo_hog.imaging.writing import jpeg
from limo_hog.live.controls import Parameter, ParameterError
from limo_hog.live.server import Live

if TYPE_CHECKING:
    from limo_hog.cli.support.pictures import Run

#: A picture that was searched, and the same with boxes and numbers drawn into it.
Shown = tuple[Row, NDArray[np.uint8]]


class FilmPage(Live[Shown]):
    """The live page of a `detect` run: pictures with boxes, their rate, a pause, and the threshold, which it sets."""

    def __init__(self, run: Run, host: str, port: int) -> None:
        super().__init__("limo_hog.live", self, host, port)
        about = ("SVM margin", "Least margin of a box that is shown.")
        self._run, self._threshold = run, Parameter("threshold", run.threshold, -1.0, 3.0, *about)
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
        self._run.set_threshold(self._threshold.checked(value))

    def _welcome(self) -> dict[str, Any]:
        return {"threshold": {"min": self._threshold.low, "max": self._threshold.high, "value": self._run.threshold}}

    def _state(self, moment: Shown) -> dict[str, Any]:
        """Return what the page's elements say, by their ids."""
        row, times = moment[0], list(self._times)
        ids = row.people.to_dict().get("ids")
        return {
            "source": row.source,
            "frame": row.frame,
            "people": len(row.people),
            "ids": f"in view: {', '.join(map(str, ids))}" if ids else "",
            "detect": f"{row.ms:.1f} ms",
            "rate": f"{(len(times) - 1) / (times[-1] - times[0]):.1f}/s" if len(times) > 1 else "–",
            "dropped": self._run.dropped,
            "margin": f"{self._run.threshold:.2f}",
            "pause": "Go on" if self.pace.paused else "Pause",
        }

    def _pictures(self, moment: Shown) -> list[bytes]:
        return [jpeg(moment[1])]
