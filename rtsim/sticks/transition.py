"""The conversion a command asks for (MAV_CMD_DO_VTOL_TRANSITION): nacelle angle scheduled with airspeed.

Towards the airplane the nacelles go to 80 deg at once, which accelerates the aircraft from hover, and then follow the
centre line of the corridor as it gains speed. Back to the helicopter they follow the same line as it slows down, and
stand at 90 deg from the corridor's centre speed there. The nacelles never turn back during a transition: a loss of
speed makes them wait. The pilot keeps stick and lever.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.corridor.boundaries import Corridor
from rtsim.units import deg

TO_HELICOPTER, TO_AIRPLANE = 3, 4
"""MAV_VTOL_STATE of the two targets."""
START_ANGLE = deg(80.0)
"""Nacelle angle a conversion from hover begins with [rad]."""
LINE_FROM = deg(75.0)
"""From this angle downwards the schedule is the corridor's centre line [rad]."""
_POINTS = 31


@dataclass(frozen=True, slots=True)
class TransitionSchedule:
    """Nacelle angle over airspeed for both directions; airspeed ascending, angle descending."""

    forward_airspeed: FloatArray
    """Towards airplane mode [m/s], shape (n,)."""
    forward_angle: FloatArray
    """Nacelle angle there [rad], shape (n,)."""
    aft_airspeed: FloatArray
    """Towards helicopter mode [m/s], shape (m,)."""
    aft_angle: FloatArray
    """Nacelle angle there [rad], shape (m,)."""

    def target(self, direction: int, airspeed: float) -> float:
        """Nacelle angle to be at [rad].

        Args:
            direction: ``TO_HELICOPTER`` or ``TO_AIRPLANE``.
        """
        if direction == TO_AIRPLANE:
            return float(np.interp(airspeed, self.forward_airspeed, self.forward_angle))
        return float(np.interp(airspeed, self.aft_airspeed, self.aft_angle))


def transition_schedule(corridor: Corridor) -> TransitionSchedule:
    """Make the schedule of a corridor.

    Args:
        corridor: Whose centre line is followed.
    """
    angle = np.linspace(LINE_FROM, 0.0, _POINTS)
    # The downstop widens the corridor on its last half degree; the line ends where it was before that.
    above_stop = np.maximum(angle, corridor.downstop_nacelle * 1.001)
    speed = np.maximum.accumulate([float(corridor.centre_speed(float(value))) for value in above_stop])
    helicopter_speed = float(corridor.centre_speed(deg(90.0)))
    forward = np.concatenate(([0.0], speed)), np.concatenate(([START_ANGLE], angle))
    aft = np.concatenate(([helicopter_speed], speed)), np.concatenate(([deg(90.0)], angle))
    arrays = [np.ascontiguousarray(values) for values in (*forward, *aft)]
    for array in arrays:
        array.flags.writeable = False
    return TransitionSchedule(*arrays)
