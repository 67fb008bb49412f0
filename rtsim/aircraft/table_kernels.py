"""Look-up of smooth (continuously differentiable) tables on uniform grids.

A table is resampled once by monotone cubics (``smooth_tables.py``) and evaluated here as a cubic
Hermite interpolant, so that Jacobians do not depend on the step they are taken with. Outside its
range a table holds its end value.
"""

from __future__ import annotations

from typing import NamedTuple

from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import inner_kernel


class Curves(NamedTuple):
    """Several curves of one argument on one uniform grid."""

    start: float
    """First argument of the grid."""
    step: float
    """Grid spacing."""
    values: FloatArray
    """Values, shape (curves, points)."""
    slopes: FloatArray
    """Derivatives with respect to the argument, shape (curves, points)."""


class Surfaces(NamedTuple):
    """Several surfaces of two arguments on one uniform grid."""

    x_start: float
    """First value of the first argument."""
    x_step: float
    """Spacing in the first argument."""
    y_start: float
    """First value of the second argument."""
    y_step: float
    """Spacing in the second argument."""
    nodes: FloatArray
    """Value, x derivative, y derivative and cross derivative, shape (surfaces, x points, y points, 4)."""


@inner_kernel
def curve(table: Curves, which: int, argument: float) -> float:
    """Value of curve number ``which`` at ``argument``.

    Args:
        table: The curves.
        which: Number of the curve.
        argument: Where to evaluate, in the unit of the grid.
    """
    values = table.values
    last = values.shape[1] - 1
    position = (argument - table.start) / table.step
    if position <= 0.0:
        return values[which, 0]
    if position >= last:
        return values[which, last]
    i = int(position)
    t = position - i
    t2 = t * t
    t3 = t2 * t
    slope = table.step * table.slopes[which, i]
    slope_next = table.step * table.slopes[which, i + 1]
    return (
        (2.0 * t3 - 3.0 * t2 + 1.0) * values[which, i]
        + (t3 - 2.0 * t2 + t) * slope
        + (3.0 * t2 - 2.0 * t3) * values[which, i + 1]
        + (t3 - t2) * slope_next
    )


@inner_kernel
def _cell(argument: float, start: float, step: float, points: int) -> tuple[int, float]:
    position = (argument - start) / step
    if position <= 0.0:
        return 0, 0.0
    if position >= points - 1:
        return points - 2, 1.0
    i = int(position)
    return i, position - i


@inner_kernel
def surface(table: Surfaces, which: int, x: float, y: float) -> float:
    """Value of surface number ``which`` at (x, y), bicubic Hermite.

    Args:
        table: The surfaces.
        which: Number of the surface.
        x: First argument.
        y: Second argument.
    """
    nodes = table.nodes
    i, t = _cell(x, table.x_start, table.x_step, nodes.shape[1])
    j, s = _cell(y, table.y_start, table.y_step, nodes.shape[2])
    t2, s2 = t * t, s * s
    t3, s3 = t2 * t, s2 * s
    x_value = (2.0 * t3 - 3.0 * t2 + 1.0, 3.0 * t2 - 2.0 * t3)
    x_slope = ((t3 - 2.0 * t2 + t) * table.x_step, (t3 - t2) * table.x_step)
    y_value = (2.0 * s3 - 3.0 * s2 + 1.0, 3.0 * s2 - 2.0 * s3)
    y_slope = ((s3 - 2.0 * s2 + s) * table.y_step, (s3 - s2) * table.y_step)
    total = 0.0
    for a in range(2):
        for b in range(2):
            node = nodes[which, i + a, j + b]
            total += (
                x_value[a] * y_value[b] * node[0]
                + x_slope[a] * y_value[b] * node[1]
                + x_value[a] * y_slope[b] * node[2]
                + x_slope[a] * y_slope[b] * node[3]
            )
    return total
