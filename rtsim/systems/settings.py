"""Tables of flaps and rotor drive, from ``data/systems.toml`` and the aircraft's data."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib import resources
from typing import Any

import numpy as np

from rtsim.aircraft.xv15.tables import AircraftTables
from rtsim.faults.fault import ENGINE_RATING, TRANSMISSION_EFFICIENCY
from rtsim.systems.drive_kernels import DriveTables
from rtsim.systems.flap_kernels import FlapTables
from rtsim.units import deg

ENGINES = 2
ROTORS = 2
FULL_POWER = ENGINES * ENGINE_RATING["contingency"] * TRANSMISSION_EFFICIENCY
"""Shaft power of both engines at their contingency rating [W]."""


@cache
def _data() -> dict[str, Any]:
    text = resources.files("rtsim.aircraft.xv15").joinpath("data", "systems.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def load_flap_tables(aircraft: AircraftTables) -> FlapTables:
    """The flaps of an aircraft.

    Args:
        aircraft: The nonlinear aircraft's tables: flap settings.
    """
    return FlapTables(nodes=aircraft.wing.flap_nodes, rate=deg(float(_data()["flaps"]["rate_deg_s"])))


def load_drive_tables(aircraft: AircraftTables) -> DriveTables:
    """The rotor drive of an aircraft.

    The inertia is that of the blades about the shaft, which for these slender blades is that about the flapping hinge;
    hubs, transmission and turbines would add to it and were not found.

    Args:
        aircraft: The nonlinear aircraft's tables: blades, governed rotor speed.
    """
    data = _data()
    rotor, speed = aircraft.rotor, aircraft.configuration.rotor_speed
    engine, limits = data["engine"], data["rotor_speed"]
    throttle = np.asarray(engine["throttle_deg"], dtype=np.float64)
    return DriveTables(
        governed_speed=speed,
        inertia=ROTORS * rotor.blades * rotor.blade_inertia,
        lever=np.asarray(engine["lever_in"], dtype=np.float64) / float(engine["lever_travel_in"]),
        power=FULL_POWER * (throttle - throttle[0]) / (throttle[-1] - throttle[0]),
        lag=float(engine["power_lag_s"]),
        recovery=float(data["governor"]["recovery_s"]),
        lowest=float(limits["lowest_fraction"]) * speed,
        highest=float(limits["highest_fraction"]) * speed,
    )
