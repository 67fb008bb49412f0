"""International standard atmosphere up to 11 km (ISO 2533)."""

from __future__ import annotations

import math

from rtsim.units import GRAVITY

STANDARD_TEMPERATURE, TEMPERATURE_LAPSE = 288.15, 0.0065
"""Temperature at sea level [K], and what it falls by with altitude [K/m]."""
_PRESSURE, _GAS = 101325.0, 287.05287


def standard_atmosphere(height: float) -> tuple[float, float]:
    """Density [kg/m^3] and speed of sound [m/s].

    Args:
        height: Pressure altitude [m], -1000 to 11000.
    """
    temperature = STANDARD_TEMPERATURE - TEMPERATURE_LAPSE * height
    pressure = _PRESSURE * (temperature / STANDARD_TEMPERATURE) ** (GRAVITY / (TEMPERATURE_LAPSE * _GAS))
    return pressure / (_GAS * temperature), math.sqrt(1.4 * _GAS * temperature)
