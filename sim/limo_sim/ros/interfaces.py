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
from rosbags.interfaces import Nodetype
from rosbags.typesys import get_types_from_msg

from limo_hog.ros2.messages import element_type, typestore

#: What `import` finds.
PACKAGES = (
    *("builtin_interfaces", "diagnostic_msgs", "geometry_msgs", "nav_msgs", "people_msgs", "rosgraph_msgs"),
    *("sensor_msgs", "shape_msgs", "std_msgs", "stereo_msgs", "tf2_msgs", "trajectory_msgs", "vision_msgs"),
    *("unique_identifier_msgs", "visualization_msgs"),
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

_TEXT = ("string", "wstring")


class Field:
    """One field of a message: its default, and what may be assigned."""

    def __init__(self, name: str, desc: Any) -> None:
        self.name = name
        self.kind, of = desc
        if self.kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            (self.item_kind, item), self.length = of
        else:
            self.item_kind, item = desc
        self.base = "" if self.item_kind == Nodetype.NAME else item[0]
        self.nested = item if self.item_kind == Nodetype.NAME else ""
        self.is_numeric = bool(self.base) and self.base not in (*_TEXT, "bool")

    def default(self) -> Any:
        """Return a fresh default."""
        if self.kind == Nodetype.ARRAY:
            if self.is_numeric:
                return np.zeros(self.length, element_type(self.base))
            return [self._item_default() for _ in range(self.length)]
        if self.kind == Nodetype.SEQUENCE:
            return array.array(self._code) if self.is_numeric else []
        return self._item_default()

    def checked(self, value: Any) -> Any:
        """Return a value as it is stored.

        Raises
        ------
        AssertionError
            As rclpy does, if the value is of another type or out of range.
        """
        if self.kind not in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            self._check_item(value)
            return value
        if isinstance(value, array.array) and self.is_numeric and value.typecode == self._code:
            return self._sized(value)
        if isinstance(value, np.ndarray):
            fits = self.is_numeric and value.dtype == element_type(self.base)
            if not fits or self.kind != Nodetype.ARRAY:
                self._refuse(value, "use .tolist(), or array.array with .tobytes()" if self.is_numeric else "")
            return self._sized(value)
        if isinstance(value, str) or not isinstance(value, Sequence):
            self._refuse(value)
        if self.base == "uint8" and isinstance(value, bytes | bytearray):
            return self._sized(array.array("B", value))
        for item in value:
            self._check_item(item)
        return self._sized(array.array(self._code, value) if self.is_numeric else value)

    def from_wire(self, value: Any) -> Any:
        """Return a rosbags field's value as it is stored here, a copy."""
        if self.kind == Nodetype.NAME:
            return from_wire(value)
        if self.nested:
            return [from_wire(item) for item in value]
        if self.kind == Nodetype.SEQUENCE and self.is_numeric:
            return array.array(self._code, np.ascontiguousarray(value).tobytes())
        return copy.copy(value)

    @property
    def _code(self) -> str:
        kind = element_type(self.base)
        return {"i8": "q", "u8": "Q"}.get(f"{kind.kind}{kind.itemsize}", kind.char)

    def _item_default(self) -> Any:
        if self.nested:
            return message_class(self.nested)()
        if self.base in _TEXT:
            return ""
        if self.base == "bool":
            return False
        return 0.0 if self.base.startswith("float") else 0

    def _check_item(self, value: Any) -> None:
        if self.nested:
            good = isinstance(value, message_class(self.nested))
        elif self.base in _TEXT:
            good = isinstance(value, str)
        elif self.base == "bool":
            good = isinstance(value, bool)
        elif self.base.startswith("float"):
            good = isinstance(value, float)
        else:
            good = isinstance(value, int)
            limits = np.iinfo(element_type(self.base))
            if good and not limits.min <= value <= limits.max:
                self._refuse(value, f"want {limits.min} … {limits.max}")
        if not good:
            self._refuse(value)

    def _sized(self, value: Any) -> Any:
        if self.kind == Nodetype.ARRAY:
            if len(value) != self.length:
                self._refuse(value, f"want {self.length} elements, came {len(value)}")
            if self.is_numeric:
                return np.array(value, element_type(self.base))
        return value

    def _refuse(self, value: Any, advice: str = "") -> None:
        wanted = self.nested.replace("/msg/", ".msg.") or {"string": "str"}.get(self.base, self.base)
        wanted = "float" if wanted.startswith("float") else "int" if "int" in wanted else wanted
        several = {Nodetype.ARRAY: "a sequence of ", Nodetype.SEQUENCE: "a sequence of "}.get(self.kind, "")
        came = f"{type(value).__name__} {value!r}"[:80]
        raise AssertionError(
            f"the field {self.name!r} must be {several}{wanted!r}, came {came}" + (f": {advice}" if advice else "")
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
                object.__setattr__(self, name, field.default())
        if self._type_name == "geometry_msgs/msg/Quaternion" and "w" not in values:
            object.__setattr__(self, "w", 1.0)

    def __setattr__(self, name: str, value: Any) -> None:
        field = self._fields.get(name)
        if field is None:
            raise AttributeError(
                f"{type(self).__name__!r} object has no attribute {name!r}; its fields are {', '.join(self._fields)}"
            )
        object.__setattr__(self, name, field.checked(value))

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
            item = field.nested.replace("/msg/", "/") or {"float64": "double", "float32": "float"}.get(
                field.base, field.base
            )
            if field.kind == Nodetype.SEQUENCE:
                item = f"sequence<{item}>"
            elif field.kind == Nodetype.ARRAY:
                item = f"{item}[{field.length}]"
            types[name] = item
        return types


@cache
def message_class(type_name: str) -> type[Message]:
    """Return the class of a type such as "geometry_msgs/msg/Twist"."""
    constants, fields = typestore().fielddefs[type_name]
    package, _, name = type_name.split("/")
    body: dict[str, Any] = {constant: value for constant, _, value in constants}
    body |= {
        "__slots__": tuple(field for field, _ in fields),
        "__doc__": f"{type_name}.",
        "__module__": f"{package}.msg",
        "_fields": {field: Field(field, desc) for field, desc in fields if field != _EMPTY},
        "_type_name": type_name,
    }
    return type(name, (Message,), body)


#: The member rosbags gives to messages without fields.
_EMPTY = "structure_needs_at_least_one_member"


def from_wire(message: Any) -> Message:
    """Return a rosbags message as one of these classes; no data are shared."""
    made = message_class(message.__msgtype__)
    new = made.__new__(made)
    for name, field in made._fields.items():
        object.__setattr__(new, name, field.from_wire(getattr(message, name)))
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
