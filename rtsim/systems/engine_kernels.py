"""Compiled engines: the power that they have, the fuel that they burn, and the tank that it comes from.

The rotor drive (``drive_kernels``) decides what power the engines give; here is what that costs, and what they could
give. The weight of the aircraft in flight stays as it was trimmed: burning fuel does not make it lighter.

Legend:
    tables: The engines.
    altitude: Pressure altitude in the standard atmosphere [m].
    shaft: Rotor shaft power of all engines together [W].
"""

from __future__ import annotations

from typing import NamedTuple

from rtsim.aircraft.table_kernels import Curves, Surfaces, curve, surface
from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import inner_kernel
from rtsim.places import Places

TANK = Places("fuel", "capacity")
"""Weight of the fuel left, and of full tanks [N]; no tanks (0): the aircraft's fuel is not known and never ends."""


class EngineTables(NamedTuple):
    """What the kernels know of engines and fuel. SI."""

    engines: float
    """How many."""
    takeoff: Curves
    """Rotor shaft power of one engine at take-off rating [W] against pressure altitude [m]."""
    flow: Surfaces
    """Weight of the fuel that one engine burns [N/s] against its rotor shaft power [W] and pressure altitude [m]."""
    capacity: float
    """Weight of the fuel in full tanks [N]; 0 where nothing is known of the fuel."""
    ground: float
    """Pressure altitude of height 0 above the ground [m]."""
    disc: float
    """Density times blade area [kg/m]: with the square of the tip speed, thrust over CT/sigma; 0: blades not known."""
    radius: float
    """Radius of a rotor [m]."""


@inner_kernel
def takeoff_power(tables: EngineTables, altitude: float) -> float:
    """Largest rotor shaft power of all engines for take-off (10 minutes) on a standard day [W]."""
    return tables.engines * curve(tables.takeoff, 0, altitude)


@inner_kernel
def fuel_flow(tables: EngineTables, shaft: float, altitude: float) -> float:
    """Weight of the fuel that all engines burn [N/s]; those that are driven by the rotors burn what idling takes."""
    return tables.engines * surface(tables.flow, 0, shaft / tables.engines, altitude)


@inner_kernel
def thrust_over_solidity(tables: EngineTables, thrust: float, rotor_speed: float) -> float:
    """Thrust coefficient over solidity of a rotor [-]; 0 where its blades are not known.

    Args:
        thrust: Thrust of one rotor [N].
        rotor_speed: Rotor speed [rad/s].
    """
    if tables.disc <= 0.0:
        return 0.0
    return thrust / (tables.disc * (rotor_speed * tables.radius) ** 2)


@inner_kernel
def advance_ratio(tables: EngineTables, across: float, rotor_speed: float) -> float:
    """Speed of the air across the disc over tip speed [-]; 0 where the rotor's size is not known.

    Args:
        across: That speed, along the body's plane of symmetry and square to the mast [m/s].
        rotor_speed: Rotor speed [rad/s].
    """
    return abs(across) / (rotor_speed * tables.radius) if tables.radius > 0.0 else 0.0


@inner_kernel
def burn(state: FloatArray, flow: float, dt: float) -> bool:
    """Take the fuel of one frame from the tanks.

    Args:
        state: Tanks, changed in place.
        flow: Fuel flow [N/s].

    Returns:
        Whether the engines have nothing left to burn.
    """
    if state[TANK.capacity] <= 0.0:
        return False
    state[TANK.fuel] = max(state[TANK.fuel] - flow * dt, 0.0)
    return bool(state[TANK.fuel] <= 0.0)
