"""What a script called, and where: for warnings, and for the workshop's checker."""

from __future__ import annotations

import difflib
from dataclasses import dataclass, field

from limo_hog.ros2 import names

#: Topics that the arena publishes.
PUBLISHED = tuple(topic for topic in names.TYPES if topic not in (names.COMMAND, names.ANNOTATED))
#: A subscription is warned of when nobody publishes its topic for this time [s]. Chosen: publishers start within it.
UNHEARD_AFTER = 2.0
#: The name under which the run itself logs.
LOGGER = "limo-hog"


@dataclass
class Calls:
    """What the script called, with the line of its first call; None where the call came from another file."""

    #: nodes … windows: lines by the node's name, by topic, by the service's name, and by the window's name.
    nodes: dict[str, int | None] = field(default_factory=dict)
    readers: dict[str, int | None] = field(default_factory=dict)
    writers: dict[str, int | None] = field(default_factory=dict)
    services: dict[str, int | None] = field(default_factory=dict)
    clients: dict[str, int | None] = field(default_factory=dict)
    windows: dict[str, int | None] = field(default_factory=dict)
    spun: bool = False  #: whether `spin` or `spin_once` ran, of rclpy or of an executor
    given: bool = False  #: whether a callback of the script was given a camera image
    searched_without_svm: int | None = 0  #: line of a `detectMultiScale` before `setSVMDetector`; 0 where none was
    types: dict[str, str] = field(default_factory=dict)  #: the message types of subscriptions, by topic
    #: Lines of what no quality of service of the arena's matches, by ROS 2's warning.
    unmatched: dict[str, int | None] = field(default_factory=dict)
    #: Line that reads one of the workshop's model solutions, 0 where it is not known; None where none does.
    solution_read: int | None = None


def nearest_topic(topic: str, type_name: str) -> str:
    """Return the topic of this type whose name is most like `topic`, of any type where none has this one."""
    # A depth image has the colour image's type; who means it says so.
    of_type = [
        name for name, kind in names.TYPES.items() if kind == type_name and ("depth" in name) == ("depth" in topic)
    ]
    return difflib.get_close_matches(topic, of_type or PUBLISHED, n=1, cutoff=0.0)[0]
