"""Compiled steady wind: its components where the aircraft is, and motion in the horizontal plane.

The velocity of the state is relative to the air. Where the wind changes with height, an aircraft that climbs keeps its
motion over the ground and so loses airspeed by as much as the wind gains: ``meet_wind`` takes the change of the wind
over a frame off the air-relative velocity, exactly.

Legend:
    tables: The wind.
    altitude: Height above the ground [m].
    x: Aircraft state.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rtsim.aircraft.variables import STATE
from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import inner_kernel
from rtsim.units import FOOT

ROUGHNESS = 0.15 * FOOT
"""Roughness length of MIL-F-8785C 3.7.3.2 for take-off, approach and landing [m]."""
LOWEST, HIGHEST = 3.0 * FOOT, 1000.0 * FOOT
"""Heights between which the law of the wind shear holds; beyond, the wind is that at the end [m]."""


class WindTables(NamedTuple):
    """The steady wind; read-only."""

    ahead: float
    """Wind along the heading at the start, a tailwind positive [m/s]."""
    right: float
    """Wind towards the right of it [m/s]."""
    heading: float
    """Heading at the start [rad]."""
    reference_height: float
    """Height at which it blows as given; 0: at every height [m]."""
    felt: float
    """1 where the aircraft also moves sideways through the air, else 0."""


@inner_kernel
def wind_share(tables: WindTables, altitude: float) -> float:
    """Wind at a height as a share of that at the reference height: ``ln(h/z0) / ln(h_ref/z0)``, MIL-F-8785C 3.7.3.2."""
    if tables.reference_height == 0.0:
        return 1.0
    height = min(max(altitude, LOWEST), HIGHEST)
    return math.log(height / ROUGHNESS) / math.log(tables.reference_height / ROUGHNESS)


@inner_kernel
def wind_gradient(tables: WindTables, altitude: float) -> float:
    """Change of that share with height [1/m]."""
    if tables.reference_height == 0.0 or not LOWEST < altitude < HIGHEST:
        return 0.0
    return 1.0 / (altitude * math.log(tables.reference_height / ROUGHNESS))


@inner_kernel
def wind_along(tables: WindTables, heading: float) -> tuple[float, float]:
    """Wind at the reference height along a heading and towards the right of it [m/s].

    Args:
        heading: The heading [rad].
    """
    turned = heading - tables.heading
    if turned == 0.0:
        return tables.ahead, tables.right
    sine, cosine = math.sin(turned), math.cos(turned)
    return tables.ahead * cosine + tables.right * sine, tables.right * cosine - tables.ahead * sine


@inner_kernel
def level_motion(x: FloatArray) -> tuple[float, float, float]:
    """Motion through the undisturbed air: ahead and to the right in the horizontal plane, and up [m/s]."""
    sine, cosine = math.sin(x[STATE.pitch]), math.cos(x[STATE.pitch])
    bank_sine, bank_cosine = math.sin(x[STATE.bank]), math.cos(x[STATE.bank])
    down = x[STATE.v] * bank_sine + x[STATE.w] * bank_cosine
    right = x[STATE.v] * bank_cosine - x[STATE.w] * bank_sine
    return x[STATE.u] * cosine + down * sine, right + 0.0, x[STATE.u] * sine - down * cosine


@inner_kernel
def over_ground(tables: WindTables, x: FloatArray) -> tuple[float, float]:
    """Motion over the ground along the heading and to the right of it [m/s]."""
    ahead, right, _ = level_motion(x)
    share = wind_share(tables, x[STATE.altitude])
    along, across = wind_along(tables, x[STATE.heading])
    return ahead + share * along, right + share * across


@inner_kernel
def level_speed(ahead: float, right: float) -> float:
    """Speed in the horizontal plane, negative where the motion is more rearward than sideways.

    Args:
        ahead: Component along the heading [m/s].
        right: Component to the right of it [m/s].
    """
    if right == 0.0:
        return ahead
    speed = math.sqrt(ahead * ahead + right * right)
    return -speed if ahead < -abs(right) else speed


@inner_kernel
def meet_wind(tables: WindTables, x: FloatArray, before: float) -> None:
    """Take the change of the wind over a frame off the air-relative velocity.

    Args:
        x: Aircraft state after the step, which moved it in the wind of the height before; u, v, w are changed.
        before: Height at the start of the frame [m].
    """
    change = wind_share(tables, x[STATE.altitude]) - wind_share(tables, before)
    along, across = wind_along(tables, x[STATE.heading])
    ahead, right = change * along, change * across * tables.felt
    sine, cosine = math.sin(x[STATE.pitch]), math.cos(x[STATE.pitch])
    bank_sine, bank_cosine = math.sin(x[STATE.bank]), math.cos(x[STATE.bank])
    x[STATE.u] -= ahead * cosine
    x[STATE.v] -= ahead * sine * bank_sine + right * bank_cosine
    x[STATE.w] -= ahead * sine * bank_cosine - right * bank_sine
