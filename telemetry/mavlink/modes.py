"""Flight modes as ground stations see them: which pilot flies and which holds are on, under PX4's numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from telemetry.mavlink.exchange import Request
from telemetry.mavlink.state import PILOT_EXTERNAL

HOLDS = ("attitude_retention", "altitude_hold", "airspeed_hold")
"""The aids a mode decides on; the others stay as they are."""


@dataclass(frozen=True, slots=True)
class FlightMode:
    """One mode."""

    name: str
    """As shown; mixed case, no underscores."""
    main: int
    """PX4 main mode."""
    sub: int
    """PX4 sub mode."""
    standard: int
    """MAV_STANDARD_MODE, 0 where there is none."""
    aids: frozenset[str]
    """Holds that are on."""
    manual: bool = True
    """A person's sticks fly; else the virtual pilot."""

    @property
    def custom_mode(self) -> int:
        """The number in HEARTBEAT."""
        return self.sub << 24 | self.main << 16


MANUAL = FlightMode("Manual", 1, 0, 0, frozenset())
STABILIZED = FlightMode("Stabilized", 7, 0, 0, frozenset({"attitude_retention"}))
ALTITUDE = FlightMode("Altitude", 2, 0, 3, frozenset({"attitude_retention", "altitude_hold"}))
POSITION = FlightMode("Position", 3, 0, 1, frozenset({"attitude_retention", "altitude_hold", "airspeed_hold"}))
HOLD = FlightMode("Hold", 4, 3, 0, frozenset(), manual=False)
_ALL = (MANUAL, STABILIZED, ALTITUDE, POSITION, HOLD)


def offered_modes(aids: Mapping[str, bool]) -> tuple[FlightMode, ...]:
    """The modes a flight can really fly.

    Args:
        aids: The pilot aids it has.
    """
    return tuple(mode for mode in _ALL if mode.aids <= set(aids))


def present_mode(pilot: int, aids: Mapping[str, bool]) -> FlightMode:
    """The mode that describes the present state.

    Args:
        pilot: Who flies, as in the row.
        aids: The pilot aids and whether each is on.
    """
    if pilot != PILOT_EXTERNAL:
        return HOLD
    on = {name for name, state in aids.items() if state}
    if "airspeed_hold" in on and "altitude_hold" in on:
        return POSITION
    if "altitude_hold" in on:
        return ALTITUDE
    return STABILIZED if "attitude_retention" in on else MANUAL


def requests_for(mode: FlightMode, aids: Mapping[str, bool]) -> list[Request]:
    """What to ask of the flight for a mode.

    Args:
        mode: The mode wanted.
        aids: The pilot aids the flight has.
    """
    if not mode.manual:
        return [Request("pilot", "mocm")]
    wanted = [Request("aid", name, float(name in mode.aids)) for name in HOLDS if name in aids]
    return [*wanted, Request("pilot", "external")]
