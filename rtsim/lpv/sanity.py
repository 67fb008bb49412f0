"""Whether the numbers of a database can mean an aircraft in SI and radians: degrees, knots and noise are told."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from rtsim.aircraft.variables import INPUTS, OUTPUTS, STATES, position
from rtsim.errors import InputError
from rtsim.lpv.database import GRIDDED, Database
from rtsim.units import to_deg

LARGEST: Final = 1e12
"""No number of an aircraft is larger, in SI."""
AXIS_UNITS: Final[Mapping[str, str]] = {
    "layer_acceleration": "m/s^2", "airspeed": "m/s", "nacelle": "rad", "flap": "rad", "rotor_speed": "rad/s",
}  # fmt: skip
"""Units of the arrays that have one."""
_RANGES: Final[Mapping[str, tuple[float, float, str]]] = {
    "layer_acceleration": (-20.0, 20.0, "give m/s^2"),
    "airspeed": (-350.0, 350.0, "give m/s"),
    "nacelle": (-0.6, 2.2, "give radians: 0 airplane, pi/2 helicopter"),
    "flap": (-2.0, 2.0, "give radians"),
    "rotor_speed": (0.0, 3000.0, "give rad/s"),
}
_KNOWN: Final = {
    kind: {variable.name: variable.unit for variable in variables}
    for kind, variables in (("state", STATES), ("input", INPUTS), ("output", OUTPUTS))
}
_SPEED_SHARE, _SPEED_LEAST = 0.1, 2.0
"""How far the speed of a trim may be from its place on the axis: a share, or [m/s]."""


def check_units(units: Mapping[str, str]) -> None:
    """Refuse axes that say that they are in other units.

    Args:
        units: What a file says, by array; what it does not say is taken for SI.

    Raises:
        InputError: For the first that is not SI.
    """
    for name, unit in units.items():
        if name in AXIS_UNITS and _plain(unit) not in {"", AXIS_UNITS[name]}:
            raise InputError(
                "is in another unit", key=f"{name}.units", value=unit, allowed=AXIS_UNITS[name], mend="convert it"
            )


def check_meaning(database: Database) -> None:
    """Refuse numbers that cannot be what they should be.

    Raises:
        InputError: For the first that is found.
    """
    for kind, variables in (("state", database.states), ("input", database.inputs), ("output", database.outputs)):
        for variable in variables:
            wanted = _KNOWN[kind].get(variable.name)
            if wanted is not None and _plain(variable.unit) not in {"", wanted}:
                raise InputError(
                    f"the {kind} '{variable.name}' is in another unit",
                    key=f"{kind}_unit",
                    value=variable.unit,
                    allowed=wanted or "none",
                    mend="convert it, or give it another name and a role",
                )
    for name, (low, high, mend) in _RANGES.items():
        values = np.asarray(getattr(database, name))
        _within(name, values, low, high, mend)
    for name in GRIDDED:
        if name != "valid":
            _within(name, getattr(database, name), -LARGEST, LARGEST, "correct it")
    _check_trims(database)


def _check_trims(database: Database) -> None:
    """The airspeed of every trim follows from its state: other units do not close."""
    u, w, pitch = (database.x_ref[..., position(database.states, name)] for name in ("u", "w", "pitch"))
    _within("x_ref (pitch)", np.where(database.valid, pitch, 0.0), -1.6, 1.6, "give radians")
    speed = u * np.cos(pitch) + w * np.sin(pitch)
    wanted = database.airspeed[None, :, None]
    off = np.abs(speed - wanted) > np.maximum(_SPEED_SHARE * np.abs(wanted), _SPEED_LEAST)
    if np.any(off & database.valid):
        layer, place, nacelle = (int(k) for k in np.argwhere(off & database.valid)[0])
        raise InputError(
            f"the trim at nacelle {to_deg(float(database.nacelle[nacelle])):g} deg has another airspeed than the axis",
            key=f"x_ref[{layer}, {place}, {nacelle}]",
            value=float(speed[layer, place, nacelle]),
            allowed=f"u cos(pitch) + w sin(pitch) = {float(database.airspeed[place]):g} m/s",
            mend="give axis and states in m/s and rad",
        )


def _within(name: str, values: Any, low: float, high: float, mend: str) -> None:
    wrong = ~((values >= low) & (values <= high))
    if np.any(wrong):
        where = [int(k) for k in np.argwhere(wrong)[0]]
        raise InputError(
            "is out of range",
            key=f"{name}{where or ''}",
            value=float(values[tuple(where)]),
            allowed=f"{low:g} to {high:g}",
            mend=mend,
        )


def _plain(unit: str) -> str:
    """A unit in one spelling: ``m s-1``, ``m s^-1`` and ``m/s`` are the same."""
    text = re.sub(r"\bradians?\b", "rad", " ".join(unit.split()))
    text = re.sub(r"^(\S+)[ .*·]s(?:\^|\*\*)?-1$", r"\1/s", text)
    text = re.sub(r"^(\S+)[ .*·]s(?:\^|\*\*)?-2$|^(\S+)/s(?:\*\*)?2$", lambda m: f"{m[1] or m[2]}/s^2", text)
    return {"1": "", "-": "", "Nm": "N m", "N*m": "N m", "N.m": "N m"}.get(text, text)
