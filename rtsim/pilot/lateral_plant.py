"""The plant that the pilot's lateral half is designed for at one grid point: rigid body, hands, gust and integrals.

Made as ``rtsim.pilot.design_plant`` makes the longitudinal one: the rotors' states are residualized, the actuators of
one hand become one lag, a side gust gets a first-order Dryden filter. A roll gust is over once the wing has left it: it
is white noise of the intensity that its spectrum has at low frequencies (MIL-F-8785C 3.7.1.4). Displays are lateral
airspeed (gust included), roll rate, bank, yaw rate and heading, and the integrals of heading and of the aircraft's own
lateral velocity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rtsim.aircraft.variables import LATERAL_INPUTS, LATERAL_STATES, of_role, position
from rtsim.arrays import FloatArray
from rtsim.atmosphere.dryden_kernels import roll_intensity
from rtsim.kernels.compiled import interpreted
from rtsim.lpv.lateral import LateralData
from rtsim.lpv.reduction import eliminated
from rtsim.pilot.weights import LateralPilotSettings

RIGID = ("v", "p", "r", "bank", "heading")
"""Rigid-body states of the plant."""
HANDS = ("lateral_stick", "pedal")
"""The pilot's hands, as inputs of the database."""
STATES = (*RIGID, "lateral_stick_lag", "pedal_lag", "gust_v", "heading_integral", "lateral_velocity_integral")
"""Names of the plant's states."""
DISPLAYS = ("lateral_velocity", "roll_rate", "bank", "yaw_rate", "heading", "heading_integral",
            "lateral_velocity_integral")  # fmt: skip
"""What the pilot sees."""
GUSTS = ("gust_v", "gust_p")
"""Gusts the pilot reckons with, as inputs of the database."""


@dataclass(frozen=True, slots=True)
class LateralPlant:
    """Linear plant of one grid point, deviations from straight flight, controls -1..1 right. SI and radians."""

    A: FloatArray
    """Dynamics (10, 10)."""
    B: FloatArray
    """Controls (10, 2)."""
    C: FloatArray
    """Displays (7, 10)."""
    E: FloatArray
    """White noises: of the side gust's filter, and the roll gust (10, 2)."""


def lateral_plant(
    data: LateralData, where: tuple[int, int], airspeed: float, settings: LateralPilotSettings
) -> LateralPlant:
    """Build the design plant of one grid point in level flight.

    Args:
        data: The lateral half of the aircraft.
        where: Numbers of airspeed and nacelle angle.
        airspeed: Airspeed there [m/s].
        settings: Gust to reckon with.
    """
    full_a, full_b = data.A[(0, *where)], data.B[(0, *where)]
    rigid = [position(LATERAL_STATES, name) for name in RIGID]
    lags = list(of_role(LATERAL_STATES, "actuator"))
    slow = rigid + lags
    inputs = [position(LATERAL_INPUTS, name) for name in (*HANDS, *GUSTS)]
    a, b = eliminated(full_a, full_b, slow, inputs)

    n, r = len(STATES), len(RIGID)
    plant_a, plant_b, plant_e = np.zeros((n, n)), np.zeros((n, len(HANDS))), np.zeros((n, len(GUSTS)))
    plant_a[:r, :r] = a[:r, :r]
    for hand in range(len(HANDS)):
        driven = [k for k in range(r, len(slow)) if b[k, hand] != 0.0]
        rates = [-a[k, k] for k in driven]
        plant_a[:r, r + hand] = a[:r, driven] @ [b[k, hand] / rate for k, rate in zip(driven, rates, strict=True)]
        plant_a[r + hand, r + hand], plant_b[r + hand, hand] = -min(rates), min(rates)
    gust = r + len(HANDS)
    plant_a[:r, gust] = b[:r, len(HANDS)]
    speed = max(abs(airspeed), settings.gust_least_airspeed)
    pole = speed / settings.gust_length
    plant_a[gust, gust] = -pole
    plant_e[gust, 0] = settings.gust_intensity * np.sqrt(2.0 * pole)
    roll = interpreted(roll_intensity)(settings.span, settings.gust_intensity, settings.gust_length)
    plant_e[:r, 1] = b[:r, len(HANDS) + 1] * roll * np.sqrt(8.0 * settings.span / (np.pi * speed))
    plant_a[n - 2, RIGID.index("heading")] = 1.0
    plant_a[n - 1, RIGID.index("v")] = 1.0  # the own velocity: as for the airspeed's integral in the longitudinal plant
    c = np.zeros((len(DISPLAYS), n))
    for row, state in enumerate((0, 1, 3, 2, 4, n - 2, n - 1)):
        c[row, state] = 1.0
    c[0, gust] = 1.0
    return LateralPlant(plant_a, plant_b, c, plant_e)
