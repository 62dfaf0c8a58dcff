"""Which requests the live page answers, and the headers it answers with.

Two attacks come through a browser that may reach the page: another site's page that opens our socket (its `Origin`
is not ours), and a site whose name an attacker makes lead to this machine (DNS rebinding: `Host` and `Origin` agree,
but name the attacker's site). So `Host` must be a name that only this machine has, and `Origin`, where a browser
sends one, must be the same.
"""

from __future__ import annotations

import ipaddress
import logging
import socket
from collections.abc import Iterable
from dataclasses import dataclass
from urllib.parse import urlsplit

from aiohttp.http_exceptions import HttpProcessingError

#: Sent with every answer: nothing from elsewhere, no inline script or style, in no frame of another page.
HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}


@dataclass(frozen=True, slots=True)
class Access:
    """Decides by `Host` and `Origin` whether a request is admitted."""

    name: str  #: the host that the page was asked to be served at
    loopback: bool  #: whether it listens on loopback addresses alone

    @classmethod
    def at(cls, name: str, addresses: Iterable[str]) -> Access:
        """Return the rule for a page asked for at `name` that listens at some IP addresses."""
        return cls(name.casefold(), all(_is_loopback(address) for address in addresses))

    def admits(self, host: str | None, origin: str | None) -> bool:
        """Whether a request with these headers is admitted.

        `Host` must name this machine: by loopback or as it was asked for; where the page is open to the network also
        by any IP address or by this machine's own name. `Origin`, where there is one, must be the same host and port.
        """
        name = _host_name(host)
        if name is None or not self._is_ours(name):
            return False
        return origin is None or origin.casefold() in (f"http://{host}".casefold(), f"https://{host}".casefold())

    def _is_ours(self, name: str) -> bool:
        if name in ("localhost", self.name) or _is_loopback(name):
            return True
        # An address cannot be made to lead elsewhere, as a name can.
        own = socket.gethostname().casefold()
        return not self.loopback and (_address(name) is not None or name in (own, f"{own}.local"))


class QuietLogger(logging.LoggerAdapter[logging.Logger]):
    """Keeps what is wrong with a request to the request's answer; our own errors are logged."""

    def exception(self, msg: object, *args: object, **kwargs: object) -> None:
        """Log an error that is neither a malformed request nor a client that has gone."""
        if not isinstance(kwargs.get("exc_info"), (HttpProcessingError, ConnectionError)):
            super().exception(msg, *args, **kwargs)  # type: ignore[arg-type]


def _host_name(host: str | None) -> str | None:
    """Return the name in a `Host` header, in lower case and without brackets; None where it is none."""
    try:
        parts = urlsplit(f"//{host}")
        _ = parts.port  # raises where it is no port
    except ValueError:
        return None
    whole = parts.netloc == host and "@" not in parts.netloc
    return parts.hostname if whole else None


def _address(name: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        address = ipaddress.ip_address(name)
    except ValueError:
        return None
    return getattr(address, "ipv4_mapped", None) or address


def _is_loopback(name: str) -> bool:
    address = _address(name)
    return address is not None and address.is_loopback
