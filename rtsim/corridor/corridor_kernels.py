"""Compiled corridor margins and warning levels, called once per frame.

A boundary is a polyline: speed over nacelle angle. Both speeds fall (or stay) as the nacelle angle grows, so at a fixed
speed the allowed nacelle angles are one interval; ``Corridor`` checks this when it is built.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import inner_kernel

LARGEST_BANK = math.pi / 3.0
"""Bank up to which a turn moves the sides [rad]: a load factor of 2."""
LOW, HIGH, NACELLE_FORWARD, NACELLE_AFT = 0, 1, 2, 3
"""Places of the margins in the array that ``corridor_margins`` fills."""
MARGIN_COUNT = 4
LEVEL_COUNT = 3
LEVEL_STATE_SIZE = 2 * LEVEL_COUNT
"""Size of the state of ``corridor_level_step``: per threshold whether it is active (0, 1) and a timer [s]."""


class CorridorTables(NamedTuple):
    """What the kernels know of one corridor. SI and radians; arrays ascend in nacelle angle."""

    low_nacelle: FloatArray
    """Nacelle angles of the low-speed boundary's corners, shape (n,) [rad]."""
    low_speed: FloatArray
    """Speeds there, shape (n,) [m/s]."""
    high_nacelle: FloatArray
    """Nacelle angles of the high-speed boundary's corners, shape (m,) [rad]."""
    high_speed: FloatArray
    """Speeds there, shape (m,) [m/s]."""
    downstop_nacelle: float
    """At and below this angle the nacelles rest on the airplane-mode stop [rad]."""
    downstop_speed: float
    """High-speed boundary on the downstop [m/s]."""
    turn_nacelle: FloatArray
    """Nacelle angles of what a turn changes, shape (k,) [rad]."""
    turn_low: FloatArray
    """What the low-speed boundary gains for each unit of load factor above 1, shape (k,) [m/s]."""
    turn_high: FloatArray
    """The same of the high-speed boundary off the downstop, shape (k,) [m/s]."""
    level_threshold: FloatArray
    """Margins below which caution, warning, exceedance begin, shape (3,), falling [m/s]."""
    level_hysteresis: float
    """How far above its threshold the margin must rise before a level ends [m/s]."""
    level_rise_time: float
    """How long the margin must be below a threshold before the level begins [s]."""
    level_fall_time: float
    """How long the margin must be above threshold + hysteresis before the level ends [s]."""


@inner_kernel
def turn_excess(bank: float) -> float:
    """Load factor of a level turn less 1; 0 in straight flight, whatever the load there.

    Args:
        bank: Bank angle [rad]; beyond 60 deg it counts as 60 deg.
    """
    return 1.0 / math.cos(min(abs(bank), LARGEST_BANK)) - 1.0 if bank != 0.0 else 0.0


@inner_kernel
def boundary_speed(nacelle: FloatArray, speed: FloatArray, angle: float) -> float:
    """Speed of a boundary at a nacelle angle; constant beyond its ends.

    Args:
        nacelle: Corner angles, ascending, shape (n,) [rad].
        speed: Corner speeds, shape (n,) [m/s].
        angle: Nacelle angle [rad].

    Returns:
        The boundary's speed [m/s].
    """
    last = nacelle.shape[0] - 1
    if angle <= nacelle[0]:
        return speed[0]
    for i in range(last):
        if angle <= nacelle[i + 1]:
            fraction = (angle - nacelle[i]) / (nacelle[i + 1] - nacelle[i])
            return speed[i] + fraction * (speed[i + 1] - speed[i])
    return speed[last]


@inner_kernel
def most_forward_angle(tables: CorridorTables, airspeed: float) -> float:
    """Smallest nacelle angle at which the airspeed is not below the low-speed boundary.

    Returns:
        The angle [rad]; the aft end of the boundary where the airspeed is below it everywhere.
    """
    nacelle, speed = tables.low_nacelle, tables.low_speed
    if airspeed >= speed[0]:
        return nacelle[0]
    for i in range(nacelle.shape[0] - 1):
        if airspeed >= speed[i + 1]:
            fraction = (speed[i] - airspeed) / (speed[i] - speed[i + 1])
            return nacelle[i] + fraction * (nacelle[i + 1] - nacelle[i])
    return nacelle[nacelle.shape[0] - 1]


@inner_kernel
def most_aft_angle(tables: CorridorTables, airspeed: float) -> float:
    """Largest nacelle angle at which the airspeed is not above the high-speed boundary.

    Returns:
        The angle [rad]; the forward end where the airspeed is above the boundary everywhere.
    """
    nacelle, speed = tables.high_nacelle, tables.high_speed
    last = nacelle.shape[0] - 1
    if airspeed <= speed[last]:
        return nacelle[last]
    for j in range(last):
        i = last - 1 - j
        if airspeed <= speed[i]:
            fraction = (speed[i] - airspeed) / (speed[i] - speed[i + 1])
            return nacelle[i] + fraction * (nacelle[i + 1] - nacelle[i])
    if airspeed <= tables.downstop_speed:
        return tables.downstop_nacelle
    return nacelle[0]


@inner_kernel
def corridor_margins(
    tables: CorridorTables, airspeed: float, nacelle_angle: float, excess: float, out: FloatArray
) -> None:
    """Signed distances to the boundaries, positive inside.

    The nacelle margins are measured at fixed airspeed to the first angle that violates a boundary, or to the end of the
    nacelle travel where none does. Outside, the one towards the violated boundary is negative: that much travel, the
    other way, is needed to re-enter. Both are continuous across a boundary.

    Args:
        excess: Load factor of the turn less 1.
        out: Filled with low, high [m/s], nacelle forward, nacelle aft [rad]; shape (4,).
    """
    slow = fast = airspeed  # in a turn each side is met as if the airspeed were nearer to it
    if excess != 0.0:
        slow -= excess * boundary_speed(tables.turn_nacelle, tables.turn_low, nacelle_angle)
        fast -= excess * boundary_speed(tables.turn_nacelle, tables.turn_high, nacelle_angle)
    high = boundary_speed(tables.high_nacelle, tables.high_speed, nacelle_angle)
    if nacelle_angle <= tables.downstop_nacelle:
        high = tables.downstop_speed
        fast = airspeed
    out[0] = slow - boundary_speed(tables.low_nacelle, tables.low_speed, nacelle_angle)
    out[1] = high - fast
    out[2] = nacelle_angle - most_forward_angle(tables, slow)
    out[3] = most_aft_angle(tables, fast) - nacelle_angle
    # No angle would do: neither direction re-enters, so both margins are the whole travel, negative.
    if slow < tables.low_speed[tables.low_speed.shape[0] - 1] or fast > tables.downstop_speed:
        travel = tables.low_nacelle[tables.low_nacelle.shape[0] - 1] - tables.low_nacelle[0]
        out[2] = -travel
        out[3] = -travel


@inner_kernel
def corridor_level_step(tables: CorridorTables, margin: float, dt: float, state: FloatArray) -> int:
    """Advance the warning level by one frame.

    Each threshold has its own timer, so that a margin jumping about above 0 never becomes an exceedance, and the level
    is the highest active threshold.

    Args:
        margin: Smaller of the two speed margins [m/s].
        state: Flat state, updated in place; zeros at the start; shape (6,).

    Returns:
        0 clear, 1 caution, 2 warning, 3 exceedance.
    """
    level = 0
    tolerance = 0.5 * dt  # a sum of frame lengths misses a time by rounding, never by half a frame
    for k in range(3):
        active, timer = 2 * k, 2 * k + 1
        if state[active] == 0.0:
            waiting, hold = margin < tables.level_threshold[k], tables.level_rise_time
        else:
            waiting, hold = margin > tables.level_threshold[k] + tables.level_hysteresis, tables.level_fall_time
        state[timer] = state[timer] + dt if waiting else 0.0
        if state[timer] > hold - tolerance:
            state[active] = 1.0 - state[active]
            state[timer] = 0.0
        if state[active] != 0.0:
            level = k + 1
    return level


def new_level_state() -> FloatArray:
    """Give the state of ``corridor_level_step`` at the start of a flight, shape (6,)."""
    return np.zeros(LEVEL_STATE_SIZE)
