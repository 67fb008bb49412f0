"""Resample printed tables by monotone cubics (PCHIP) onto the uniform grids of ``table_kernels``.

Raw linear interpolation would put steps into the linear models wherever a table has a break point.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rtsim.aircraft.table_kernels import Curves, Surfaces
from rtsim.arrays import FloatArray
from rtsim.units import deg

NACELLE_GRID = np.radians(np.arange(0.0, 96.0, 1.0))
"""Uniform grid of what depends on the nacelle angle [rad]."""


def smooth_curves(arguments: Sequence[Sequence[float]], values: Sequence[Sequence[float]], grid: FloatArray) -> Curves:
    """Resample curves, each with its own break points, onto one uniform grid.

    Args:
        arguments: Break points of each curve, ascending.
        values: Values at the break points.
        grid: The uniform grid, ascending.

    Returns:
        The curves; outside the break points of a curve its end values are held.
    """
    from scipy.interpolate import PchipInterpolator

    rows, slopes = [], []
    for nodes, ordinates in zip(arguments, values, strict=True):
        interpolant = PchipInterpolator(np.asarray(nodes, float), np.asarray(ordinates, float))
        inside = np.clip(grid, nodes[0], nodes[-1])
        rows.append(interpolant(inside))
        slopes.append(np.where((grid >= nodes[0]) & (grid <= nodes[-1]), interpolant(inside, 1), 0.0))
    return Curves(float(grid[0]), float(grid[1] - grid[0]), np.array(rows), np.array(slopes))


def against_nacelle(mast_deg: Sequence[float], rows: Sequence[Sequence[float]]) -> Curves:
    """Curves printed against the mast angle (0 helicopter, 90 airplane), turned round to run against nacelle angle.

    Args:
        mast_deg: Mast angles of the print [deg], ascending.
        rows: Values of each curve.
    """
    nacelle = [deg(90.0 - b) for b in reversed(mast_deg)]
    return smooth_curves([nacelle] * len(rows), [list(reversed(row)) for row in rows], NACELLE_GRID)


def smooth_surface(
    x: Sequence[float], y: Sequence[float], values: FloatArray, *, x_grid: FloatArray, y_grid: FloatArray
) -> FloatArray:
    """Resample a printed two-argument table onto a uniform grid.

    Args:
        x: Break points of the first argument, ascending.
        y: Break points of the second argument, ascending.
        values: Table, shape (len(x), len(y)).
        x_grid: Uniform grid of the first argument.
        y_grid: Uniform grid of the second argument.

    Returns:
        Nodes (value, x, y and cross derivative), shape (len(x_grid), len(y_grid), 4).
    """
    from scipy.interpolate import PchipInterpolator

    along_y = PchipInterpolator(np.asarray(y, float), values, axis=1)
    y_inside = np.clip(y_grid, y[0], y[-1])
    y_within = (y_grid >= y[0]) & (y_grid <= y[-1])
    x_inside = np.clip(x_grid, x[0], x[-1])
    x_within = ((x_grid >= x[0]) & (x_grid <= x[-1]))[:, None]
    value = PchipInterpolator(np.asarray(x, float), along_y(y_inside), axis=0)
    slope = PchipInterpolator(np.asarray(x, float), np.where(y_within, along_y(y_inside, 1), 0.0), axis=0)
    return np.stack(
        [
            value(x_inside),
            np.where(x_within, value(x_inside, 1), 0.0),
            slope(x_inside),
            np.where(x_within, slope(x_inside, 1), 0.0),
        ],
        axis=-1,
    )


def stack_surfaces(nodes: Sequence[FloatArray], x_grid: FloatArray, y_grid: FloatArray) -> Surfaces:
    """Put resampled tables on one grid together.

    Args:
        nodes: Results of ``smooth_surface`` on the same grids.
        x_grid: The uniform grid of the first argument.
        y_grid: The uniform grid of the second argument.
    """
    return Surfaces(
        float(x_grid[0]),
        float(x_grid[1] - x_grid[0]),
        float(y_grid[0]),
        float(y_grid[1] - y_grid[0]),
        np.ascontiguousarray(np.stack(nodes)),
    )
