"""FlightGear's native FDM packet, version 24: 408 bytes, big endian, its units as they are.

The fields follow ``FGNetFDM`` of FlightGear's ``net_fdm.hxx``; where FlightGear puts each is said in
docs/flightgear.md. Version 25 was taken back before any release; another version than its own makes FlightGear print
an alert for every packet.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import NamedTuple

VERSION = 24
"""Version of the packet."""
OWN_HEIGHT = -9999.0
"""In ``agl``: FlightGear takes the height above its own ground."""
RUNNING = 2
"""State of an engine that runs."""


class Field(NamedTuple):
    """One field of the packet."""

    name: str
    """As pymavlink's ``fgFDM`` calls it."""
    code: str
    """Its type, a code of ``struct``."""
    size: int = 1
    """How many values it has."""
    unit: str = ""
    """Unit; empty for counts, states and shares."""


LAYOUT = (
    Field("version", "I4x"),  # doubles begin at a multiple of eight
    Field("longitude", "d", 1, "rad"),
    Field("latitude", "d", 1, "rad"),
    Field("altitude", "d", 1, "m"),
    Field("agl", "f", 1, "m"),
    Field("phi", "f", 1, "rad"),
    Field("theta", "f", 1, "rad"),
    Field("psi", "f", 1, "rad"),
    Field("alpha", "f", 1, "rad"),
    Field("beta", "f", 1, "rad"),
    Field("phidot", "f", 1, "rad/s"),
    Field("thetadot", "f", 1, "rad/s"),
    Field("psidot", "f", 1, "rad/s"),
    Field("vcas", "f", 1, "kn"),
    Field("climb_rate", "f", 1, "ft/s"),
    Field("v_north", "f", 1, "ft/s"),
    Field("v_east", "f", 1, "ft/s"),
    Field("v_down", "f", 1, "ft/s"),
    Field("v_wind_body_north", "f", 1, "ft/s"),  # since 2.0 the velocity over the ground in body axes
    Field("v_wind_body_east", "f", 1, "ft/s"),
    Field("v_wind_body_down", "f", 1, "ft/s"),
    Field("A_X_pilot", "f", 1, "ft/s2"),
    Field("A_Y_pilot", "f", 1, "ft/s2"),
    Field("A_Z_pilot", "f", 1, "ft/s2"),
    Field("stall_warning", "f"),
    Field("slip_deg", "f", 1, "deg"),
    Field("num_engines", "I"),
    Field("eng_state", "I", 4),
    Field("rpm", "f", 4, "rpm"),
    Field("fuel_flow", "f", 4, "gal/h"),
    Field("fuel_px", "f", 4, "psi"),
    Field("egt", "f", 4, "degF"),
    Field("cht", "f", 4, "degF"),
    Field("mp_osi", "f", 4, "psi"),
    Field("tit", "f", 4, "degF"),
    Field("oil_temp", "f", 4, "degF"),
    Field("oil_px", "f", 4, "psi"),
    Field("num_tanks", "I"),
    Field("fuel_quantity", "f", 4, "gal"),
    Field("num_wheels", "I"),
    Field("wow", "I", 3),
    Field("gear_pos", "f", 3),
    Field("gear_steer", "f", 3),
    Field("gear_compression", "f", 3),
    Field("cur_time", "I", 1, "s"),
    Field("warp", "i", 1, "s"),
    Field("visibility", "f", 1, "m"),
    Field("elevator", "f"),
    Field("elevator_trim_tab", "f"),
    Field("left_flap", "f"),
    Field("right_flap", "f"),
    Field("left_aileron", "f"),
    Field("right_aileron", "f"),
    Field("rudder", "f"),
    Field("nose_wheel", "f"),
    Field("speedbrake", "f"),
    Field("spoilers", "f"),
)
"""Every field in the order of the packet."""
_PACKED = struct.Struct(">" + "".join(f"{field.size}{field.code}" for field in LAYOUT))
SIZE = _PACKED.size
"""Length of the packet [bytes]."""


def encode(values: Mapping[str, float | Sequence[float]]) -> bytes:
    """Pack a packet; fields that are not given are zero.

    Args:
        values: Number of each field, or as many as the field has.

    Raises:
        KeyError: There is no such field.
        struct.error: A field was given another count of values than it has.
        OverflowError: A number does not fit its field.
    """
    given: dict[str, float | Sequence[float]] = {"version": VERSION, **values}
    numbers: list[float] = []
    for field in LAYOUT:
        value = given.pop(field.name, None)
        if value is None:
            numbers += [0] * field.size
        elif isinstance(value, Sequence):
            if len(value) != field.size:
                raise struct.error(f"{field.name} has {field.size} values")
            numbers += value
        else:
            numbers.append(value)
    if given:
        raise KeyError(*given)
    return _PACKED.pack(*numbers)
