"""Tables of ground and gear, from an aircraft's profile."""

from __future__ import annotations

import math

import numpy as np

from rtsim.aircraft.profile import AircraftProfile
from rtsim.aircraft.xv15.dynamics_kernels import gravity_centre
from rtsim.aircraft.xv15.tables import AircraftTables
from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.systems.ground_kernels import DOWN, FORWARD, GroundTables
from rtsim.units import FOOT, GRAVITY, INCH, SLUG_FOOT_SQUARED, deg, kt

_NONE = np.zeros((0, 5))


def no_ground() -> GroundTables:
    """What a flight has that has no ground to stand on."""
    return GroundTables(0.0, 0.0, _NONE, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 1.0)


def load_ground_tables(profile: AircraftProfile, tables: AircraftTables) -> GroundTables:
    """Ground and gear of an aircraft; geometry and inertia are those of the nonlinear XV-15.

    Args:
        profile: The aircraft.
        tables: The nonlinear XV-15, with the mass and centre of gravity that stand on the wheels.

    Raises:
        InputError: It has no gear, or a value is missing or out of range.
    """
    if not profile.systems.has("gear"):
        raise InputError(
            f"the {profile.name} has no landing gear", key="ground", value=True, allowed="false",
            mend="add the table [systems.gear] to its profile (docs/ground.md)",
        )  # fmt: skip
    part, mass = profile.systems.table("gear"), tables.configuration.mass
    centre = np.array(gravity_centre(tables.mass, deg(90.0)))
    forward, down, share, stroke = [], [], [], []
    for place in ("nose", "main"):
        station, water = part.numbers(f"{place}_axle_SL_WL_in", low=-1e3, high=2e3, count=2)
        tyre = 0.5 * part.number(f"{place}_tire_diameter_in", low=1.0, high=200.0)
        arm = centre - np.array([station, water - tyre]) * INCH
        forward.append(arm[0])
        down.append(arm[1])
        stroke.append(part.number(f"{place}_stroke_in", low=0.1, high=200.0) * INCH)
    wheelbase = forward[0] - forward[1]
    share = [-forward[1] / wheelbase, forward[0] / wheelbase]
    pressed = part.number("standing_stroke_fraction", low=0.05, high=0.95)
    damping = part.number("damping_ratio", low=0.0, high=2.0)
    aside = [0.0, 0.5 * part.number("main_track_in", low=1.0, high=1e3) * INCH]
    wheels = np.array([
        _wheel((forward[i], down[i], aside[i]), share[i] * mass, pressed * stroke[i], damping) for i in range(2)
    ])  # fmt: skip
    pivot = np.array([tables.mass.pivot[0], tables.mass.pivot[1]])
    inertia = tables.mass.pitch_inertia_airplane + tables.mass.pitch_inertia_slope * deg(90.0)
    # Standing, the aircraft leans a little; the height is that of its centre of gravity.
    lean = ((down[1] - pressed * stroke[1]) - (down[0] - pressed * stroke[0])) / wheelbase
    return GroundTables(
        active=1.0,
        standing=float(down[1] - pressed * stroke[1] + forward[1] * lean),
        wheels=wheels,
        friction=part.number("braked_friction", low=0.0, high=2.0),
        most_sink=part.number("limit_sink_ft_s", low=0.1, high=100.0) * FOOT,
        mass=mass,
        inertia=inertia,
        roll_inertia=part.number("roll_inertia_slug_ft2", low=1.0, high=1e7) * SLUG_FOOT_SQUARED,
        yaw_inertia=part.number("yaw_inertia_slug_ft2", low=1.0, high=1e7) * SLUG_FOOT_SQUARED,
        radius=tables.rotor.radius,
        pivot_up=float(pivot[1] - centre[1]),
        mast=tables.mass.mast_length,
        fade_speed=kt(part.number("ground_effect_fade_kt", low=1.0, high=200.0)),
    )


def _wheel(arm: tuple[float, float, float], mass: float, pressed: float, damping: float) -> FloatArray:
    """One wheel, or pair: its spring carries its share of the mass at the standing stroke."""
    stiffness = mass * GRAVITY / pressed
    return np.array([arm[0], arm[1], stiffness, 2.0 * damping * math.sqrt(stiffness * mass), arm[2]])


def light_on_wheels(tables: GroundTables, pitch: float) -> float:
    """Altitude at which the wheels just touch [m].

    Args:
        tables: Ground and gear.
        pitch: Pitch attitude [rad].
    """
    feet = tables.wheels[:, DOWN] * math.cos(pitch) - tables.wheels[:, FORWARD] * math.sin(pitch)
    return float(np.max(feet)) - tables.standing
