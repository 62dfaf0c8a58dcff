"""The workshop's exercises: the scenes a node is tried in, its checkpoints, and the points of each."""

from __future__ import annotations

from dataclasses import dataclass

from limo_sim.workshop import checkpoints as points
from limo_sim.workshop import stretch
from limo_sim.workshop.checkpoints import Checkpoint
from limo_sim.workshop.scenes import FOLLOWER_SCENES, PROXEMIC_SCENES, Scene

SHOWN = Checkpoint(
    1,
    "the camera image is shown",
    10,
    points.shown,
    (
        "Which function of cv2 shows a picture in a window?",
        "Call self.show(picture) once for every image; picture is a copy of image.",
    ),
)
FOUND = Checkpoint(
    2,
    "people are found",
    15,
    points.found,
    (
        "The detector is self.hog; which of its methods searches at many scales?",
        "boxes, weights = self.hog.detectMultiScale(image, winStride=(8, 8), scale=1.05)",
    ),
)
LOGGED = Checkpoint(
    2,
    "the number of boxes is logged",
    5,
    points.logged,
    ("len(boxes) is their number.", "self.get_logger().info(f'Detections: {len(boxes)}')"),
)
SCALED = Checkpoint(
    2,
    "boxes are in the camera's pixels",
    5,
    points.scaled_back,
    ("A box found in an image of half the size has half the coordinates.",),
)
STANDS = Checkpoint(
    3,
    "the robot stands while no person is found",
    10,
    points.stands,
    ("What should the robot do when boxes is empty?", "Publish Twist() and return from the callback."),
)
BEST = Checkpoint(
    3,
    "the surest box is chosen and drawn",
    15,
    points.best,
    (
        "The surest box is the one with the greatest weight.",
        "best = int(np.argmax(weights)); draw it last, in (0, 0, 255), with a dot in (255, 0, 0), and show it.",
    ),
)
TURNS = Checkpoint(
    4,
    "the robot turns towards the person",
    10,
    points.turns,
    (
        "A positive angular.z turns left. What sign has the error of a person on the left?",
        "error = middle - cx; twist.angular.z = 0.005 * float(error)",
    ),
)
DEAD_BAND = Checkpoint(
    4,
    "a person in the middle does not turn it",
    5,
    points.dead_band,
    ("Leave angular.z at 0.0 while abs(error) is smaller than the dead-band.",),
)
DRIVES = Checkpoint(4, "it drives to the person", 5, points.drives, ("Set twist.linear.x to 0.2.",))
SPEAKS = Checkpoint(
    4, "a command comes at least every 0.5 s", 5, points.speaks, ("Publish a command after every image.",)
)
RETURNS = Checkpoint(
    4, "callbacks return in time", 5, points.returns, ("Do not call time.sleep in a callback; use a timer.",)
)
KEEPS = Checkpoint(
    5,
    "it keeps its distance",
    40,
    points.keeps,
    (
        "Take the median of the depths around the box's centre; the error is distance - self.target.",
        "twist.linear.x = float(np.clip(self.linear_gain * (distance - self.target), -0.3, 0.3))",
    ),
)
LIMITS = Checkpoint(
    5, "its speeds keep within the limits", 20, points.limits, ("Clip both speeds with np.clip before publishing.",)
)

#: The sequel's template does tasks 1 to 3, which therefore are worth no points there.
GIVEN = (SHOWN, FOUND, LOGGED, SCALED, STANDS, BEST)


@dataclass(frozen=True, slots=True)
class Exercise:
    """What is asked of a node.

    Attributes
    ----------
    words
        Its name.
    scenes, checkpoints
        Where the node is tried, and what it is judged by.
    given
        Checkpoints that are worth no points.
    walk
        Points for a walk of 20 s behind a person, which is tried when all checkpoints hold; 0 for none.
    hog
        Whether the checkpoints look at what OpenCV's HOG detector finds.
    """

    words: str
    scenes: tuple[Scene, ...]
    checkpoints: tuple[Checkpoint, ...]
    given: tuple[Checkpoint, ...] = ()
    walk: int = 0
    hog: bool = True


EXERCISES = {
    "follower": Exercise(
        "tasks 1 to 4",
        FOLLOWER_SCENES,
        (SHOWN, FOUND, LOGGED, SCALED, STANDS, BEST, TURNS, DEAD_BAND, DRIVES, SPEAKS, RETURNS),
        walk=10,
    ),
    "proxemic": Exercise(
        "the sequel", PROXEMIC_SCENES, (*GIVEN, TURNS, SPEAKS, RETURNS, KEEPS, LIMITS), GIVEN, walk=20
    ),
    "stretch a": Exercise("stretch task A: slow down", stretch.SLOW_SCENES, stretch.SLOW),
    "stretch b": Exercise("stretch task B: fewer boxes", stretch.MERGE_SCENES, stretch.MERGE),
    "stretch c": Exercise("stretch task C: another detector", stretch.DETECTOR_SCENES, stretch.DETECTOR, hog=False),
    "stretch d": Exercise("stretch task D: track", stretch.TRACK_SCENES, stretch.TRACK),
    "stretch e": Exercise("stretch task E: the laser", stretch.LASER_SCENES, stretch.LASER),
}
