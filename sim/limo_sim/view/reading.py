"""What every view says about a run: the same numbers on the page, in the video and in the plots."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.sense.ranging import box_centre, person_depth
from limo_hog.follow.zones import zone_of
from limo_hog.imaging.drawing import annotate
from limo_sim.run.episode import Step
from limo_sim.sensing.camera import WIDTH, Frame


@dataclass(frozen=True, slots=True)
class Reading:
    """One control period in a few numbers.

    Attributes
    ----------
    time
        Of the arena [s].
    error_px
        How far left of the image's middle the followed box is [px]; None without one.
    distance_m
        From the robot's centre to the nearest person, as the arena knows it [m]; None without people.
    linear_m_s, angular_rad_s
        The command.
    """

    time: float
    error_px: float | None
    distance_m: float | None
    linear_m_s: float
    angular_rad_s: float


def reading(step: Step) -> Reading:
    """Read a control period."""
    error, twist = None, step.decision.twist
    if step.decision.target is not None:
        error = WIDTH / 2 - box_centre(step.detections.boxes[step.decision.target])[0]
    distances = [person.distance for person in step.truth.people if person is not None]
    return Reading(step.time, error, min(distances, default=None), float(twist.linear), float(twist.angular))


def annotated(frame: Frame, step: Step) -> NDArray[np.uint8]:
    """Draw what the follower saw: all boxes, whom it follows, how far that is by the depth image, and what it does."""
    target, words = step.decision.target, [f"{step.time:.1f} s", step.decision.mode.value]
    if target is not None:
        distance = person_depth(frame.depth, step.detections.boxes[target])
        if distance is not None:
            words += [f"{distance:.2f} m", zone_of(distance).value]
    labels = [f"{score:.1f}" for score in step.detections.scores]
    return annotate(frame.image, step.detections.boxes, labels, target, "  ".join(words))


def depth_picture(depth: NDArray[np.float32], far: float) -> NDArray[np.uint8]:
    """Colour a float32 (H, W) depth image [m]: near is bright, `far` dark, unknown black; uint8 (H, W, 3) BGR."""
    import cv2

    known = np.isfinite(depth)
    shade = np.where(known, 255 - np.clip(np.where(known, depth, 0) * (240 / far), 0, 240), 0).astype(np.uint8)
    picture = cv2.applyColorMap(shade, cv2.COLORMAP_VIRIDIS)
    picture[~known] = 0
    return picture.astype(np.uint8, copy=False)
