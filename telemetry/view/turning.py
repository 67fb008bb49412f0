"""Turns as quaternions x y z w.

Legend:
    angle: Right-handed about the axis [rad].
    axis: A unit vector.
    a: Turn that is made last.
    b: Turn that is made first.
    xyzw: The four numbers.
"""

from __future__ import annotations

import math
from typing import Any

import rerun as rr

from rtsim.arrays import FloatArray


def about_x(angle: float) -> list[float]:
    """About x."""
    return [math.sin(0.5 * angle), 0.0, 0.0, math.cos(0.5 * angle)]


def about_y(angle: float) -> list[float]:
    """About y."""
    return [0.0, math.sin(0.5 * angle), 0.0, math.cos(0.5 * angle)]


def about_z(angle: float) -> list[float]:
    """About z."""
    return [0.0, 0.0, math.sin(0.5 * angle), math.cos(0.5 * angle)]


def about(axis: FloatArray, angle: float) -> list[float]:
    """About any axis."""
    x, y, z = math.sin(0.5 * angle) * axis
    return [x, y, z, math.cos(0.5 * angle)]


def product(a: list[float], b: list[float]) -> list[float]:
    """Two turns, one after the other."""
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return [
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    ]


def quaternion(xyzw: list[float]) -> Any:
    """As Rerun takes it."""
    return rr.Quaternion(xyzw=xyzw)
