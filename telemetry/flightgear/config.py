"""Where FlightGear is and where in the world it shows the flight."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field

from telemetry.exchange.endpoint import Endpoint
from telemetry.exchange.globe import HomePosition

PACKETS_PER_SECOND = 60
"""Packets sent; FlightGear takes all that came since its last picture and shows the newest."""
DEFAULT_TARGET = "127.0.0.1:5510"
"""Where FlightGear listens for us; 5501 to 5503 are taken where ArduPilot's simulator runs."""
KEFLAVIK = HomePosition(latitude_deg=63.976, longitude_deg=-22.605435, altitude_m=45.0)
"""On runway 02 of Keflavik, which points due north: its scenery comes with FlightGear. The ground's height is that of
FlightGear's own tool, fgelev; from here on it stays within a metre for a kilometre."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowConfig:
    """What the process that sends to FlightGear needs to know."""

    target: Endpoint = field(default_factory=lambda: Endpoint.parse(DEFAULT_TARGET, default=DEFAULT_TARGET))
    """Where FlightGear listens."""
    home: HomePosition = KEFLAVIK
    """Start of the flight on the globe."""

    def to_json(self) -> str:
        """The settings as one line of JSON."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> WindowConfig:
        """Read back what ``to_json`` wrote.

        Args:
            text: The line.
        """
        values = json.loads(text)
        return cls(target=Endpoint(**values["target"]), home=HomePosition(**values["home"]))
