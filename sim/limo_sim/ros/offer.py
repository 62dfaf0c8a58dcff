"""What a node may import under `limo-hog run`: every module and its names."""

from __future__ import annotations

import contextlib
from typing import Any

from limo_sim.ros import interfaces
from limo_sim.ros.companions import bridge, camera_model, filters, quaternions, tf2, tf2_geometry
from limo_sim.ros.lockstep import turns
from limo_sim.ros.rclpy_stub import (
    clock,
    executors,
    future,
    groups,
    logger,
    naming,
    node,
    parameters,
    qos,
    services,
    topics,
)
from limo_sim.ros.rclpy_stub.context import default_context


def offered() -> dict[str, dict[str, Any]]:
    """Return the content of every module."""
    found = _rclpy() | _companions()
    for package in interfaces.PACKAGES:
        found[package] = {}
        found[f"{package}.msg"] = {
            name: interfaces.message_class(f"{package}/msg/{name}") for name in interfaces.class_names(package)
        }
    for package, name in interfaces.SERVICES:
        found.setdefault(package, {})
        found.setdefault(f"{package}.srv", {})[name] = interfaces.service_class(package, name)
    return found


def _of(module: Any, names: str) -> dict[str, Any]:
    """Return what a module of ours has under ROS 2's names."""
    return {name: getattr(module, name) for name in names.split()}


def _rclpy() -> dict[str, dict[str, Any]]:
    context = {"ok": _ok, "shutdown": _shutdown, "try_shutdown": _try_shutdown}
    return {
        "rclpy": {
            **context,
            "init": _init,
            "create_node": node.create_node,
            "get_global_executor": executors.global_executor,
            **_of(executors, "spin spin_once spin_until_future_complete"),
            "Parameter": parameters.Parameter,
            "Future": future.Future,
        },
        "rclpy.node": _of(node, "Node"),
        "rclpy.publisher": _of(topics, "Publisher"),
        "rclpy.subscription": _of(topics, "Subscription"),
        "rclpy.service": _of(services, "Service"),
        "rclpy.client": _of(services, "Client"),
        "rclpy.task": _of(future, "Future Task"),
        "rclpy.qos": qos.OFFERED,
        "rclpy.time": _of(clock, "Time"),
        "rclpy.duration": _of(clock, "Duration"),
        "rclpy.clock": _of(clock, "Clock ClockType"),
        "rclpy.timer": _of(clock, "Timer Rate"),
        "rclpy.logging": _of(logger, "get_logger set_logger_level LoggingSeverity"),
        "rclpy.parameter": _of(parameters, "Parameter ParameterType ParameterValue"),
        "rclpy.exceptions": {
            **_of(parameters, "ParameterException ParameterNotDeclaredException ParameterAlreadyDeclaredException"),
            **_of(parameters, "InvalidParameterTypeException InvalidParameterValueException"),
            **_of(node, "NotInitializedException"),
            **_of(naming, "NameValidationException InvalidNodeNameException InvalidNamespaceException"),
            **_of(naming, "InvalidTopicNameException InvalidServiceNameException"),
        },
        "rclpy.executors": {
            **_of(executors, "Executor SingleThreadedExecutor MultiThreadedExecutor"),
            **_of(turns, "ExternalShutdownException"),
        },
        "rclpy.callback_groups": _of(groups, "CallbackGroup MutuallyExclusiveCallbackGroup ReentrantCallbackGroup"),
        "rclpy.utilities": context,
        "rcl_interfaces": {},
        "rcl_interfaces.msg": _of(parameters, "SetParametersResult ParameterDescriptor ParameterType ParameterValue"),
    }


def _companions() -> dict[str, dict[str, Any]]:
    share = {"get_package_share_directory": _share_directory}
    geometry = {name: interfaces.message_class(f"geometry_msgs/msg/{name}") for name in _STAMPED.split()}
    return {
        "message_filters": _of(filters, "SimpleFilter Subscriber TimeSynchronizer ApproximateTimeSynchronizer"),
        "ament_index_python": share,
        "ament_index_python.packages": share,
        "cv_bridge": _of(bridge, "CvBridge CvBridgeError"),
        "image_geometry": _of(camera_model, "PinholeCameraModel"),
        "tf2_ros": _of(tf2, _TF2_ROS),
        "tf2_ros.buffer": _of(tf2, "Buffer"),
        "tf2_ros.transform_listener": _of(tf2, "TransformListener"),
        "tf2_ros.transform_broadcaster": _of(tf2, "TransformBroadcaster"),
        "tf2_ros.static_transform_broadcaster": _of(tf2, "StaticTransformBroadcaster"),
        "tf2_geometry_msgs": _of(tf2_geometry, _TRANSFORMS) | geometry,
        "tf_transformations": _of(quaternions, "euler_from_quaternion quaternion_from_euler"),
    }


_TF2_ROS = (
    "Buffer TransformListener TransformBroadcaster StaticTransformBroadcaster TransformException LookupException "
    "ConnectivityException ExtrapolationException InvalidArgumentException TimeoutException"
)
_TRANSFORMS = "do_transform_point do_transform_pose do_transform_pose_stamped do_transform_vector3"
_STAMPED = "PointStamped PoseStamped Vector3Stamped"


def _share_directory(package_name: str) -> str:
    """Return the package's folder around the script; the script's own folder where none has that name."""
    here = default_context().world.script.resolve().parent
    for folder in (here, *here.parents[:3]):
        for candidate in (folder, folder / package_name, folder / "src" / package_name):
            # (The Python package in a package has its name, too.)
            if candidate.name == package_name and candidate.is_dir() and not (candidate / "__init__.py").exists():
                return str(candidate)
    return str(here)


def _init(
    *,
    args: list[str] | None = None,
    context: Any = None,  # noqa: ARG001 — rclpy's signature
    domain_id: int | None = None,  # noqa: ARG001
    signal_handler_options: Any = None,  # noqa: ARG001
) -> Any:
    default_context().init(args)
    ended = contextlib.ExitStack()
    ended.callback(_try_shutdown)
    return ended


def _shutdown(*, context: Any = None, uninstall_handlers: bool | None = None) -> None:  # noqa: ARG001
    default_context().shutdown()


def _try_shutdown(*, context: Any = None, uninstall_handlers: bool | None = None) -> None:  # noqa: ARG001
    if default_context().is_initialized:
        default_context().shutdown()


def _ok(*, context: Any = None) -> bool:  # noqa: ARG001 — rclpy's signature
    return default_context().ok()
