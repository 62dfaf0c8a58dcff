"""What every view says about a run: the same numbers on the page, in the video and in the plots."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.pipeline import FrameLog
from limo_hog.follow.robot import RobotGeometry
from limo_hog.follow.sense.clearance import to_odometry
from limo_hog.follow.sense.measurement import box_centre, person_depth, zone_of
from limo_hog.follow.sense.observation import Odometry, Scan
from limo_hog.imaging.drawing import annotate
from limo_hog.suppression import share_inside
from limo_sim.run.log import Step
from limo_sim.sensing.camera import WIDTH


def figures(step: Step) -> dict[str, float | None]:
    """Return a control period in a few numbers, for the page and the plot.

    `time` of the arena [s]; `error_px`, how far left of the image's middle the followed box is, None without one;
    `distance_m` from the robot's centre to the nearest person, by the truth, None without people; the command's
    `linear_m_s` and `angular_rad_s`.
    """
    log, error = step.log, None
    if log.decision.target is not None:
        error = WIDTH / 2 - box_centre(log.detections.windows[log.decision.target])[0]
    distances = [person.distance for person in step.truth.people if person is not None]
    return {
        "time": log.time,
        "error_px": error,
        "distance_m": min(distances, default=None),
        "linear_m_s": float(log.decision.twist.linear),
        "angular_rad_s": float(log.decision.twist.angular),
    }


def measured_m(log: FrameLog) -> float | None:
    """Return how far the followed person is as the follower measures it: from the camera to their front [m]."""
    if log.frame is None or log.frame.depth is None or log.decision.target is None:
        return None
    return person_depth(log.frame.depth, log.detections.windows[log.decision.target])


def followed_person(step: Step) -> int | None:
    """Return the index of the person that the followed box covers most of; None without a box or a person in it."""
    log = step.log
    if log.decision.target is None or step.seen is None:
        return None
    people = [(0.0, (0, 0, 0, 0)) if p is None or p.box is None else (p.visible, p.box) for p in step.seen.people]
    outlines = np.array([box for _, box in people]).reshape(-1, 4)
    (shares,) = share_inside(log.detections.windows[[log.decision.target]], outlines)
    shown = shares * [visible for visible, _ in people]
    return max(np.flatnonzero(shares).tolist(), key=shown.__getitem__, default=None)


def annotated(log: FrameLog, caption: bool = True) -> NDArray[np.uint8]:
    """Draw what the follower saw, uint8 (H, W, 3) BGR: all boxes and which is followed; of a log with a frame.

    The caption tells the followed person's distance and what the follower does.
    """
    if log.frame is None:
        raise ValueError("annotated: the log has no frame")
    words = [f"{log.time:.1f} s", log.decision.mode.value]
    distance = measured_m(log)
    if distance is not None:
        words += [f"depth {distance:.2f} m", zone_of(distance).value]
    text = "  ".join(words) if caption else ""
    return annotate(log.frame.image, log.detections.boxes, log.detections.labels, log.decision.target, text)


def depth_picture(depth: NDArray[np.float32], far: float) -> NDArray[np.uint8]:
    """Colour a float32 (H, W) depth image [m]: near is bright, `far` dark, unknown black; uint8 (H, W, 3) BGR."""
    import cv2

    known = np.isfinite(depth)
    shade = np.where(known, 255 - np.clip(np.where(known, depth, 0) * (240 / far), 0, 240), 0).astype(np.uint8)
    picture = cv2.applyColorMap(shade, cv2.COLORMAP_VIRIDIS)
    picture[~known] = 0
    return picture.astype(np.uint8, copy=False)


def depth_colours(far: float, count: int = 17) -> list[str]:
    """Return the colours of `depth_picture` at evenly spaced depths from 0 to `far` [m], as #rrggbb."""
    scale = depth_picture(np.linspace(0, far, count, dtype=np.float32)[None], far)[0]
    return [f"#{red:02x}{green:02x}{blue:02x}" for blue, green, red in scale.tolist()]


def hits(scan: Scan | None, robot: RobotGeometry, poses: list[tuple[float, float, float, float]]) -> list[list[float]]:
    """Return every second lidar hit in the arena's frame [m], to the centimetre, by the pose at the scan's time."""
    if scan is None:
        return []
    times, *pose = np.array(poses).T
    x, y, yaw = (float(np.interp(scan.stamp, times, values)) for values in (*pose[:2], np.unwrap(pose[2])))
    ranges: NDArray[np.float64] = scan.ranges.astype(np.float64)
    angles = yaw + robot.lidar_yaw + np.linspace(scan.angle_min, scan.angle_max, len(ranges))
    hit = np.isfinite(ranges)
    hit[1::2] = False
    ahead = x + robot.lidar_x * math.cos(yaw) + ranges[hit] * np.cos(angles[hit])
    left = y + robot.lidar_x * math.sin(yaw) + ranges[hit] * np.sin(angles[hit])
    return list(np.round(np.stack([ahead, left], axis=1), 2).tolist())


def believed(step: Step) -> list[list[float | None]]:
    """Return where the follower takes people to be, x, y [m] in the arena's frame, two probabilities and a number.

    They are of being a person, and of being the person followed; None for that before one was followed.
    """
    people = step.log.decision.belief.people
    places = _in_arena(np.array([(person.x, person.y) for person in people]).reshape(-1, 2), step).tolist()
    return [
        [x, y, round(person.probability, 2), None if person.same is None else round(person.same, 2), person.number]
        for person, (x, y) in zip(people, places, strict=True)
    ]


def rollouts(step: Step) -> list[list[list[float]]]:
    """Return where the commands lead that the follower compared, every third point, x, y [m] in the arena's frame.

    The chosen one comes first; of those that end at the same place [dm] there is one.
    """
    belief = step.log.decision.belief
    if belief.rollouts is None:
        return []
    _, which = np.unique(np.round(belief.rollouts[:, -1], 1), axis=0, return_index=True)
    ways = np.concatenate([[belief.rollout], belief.rollouts[np.sort(which)]])
    return list(_in_arena(ways[:, 2::3], step).tolist())


def _in_arena(places: NDArray[np.float64], step: Step) -> NDArray[np.float64]:
    """Carry places (..., 2) from the base frame into the arena's [m], to the centimetre."""
    x, y, yaw = step.truth.robot
    return np.asarray(np.round(to_odometry(places, Odometry(x=x, y=y, yaw=yaw)), 2))
