"""From a TOML table to a frozen dataclass; an unknown key, a wrong type or a value out of range is refused by name."""

from __future__ import annotations

import dataclasses
import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

from limo_hog.exceptions import LimoHogError
from limo_hog.follow.robot import RobotError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found]

T = TypeVar("T")

WIDEST = 15.0
"""Half of the widest room [m]. Chosen: 30 m, nearly twice as far as the depth camera sees in any direction."""


class ScenarioError(LimoHogError):
    """A scenario that cannot be run; the message names the file, the key and what is allowed."""


def from_toml(text: str) -> dict[str, Any]:
    """Parse TOML; what is none, or too deep, is a `ValueError` or a `RecursionError`."""
    return dict(tomllib.loads(text))


def misfit(key: str, found: str, want: str) -> ScenarioError:
    """Return the error of a key: what was found there, and what is allowed."""
    return ScenarioError(f"{key}: {found}, want {want}")


@dataclass(frozen=True, slots=True)
class Limits:
    """What a field may hold: a closed range of numbers, or a set of words."""

    low: float = -math.inf
    high: float = math.inf
    words: tuple[str, ...] = ()

    def check(self, value: Any, where: str) -> None:
        """Raise `ScenarioError` unless every number or word in `value` is allowed."""
        if isinstance(value, tuple):
            for index, item in enumerate(value):
                self.check(item, f"{where}[{index}]")
        elif isinstance(value, str):
            if self.words and value not in self.words:
                raise ScenarioError(f"{where}: got {value!r}, want one of {', '.join(self.words)}")
        elif not self.low <= value <= self.high:
            raise ScenarioError(f"{where}: got {value}, want a number in {self.low:g} … {self.high:g}")


def within(default: Any, low: float, high: float) -> Any:
    """Return a dataclass field with a default and the range it must stay in."""
    return dataclasses.field(default=default, metadata={"limits": Limits(low, high)})


def required(low: float, high: float) -> Any:
    """Return a dataclass field without a default and the range it must stay in."""
    return within(dataclasses.MISSING, low, high)


def one_of(words: tuple[str, ...], default: Any = dataclasses.MISSING) -> Any:
    """Return a dataclass field that holds one of `words`; without a default it is required."""
    return dataclasses.field(default=default, metadata={"limits": Limits(words=words)})


def check_fields(value: Any, where: str) -> None:
    """Check the ranges of every field of a dataclass, and of the dataclasses within it."""
    for field in dataclasses.fields(value):
        item, key = getattr(value, field.name), f"{where}{field.name}"
        if "limits" in field.metadata:
            field.metadata["limits"].check(item, key)
        elif dataclasses.is_dataclass(item):
            check_fields(item, f"{key}.")
        elif isinstance(item, tuple):
            for index, entry in enumerate(item):
                if dataclasses.is_dataclass(entry):
                    check_fields(entry, f"{key}[{index}].")


def build(kind: type[T], table: Any, where: str) -> T:
    """Make a dataclass from a parsed TOML table; ranges are left to `check_fields`.

    Raises `ScenarioError` for an unknown or missing key or a value of the wrong type; `where` begins the message.
    """
    if not isinstance(table, Mapping):
        raise ScenarioError(f"{where.rstrip('.')}: got {table!r}, want a table")
    hints = get_type_hints(kind)
    fields = {field.name: field for field in dataclasses.fields(kind)}  # type: ignore[arg-type]
    for key in table:
        if key not in fields:
            raise ScenarioError(f"{where}{key}: unknown key, want one of {', '.join(fields)}")
    for name, field in fields.items():
        required = field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
        if required and name not in table:
            raise ScenarioError(f"{where}{name}: missing")
    values = {key: _convert(hints[key], value, f"{where}{key}") for key, value in table.items()}
    try:
        return kind(**values)
    except RobotError as error:
        raise ScenarioError(f"{where}{error}") from None


def _convert(hint: Any, value: Any, where: str) -> Any:
    # TOML promises no more, a float has no place for it, and Python does not even print the largest.
    if isinstance(value, int) and not -(2**63) <= value < 2**63:
        raise ScenarioError(f"{where}: got a whole number of more than 64 bits, want a smaller one")
    if dataclasses.is_dataclass(hint):
        return build(hint, value, f"{where}.")  # type: ignore[arg-type]
    if get_origin(hint) is tuple:
        if not isinstance(value, list | tuple):
            raise ScenarioError(f"{where}: got {value!r}, want a list")
        kinds = get_args(hint)
        if kinds[-1] is Ellipsis:
            kinds = (kinds[0],) * len(value)
        if len(kinds) != len(value):
            raise ScenarioError(f"{where}: got {len(value)} values, want {len(kinds)}")
        pairs = enumerate(zip(kinds, value, strict=True))
        return tuple(_convert(kind, item, f"{where}[{index}]") for index, (kind, item) in pairs)
    if hint is float and isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    if isinstance(value, hint) and not (hint is int and isinstance(value, bool)):
        return value
    raise ScenarioError(f"{where}: got {value!r}, want {'a number' if hint is float else hint.__name__}")
