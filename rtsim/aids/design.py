"""Schedules of the pilot aids, from the level layer of the LPV database; and the aids by name."""

from __future__ import annotations

import functools
from typing import get_args

import numpy as np

from rtsim.aids.aids_kernels import (
    AIRSPEED_HOLD,
    ALTITUDE_HOLD,
    ATTITUDE_RETENTION,
    AUTOMATIC_FLAPS,
    AUTOMATIC_ROTOR_SPEED,
    BANK_RETENTION,
    GOVERNOR,
    HEADING_HOLD,
    MAP,
    POSITION_HOLD,
    RATE_DAMPING,
    ROLL_DAMPING,
    SWITCH_COUNT,
    TRIM_BIAS,
    TURN_COORDINATION,
    YAW_DAMPING,
    AidTables,
)
from rtsim.aircraft.variables import FLAP_INPUTS, position
from rtsim.arrays import FloatArray
from rtsim.choices import AidName, SwitchName
from rtsim.errors import InputError
from rtsim.kernels.packed import packed
from rtsim.lpv.database import Database
from rtsim.lpv.reduction import settled
from rtsim.units import deg

SWITCHES: dict[SwitchName, int] = {
    "rate_damping": RATE_DAMPING,
    "attitude_retention": ATTITUDE_RETENTION,
    "altitude_hold": ALTITUDE_HOLD,
    "airspeed_hold": AIRSPEED_HOLD,
    "trim_bias": TRIM_BIAS,
    "roll_damping": ROLL_DAMPING,
    "yaw_damping": YAW_DAMPING,
    "bank_retention": BANK_RETENTION,
    "heading_hold": HEADING_HOLD,
    "turn_coordination": TURN_COORDINATION,
    "position_hold": POSITION_HOLD,
    "automatic_flaps": AUTOMATIC_FLAPS,
    "governor": GOVERNOR,
    "automatic_rotor_speed": AUTOMATIC_ROTOR_SPEED,
}
"""Everything that can be switched, by name, with its place in the switches. Flaps and governor are on unless switched
off."""
AIDS: dict[AidName, int] = {name: SWITCHES[name] for name in get_args(AidName)}
"""The aids among them."""
RIGID_BODY = ("u", "w", "q", "pitch")


@functools.lru_cache(maxsize=4)
def design_aids(database: Database) -> AidTables:
    """Make the aids' schedules: what the controls do at each grid point once rotor and actuators have settled."""
    # A database of one's own may lack flap inputs: the flaps stay where its schedule has them.
    flaps = [name for name in FLAP_INPUTS if position(database.inputs, name) >= 0]
    model = settled(database, keep=RIGID_BODY, inputs=("stick", "lever", *flaps), purpose="the aids")
    level, reduced_a, reduced_b = database.level_layer, model.a, model.b
    u, w, q, pitch_place = range(len(RIGID_BODY))
    stick, lever, *flap_columns = range(len(model.inputs))
    pitch = database.x_ref[level, ..., model.kept[pitch_place]]
    maps = np.zeros((MAP.size, len(database.airspeed), len(database.nacelle)))
    maps[MAP.stick] = database.u_ref[level, ..., model.inputs[stick]]
    maps[MAP.lever] = database.u_ref[level, ..., model.inputs[lever]]
    maps[MAP.pitch_sensitivity] = reduced_b[..., q, stick]
    maps[MAP.pitch_damping] = reduced_a[..., q, q]
    maps[MAP.lever_lift] = np.sin(pitch) * reduced_b[..., u, lever] - np.cos(pitch) * reduced_b[..., w, lever]
    maps[MAP.lever_thrust] = np.cos(pitch) * reduced_b[..., u, lever] + np.sin(pitch) * reduced_b[..., w, lever]
    for name, column in zip(flaps, flap_columns, strict=True):
        place = MAP.stick_flaps + FLAP_INPUTS.index(name)
        maps[place] = -reduced_b[..., q, column] / reduced_b[..., q, stick]
    part = database.profile.aids
    blend = part.numbers("blend_nacelle_deg", low=0.0, high=95.0, count=2, rises=True)
    return packed(
        AidTables(
            airspeed=database.airspeed,
            nacelle=database.nacelle,
            maps=maps,
            schedule_time=part.number("schedule_time_s", low=0.01, high=100.0),
            damping=part.number("damping_per_s", low=0.0, high=20.0),
            attitude_frequency=part.number("attitude_frequency_rad_s", low=0.01, high=20.0),
            attitude_damping=part.number("attitude_damping", low=0.0, high=5.0),
            authority=part.number("authority", low=0.0, high=1.0),
            rate_command=deg(part.number("rate_command_deg_s", low=0.1, high=100.0)),
            dead_zone=part.number("dead_zone", low=0.0, high=0.5),
            altitude_frequency=part.number("altitude_frequency_rad_s", low=0.01, high=10.0),
            airspeed_frequency=part.number("airspeed_frequency_rad_s", low=0.01, high=10.0),
            integral_time=part.number("integral_time_s", low=0.1, high=1000.0),
            fade_time=part.number("fade_time_s", low=0.0, high=100.0),
            blend=(deg(blend[0]), deg(blend[1])),
        )
    )


def switches_of(names: tuple[AidName, ...]) -> FloatArray:
    """Switch positions with the named aids on.

    Args:
        names: Aids to switch on.
    """
    switches = np.zeros(SWITCH_COUNT)
    for name in names:
        switches[AIDS[name]] = 1.0
    return switches


def switch_of(name: str) -> SwitchName:
    """The switch of a name that came from outside.

    Args:
        name: Any text.

    Raises:
        InputError: There is no such switch.
    """
    for switch in SWITCHES:
        if switch == name:
            return switch
    raise InputError("no such pilot aid", key="aid", value=name, allowed=", ".join(SWITCHES), mend="choose one")
