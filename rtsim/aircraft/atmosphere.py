"""International standard atmosphere up to 11 km (ISO 2533)."""

from __future__ import annotations

import math

from rtsim.units import GRAVITY

_TEMPERATURE, _PRESSURE, _LAPSE, _GAS = 288.15, 101325.0, 0.0065, 287.05287


def standard_atmosphere(height: float) -> tuple[float, float]:
    """Density [kg/m^3] and speed of sound [m/s].

    Args:
        height: Pressure altitude [m], -1000 to 11000.
    """
    temperature = _TEMPERATURE - _LAPSE * height
    pressure = _PRESSURE * (temperature / _TEMPERATURE) ** (GRAVITY / (_LAPSE * _GAS))
    return pressure / (_GAS * temperature), math.sqrt(1.4 * _GAS * temperature)
