"""docs/ros2.md lists what is offered, and no more."""

import re
from pathlib import Path

from limo_hog.ros2 import names
from limo_sim.ros.offer import offered

TEXT = (Path(__file__).parents[2] / "docs" / "ros2.md").read_text(encoding="utf-8")


def test_every_module_and_name_that_is_offered_is_listed() -> None:
    listed = set(re.findall(r"`([A-Za-z0-9_.]+)`", TEXT))
    for module, content in offered().items():
        if content:
            assert module in listed or module.removesuffix(".msg") in listed, module
        if not module.endswith(("_msgs.msg", ".srv", "builtin_interfaces.msg", "rclpy.qos")):
            assert set(content) <= listed, (module, set(content) - listed)
    assert [topic for topic in names.TYPES | names.FINDINGS if f"`{topic}`" not in TEXT] == []
