"""A run as a log for the Rerun viewer."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from limo_hog.atomic import whole_file
from limo_hog.extras import needed
from limo_sim.run.episode import Moment
from limo_sim.view.reading import reading

with needed(by="--rerun"):
    import rerun as rr

_ROBOT, _PERSON, _WALL = (31, 111, 235), (209, 36, 47), (138, 148, 158)
_OTHER, _CHOSEN = (0, 158, 115), (213, 94, 0)


@contextmanager
def logged(path: Path, room_half: float) -> Iterator[Callable[[Moment], None]]:
    """Give a function that logs a moment: camera with boxes, depth, map of a room of ± `room_half` [m], and series."""
    with whole_file(path) as part:
        log = rr.RecordingStream("limo-hog")
        log.save(part)
        corners = room_half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]])
        log.log("map/walls", rr.LineStrips2D([corners], colors=[_WALL]), static=True)
        trail: deque[tuple[float, float]] = deque(maxlen=300)

        def watch(moment: Moment) -> None:
            step, frame, now = moment.step, moment.frame, reading(moment.step)
            log.set_time("arena", duration=step.time)
            if frame is not None:
                log.log("camera", rr.Image(frame.image, color_model="BGR").compress(jpeg_quality=85))
                # Every second pixel in millimetres, a tenth of the bytes: this is to look at.
                depth = np.nan_to_num(1000 * frame.depth[::2, ::2], nan=0, posinf=0, neginf=0).astype(np.uint16)
                log.log("depth", rr.DepthImage(depth, meter=1000))
                colours = [_CHOSEN if i == step.decision.target else _OTHER for i in range(len(step.detections))]
                labels = [f"{score:.1f}" for score in step.detections.scores]
                boxes = rr.Boxes2D(
                    array=step.detections.boxes, array_format=rr.Box2DFormat.XYWH, labels=labels, colors=colours
                )
                log.log("camera/people", boxes)
            trail.append(step.truth.robot[:2])
            log.log("map/robot", rr.LineStrips2D([list(trail)], colors=[_ROBOT]))
            people = [(p.x, p.y) for p in step.truth.people if p is not None]
            log.log("map/people", rr.Points2D(people, colors=[_PERSON], radii=0.15))
            for name in ("error_px", "distance_m", "linear_m_s", "angular_rad_s"):
                value = getattr(now, name)
                if value is not None:
                    log.log(f"series/{name}", rr.Scalars(value))
            log.log("mode", rr.TextLog(f"{step.decision.mode.value}: {step.decision.reason}"))

        yield watch
        log.flush()
        log.disconnect()
