"""Tables of flaps and rotor drive, from an aircraft's profile."""

from __future__ import annotations

import numpy as np

from rtsim.aircraft.profile import AircraftProfile, xv15_profile
from rtsim.aircraft.xv15.model import Xv15
from rtsim.arrays import FloatArray
from rtsim.faults.fault import engine_rating, transmission_efficiency
from rtsim.systems.drive_kernels import DriveTables
from rtsim.systems.flap_kernels import FlapTables
from rtsim.units import deg, rpm

ROTORS = 2


def load_flap_tables(profile: AircraftProfile | None = None) -> FlapTables:
    """The flaps of an aircraft.

    Raises:
        InputError: A value is missing or out of range.
    """
    flaps = (xv15_profile() if profile is None else profile).systems.table("flaps")
    # The inputs of the aircraft are the parts of the deflection between these settings.
    nodes = np.radians(flaps.numbers("settings_deg", low=0.0, high=90.0, count=4, rises=True))
    return FlapTables(nodes=nodes, rate=deg(flaps.number("rate_deg_s", low=0.01, high=100.0)))


def all_engines_power(profile: AircraftProfile | None = None) -> float:
    """Power of all engines at their highest rating [W].

    Raises:
        InputError: A value is missing or out of range.
    """
    aircraft = xv15_profile() if profile is None else profile
    return aircraft.systems.table("engine").number("engines", low=1, high=8) * engine_rating(aircraft, "contingency")


def load_drive_tables(
    profile: AircraftProfile | None = None,
    *,
    rotor_speed: FloatArray | None = None,
    nacelle: FloatArray | None = None,
    nonlinear: bool = False,
) -> DriveTables:
    """The rotor drive of an aircraft.

    The XV-15's inertia is that of the blades about the shaft, which for these slender blades is that about the flapping
    hinge; hubs, transmission and turbines would add to it and were not found.

    Args:
        rotor_speed: Rotor speed that the database holds in each row of its nacelle axis [rad/s]; None: the XV-15's.
        nacelle: That axis [rad].
        nonlinear: Whether the nonlinear aircraft flies.

    Raises:
        InputError: A value is missing or out of range.
    """
    aircraft = xv15_profile() if profile is None else profile
    part = aircraft.systems
    engine, limits, rotors = part.table("engine"), part.table("rotor_speed"), part.table("rotors")
    xv15 = Xv15.load().tables
    held = np.zeros(1) if rotor_speed is None else rotor_speed
    speed = float(held[-1]) or xv15.configuration.rotor_speed
    slow = float(held[0] - held[-1])
    if rotors.has("nonlinear_model"):
        inertia = ROTORS * xv15.rotor.blades * xv15.rotor.blade_inertia
    else:
        inertia = rotors.number("inertia_kg_m2", low=0.1, high=1e7)
    lever = np.asarray(engine.numbers("lever_in", low=0.0, high=1e3, rises=True))
    throttle = np.asarray(engine.numbers("throttle_deg", low=0.0, high=1e3, count=len(lever), rises=True))
    efficiency = transmission_efficiency(aircraft)
    full = all_engines_power(aircraft) * efficiency
    return DriveTables(
        governed_speed=speed,
        slow_offset=slow,
        change_rate=rpm(limits.number("change_rate_rpm_s", low=0.1, high=1000.0)),
        slow_axis=0.0 if slow == 0.0 or nacelle is None else float(nacelle[0]) / slow,
        held_acts=1.0 if nonlinear else 0.0,
        inertia=inertia,
        lever=lever / engine.number("lever_travel_in", low=0.1, high=1e3),
        power=full * (throttle - throttle[0]) / (throttle[-1] - throttle[0]),
        lag=engine.number("power_lag_s", low=0.0, high=60.0),
        recovery=part.table("governor").number("recovery_s", low=0.01, high=60.0),
        lowest=limits.number("lowest_fraction", low=0.1, high=1.0) * speed,
        efficiency=efficiency,
        highest=limits.number("highest_fraction", low=1.0, high=2.0) * speed,
    )
