"""Puts ROS 2's Python API into `sys.modules` for one run; a name that is not offered raises an error."""

from __future__ import annotations

import contextlib
import importlib.abc
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

from limo_sim.ros import interfaces
from limo_sim.ros.lockstep.world import StubError, World
from limo_sim.ros.rclpy_stub import bridge, clock, context, executors, filters, logger, node, parameters, qos


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
        offered = sorted(key for key in self.__dict__ if not key.startswith("_"))
        raise NotOfferedError(
            f"limo-hog run does not offer {self.__name__}.{name}; {self.__name__} has {', '.join(offered)}"
        )


#: Tops of names that belong to ROS 2, whether offered or not.
_ROS_TOPS = (
    *("rclpy", "message_filters", "cv_bridge", "image_transport", "image_geometry", "laser_geometry", "rosbag2_py"),
    *("tf2_ros", "tf2_py", "tf2_geometry_msgs", "tf_transformations", "launch", "launch_ros"),
    *("ament_index_python", "rosidl_runtime_py", "nav2_simple_commander"),
)


class _Refuser(importlib.abc.MetaPathFinder):
    """The last finder of modules: for one of ROS 2's, the error names what is offered."""

    def find_spec(
        self,
        fullname: str,
        path: Sequence[str] | None,  # noqa: ARG002 — the protocol's
        target: ModuleType | None = None,  # noqa: ARG002
    ) -> ModuleSpec | None:
        top = fullname.partition(".")[0]
        if top in _ROS_TOPS or top.endswith(("_msgs", "_srvs", "_interfaces")):
            raise NotOfferedError(
                f"limo-hog run does not offer {fullname}; what of ROS 2 it offers is listed at "
                "https://github.com/limo-hog/limo-hog/blob/main/docs/ros2.md",
                name=fullname,
            )
        return None


@contextmanager
def in_front(world: World) -> Iterator[None]:
    """Let `import rclpy` and its companions find what belongs to `world`, and `time.sleep` be the arena's time."""
    run = context.Context(world)
    modules = _modules(run)
    tops = {name.partition(".")[0] for name in modules}
    # A real rclpy that was imported before is put aside for the run.
    hidden = {name: module for name, module in sys.modules.items() if name.partition(".")[0] in tops}
    for name in hidden:
        del sys.modules[name]
    sys.modules.update(modules)
    refuser = _Refuser()
    sys.meta_path.append(refuser)
    real_sleep = time.sleep

    def sleep(seconds: float) -> None:
        # Other threads, such as the live view's, sleep in wall time.
        if threading.current_thread() is threading.main_thread():
            world.sleep(seconds)
        else:
            real_sleep(seconds)

    time.sleep = sleep  # type: ignore[assignment]
    context.enter(run)
    try:
        yield
    finally:
        context.enter(None)
        time.sleep = real_sleep
        sys.meta_path.remove(refuser)
        for name in [name for name in sys.modules if name.partition(".")[0] in tops]:
            del sys.modules[name]
        sys.modules.update(hidden)


def _modules(run: context.Context) -> dict[str, ModuleType]:
    made: dict[str, ModuleType] = {}
    for name, content in _offered(run).items():
        made[name] = _Module(name, content)
    for name, module in made.items():
        parent, _, child = name.rpartition(".")
        if parent:
            setattr(made[parent], child, module)
    return made


def _offered(run: context.Context) -> dict[str, dict[str, Any]]:
    """Every module and what it holds: the whole of what a script may import."""

    def init(*, args: list[str] | None = None, context: Any = None, **_: Any) -> Any:  # noqa: ARG001
        run.init(args)
        ended = contextlib.ExitStack()
        ended.callback(run.shutdown)
        return ended

    def shutdown(*, context: Any = None, uninstall_handlers: bool | None = None) -> None:  # noqa: ARG001
        run.shutdown()

    def ok(*, context: Any = None) -> bool:  # noqa: ARG001
        return run.ok()

    def create_node(node_name: str, **options: Any) -> node.Node:
        return node.Node(node_name, **options)

    policies = {
        "QoSProfile": qos.QoSProfile,
        "ReliabilityPolicy": qos.ReliabilityPolicy,
        "QoSReliabilityPolicy": qos.ReliabilityPolicy,
        "DurabilityPolicy": qos.DurabilityPolicy,
        "QoSDurabilityPolicy": qos.DurabilityPolicy,
        "HistoryPolicy": qos.HistoryPolicy,
        "QoSHistoryPolicy": qos.HistoryPolicy,
        "LivelinessPolicy": qos.LivelinessPolicy,
        "QoSLivelinessPolicy": qos.LivelinessPolicy,
        "qos_profile_sensor_data": qos.qos_profile_sensor_data,
        "qos_profile_system_default": qos.qos_profile_system_default,
        "qos_profile_services_default": qos.qos_profile_services_default,
        "qos_profile_parameters": qos.qos_profile_parameters,
    }
    logging = {
        "get_logger": logger.get_logger,
        "set_logger_level": logger.set_logger_level,
        "LoggingSeverity": logger.LoggingSeverity,
    }
    offered: dict[str, dict[str, Any]] = {
        "rclpy": {
            "init": init,
            "shutdown": shutdown,
            "try_shutdown": shutdown,
            "ok": ok,
            "create_node": create_node,
            "spin": executors.spin,
            "spin_once": executors.spin_once,
            "Parameter": parameters.Parameter,
        },
        "rclpy.node": {"Node": node.Node},
        "rclpy.publisher": {"Publisher": node.Publisher},
        "rclpy.subscription": {"Subscription": node.Subscription},
        "rclpy.qos": policies,
        "rclpy.time": {"Time": clock.Time},
        "rclpy.duration": {"Duration": clock.Duration},
        "rclpy.clock": {"Clock": clock.Clock, "ClockType": clock.ClockType},
        "rclpy.timer": {"Timer": clock.Timer},
        "rclpy.logging": logging,
        "rclpy.parameter": {"Parameter": parameters.Parameter, "ParameterType": parameters.ParameterType},
        "rclpy.exceptions": {
            "ParameterException": parameters.ParameterException,
            "ParameterNotDeclaredException": parameters.ParameterNotDeclaredException,
            "ParameterAlreadyDeclaredException": parameters.ParameterAlreadyDeclaredException,
            "InvalidParameterTypeException": parameters.InvalidParameterTypeException,
            "NotInitializedException": node.NotInitializedException,
        },
        "rclpy.executors": {
            "Executor": executors.Executor,
            "SingleThreadedExecutor": executors.SingleThreadedExecutor,
            "MultiThreadedExecutor": executors.MultiThreadedExecutor,
            "ExternalShutdownException": executors.ExternalShutdownException,
        },
        "rclpy.callback_groups": {
            "CallbackGroup": node.CallbackGroup,
            "MutuallyExclusiveCallbackGroup": node.MutuallyExclusiveCallbackGroup,
            "ReentrantCallbackGroup": node.ReentrantCallbackGroup,
        },
        "rclpy.utilities": {"ok": ok},
        "rcl_interfaces": {},
        "rcl_interfaces.msg": {
            "SetParametersResult": parameters.SetParametersResult,
            "ParameterDescriptor": parameters.ParameterDescriptor,
            "ParameterType": parameters.ParameterType,
            "ParameterValue": parameters.ParameterValue,
        },
        "message_filters": {
            "SimpleFilter": filters.SimpleFilter,
            "Subscriber": filters.Subscriber,
            "TimeSynchronizer": filters.TimeSynchronizer,
            "ApproximateTimeSynchronizer": filters.ApproximateTimeSynchronizer,
        },
        "cv_bridge": {"CvBridge": bridge.CvBridge, "CvBridgeError": bridge.CvBridgeError},
    }
    for package in interfaces.PACKAGES:
        offered[package] = {}
        offered[f"{package}.msg"] = {
            name: interfaces.message_class(f"{package}/msg/{name}") for name in interfaces.class_names(package)
        }
    return offered
