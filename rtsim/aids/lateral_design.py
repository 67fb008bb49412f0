"""Schedules of the aids out of the plane of symmetry, from the lateral half of the LPV database at level flight."""

from __future__ import annotations

import functools
from typing import get_args

import numpy as np

from rtsim.aids.lateral_aids_kernels import LATERAL_MAP, LateralAidTables
from rtsim.aircraft.profile import Part, xv15_profile
from rtsim.aircraft.variables import LATERAL_INPUTS, LATERAL_STATES, position, required_position
from rtsim.arrays import FloatArray
from rtsim.choices import LateralAidName
from rtsim.kernels.packed import packed
from rtsim.lpv.database import Database
from rtsim.lpv.lateral import LateralData
from rtsim.lpv.reduction import eliminated
from rtsim.units import deg, kt

LATERAL_AIDS: frozenset[str] = frozenset(get_args(LateralAidName))
"""Aids that act out of the plane of symmetry."""
RIGID_BODY = ("v", "p", "r", "bank", "heading")
_TABLE = "lateral"
"""Table of the profile's part ``aids``."""


def knows_lateral_aids(database: Database) -> bool:
    """Whether a database says what the lateral aids need: a lateral half, and their targets."""
    return database.lateral is not None and database.profile.aids.has(_TABLE)


@functools.lru_cache(maxsize=4)
def design_lateral_aids(database: Database) -> LateralAidTables:
    """Make the lateral aids' schedules: what the controls do once rotors and actuators have settled.

    A database that does not know the motion gets schedules of zeros, which nothing uses.
    """
    maps = np.zeros((LATERAL_MAP.size, len(database.airspeed), len(database.nacelle)))
    if not knows_lateral_aids(database):
        return packed(_tables(database, maps, xv15_profile().aids))
    data = LateralData.of(database)
    rigid = [position(LATERAL_STATES, name) for name in RIGID_BODY]
    inputs = [position(LATERAL_INPUTS, name) for name in ("lateral_stick", "pedal")]
    a, b = eliminated(data.A[0], data.B[0], rigid, inputs)
    v, p, r = range(3)
    maps[LATERAL_MAP.roll_sensitivity] = b[..., p, 0]
    maps[LATERAL_MAP.roll_damping] = a[..., p, p]
    maps[LATERAL_MAP.yaw_sensitivity] = b[..., r, 1]
    maps[LATERAL_MAP.yaw_damping] = a[..., r, r]
    maps[LATERAL_MAP.weathercock] = a[..., r, v]
    pitch = required_position(database.states, "pitch", "the aids")
    maps[LATERAL_MAP.pitch] = database.x_ref[database.level_layer, ..., pitch]
    return packed(_tables(database, maps, database.profile.aids))


def _tables(database: Database, maps: FloatArray, aids: Part) -> LateralAidTables:
    part = aids.table(_TABLE)
    turning = part.numbers("turning_kt", low=0.0, high=500.0, count=2, rises=True)
    pedals = part.numbers("pedals_kt", low=0.0, high=500.0, count=2, rises=True)
    return LateralAidTables(
        airspeed=database.airspeed,
        nacelle=database.nacelle,
        maps=maps,
        roll_damping=part.number("roll_damping_per_s", low=0.0, high=20.0),
        yaw_damping=part.number("yaw_damping_per_s", low=0.0, high=20.0),
        bank_frequency=part.number("bank_frequency_rad_s", low=0.01, high=20.0),
        bank_damping=part.number("bank_damping", low=0.0, high=5.0),
        roll_rate_command=deg(part.number("roll_rate_command_deg_s", low=0.1, high=200.0)),
        largest_bank=deg(part.number("largest_bank_deg", low=5.0, high=80.0)),
        heading_frequency=part.number("heading_frequency_rad_s", low=0.0, high=20.0),
        heading_time=part.number("heading_time_s", low=0.1, high=1000.0),
        turn_to_heading=part.number("turn_to_heading_per_s", low=0.0, high=10.0),
        heading_bank=deg(part.number("heading_bank_deg", low=0.0, high=60.0)),
        sideslip_frequency=part.number("sideslip_frequency_rad_s", low=0.0, high=20.0),
        turning=(kt(turning[0]), kt(turning[1])),
        pedals=(kt(pedals[0]), kt(pedals[1])),
        place_speed=kt(part.number("place_speed_kt", low=0.1, high=100.0)),
        place_rate=part.number("place_rate_per_s", low=0.01, high=10.0),
        place_damping=part.number("place_damping_per_s", low=0.01, high=10.0),
        place_time=part.number("place_time_s", low=0.1, high=1000.0),
        place_attitude=deg(part.number("place_attitude_deg", low=0.1, high=45.0)),
        authority=aids.number("authority", low=0.0, high=1.0),
        dead_zone=aids.number("dead_zone", low=0.0, high=0.5),
        fade_time=aids.number("fade_time_s", low=0.0, high=100.0),
    )
