"""tf2_geometry_msgs: points, poses and vectors carried by a transform."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from limo_sim.ros.companions.quaternions import Rigid, multiply, rigid_of, rotate


def _moved(point: Any, rigid: Rigid) -> Any:
    new = copy.deepcopy(point)
    new.x, new.y, new.z = (float(value) for value in rigid.apply(np.array([point.x, point.y, point.z])))
    return new


def do_transform_pose(pose: Any, transform: Any) -> Any:
    """Return a Pose carried by a TransformStamped."""
    rigid, new, q = rigid_of(transform), copy.deepcopy(pose), pose.orientation
    new.position = _moved(pose.position, rigid)
    turned = multiply(rigid.rotation, np.array([q.x, q.y, q.z, q.w]))
    new.orientation.x, new.orientation.y, new.orientation.z, new.orientation.w = (float(value) for value in turned)
    return new


def do_transform_point(point: Any, transform: Any) -> Any:
    """Return a PointStamped carried by a TransformStamped, in its target frame."""
    new = _stamped(point, transform)
    new.point = _moved(point.point, rigid_of(transform))
    return new


def do_transform_pose_stamped(pose: Any, transform: Any) -> Any:
    """Return a PoseStamped carried by a TransformStamped, in its target frame."""
    new = _stamped(pose, transform)
    new.pose = do_transform_pose(pose.pose, transform)
    return new


def do_transform_vector3(vector3: Any, transform: Any) -> Any:
    """Return a Vector3Stamped turned by a TransformStamped: a vector has no place."""
    new, v = _stamped(vector3, transform), vector3.vector
    turned = rotate(rigid_of(transform).rotation, np.array([v.x, v.y, v.z]))
    new.vector.x, new.vector.y, new.vector.z = (float(value) for value in turned)
    return new


def _stamped(message: Any, transform: Any) -> Any:
    new = copy.deepcopy(message)
    new.header.stamp, new.header.frame_id = copy.deepcopy(transform.header.stamp), transform.header.frame_id
    return new


#: By type of message.
TRANSFORMS = {
    "geometry_msgs/msg/PointStamped": do_transform_point,
    "geometry_msgs/msg/PoseStamped": do_transform_pose_stamped,
    "geometry_msgs/msg/Vector3Stamped": do_transform_vector3,
}
