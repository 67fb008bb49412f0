"""The condition an XV-15 is modelled at: its weight, the air it flies in, its centre of gravity.

A database is for one condition, and so is a flight: weight, density and speed of sound stay as they are while the
aircraft climbs and burns fuel.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rtsim.aircraft.atmosphere import standard_atmosphere
from rtsim.units import FOOT, INCH, POUND

SHIPPED_MASS = 13000.0 * POUND
"""Mass of the shipped aircraft [kg]."""
_DIGITS = 3  # of the units people give them in: what was read back from a file is the same condition
_UNITS = {"mass": POUND, "density_altitude": FOOT, "cg_forward": INCH}
_STORED = {"mass": "weight_lb", "density_altitude": "density_altitude_ft", "cg_forward": "cg_in"}


@dataclass(frozen=True, slots=True, kw_only=True)
class AircraftCondition:
    """Weight, air and centre of gravity, to a thousandth of lb, ft and in; by default those of the shipped aircraft."""

    mass: float = SHIPPED_MASS
    """Mass [kg]."""
    density_altitude: float = 0.0
    """Height in the standard atmosphere whose density and speed of sound the air of the flight has [m]."""
    cg_forward: float = 0.0
    """Centre of gravity forward of the aft limit, which is that of the shipped aircraft [m]."""

    def __post_init__(self) -> None:
        """Round."""
        for name, unit in _UNITS.items():
            object.__setattr__(self, name, round(getattr(self, name) / unit, _DIGITS) * unit)

    @staticmethod
    def stored(attributes: Mapping[str, Any]) -> AircraftCondition:
        """The condition of a database.

        Args:
            attributes: Its attributes; one that does not say its condition has that of the shipped aircraft.
        """
        if any(not isinstance(attributes.get(key), (int, float)) for key in _STORED.values()):
            return SHIPPED
        return AircraftCondition(**{name: float(attributes[key]) * _UNITS[name] for name, key in _STORED.items()})

    @property
    def attributes(self) -> dict[str, float]:
        """The condition as attributes of a database."""
        return {key: round(getattr(self, name) / _UNITS[name], _DIGITS) for name, key in _STORED.items()}

    @property
    def density(self) -> float:
        """Density of the air [kg/m^3]."""
        return standard_atmosphere(self.density_altitude)[0]

    @property
    def true_over_calibrated(self) -> float:
        """True airspeed over calibrated airspeed, without compressibility (under 1 % below 260 kn and 15000 ft) [-]."""
        return math.sqrt(SHIPPED.density / self.density)

    @property
    def values(self) -> tuple[str, str, str]:
        """Weight in lb, density altitude in ft and centre of gravity in in, as people write them."""
        weight, height, forward = (f"{round(getattr(self, name) / unit, _DIGITS):.9g}" for name, unit in _UNITS.items())
        return weight, height, forward

    @property
    def flags(self) -> str:
        """The condition as options of the command line."""
        weight, height, forward = self.values
        return f"--weight-lb {weight} --density-altitude-ft {height} --cg-in {forward}"

    def __str__(self) -> str:
        """Say it for people."""
        weight, height, forward = self.values
        return f"{weight} lb, {height} ft" + (f", centre of gravity {forward} in forward" if self.cg_forward else "")


SHIPPED = AircraftCondition()
"""The condition of the shipped aircraft: 13000 lb, sea level, centre of gravity at its aft limit."""
AircraftName = str | AircraftCondition
"""What names an aircraft: the file of its database, empty for the shipped one; or a condition of the XV-15."""
