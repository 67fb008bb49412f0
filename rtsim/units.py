"""Conversions between SI (used everywhere inside) and the units people read.

A function named after a unit takes a number *in that unit* and returns SI: ``kt(100)`` is
51.44 m/s. ``to_kt`` goes the other way. Both accept floats and arrays.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

Quantity = TypeVar("Quantity", float, "npt.NDArray[np.float64]")
"""A number or an array of numbers; what goes in comes out."""

KNOT = 1852.0 / 3600.0
"""One knot [m/s], exact by definition."""
FOOT = 0.3048
"""One foot [m], exact by definition."""
INCH = 0.0254
"""One inch [m], exact by definition."""
POUND = 0.45359237
"""One pound [kg], exact by definition."""
GRAVITY = 9.80665
"""Standard gravity [m/s^2], ISO 80000-3."""
POUND_FORCE = POUND * GRAVITY
"""One pound-force [N]."""
SLUG = POUND_FORCE / FOOT
"""One slug [kg]."""
SLUG_FOOT_SQUARED = SLUG * FOOT**2
"""One slug ft^2 [kg m^2]."""
FOOT_POUND = POUND_FORCE * FOOT
"""One foot-pound of moment or work [N m]."""
INCH_POUND = POUND_FORCE * INCH
"""One inch-pound of moment [N m]."""
HORSEPOWER = 550.0 * FOOT_POUND
"""One mechanical horsepower [W]."""
DEGREE = math.pi / 180.0
"""One degree [rad]."""
RPM = 2.0 * math.pi / 60.0
"""One revolution per minute [rad/s]."""
STICK_HALF_TRAVEL_IN = 4.8
PEDAL_HALF_TRAVEL_IN = 2.5
"""Longitudinal stick travel from neutral to either stop [in], NASA CR-166536."""


def kt(value: Quantity) -> Quantity:
    """Airspeed in knots to m/s.

    Args:
        value: Airspeed [kn].
    """
    return value * KNOT


def to_kt(value: Quantity) -> Quantity:
    """Airspeed in m/s to knots.

    Args:
        value: Airspeed [m/s].
    """
    return value / KNOT


def deg(value: Quantity) -> Quantity:
    """Angle in degrees to radians.

    Args:
        value: Angle [deg].
    """
    return value * DEGREE


def to_deg(value: Quantity) -> Quantity:
    """Angle in radians to degrees.

    Args:
        value: Angle [rad].
    """
    return value / DEGREE


def ft(value: Quantity) -> Quantity:
    """Length in feet to metres.

    Args:
        value: Length [ft].
    """
    return value * FOOT


def lb(value: Quantity) -> Quantity:
    """Mass in pounds to kilograms.

    Args:
        value: Mass [lb].
    """
    return value * POUND


def rpm(value: Quantity) -> Quantity:
    """Rotational speed in revolutions per minute to rad/s.

    Args:
        value: Rotational speed [rpm].
    """
    return value * RPM


def to_rpm(value: Quantity) -> Quantity:
    """Rotational speed in rad/s to revolutions per minute.

    Args:
        value: Rotational speed [rad/s].
    """
    return value / RPM
