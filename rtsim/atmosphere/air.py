"""Gusts as the kernels read and advance them: tables from a specification, the state, and changes in flight."""

from __future__ import annotations

import math

import numpy as np

from rtsim.aircraft.profile import AircraftProfile, xv15_profile
from rtsim.arrays import FloatArray
from rtsim.atmosphere import dryden_kernels as dryden
from rtsim.atmosphere import gust_kernels as kernels
from rtsim.atmosphere.gust_kernels import GustTables
from rtsim.atmosphere.specification import SEVERITY_WIND, AirSpecification, Gust, GustShape, Severity, Turbulence
from rtsim.atmosphere.wind_kernels import WindTables
from rtsim.errors import InputError
from rtsim.units import FOOT

GUST_SHAPES: dict[GustShape, int] = {
    "one-minus-cosine": kernels.SHAPE_ONE_MINUS_COSINE,
    "build-up": kernels.SHAPE_BUILD_UP,
    "ramp": kernels.SHAPE_RAMP,
}
"""Shapes of discrete gusts: there and back (14 CFR 25.341), half a cosine (MIL-F-8785C) or straight, and staying."""
LIVE_SLOTS = 8
"""Room for gusts that are added during a flight."""

# MIL-F-8785C figure 7: intensity [ft/s] against height [ft] for probabilities of exceedance of 1e-2, 1e-3 and 1e-5,
# which the specification calls light, moderate and severe; read from the figure by the authors of JSBSim (FGWinds).
_CURVE_HEIGHT_FT = (500.0, 1750.0, 3750.0, 7500.0, 15000.0, 25000.0, 35000.0, 45000.0)
_CURVES_FT_S: tuple[tuple[Severity, tuple[float, ...]], ...] = (
    ("none", (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
    ("light", (6.6, 6.9, 7.4, 6.7, 4.6, 2.7, 0.4, 0.0)),
    ("moderate", (8.6, 9.6, 10.6, 10.1, 8.0, 6.6, 5.0, 4.2)),
    ("severe", (15.6, 17.6, 23.0, 23.6, 22.1, 20.0, 16.0, 15.1)),
)


def gust_tables(air: AirSpecification, profile: AircraftProfile | None = None) -> GustTables:
    """Give the parameters that the kernels read.

    Args:
        air: What the air does.
        profile: The aircraft, whose span filters what it feels; None: the XV-15.

    Raises:
        InputError: The span is missing or out of range.
    """
    dimensions = (xv15_profile() if profile is None else profile).dimensions
    turbulence = dryden.TurbulenceTables(
        span=dimensions.number("span_ft", low=1.0, high=1000.0) * FOOT,
        minimum_speed=air.minimum_speed,
        altitude=np.array(_CURVE_HEIGHT_FT) * FOOT,
        wind=np.array([SEVERITY_WIND[name] for name, _ in _CURVES_FT_S]),
        intensity=np.array([curve for _, curve in _CURVES_FT_S]) * FOOT,
    )
    for array in (turbulence.altitude, turbulence.wind, turbulence.intensity):
        array.setflags(write=False)
    return GustTables(turbulence)


def wind_tables(
    speed: float, wind_from: float | None, *, heading: float, reference_height: float, felt: bool
) -> WindTables:
    """Give the steady wind as the kernels read it.

    Args:
        speed: Wind [m/s].
        wind_from: Where it comes from, clockwise from north [rad]; None: from behind.
        heading: Heading at the start [rad].
        reference_height: Height at which it blows as given [m]; 0: at every height.
        felt: The aircraft also moves sideways through the air.
    """
    ahead, right = speed, 0.0
    if wind_from is not None:
        ahead, right = -speed * math.cos(wind_from - heading), -speed * math.sin(wind_from - heading)
    return WindTables(float(ahead), float(right), float(heading), float(reference_height), float(felt))


def new_gust_state(air: AirSpecification, normals: FloatArray | None = None) -> FloatArray:
    """Give the gust state before the first ``gust_step`` (which has ``dt = 0``).

    Args:
        air: What the air does.
        normals: Standard normals that set the filters in their stationary state, three, or six with lateral
            turbulence; needed where the air is turbulent from the start.

    Returns:
        The state, shape (SLOTS + slots * SLOT_SIZE,), with room for ``LIVE_SLOTS`` more gusts.
    """
    state = np.zeros(kernels.GUST.size + kernels.SLOT.size * (len(air.gusts) + LIVE_SLOTS))
    state[dryden.TURBULENCE.lateral] = float(air.lateral)
    for number, gust in enumerate(air.gusts):
        _fill_slot(state, kernels.GUST.size + number * kernels.SLOT.size, gust)
    if air.turbulence is not None and air.turbulent:
        if normals is None:
            raise ValueError("turbulence needs three or six standard normals for its first state")
        set_turbulence(state, air.turbulence, normals)
    return state


def normals_needed(state: FloatArray) -> int:
    """Give the standard normals that each ``gust_step`` takes: 0 until there has been turbulence, then 3, or 6."""
    if state[dryden.TURBULENCE.active] == 0.0:
        return 0
    return kernels.NORMALS_PER_FRAME * (2 if state[dryden.TURBULENCE.lateral] != 0.0 else 1)


def set_turbulence(state: FloatArray, turbulence: Turbulence, normals: FloatArray) -> None:
    """Let the turbulence move to another severity from now on; a change without fade acts from the next step.

    Args:
        state: Gust state, changed in place.
        turbulence: What it becomes; its ``fade_in`` is the time of the change.
        normals: Three standard normals, or six, used only where there was no turbulence before.
    """
    if state[dryden.TURBULENCE.active] == 0.0:
        if turbulence.wind_at_20_ft == 0.0:
            return
        state[dryden.TURBULENCE.u], state[dryden.TURBULENCE.w_1], state[dryden.TURBULENCE.w_2] = normals[:3]
        if state[dryden.TURBULENCE.lateral] != 0.0:
            state[dryden.TURBULENCE.v_1], state[dryden.TURBULENCE.v_2], state[dryden.TURBULENCE.p] = normals[3:]
        state[dryden.TURBULENCE.active] = state[kernels.GUST.busy] = 1.0
    target = turbulence.wind_at_20_ft
    state[dryden.TURBULENCE.wind_target] = target
    if turbulence.fade_in > 0.0:
        state[dryden.TURBULENCE.wind_rate] = abs(target - state[dryden.TURBULENCE.wind]) / turbulence.fade_in
    else:
        state[dryden.TURBULENCE.wind] = target


def add_gust(state: FloatArray, gust: Gust) -> None:
    """Add a gust during a flight; it is felt from the first step after its start.

    Args:
        state: Gust state, changed in place.
        gust: The gust.

    Raises:
        InputError: As many gusts as fit are still acting.
    """
    for slot in range(kernels.GUST.size, state.shape[0], kernels.SLOT.size):
        if state[slot + kernels.SLOT.shape] == kernels.SHAPE_NONE:
            _fill_slot(state, slot, gust)
            return
    raise InputError(
        "there is no room for another gust",
        key="gust",
        allowed=f"{LIVE_SLOTS} live gusts at a time",
        mend="wait until one is over, or reset the flight (gusts that rise and stay never end)",
    )


def _fill_slot(state: FloatArray, slot: int, gust: Gust) -> None:
    extent = gust.length if gust.duration is None else gust.duration
    assert extent is not None  # the gust was checked when it was made
    state[slot + kernels.SLOT.shape] = GUST_SHAPES[gust.shape]
    state[slot + kernels.SLOT.start] = gust.start
    state[slot + kernels.SLOT.first] = gust.ahead
    state[slot + kernels.SLOT.second] = gust.below
    state[slot + kernels.SLOT.third] = gust.lateral
    state[slot + kernels.SLOT.extent] = extent
    state[slot + kernels.SLOT.by_length] = 0.0 if gust.length is None else 1.0
    state[slot + kernels.SLOT.body] = 1.0 if gust.axes == "body" else 0.0
    state[slot + kernels.SLOT.travelled] = 0.0
    state[kernels.GUST.busy] = 1.0
