"""The nacelles in Python: their data with sources, the actuator and the pilot's switch as small objects.

The simulation calls the kernels directly; these objects wrap the same kernels for scripts and tests.
"""

from __future__ import annotations

import tomllib
from functools import cache
from importlib import resources

import numpy as np

from rtsim.errors import InputError
from rtsim.frame import FloatArray
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


@cache
def load_nacelle_tables(*, extended_aft_travel: bool = False) -> NacelleTables:
    """Read the data of the nacelles.

    Args:
        extended_aft_travel: Let the nacelles go to 95 deg instead of 90.
    """
    text = resources.files("rtsim.aircraft.xv15").joinpath("data", "nacelle.toml").read_text(encoding="utf-8")
    data = tomllib.loads(text)
    travel, switch = data["travel"], data["switch"]
    detents = np.array(sorted(deg(angle) for angle in switch["detents_deg"]))
    detents.flags.writeable = False
    return NacelleTables(
        frequency=float(data["filter"]["natural_frequency_rad_s"]),
        forward_stop=deg(travel["forward_stop_deg"]),
        aft_stop=deg(travel["extended_aft_stop_deg" if extended_aft_travel else "aft_stop_deg"]),
        downstop=deg(travel["downstop_deg"]),
        assigned_rate=deg(data["assigned"]["rate_deg_s"]),
        switch_rate=deg(switch["rate_deg_s"]),
        slow_zone=deg(switch["slow_zone_deg"]),
        slow_rate_forward=deg(switch["slow_rate_forward_deg_s"]),
        slow_rate_aft=deg(switch["slow_rate_aft_deg_s"]),
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
            dt: Length of the frame [s].

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
            dt: Length of the frame [s].
        """
        return float(nacelle_switch_step(self.tables, self.state, float(pressed), command_angle, dt))
