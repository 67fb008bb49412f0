"""Compiled automatic nacelle control: a nacelle rate from the measured airspeed along a schedule.

The law follows ``nacelle angle = schedule(airspeed)`` in both directions. Its airspeed is a complementary filter of the
indicated airspeed and of its rate, so that it neither lags in an acceleration nor chases every gust; a lead in time
makes up for the lag of the conversion actuator.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import inner_kernel

FILTERED_AIRSPEED, LAST_RATE, STARTED = 0, 1, 2
"""Places in the law's state: airspeed [m/s], rate commanded last [rad/s], whether it has begun (0, 1)."""
AUTOMATIC_STATE_SIZE = 3


class AutomaticTables(NamedTuple):
    """What the law knows. SI and radians."""

    active: int
    """1 where the law sets the nacelle rate, 0 where the programme does."""
    airspeed: FloatArray
    """Airspeeds of the schedule's corners, ascending, shape (n,) [m/s]."""
    nacelle: FloatArray
    """Nacelle angles there, nowhere rising, shape (n,) [rad]."""
    rate: float
    """Largest rate [rad/s]."""
    acceleration: float
    """Largest change of the rate per second [rad/s^2]."""
    gain: float
    """Rate per angle still to go [1/s]."""
    correction: float
    """How fast the filtered airspeed is drawn to the indicated one [1/s]."""
    lead: float
    """How far ahead the schedule is read [s]."""
    detents: FloatArray
    """Angles at which the nacelles pause; may be empty, shape (d,) [rad]."""
    detent_zone: float
    """Distance of the scheduled angle from a detent within which they pause [rad]."""


@inner_kernel
def scheduled_angle(tables: AutomaticTables, airspeed: float) -> float:
    """Nacelle angle of the schedule at an airspeed; constant beyond its ends.

    Returns:
        The angle [rad], on a detent where it is within the zone of one.
    """
    speeds, angles = tables.airspeed, tables.nacelle
    last = speeds.shape[0] - 1
    if airspeed >= speeds[last]:
        angle = angles[last]
    else:
        angle = angles[0]
        for i in range(last):
            if airspeed < speeds[i]:
                break
            share = min((airspeed - speeds[i]) / (speeds[i + 1] - speeds[i]), 1.0)
            angle = angles[i] + share * (angles[i + 1] - angles[i])
    for k in range(tables.detents.shape[0]):
        if abs(angle - tables.detents[k]) <= tables.detent_zone:
            return tables.detents[k]
    return angle


@inner_kernel
def automatic_rate(
    tables: AutomaticTables, state: FloatArray, airspeed: float, airspeed_rate: float, angle: float, dt: float
) -> float:
    """Nacelle rate for the frame that starts now; changes no state.

    Args:
        state: Its state, shape (3,).
        airspeed: Indicated airspeed [m/s].
        airspeed_rate: Rate of the airspeed [m/s^2].
        angle: Command angle of the conversion actuator [rad].

    Returns:
        The rate, aft positive [rad/s].
    """
    filtered = state[0] if state[2] != 0.0 else airspeed
    ahead = filtered + tables.lead * airspeed_rate
    wanted = scheduled_angle(tables, ahead)
    along = (scheduled_angle(tables, ahead + airspeed_rate * dt) - wanted) / dt
    missing = wanted - angle
    # The square root is the speed from which the rate limit can still brake within what is left, with half of it spare.
    back = min(tables.gain * abs(missing), math.sqrt(tables.acceleration * abs(missing)))
    rate = along + (back if missing > 0.0 else -back)
    rate = min(max(rate, -tables.rate), tables.rate)
    change = tables.acceleration * dt
    return min(max(rate, state[1] - change), state[1] + change)


@inner_kernel
def automatic_advance(
    tables: AutomaticTables, state: FloatArray, airspeed: float, airspeed_rate: float, rate: float, dt: float
) -> None:
    """Advance the law by one frame.

    Args:
        state: Its state, updated in place, zeros at the start, shape (3,).
        airspeed: Indicated airspeed at the start of the frame [m/s].
        airspeed_rate: Rate of the airspeed [m/s^2].
        rate: Rate of the actuator's command angle over the frame, as it acted [rad/s].
    """
    if state[2] == 0.0:
        state[0] = airspeed
        state[2] = 1.0
    state[0] += dt * (airspeed_rate + tables.correction * (airspeed - state[0]))
    state[1] = rate
