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
    GOVERNOR,
    MAP_COUNT,
    MAP_LEVER,
    MAP_LEVER_LIFT,
    MAP_LEVER_THRUST,
    MAP_PITCH_DAMPING,
    MAP_PITCH_SENSITIVITY,
    MAP_STICK,
    MAP_STICK_FLAPS,
    RATE_DAMPING,
    SWITCH_COUNT,
    TRIM_BIAS,
    AidTables,
)
from rtsim.aircraft.variables import FLAP_INPUTS
from rtsim.choices import AidName, SwitchName
from rtsim.errors import InputError
from rtsim.frame import FloatArray
from rtsim.kernels.packed import packed
from rtsim.lpv.database import Database
from rtsim.units import deg

SWITCHES: dict[SwitchName, int] = {
    "rate_damping": RATE_DAMPING,
    "attitude_retention": ATTITUDE_RETENTION,
    "altitude_hold": ALTITUDE_HOLD,
    "airspeed_hold": AIRSPEED_HOLD,
    "trim_bias": TRIM_BIAS,
    "automatic_flaps": AUTOMATIC_FLAPS,
    "governor": GOVERNOR,
}
"""Everything that can be switched, by name, with its place in the switches. The last two are on unless switched off."""
AIDS: dict[AidName, int] = {name: SWITCHES[name] for name in get_args(AidName)}
"""The aids among them."""
RIGID_BODY = ("u", "w", "q", "pitch")


@functools.lru_cache(maxsize=4)
def design_aids(database: Database) -> AidTables:
    """Make the aids' schedules: what the controls do at each grid point once rotor and actuators have settled.

    Args:
        database: The LPV database.
    """
    names = [variable.name for variable in database.states]
    inputs = [variable.name for variable in database.inputs]
    slow = [names.index(name) for name in RIGID_BODY]
    fast = [i for i, name in enumerate(names) if name not in (*RIGID_BODY, "altitude")]
    level = database.level_layer
    stick, lever = inputs.index("stick"), inputs.index("lever")
    reduced_a, reduced_b = _settled(database.A[level], database.B[level], slow, fast)
    pitch = database.x_ref[level, ..., names.index("pitch")]
    maps = np.zeros((MAP_COUNT, len(database.airspeed), len(database.nacelle)))
    maps[MAP_STICK] = database.u_ref[level, ..., stick]
    maps[MAP_LEVER] = database.u_ref[level, ..., lever]
    maps[MAP_PITCH_SENSITIVITY] = reduced_b[..., 2, stick]
    maps[MAP_PITCH_DAMPING] = reduced_a[..., 2, 2]
    maps[MAP_LEVER_LIFT] = np.sin(pitch) * reduced_b[..., 0, lever] - np.cos(pitch) * reduced_b[..., 1, lever]
    maps[MAP_LEVER_THRUST] = np.cos(pitch) * reduced_b[..., 0, lever] + np.sin(pitch) * reduced_b[..., 1, lever]
    for k, name in enumerate(FLAP_INPUTS):
        if name not in inputs:  # a database of one's own: the flaps stay where its schedule has them
            continue
        maps[MAP_STICK_FLAPS + k] = -reduced_b[..., 2, inputs.index(name)] / reduced_b[..., 2, stick]
    return packed(
        AidTables(
            airspeed=database.airspeed,
            nacelle=database.nacelle,
            maps=maps,
            schedule_time=2.0,
            damping=1.5,
            attitude_frequency=1.5,
            attitude_damping=0.8,
            authority=0.5,
            rate_command=deg(10.0),
            dead_zone=0.03,
            altitude_frequency=0.5,
            airspeed_frequency=0.25,
            integral_time=10.0,
            fade_time=1.0,
            blend=(deg(30.0), deg(60.0)),
        )
    )


def _settled(A: FloatArray, B: FloatArray, slow: list[int], fast: list[int]) -> tuple[FloatArray, FloatArray]:
    """Residualise the fast states at all points at once; leading axes are the grid's."""
    all_fast, all_slow = A[..., fast, :], A[..., slow, :]
    inner, back = all_fast[..., fast], all_slow[..., fast]
    return (
        all_slow[..., slow] - back @ np.linalg.solve(inner, all_fast[..., slow]),
        B[..., slow, :] - back @ np.linalg.solve(inner, B[..., fast, :]),
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
