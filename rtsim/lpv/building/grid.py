"""The grid of the shipped database: its axes, and which part of it is worth solving.

The spacing is what the paper's own density check asks for (see ``rtsim.lpv.building.checks``): 5 kn below 60 kn,
2.5 kn about hover, where the fore-and-aft inflow gradient fades in, 3.5 kn where the low side of the corridor nears
stall (60 to 109 kn), 7 kn to 130 kn, 10 kn above, and 2.5 kn where the flaps retract on the downstop; nacelle 2.5 deg
above 60 deg, 5 deg below.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rtsim.arrays import BoolArray, FloatArray
from rtsim.units import DEGREE, KNOT, deg, kt

AIRSPEED_KT = np.concatenate(
    [
        np.arange(-20.0, -5.0, 5.0),
        np.arange(-5.0, 7.5, 2.5),
        np.arange(10.0, 60.0, 5.0),
        np.arange(60.0, 109.0, 3.5),
        [109.0, 116.0, 123.0],
        np.arange(130.0, 170.0, 10.0),
        np.arange(170.0, 180.0, 2.5),
        np.arange(180.0, 261.0, 10.0),
    ]
)
"""Airspeed axis [kn], signed: hover by hand and tailwinds go below zero."""
NACELLE_DEG = np.concatenate([[-3.0, -2.0, -1.0, 0.0, 0.5], np.arange(5.0, 60.0, 5.0), np.arange(60.0, 91.0, 2.5)])
"""Nacelle axis [deg]; 0.5 is the end of the downstop, where the flap schedule changes. Below 0 the nacelles stay at 0
and the rotor speed comes down, to that of airplane mode in the first row."""
LAYERS_KT_S = np.array([-3.0, -1.5, 0.0, 1.5, 3.0])
"""Level acceleration of the layers [kn/s]; 3 kn/s is what Table 1 of the paper flies. With the layers between, flights
at 0.8 to 2.6 kn/s differ half as much from the nonlinear model as without (docs/lpv.md)."""

# Design corridor (NASA TM X-62407), widened by a rim; what cannot be trimmed there is marked by the solver.
_LOW_NACELLE_DEG = np.array([0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 59.3, 74.0, 90.0])
_LOW_KT = np.array([101.0, 95.2, 89.1, 82.6, 75.3, 66.7, 58.0, 5.0, 0.0])
_HIGH_NACELLE_DEG = np.array([0.0, 45.0, 60.0, 75.0, 90.0])
_HIGH_KT = np.array([170.0, 170.0, 155.0, 140.0, 125.0])
_RIM_LOW_KT, _RIM_HIGH_KT = 25.0, 25.0
_DOWNSTOP_DEG, _DOWNSTOP_HIGH_KT = 0.5, 260.0


@dataclass(frozen=True, slots=True)
class Grid:
    """Axes of a database to build, and the cells to solve."""

    layer_acceleration: FloatArray
    """Level acceleration of each layer (L,) [m/s^2], ascending; contains 0."""
    airspeed: FloatArray
    """Airspeed (V,) [m/s], ascending."""
    nacelle: FloatArray
    """Nacelle axis (N,) [rad], ascending; below 0 rows of lower rotor speed."""
    wanted: BoolArray
    """Which cells are worth solving (V, N)."""

    @property
    def level_layer(self) -> int:
        """Number of the layer of zero acceleration."""
        return int(np.argmin(np.abs(self.layer_acceleration)))


def conversion_grid() -> Grid:
    """Give the grid of the shipped XV-15 database.

    Returns:
        Axes in SI and the cells within the design corridor and its rim.
    """
    airspeed_kt, nacelle_deg = np.meshgrid(AIRSPEED_KT, NACELLE_DEG, indexing="ij")
    low = np.maximum(np.interp(nacelle_deg, _LOW_NACELLE_DEG, _LOW_KT) - _RIM_LOW_KT, AIRSPEED_KT[0])
    high = np.interp(nacelle_deg, _HIGH_NACELLE_DEG, _HIGH_KT) + _RIM_HIGH_KT
    high = np.where(nacelle_deg <= _DOWNSTOP_DEG, _DOWNSTOP_HIGH_KT, high)
    return Grid(
        layer_acceleration=LAYERS_KT_S * KNOT,
        airspeed=AIRSPEED_KT * kt(1.0),
        nacelle=NACELLE_DEG * DEGREE,
        wanted=(airspeed_kt >= low) & (airspeed_kt <= high),
    )


HELICOPTER_SIDE = deg(70.0)
"""From this nacelle angle up, trims are continued from hover; below it, from the fast side of the corridor [rad]."""
