"""Gearing, stops, actuators and flap schedule of an aircraft, from its profile."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from rtsim.aircraft.profile import AircraftProfile
from rtsim.aircraft.smooth_tables import NACELLE_GRID, smooth_curves
from rtsim.aircraft.xv15.model import Xv15
from rtsim.aircraft.xv15.tables import ControlTables
from rtsim.units import deg, kt


@lru_cache(maxsize=8)
def control_tables(profile: AircraftProfile) -> ControlTables:
    """Controls of an aircraft; the XV-15's are those of its nonlinear model.

    Raises:
        InputError: A value is missing or out of range.
    """
    part = profile.controls
    if part.has("nonlinear_model"):
        return Xv15.load().tables.controls
    nacelle = [deg(angle) for angle in part.numbers("nacelle_deg", low=0.0, high=95.0, rises=True)]
    count = len(nacelle)

    def curve(key: str, low: float, high: float) -> list[float]:
        return [deg(value) for value in part.numbers(key, low=low, high=high, count=count)]

    return ControlTables(
        cyclic_per_stick=smooth_curves([nacelle], [curve("cyclic_per_stick_deg", 0.0, 30.0)], NACELLE_GRID),
        cyclic_limit=deg(part.number("cyclic_limit_deg", low=0.1, high=45.0)),
        elevator_per_stick=deg(part.number("elevator_per_stick_deg", low=0.0, high=60.0)),
        elevator_limit=deg(part.number("elevator_limit_deg", low=0.1, high=60.0)),
        collective_range=smooth_curves(
            [nacelle] * 2,
            [curve("collective_low_deg", -20.0, 60.0), curve("collective_high_deg", -20.0, 90.0)],
            NACELLE_GRID,
        ),
        actuator_rate=1.0 / np.array(part.numbers("actuator_lag_s", low=0.005, high=5.0, count=3)),
        default_flap=deg(part.number("flap_deg", low=0.0, high=75.0)),
        flap_retraction=np.array(
            [kt(speed) for speed in part.numbers("flap_retraction_kt", low=1.0, high=500.0, count=2, rises=True)]
        ),
        downstop_nacelle=deg(part.number("downstop_nacelle_deg", low=0.01, high=10.0)),
    )
