"""Settings of the MAVLink vehicle: where it sends, who may fly, how it presents itself."""

from __future__ import annotations

import ipaddress
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

from rtsim.errors import InputError
from rtsim.outside import read_bytes
from telemetry.exchange.endpoint import Endpoint
from telemetry.exchange.globe import HomePosition

DEFAULT_TARGET = "127.0.0.1:14550"
"""Where ground stations listen by convention."""
WHITELIST = tuple(range(240, 256))
"""System ids of ground stations (QGroundControl, MAVProxy 255, MAVSDK 245, APM Planner 252); no vehicle uses them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ratings:
    """What counts as 100 per cent, in conversion and airplane mode and in helicopter mode; the default is the XV-15."""

    torque_inlb: float = 130_000.0
    """Mast torque [in lb]."""
    hover_torque_inlb: float = 163_000.0
    """Mast torque in helicopter mode [in lb]."""
    hover_nacelle_deg: float = 80.0
    """Nacelle angle above which that holds [deg]."""
    hover_airspeed_kt: float = 60.0
    """Airspeed below which it holds [kn]."""
    rotor_speed_rpm: float = 589.0
    """Rotor speed [rpm]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MavlinkConfig:
    """Everything the MAVLink process needs to know."""

    targets: tuple[Endpoint, ...] = (Endpoint("127.0.0.1", 14550),)
    """Where telemetry goes unasked."""
    bind_host: str = "127.0.0.1"
    """Address to receive on."""
    bind_port: int = 0
    """Port to receive on; 0 takes a free one."""
    system_id: int = 1
    """Own MAVLink system id."""
    component_id: int = 1
    """Own component id; ground stations make a vehicle of component 1 only."""
    autopilot: Literal["px4", "generic"] = "px4"
    """How ground stations decode modes; see docs/mavlink.md."""
    whitelist: tuple[int, ...] = WHITELIST
    """System ids that may fly and change things."""
    rate_hz: float = 250.0
    """Frame rate of the flight."""
    ratings: Ratings = Ratings()
    """What torque and rotor speed are shares of."""
    home: HomePosition = field(default_factory=HomePosition)
    """Start of the flight on the globe."""
    aids: Mapping[str, bool] = field(default_factory=dict)
    """Pilot aids of the flight and whether each is on at the start, in the order of ``Feedback.aids``."""
    parameters: Mapping[str, float] = field(default_factory=dict)
    """Start values of parameters that differ from their defaults, by name (``XV_...``)."""
    parameter_file: str | None = None
    """Where parameters are stored on request, and read from at the start."""
    axes: Mapping[str, str] = field(default_factory=dict)
    """MANUAL_CONTROL field behind each control, a leading ``-`` reverses; empty takes the standard ones."""
    buttons: Mapping[str, int] = field(default_factory=dict)
    """Button number of each function; empty takes the standard ones."""
    signing_key_file: str | None = None
    """File with the signing key; None flies unsigned."""
    reboot_resets: bool = False
    """Let MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN reset the flight."""
    title: str = "flight"
    """What is flown, for the greeting."""
    version: str = "0.0.0"
    """Version of rtsim."""

    def to_json(self) -> str:
        """The settings as one line of JSON."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> MavlinkConfig:
        """Read back what ``to_json`` wrote.

        Args:
            text: The line.
        """
        values: dict[str, Any] = json.loads(text)
        values["targets"] = tuple(Endpoint(**target) for target in values["targets"])
        values["home"] = HomePosition(**values["home"])
        values["ratings"] = Ratings(**values["ratings"])
        values["whitelist"] = tuple(values["whitelist"])
        return cls(**values)


def endpoints(
    targets: Sequence[str], *, allow_network: bool, bind: str | None = None
) -> tuple[tuple[Endpoint, ...], str, int, str | None]:
    """Check what the user wants to send to and receive on.

    Args:
        targets: ``HOST:PORT`` each; empty takes the default.
        allow_network: Whether the user said that MAVLink may leave this machine.
        bind: ``HOST:PORT`` to receive on; None takes loopback, or all addresses where a target is elsewhere.

    Returns:
        Targets, address and port to receive on, and a warning to print or None.

    Raises:
        InputError: An address is wrong, or leaves this machine without permission.
    """
    found = tuple(Endpoint.parse(text) for text in (targets or (DEFAULT_TARGET,)))
    if bind is not None:
        own = Endpoint.parse(bind, key="--mavlink-bind")
        host, port = own.host, own.port
    else:
        host, port = ("127.0.0.1" if all(target.loopback for target in found) else "0.0.0.0"), 0
    away = [str(target) for target in found if not target.loopback]
    if not ipaddress.ip_address(host).is_loopback:
        away.append(host)
    if not away:
        return found, host, port, None
    if not allow_network:
        raise InputError(
            "leaves this machine, and MAVLink has no authentication",
            key="--mavlink",
            value=", ".join(away),
            allowed="loopback addresses",
            mend="add --mavlink-network if every machine that can reach it may fly the aircraft",
        )
    warning = (
        f"MAVLink is open to the network ({', '.join(away)}): anyone who can send a packet there may fly the aircraft. "
        "Use a signing key (--mavlink-key) or a network you trust."
    )
    return found, host, port, warning


def read_signing_key(path: str | Path) -> bytes:
    """Read a signing key: 64 hexadecimal digits, or 32 raw bytes.

    Args:
        path: The file; nobody but its owner may be able to read it.

    Returns:
        The key, 32 bytes.

    Raises:
        InputError: The file is missing, open to others, or holds no key.
    """
    file = Path(path)
    data = read_bytes(file, noun="signing key", largest=4096)
    if file.stat().st_mode & 0o077:
        raise InputError(
            "the signing key can be read by others", key="--mavlink-key", value=str(path), mend=f"run chmod 600 {path}"
        )
    if len(data) == 32:
        return data
    try:
        key = bytes.fromhex(data.decode("ascii").strip())
    except ValueError:
        key = b""
    if len(key) != 32:
        raise InputError(
            "the file holds no signing key",
            key="--mavlink-key",
            value=str(path),
            allowed="64 hexadecimal digits or 32 bytes",
            mend="make one with: openssl rand -hex 32",
        )
    return key
