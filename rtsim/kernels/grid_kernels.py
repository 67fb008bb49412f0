"""Look-up on a grid: the interval that holds a value, and bilinear interpolation on two axes.

Legend:
    axis: Grid values, increasing.
    value: Where to look; beyond the axis its end holds.
"""

from __future__ import annotations

from typing import Any

from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import inner_kernel


@inner_kernel
def cell_below(axis: FloatArray, value: float) -> int:
    """Number of the interval that holds a value, the first or last for one beyond the axis."""
    low = 0
    high = axis.shape[0] - 1
    while high - low > 1:
        middle = (low + high) >> 1
        if axis[middle] <= value:
            low = middle
        else:
            high = middle
    return low


@inner_kernel
def cell(axis: FloatArray, value: float) -> tuple[int, float]:
    """Number of the interval that holds a value, and where in it, in [0, 1]."""
    low = cell_below(axis, value)
    share = (value - axis[low]) / (axis[low + 1] - axis[low])
    return low, min(1.0, max(0.0, share))


@inner_kernel
def bilinear(tables: Any, cells: FloatArray, airspeed: float, nacelle: float, last: int, out: FloatArray) -> None:
    """Interpolate the first entries of the cells around a flight condition.

    Args:
        tables: Has the axes ``airspeed`` [m/s] and ``nacelle`` [rad].
        cells: Values at the grid points, shape (airspeeds, nacelle angles, entries).
        airspeed: Airspeed [m/s].
        nacelle: Nacelle angle [rad].
        last: How many entries.
        out: Receives them.
    """
    i, s = cell(tables.airspeed, airspeed)
    j, t = cell(tables.nacelle, nacelle)
    w0 = (1.0 - s) * (1.0 - t)
    w1 = (1.0 - s) * t
    w2 = s * (1.0 - t)
    w3 = s * t
    for k in range(last):
        out[k] = w0 * cells[i, j, k] + w1 * cells[i, j + 1, k] + w2 * cells[i + 1, j, k] + w3 * cells[i + 1, j + 1, k]
