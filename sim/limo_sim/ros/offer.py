"""What a node may import under `limo-hog run`: every module and its names."""

from __future__ import annotations

import contextlib
from typing import Any

from limo_sim.ros import interfaces
from limo_sim.ros.companions import bridge, camera_model, filters, packages, quaternions, tf2, tf2_geometry
from limo_sim.ros.lockstep import turns
from limo_sim.ros.rclpy_stub import (
    clock,
    context,
    executors,
    future,
    groups,
    logger,
    node,
    parameters,
    qos,
    services,
    topics,
)


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


def _rclpy() -> dict[str, dict[str, Any]]:
    return {
        "rclpy": {
            "init": _init,
            "shutdown": _shutdown,
            "try_shutdown": _shutdown,
            "ok": _ok,
            "create_node": node.create_node,
            "get_global_executor": executors.global_executor,
            "spin": executors.spin,
            "spin_once": executors.spin_once,
            "spin_until_future_complete": executors.spin_until_future_complete,
            "Parameter": parameters.Parameter,
            "Future": future.Future,
        },
        "rclpy.node": {"Node": node.Node},
        "rclpy.publisher": {"Publisher": topics.Publisher},
        "rclpy.subscription": {"Subscription": topics.Subscription},
        "rclpy.service": {"Service": services.Service},
        "rclpy.client": {"Client": services.Client},
        "rclpy.task": {"Future": future.Future, "Task": future.Task},
        "rclpy.qos": qos.OFFERED,
        "rclpy.time": {"Time": clock.Time},
        "rclpy.duration": {"Duration": clock.Duration},
        "rclpy.clock": {"Clock": clock.Clock, "ClockType": clock.ClockType},
        "rclpy.timer": {"Timer": clock.Timer, "Rate": clock.Rate},
        "rclpy.logging": {
            "get_logger": logger.get_logger,
            "set_logger_level": logger.set_logger_level,
            "LoggingSeverity": logger.LoggingSeverity,
        },
        "rclpy.parameter": {
            "Parameter": parameters.Parameter,
            "ParameterType": parameters.ParameterType,
            "ParameterValue": parameters.ParameterValue,
        },
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
            "ExternalShutdownException": turns.ExternalShutdownException,
        },
        "rclpy.callback_groups": {
            "CallbackGroup": groups.CallbackGroup,
            "MutuallyExclusiveCallbackGroup": groups.MutuallyExclusiveCallbackGroup,
            "ReentrantCallbackGroup": groups.ReentrantCallbackGroup,
        },
        "rclpy.utilities": {"ok": _ok, "shutdown": _shutdown, "try_shutdown": _shutdown},
        "rcl_interfaces": {},
        "rcl_interfaces.msg": {
            "SetParametersResult": parameters.SetParametersResult,
            "ParameterDescriptor": parameters.ParameterDescriptor,
            "ParameterType": parameters.ParameterType,
            "ParameterValue": parameters.ParameterValue,
        },
    }


def _companions() -> dict[str, dict[str, Any]]:
    exceptions = {
        "TransformException": tf2.TransformException,
        "LookupException": tf2.LookupException,
        "ConnectivityException": tf2.ConnectivityException,
        "ExtrapolationException": tf2.ExtrapolationException,
        "InvalidArgumentException": tf2.InvalidArgumentException,
        "TimeoutException": tf2.TimeoutException,
    }
    listener = {"Buffer": tf2.Buffer, "TransformListener": tf2.TransformListener}
    moving, fixed = tf2.TransformBroadcaster, tf2.StaticTransformBroadcaster
    broadcasters = {"TransformBroadcaster": moving, "StaticTransformBroadcaster": fixed}
    return {
        "message_filters": {
            "SimpleFilter": filters.SimpleFilter,
            "Subscriber": filters.Subscriber,
            "TimeSynchronizer": filters.TimeSynchronizer,
            "ApproximateTimeSynchronizer": filters.ApproximateTimeSynchronizer,
        },
        "ament_index_python": {"get_package_share_directory": packages.share_directory},
        "ament_index_python.packages": {"get_package_share_directory": packages.share_directory},
        "cv_bridge": {"CvBridge": bridge.CvBridge, "CvBridgeError": bridge.CvBridgeError},
        "image_geometry": {"PinholeCameraModel": camera_model.PinholeCameraModel},
        "tf2_ros": {**listener, **broadcasters, **exceptions},
        "tf2_ros.buffer": {"Buffer": tf2.Buffer},
        "tf2_ros.transform_listener": {"TransformListener": tf2.TransformListener},
        "tf2_ros.transform_broadcaster": {"TransformBroadcaster": moving},
        "tf2_ros.static_transform_broadcaster": {"StaticTransformBroadcaster": fixed},
        "tf2_geometry_msgs": {
            "do_transform_point": tf2_geometry.do_transform_point,
            "do_transform_pose": tf2_geometry.do_transform_pose,
            "do_transform_pose_stamped": tf2_geometry.do_transform_pose_stamped,
            "do_transform_vector3": tf2_geometry.do_transform_vector3,
            "PointStamped": interfaces.message_class("geometry_msgs/msg/PointStamped"),
            "PoseStamped": interfaces.message_class("geometry_msgs/msg/PoseStamped"),
            "Vector3Stamped": interfaces.message_class("geometry_msgs/msg/Vector3Stamped"),
        },
        "tf_transformations": {
            "euler_from_quaternion": quaternions.euler_from_quaternion,
            "quaternion_from_euler": quaternions.quaternion_from_euler,
        },
    }


def _init(
    *,
    args: list[str] | None = None,
    context: Any = None,  # noqa: ARG001 — rclpy's signature
    domain_id: int | None = None,  # noqa: ARG001
    signal_handler_options: Any = None,  # noqa: ARG001
) -> Any:
    run = _current()
    run.init(args)
    ended = contextlib.ExitStack()
    ended.callback(run.shutdown)
    return ended


def _shutdown(*, context: Any = None, uninstall_handlers: bool | None = None) -> None:  # noqa: ARG001
    _current().shutdown()


def _ok(*, context: Any = None) -> bool:  # noqa: ARG001 — rclpy's signature
    return _current().ok()


_current = context.current
