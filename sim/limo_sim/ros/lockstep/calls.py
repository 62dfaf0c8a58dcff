"""What a script called, and where: for warnings, and for the workshop's checker."""

from __future__ import annotations

import difflib
from dataclasses import dataclass, field

from limo_hog.ros2 import names

#: Topics that the arena publishes.
PUBLISHED = tuple(topic for topic in names.TYPES if topic not in (names.COMMAND, names.ANNOTATED))


@dataclass
class Calls:
    """What the script called, with the line of its first call; None where the call came from another file.

    Attributes
    ----------
    nodes, readers, writers, clients, windows
        Lines by the node's name, by topic, by the service's name, and by the window's name.
    spun
        Whether `spin` or `spin_once` ran, of rclpy or of an executor.
    images
        How many camera images the script's callbacks were given.
    searched_without_svm
        Line of a `detectMultiScale` before `setSVMDetector`; 0 where there was none.
    """

    nodes: dict[str, int | None] = field(default_factory=dict)
    readers: dict[str, int | None] = field(default_factory=dict)
    writers: dict[str, int | None] = field(default_factory=dict)
    clients: dict[str, int | None] = field(default_factory=dict)
    windows: dict[str, int | None] = field(default_factory=dict)
    spun: bool = False
    images: int = 0
    searched_without_svm: int | None = 0


def nearest_topic(topic: str) -> str:
    """Return the arena's topic whose name is most like `topic`."""
    return difflib.get_close_matches(topic, PUBLISHED, n=1, cutoff=0.0)[0]
