"""Message classes with rclpy's behaviour, made from rosbags' definitions.

They behave as in ROS 2 Humble: every field has a default, constructors take keywords alone, and a value of the wrong
type is refused at the assignment. Unbounded sequences of numbers are `array.array`, fixed ones numpy arrays.
"""

from __future__ import annotations

import array
import copy
from collections.abc import Sequence
from functools import cache
from typing import Any, ClassVar

import numpy as np
from rosbags.typesys import get_types_from_msg

from limo_hog.ros2.messages import Field, element_type, fields_of, typestore

#: What `import` finds.
PACKAGES = tuple(
    "builtin_interfaces diagnostic_msgs geometry_msgs nav_msgs people_msgs rosgraph_msgs sensor_msgs "
    "shape_msgs std_msgs stereo_msgs tf2_msgs trajectory_msgs vision_msgs unique_identifier_msgs "
    "visualization_msgs".split()
)

#: Services that `import` finds, by package and name: the fields of request and response.
SERVICES = {
    ("std_srvs", "Empty"): ("", ""),
    ("std_srvs", "SetBool"): ("bool data", "bool success\nstring message"),
    ("std_srvs", "Trigger"): ("", "bool success\nstring message"),
    ("example_interfaces", "AddTwoInts"): ("int64 a\nint64 b", "int64 sum"),
    ("example_interfaces", "SetBool"): ("bool data", "bool success\nstring message"),
    ("example_interfaces", "Trigger"): ("", "bool success\nstring message"),
}


def default(field: Field) -> Any:
    """Return a fresh default of a field that is a message, or holds several items."""
    if field.length is None:
        return message_class(field.item)()
    if not field.is_numeric:
        return [message_class(field.item)() if field.is_message else field.zero for _ in range(field.length)]
    return np.zeros(field.length, element_type(field.item)) if field.length else array.array(_code(field))


def checked(field: Field, value: Any) -> Any:
    """Return a value as a field stores it.

    Raises `AssertionError` as rclpy does, if the value is of another type or out of range.
    """
    if field.length is None:
        _check_item(field, value)
        return value
    if isinstance(value, array.array) and field.is_numeric and value.typecode == _code(field):
        return _sized(field, value)
    if isinstance(value, np.ndarray):
        fits = field.is_numeric and value.dtype == element_type(field.item)
        if not fits or not field.length:
            _refuse(field, value, "use .tolist(), or array.array with .tobytes()" if field.is_numeric else "")
        return _sized(field, value)
    if isinstance(value, str) or not isinstance(value, Sequence):
        _refuse(field, value)
    if field.item == "uint8" and isinstance(value, bytes | bytearray):
        return _sized(field, array.array("B", value))
    for item in value:
        _check_item(field, item)
    return _sized(field, array.array(_code(field), value) if field.is_numeric else value)


def _code(field: Field) -> str:
    kind = element_type(field.item)
    return {"i8": "q", "u8": "Q"}.get(f"{kind.kind}{kind.itemsize}", kind.char)


def _check_item(field: Field, value: Any) -> None:
    if field.is_message:
        good = isinstance(value, message_class(field.item))
    else:
        good = isinstance(value, type(field.zero))
        if good and field.is_numeric and isinstance(value, int):
            limits = np.iinfo(element_type(field.item))
            if not limits.min <= value <= limits.max:
                _refuse(field, value, f"want {limits.min} … {limits.max}")
    if not good:
        _refuse(field, value)


def _sized(field: Field, value: Any) -> Any:
    if field.length:
        if len(value) != field.length:
            _refuse(field, value, f"want {field.length} elements, came {len(value)}")
        if field.is_numeric:
            return np.array(value, element_type(field.item))
    return value


def _refuse(field: Field, value: Any, advice: str = "") -> None:
    wanted = field.item.replace("/msg/", ".msg.") if field.is_message else type(field.zero).__name__
    several = "" if field.length is None else "a sequence of "
    came = f"{type(value).__name__} {value!r}"[:80]
    raise AssertionError(
        f"the field {field.name!r} must be {several}{wanted!r}, came {came}" + (f": {advice}" if advice else "")
    )


class Message:
    """The base of all message classes."""

    __slots__ = ()
    _fields: ClassVar[dict[str, Field]] = {}
    _type_name: ClassVar[str] = ""

    def __init__(self, **values: Any) -> None:
        unknown = ", ".join(set(values) - set(self._fields))
        if unknown:
            raise AssertionError(
                f"{type(self).__name__} has no field {unknown}; its fields are {', '.join(self._fields)}"
            )
        for name, field in self._fields.items():
            if name in values:
                setattr(self, name, values[name])
            else:
                plain = field.length is None and not field.is_message
                object.__setattr__(self, name, field.zero if plain else default(field))

    def __setattr__(self, name: str, value: Any) -> None:
        field = self._fields.get(name)
        if field is None:
            raise AttributeError(
                f"{type(self).__name__!r} object has no attribute {name!r}; its fields are {', '.join(self._fields)}"
            )
        object.__setattr__(self, name, checked(field, value))

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return all(np.array_equal(getattr(self, name), getattr(other, name)) for name in self._fields)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        values = ", ".join(f"{name}={getattr(self, name)!r}" for name in self._fields)
        return f"{type(self).__module__}.{type(self).__name__}({values})"

    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]:
        """Return each field's name and type."""
        types = {}
        for name, field in cls._fields.items():
            item = {"float64": "double", "float32": "float"}.get(field.item, field.item.replace("/msg/", "/"))
            if field.length is not None:
                item = f"{item}[{field.length}]" if field.length else f"sequence<{item}>"
            types[name] = item
        return types


@cache
def message_class(type_name: str) -> type[Message]:
    """Return the class of a type such as "geometry_msgs/msg/Twist"."""
    # rosbags gives messages without fields a member.
    fields = [field for field in fields_of(type_name) if field.name != "structure_needs_at_least_one_member"]
    package, _, name = type_name.split("/")
    body: dict[str, Any] = {constant: value for constant, _, value in typestore().fielddefs[type_name][0]}
    body |= {
        "__slots__": tuple(field.name for field in fields),
        "__doc__": f"{type_name}.",
        "__module__": f"{package}.msg",
        "_fields": {field.name: field for field in fields},
        "_type_name": type_name,
    }
    return type(name, (Message,), body)


def from_wire(message: Any) -> Message:
    """Return a rosbags message as one of these classes; no data are shared."""
    made = message_class(message.__msgtype__)
    new = made.__new__(made)
    for name, field in made._fields.items():
        value = getattr(message, name)
        if field.is_message:
            value = from_wire(value) if field.length is None else [from_wire(item) for item in value]
        elif field.length == 0 and field.is_numeric:
            numbers = np.ascontiguousarray(value).view(np.uint8)
            value = array.array(_code(field))
            value.frombytes(numbers.data)
        elif field.length is not None:
            value = copy.copy(value)
        object.__setattr__(new, name, value)
    return new


@cache
def service_class(package: str, name: str) -> type:
    """Return a service's class: it has `Request` and `Response`."""
    parts = {}
    for part, definition in zip(("Request", "Response"), SERVICES[package, name], strict=True):
        type_name = f"{package}/msg/{name}_{part}"
        typestore().register(get_types_from_msg(definition, type_name))
        parts[part] = message_class(type_name)
        parts[part].__module__ = f"{package}.srv"
    return type(name, (), {"__doc__": f"{package}/srv/{name}.", "__module__": f"{package}.srv", **parts})


def class_names(package: str) -> list[str]:
    """Return the names of a package's messages."""
    prefix = f"{package}/msg/"
    found = [name.removeprefix(prefix) for name in typestore().fielddefs if name.startswith(prefix)]
    return [name for name in found if not name.endswith(("_Request", "_Response"))]
