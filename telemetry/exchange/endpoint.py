"""Addresses that are sent to."""

from __future__ import annotations

import ipaddress
import socket
from dataclasses import dataclass

from rtsim.errors import InputError


@dataclass(frozen=True, slots=True)
class Endpoint:
    """An IPv4 address and a UDP port."""

    host: str
    """Dotted address."""
    port: int
    """UDP port."""

    @classmethod
    def parse(cls, text: str, *, key: str = "--mavlink", default: str = "127.0.0.1:14550") -> Endpoint:
        """Read ``HOST:PORT``; a name is resolved now.

        Args:
            text: What the user wrote; ``HOST`` alone means the port of ``default``.
            key: The option it was given to, for the message.
            default: Where whoever listens does so by convention, ``HOST:PORT``.

        Raises:
            InputError: It is not an address, or the name is unknown.
        """
        host, colon, port_text = text.strip().rpartition(":")
        if not colon:
            host, port_text = text.strip(), default.rpartition(":")[2]
        allowed = "HOST:PORT with an IPv4 address or a name, port 1 to 65535"
        mend = f"write for example {default}"
        if not port_text.isascii() or not port_text.isdigit() or not 1 <= int(port_text) <= 65535 or not host:
            raise InputError("is no UDP address", key=key, value=text, allowed=allowed, mend=mend)
        try:
            found = socket.getaddrinfo(host, int(port_text), socket.AF_INET, socket.SOCK_DGRAM)
        except (OSError, UnicodeError):
            raise InputError("the name cannot be resolved", key=key, value=text, allowed=allowed, mend=mend) from None
        return cls(str(found[0][4][0]), int(port_text))

    @property
    def loopback(self) -> bool:
        """Whether it stays on this machine."""
        return ipaddress.ip_address(self.host).is_loopback

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"
