"""Puts ROS 2's Python API into `sys.modules` of a node's process; a name that is not offered raises an error."""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any

from limo_sim.ros.lockstep.records import StubError
from limo_sim.ros.lockstep.world import World
from limo_sim.ros.offer import offered
from limo_sim.ros.rclpy_stub import context


class NotOfferedError(StubError, ImportError):
    """A name of ROS 2 that limo-hog does not have."""


class _Module(ModuleType):
    """A module whose error for a missing name lists what it has."""

    def __init__(self, name: str, content: dict[str, Any]) -> None:
        super().__init__(name, f"Part of ROS 2's {name.partition('.')[0]}, as `limo-hog run` offers it.")
        self.__path__: list[str] = []
        self.__dict__.update(content)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        there = sorted(key for key in self.__dict__ if not key.startswith("_"))
        raise NotOfferedError(
            f"limo-hog run does not offer {self.__name__}.{name}; {self.__name__} has {', '.join(there)}"
        )


#: Tops of names that belong to ROS 2, whether offered or not.
_ROS_TOPS = tuple(
    "rclpy message_filters cv_bridge image_transport image_geometry laser_geometry rosbag2_py tf2_ros tf2_py "
    "tf2_geometry_msgs tf_transformations launch launch_ros ament_index_python rosidl_runtime_py "
    "nav2_simple_commander sensor_msgs_py".split()
)


class _Refuser:
    """The last finder of modules: for one of ROS 2's, the error names what is offered."""

    def find_spec(self, fullname: str, *_: Any) -> None:
        top = fullname.partition(".")[0]
        if top in _ROS_TOPS or top.endswith(("_msgs", "_srvs", "_interfaces")):
            raise NotOfferedError(
                f"limo-hog run does not offer {fullname}; what of ROS 2 it offers is listed at "
                "https://github.com/limo-hog/limo-hog/blob/main/docs/ros2.md",
                name=fullname,
            )


def put_in_front(world: World) -> None:
    """Let `import rclpy` and its companions find what belongs to `world`, until this process ends."""
    modules: dict[str, ModuleType] = {name: _Module(name, content) for name, content in offered().items()}
    for name, module in modules.items():
        parent, _, child = name.rpartition(".")
        if parent:
            setattr(modules[parent], child, module)
    sys.modules.update(modules)
    sys.meta_path.append(_Refuser())
    context.enter(context.Context(world))
