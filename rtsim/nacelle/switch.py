"""The nacelles in Python: their data with sources, the actuator and the pilot's switch as small objects.

The simulation calls the kernels directly; these objects wrap the same kernels for scripts and tests.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from rtsim.aircraft.profile import AircraftProfile, xv15_profile
from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.nacelle.nacelle_kernels import (
    ANGLE,
    COMMAND_ANGLE,
    RATE,
    SWITCH_RUNNING,
    NacelleTables,
    nacelle_advance,
    nacelle_effective_rate,
    nacelle_switch_step,
    new_actuator_state,
    new_switch_state,
)
from rtsim.units import deg, to_deg


@lru_cache(maxsize=8)
def load_nacelle_tables(profile: AircraftProfile | None = None, *, extended_aft_travel: bool = False) -> NacelleTables:
    """Read the data of the nacelles.

    Args:
        extended_aft_travel: Let the nacelles go to the end of their travel beyond helicopter mode.

    Raises:
        InputError: A value is missing or out of range.
    """
    part = (xv15_profile() if profile is None else profile).nacelle
    travel, switch = part.table("travel"), part.table("switch")
    forward_stop = travel.number("forward_stop_deg", low=0.0, high=30.0)
    aft_stop = travel.number("aft_stop_deg", low=60.0, high=95.0)
    aft = travel.number("extended_aft_stop_deg", low=aft_stop, high=95.0) if extended_aft_travel else aft_stop
    detents = np.array(sorted(deg(a) for a in switch.numbers("detents_deg", low=forward_stop, high=aft_stop)))
    detents.flags.writeable = False
    return NacelleTables(
        frequency=part.table("filter").number("natural_frequency_rad_s", low=0.1, high=50.0),
        forward_stop=deg(forward_stop),
        aft_stop=deg(aft),
        downstop=deg(travel.number("downstop_deg", low=forward_stop, high=10.0)),
        assigned_rate=deg(part.table("assigned").number("rate_deg_s", low=0.1, high=60.0)),
        switch_rate=deg(switch.number("rate_deg_s", low=0.1, high=60.0)),
        slow_zone=deg(switch.number("slow_zone_deg", low=0.0, high=30.0)),
        slow_rate_forward=deg(switch.number("slow_rate_forward_deg_s", low=0.01, high=60.0)),
        slow_rate_aft=deg(switch.number("slow_rate_aft_deg_s", low=0.01, high=60.0)),
        detents=detents,
    )


class NacelleActuator:
    """The conversion actuator: command angle through a critically damped filter."""

    __slots__ = ("state", "tables")

    def __init__(self, angle: float, *, tables: NacelleTables | None = None) -> None:
        """Start at rest.

        Args:
            angle: Nacelle angle [rad].
            tables: The nacelles; None takes the XV-15's with 90 deg of travel.

        Raises:
            InputError: The angle is outside the travel.
        """
        self.tables = load_nacelle_tables() if tables is None else tables
        if not self.tables.forward_stop <= angle <= self.tables.aft_stop:
            low, high = to_deg(self.tables.forward_stop), to_deg(self.tables.aft_stop)
            raise InputError(
                "nacelle angle outside its travel",
                key="nacelle_deg",
                value=round(to_deg(angle), 6),
                allowed=f"{low:g} to {high:g} deg",
            )
        self.state: FloatArray = new_actuator_state(angle)

    @property
    def command_angle(self) -> float:
        """Angle the actuator is commanded to [rad]."""
        return float(self.state[COMMAND_ANGLE])

    @property
    def angle(self) -> float:
        """Nacelle angle [rad]."""
        return float(self.state[ANGLE])

    @property
    def rate(self) -> float:
        """Rate of the nacelle angle [rad/s]."""
        return float(self.state[RATE])

    def step(self, rate: float, dt: float) -> float:
        """Advance by one frame.

        Args:
            rate: Wanted rate of the command angle, aft positive [rad/s].

        Returns:
            The rate that acted, reduced where the command met a stop [rad/s].
        """
        acting = float(nacelle_effective_rate(self.tables, self.state, rate, dt))
        nacelle_advance(self.tables, self.state, acting, dt)
        return acting


class NacelleSwitch:
    """The pilot's three-position switch with its detents."""

    __slots__ = ("state", "tables")

    def __init__(self, *, tables: NacelleTables | None = None) -> None:
        """Start let go.

        Args:
            tables: The nacelles; None takes the XV-15's with 90 deg of travel.
        """
        self.tables = load_nacelle_tables() if tables is None else tables
        self.state: FloatArray = new_switch_state()

    @property
    def running(self) -> bool:
        """Whether the nacelles are on their way to a detent by themselves."""
        return bool(self.state[SWITCH_RUNNING])

    def step(self, pressed: int, *, command_angle: float, dt: float) -> float:
        """Give the rate of the command angle for this frame [rad/s].

        Args:
            pressed: -1 forward, 0 let go, 1 aft.
            command_angle: Command angle of the actuator [rad].
        """
        return float(nacelle_switch_step(self.tables, self.state, float(pressed), command_angle, dt))
