"""Engines and fuel of an aircraft: tables for the frame, and what they say at any altitude and temperature.

What is published (``rtsim/aircraft/xv15/data/engine.toml``): ratings at sea level, rotor shaft power at take-off rating
against altitude on a standard day, fuel flow against power and altitude, tanks. What is inferred from it here:

* other ratings: the published take-off power at that altitude, in the proportion of the ratings at sea level;
* temperature: at the same pressure the power goes with the 0.80th power of the density, as it does with altitude;
* altitude beyond the table (20000 ft, and below sea level): the same power of the density from its last value on.

Legend:
    profile: The aircraft; None: the XV-15.
    altitude: Pressure altitude [m].
"""

from __future__ import annotations

import functools
import math

import numpy as np

from rtsim.aircraft.atmosphere import STANDARD_TEMPERATURE, TEMPERATURE_LAPSE, standard_atmosphere
from rtsim.aircraft.profile import AircraftProfile, Part, xv15_profile
from rtsim.aircraft.smooth_tables import smooth_curves, smooth_surface, stack_surfaces
from rtsim.aircraft.table_kernels import Curves, Surfaces
from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.faults.fault import EngineRating, engine_rating, transmission_efficiency
from rtsim.kernels.compiled import interpreted
from rtsim.kernels.kept import kept
from rtsim.systems import engine_kernels
from rtsim.systems.engine_kernels import EngineTables
from rtsim.units import FOOT, HORSEPOWER, POUND_FORCE

LARGEST_TEMPERATURE_OFFSET = 60.0
"""Furthest from the standard day [K]."""
_EXPONENT = 0.80
"""Power of the density ratio with which an engine's power falls, where its data do not say [-]."""
_ALTITUDES: FloatArray = np.arange(-4000.0, 36001.0, 4000.0) * FOOT
"""Altitudes of the tables [m]; the published ones are among them."""
_HOUR = 3600.0


@functools.lru_cache(maxsize=8)
def load_engine_tables(profile: AircraftProfile | None = None, *, density: float = 0.0) -> EngineTables:
    """Engines, tanks and blades of an aircraft.

    Args:
        density: Air density at height 0 [kg/m^3]; 0: that of the standard day at sea level.

    Raises:
        InputError: A value is missing or out of range.
    """
    aircraft = xv15_profile() if profile is None else profile
    key = f"{aircraft.content_hash} {density!r}".encode()
    return kept("engine", key, lambda: _prepare(aircraft, density or standard_atmosphere(0.0)[0]))


def _prepare(aircraft: AircraftProfile, density: float) -> EngineTables:
    solidity, radius = _blades(aircraft)
    fuel = aircraft.systems.table("fuel") if aircraft.systems.has("fuel") else None
    return EngineTables(
        engines=aircraft.systems.table("engine").number("engines", low=1, high=8),
        takeoff=_takeoff(aircraft),
        flow=_flow(fuel),
        capacity=0.0 if fuel is None else fuel.number("capacity_lb", low=1.0, high=1e6) * POUND_FORCE,
        ground=_altitude_of(density),
        disc=density * math.pi * radius**2 * solidity,
        radius=radius,
    )


def power_available(
    rating: EngineRating, altitude: float, temperature_offset: float = 0.0, *, profile: AircraftProfile | None = None
) -> float:
    """Rotor shaft power of all engines at a rating [W]: what the rotors get, transmission and installation taken off.

    Args:
        rating: The rating; how long it may be used (2, 10, 30 min) is not counted.
        temperature_offset: Temperature above that of the standard day at this altitude [K].

    Raises:
        InputError: The temperature is out of range.
    """
    if not abs(temperature_offset) <= LARGEST_TEMPERATURE_OFFSET:
        raise InputError(
            "is out of range", key="temperature offset", value=temperature_offset,
            allowed=f"{-LARGEST_TEMPERATURE_OFFSET:g} to {LARGEST_TEMPERATURE_OFFSET:g} K",
        )  # fmt: skip
    aircraft = xv15_profile() if profile is None else profile
    share = engine_rating(aircraft, rating) / engine_rating(aircraft, "takeoff")
    standard = STANDARD_TEMPERATURE - TEMPERATURE_LAPSE * altitude
    warm = (standard / (standard + temperature_offset)) ** _exponent(aircraft)
    return float(share * warm * interpreted(engine_kernels.takeoff_power)(load_engine_tables(profile), altitude))


def fuel_flow(shaft: float, altitude: float, *, profile: AircraftProfile | None = None) -> float:
    """Weight of the fuel that all engines burn [N/s].

    Args:
        shaft: Rotor shaft power of all engines together [W].
    """
    return float(interpreted(engine_kernels.fuel_flow)(load_engine_tables(profile), shaft, altitude))


def _exponent(aircraft: AircraftProfile) -> float:
    engine = aircraft.systems.table("engine")
    return engine.table("lapse").number("density_exponent", low=0.0, high=3.0) if engine.has("lapse") else _EXPONENT


def _takeoff(aircraft: AircraftProfile) -> Curves:
    """Take-off power against altitude: the published points, the power of the density beyond them."""
    engine = aircraft.systems.table("engine")
    if engine.has("lapse"):
        lapse = engine.table("lapse")
        altitude = np.asarray(lapse.numbers("altitude_ft", low=-4000.0, high=36000.0, rises=True)) * FOOT
        power = np.asarray(lapse.numbers("takeoff_shaft_shp", low=1.0, high=1e5, count=len(altitude))) * HORSEPOWER
    else:
        altitude = np.zeros(1)
        power = np.array([engine_rating(aircraft, "takeoff") * transmission_efficiency(aircraft)])
    grid = _ALTITUDES
    beyond = grid[(grid < altitude[0]) | (grid > altitude[-1])]
    ends = np.where(beyond < altitude[0], 0, len(altitude) - 1)
    ratio = [
        standard_atmosphere(height)[0] / standard_atmosphere(altitude[end])[0]
        for height, end in zip(beyond, ends, strict=True)
    ]
    extended = power[ends] * np.asarray(ratio) ** _exponent(aircraft)
    order = np.argsort(nodes := np.concatenate([beyond, altitude]))
    powers = np.concatenate([extended, power])
    return smooth_curves([nodes[order].tolist()], [powers[order].tolist()], grid)


def _flow(fuel: Part | None) -> Surfaces:
    """The carpet, its rows continued with the slope of the law: down to no power, and to twice the last printed one."""
    if fuel is None:
        grid = np.array([0.0, 1.0])
        return stack_surfaces([np.zeros((2, 2, 4))], grid, grid)
    altitude = np.asarray(fuel.numbers("altitude_ft", low=-4000.0, high=36000.0, least=2, rises=True))
    printed = np.asarray(fuel.numbers("shaft_shp", low=0.0, high=1e5, least=2, rises=True))
    slope = fuel.number("slope_lb_h_shp", low=0.0, high=10.0)
    step = printed[1] - printed[0]
    power = np.arange(0.0, 2.0 * printed[-1] + 0.5 * step, step)
    rows = []
    for height in altitude:
        values = fuel.table("flow_lb_h").numbers(f"ft_{height:.0f}", low=0.0, high=1e6)
        known = printed[: len(values)]
        row = np.interp(power, known, values)
        row += slope * (np.minimum(power - known[0], 0.0) + np.maximum(power - known[-1], 0.0))
        rows.append(row)
    x_grid, heights = power * HORSEPOWER, altitude * FOOT
    y_grid = np.linspace(heights[0], heights[-1], len(heights))
    flow = np.array(rows).T * POUND_FORCE / _HOUR
    nodes = smooth_surface(x_grid.tolist(), heights.tolist(), flow, x_grid=x_grid, y_grid=y_grid)
    return stack_surfaces([nodes], x_grid, y_grid)


def _blades(aircraft: AircraftProfile) -> tuple[float, float]:
    """Solidity and radius [m] of a rotor; zeros where a profile of one's own does not say."""
    dimensions = aircraft.dimensions
    if dimensions.has("rotor_solidity"):
        radius = dimensions.number("rotor_radius_ft", low=0.1, high=100.0) * FOOT
        return dimensions.number("rotor_solidity", low=0.001, high=1.0), radius
    return 0.0, 0.0


def _altitude_of(density: float) -> float:
    """Altitude of the standard atmosphere with this density [m]."""
    heights = np.linspace(-1000.0, 11000.0, 1201)
    densities = np.array([standard_atmosphere(height)[0] for height in heights])
    return float(np.interp(-density, -densities, heights))
