"""Node parameters: declared with a value, overridden on the command line, of one type for good."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

from limo_sim.ros.rclpy_stub.partial import PartialApi


class ParameterException(Exception):  # noqa: N818 — rclpy's names
    """A parameter is not declared, or not of its type."""


class ParameterNotDeclaredException(ParameterException):
    """A parameter was asked for before it was declared."""

    def __init__(self, name: str) -> None:
        super().__init__(f"parameter {name!r} is not declared: call declare_parameter({name!r}, default) first")


class ParameterAlreadyDeclaredException(ParameterException):
    """A parameter was declared twice."""


class InvalidParameterTypeException(ParameterException):
    """A parameter was given a value of another type."""


class InvalidParameterValueException(ParameterException):
    """A callback refused a parameter's first value."""


class ParameterType(IntEnum):
    """What a parameter holds."""

    NOT_SET = 0
    BOOL = 1
    INTEGER = 2
    DOUBLE = 3
    STRING = 4
    BYTE_ARRAY = 5
    BOOL_ARRAY = 6
    INTEGER_ARRAY = 7
    DOUBLE_ARRAY = 8
    STRING_ARRAY = 9

    @classmethod
    def from_parameter_value(cls, value: Any) -> ParameterType:
        """Return the type of a value."""
        single = {type(None): cls.NOT_SET, bool: cls.BOOL, int: cls.INTEGER, float: cls.DOUBLE, str: cls.STRING}
        if type(value) in single:
            return single[type(value)]
        if isinstance(value, list | tuple):
            arrays = {bool: cls.BOOL_ARRAY, int: cls.INTEGER_ARRAY, float: cls.DOUBLE_ARRAY, str: cls.STRING_ARRAY}
            arrays[bytes] = cls.BYTE_ARRAY
            kinds = {type(item) for item in value} or {bytes}
            if len(kinds) == 1 and (kind := kinds.pop()) in arrays:
                return arrays[kind]
        raise TypeError(f"a parameter cannot hold {type(value).__name__} {value!r}")


@dataclass
class ParameterValue:
    """A value with its type: the field of that type holds it, the others their defaults."""

    type: int = 0
    bool_value: bool = False
    integer_value: int = 0
    double_value: float = 0.0
    string_value: str = ""
    byte_array_value: list[bytes] = field(default_factory=list)
    bool_array_value: list[bool] = field(default_factory=list)
    integer_array_value: list[int] = field(default_factory=list)
    double_array_value: list[float] = field(default_factory=list)
    string_array_value: list[str] = field(default_factory=list)


class Parameter(PartialApi, missing=("to_parameter_msg", "from_parameter_msg")):
    """A name with a value."""

    Type = ParameterType

    def __init__(self, name: str, type_: ParameterType | None = None, value: Any = None) -> None:
        self.name = name
        self.type_ = ParameterType.from_parameter_value(value)
        if type_ not in (None, self.type_):
            raise ValueError(f"parameter {name!r}: {value!r} is not of the type {ParameterType(type_).name}")
        self.value = value

    def get_parameter_value(self) -> ParameterValue:
        """Return the value as ROS sends it: `string_value`, `double_value` and so on."""
        message = ParameterValue(type=int(self.type_))
        if self.type_ != ParameterType.NOT_SET:
            kept = list(self.value) if isinstance(self.value, tuple) else self.value
            setattr(message, f"{self.type_.name.lower()}_value", kept)
        return message

    def __repr__(self) -> str:
        return f"Parameter(name={self.name!r}, type_={self.type_.name}, value={self.value!r})"


@dataclass
class SetParametersResult:
    """Whether a change was taken, and why not."""

    successful: bool = True
    reason: str = ""


class Parameters:
    """The parameters of one node; their values are noted in `noted` as well.

    With `declares_overrides`, those of the command line are declared at once; with `allows_undeclared`, any other is
    read as one that is not set.
    """

    def __init__(
        self, overrides: dict[str, Any], noted: dict[str, Any], *, declares_overrides: bool, allows_undeclared: bool
    ) -> None:
        self._allows_undeclared = allows_undeclared
        self._overrides = overrides
        self._noted = noted
        self.values: dict[str, Parameter] = {}  #: all that are declared
        self._described: dict[str, Any] = {}
        self.callbacks: list[Callable[[list[Parameter]], Any]] = []
        if declares_overrides:
            for name, value in overrides.items():
                self.declare(name, value)

    def declare(self, name: str, default: Any, descriptor: Any = None, ignore_override: bool = False) -> Parameter:
        """Add a parameter; the command line's value wins.

        A type may be given in place of a value, as in rclpy: the command line must then give the value.
        """
        if name in self.values:
            raise ParameterAlreadyDeclaredException(f"parameter {name!r} is declared already")
        typed = isinstance(default, ParameterType)
        wanted, value = (default, None) if typed else (ParameterType.from_parameter_value(default), default)
        if not ignore_override and name in self._overrides:
            value = self._overrides[name]
            dynamic = wanted == ParameterType.NOT_SET or getattr(descriptor, "dynamic_typing", False)
            came = ParameterType.from_parameter_value(value)
            if not dynamic and came != wanted:
                raise InvalidParameterTypeException(
                    f"parameter {name!r} is {wanted.name}, came {came.name} {value!r} from the command line"
                    + (f": write {name}:={float(value)}" if (wanted.name, came.name) == ("DOUBLE", "INTEGER") else "")
                )
        refusal = self._refusal(Parameter(name, value=value))
        if refusal is not None:
            raise InvalidParameterValueException(f"parameter {name!r}: a callback refused {value!r}: {refusal.reason}")
        self.values[name] = Parameter(name, value=value)
        self._described[name] = descriptor or ParameterDescriptor()
        self._noted[name] = value
        return self.values[name]

    def get(self, name: str) -> Parameter:
        """Return a declared parameter."""
        if name not in self.values and not self._allows_undeclared:
            raise ParameterNotDeclaredException(name)
        return self.values.get(name) or Parameter(name)

    def forget(self, name: str) -> None:
        """Remove a declared parameter."""
        if self.values.pop(name, None) is None:
            raise ParameterNotDeclaredException(name)

    def set(self, changes: Iterable[Parameter]) -> list[SetParametersResult]:
        """Change parameters one by one, each if every callback agrees and its type stays."""
        results = []
        for change in changes:
            before, described = self.get(change.name), self._described.get(change.name, ParameterDescriptor())
            other = before.type_ not in (ParameterType.NOT_SET, change.type_) and not described.dynamic_typing
            if other or described.read_only:
                wrong = "is read-only" if described.read_only else f"is {before.type_.name}, came {change.type_.name}"
                results.append(SetParametersResult(False, f"{change.name} {wrong}"))
                continue
            refused = self._refusal(change)
            results.append(SetParametersResult() if refused is None else refused)
            if refused is None:
                self.values[change.name] = change
                self._noted[change.name] = change.value
        return results

    def _refusal(self, change: Parameter) -> SetParametersResult | None:
        """Ask every callback; return the answer of the first that refuses."""
        answers = [callback([change]) for callback in self.callbacks]
        return next((answer for answer in answers if not answer.successful), None)


@dataclass
class ParameterDescriptor:
    """The description of a parameter; only `read_only` and `dynamic_typing` have an effect."""

    name: str = ""
    type: int = 0
    description: str = ""
    additional_constraints: str = ""
    read_only: bool = False
    dynamic_typing: bool = False
