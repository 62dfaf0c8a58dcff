"""Names of nodes, topics and services: which of them ROS 2 takes."""

from __future__ import annotations

import re

_TOKENS = r"[A-Za-z_]\w*(/[A-Za-z_]\w*)*"


class NameValidationException(Exception):  # noqa: N818 — rclpy's names
    """A name that ROS 2 does not take."""


class InvalidNodeNameException(NameValidationException):
    """Of a node."""


class InvalidNamespaceException(NameValidationException):
    """Of a namespace."""


class InvalidTopicNameException(NameValidationException):
    """Of a topic."""


class InvalidServiceNameException(NameValidationException):
    """Of a service."""


#: What a name must look like, by the error.
_PATTERNS: dict[type[NameValidationException], str] = {
    InvalidNodeNameException: r"[A-Za-z_]\w*",
    InvalidNamespaceException: rf"/?({_TOKENS})?",
    InvalidTopicNameException: rf"~|(~?/)?{_TOKENS}",
    InvalidServiceNameException: rf"~|(~?/)?{_TOKENS}",
}


def checked(name: str, error: type[NameValidationException]) -> str:
    """Return a name that ROS 2 takes; raise `error` for any other."""
    if not re.fullmatch(_PATTERNS[error], name, re.ASCII):
        raise error(f"{name!r}: want letters, digits and _, not first a digit, and / between words")
    return name
