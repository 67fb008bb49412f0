"""The lateral loop frozen at a command: aircraft and the pilot's lateral half, linearized as flown.

The aircraft is stepped by its own kernels about the symmetric trim, so what counts is what flies: close to straight
flight the references move along the trims in sideslip, and the slope is that to the first of them.
"""

from __future__ import annotations

import numpy as np

from rtsim.aircraft.variables import ALL_INPUTS, ALL_STATES, INPUT, LATERAL_STATES, STATE, STATES, whole
from rtsim.analysis.frozen_loop import FrozenCommand, FrozenLoop, StabilityMap, jacobian, trim_state
from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import interpreted, kernel
from rtsim.lpv.database import Database
from rtsim.lpv.sideways_kernels import sideways_step, sideways_work_size
from rtsim.lpv.sideways_tables import SidewaysTables, prepare_sideways
from rtsim.pilot.lateral_kernels import (
    WANTED,
    LateralPilotTables,
    lateral_advance_in,
    lateral_output_in,
    lateral_work_size,
)
from rtsim.pilot.lateral_tables import load_lateral_pilot
from rtsim.pilot.layout_kernels import S_FILTERED
from rtsim.pilot.layout_kernels import pilot_state_size as state_size

_STEP = 1e-4
"""Steps of the differences: within the first interval of the trims in sideslip [m/s, rad, rad/s, -]."""
_LATERAL = slice(len(STATES), len(STATES) + len(LATERAL_STATES))
Tables = tuple[SidewaysTables, LateralPilotTables]


@kernel
def _step(tables: SidewaysTables, x: FloatArray, u: FloatArray, path: FloatArray, dt: float, work: FloatArray) -> None:
    sideways_step(tables, x, u, path, dt, work)


@kernel
def _output(
    tables: LateralPilotTables,
    state: FloatArray,
    wanted: FloatArray,
    nacelle: float,
    pitch: float,
    out: FloatArray,
    work: FloatArray,
) -> None:
    lateral_output_in(tables, state, wanted, nacelle, pitch, out, work)


@kernel
def _advance(
    tables: LateralPilotTables,
    state: FloatArray,
    x: FloatArray,
    scalars: tuple[float, float, float, float],
    wanted: FloatArray,
    applied: FloatArray,
    noise: FloatArray,
    work: FloatArray,
) -> None:
    lateral_advance_in(tables, state, x, scalars, wanted, applied, noise, work)


class _Frame:
    """The two halves of one frame as functions of flat lateral states."""

    def __init__(self, database: Database, tables: Tables, condition: FrozenCommand, dt: float) -> None:
        self.aircraft, self.pilot = tables
        self.dt, self.airspeed, self.nacelle = dt, condition.airspeed, condition.nacelle_angle
        x, u = trim_state(database, condition)
        self.x, self.u = whole(x, ALL_STATES), whole(u, ALL_INPUTS)
        self.path = np.zeros((3, 3))
        self.path[:, 0] = condition.nacelle_angle
        self.work = np.zeros(interpreted(sideways_work_size)(self.aircraft))
        self.room = np.zeros(interpreted(lateral_work_size)(self.pilot))
        self.wanted = np.zeros(WANTED.size)
        self.wanted[WANTED.airspeed] = condition.airspeed
        self.out, self.silence = np.zeros(2), np.zeros(0)

    def plant(self, lateral: FloatArray, controls: FloatArray) -> FloatArray:
        x, u = self.x.copy(), self.u.copy()
        x[_LATERAL] = lateral
        u[INPUT.lateral_stick], u[INPUT.pedal] = controls
        _step(self.aircraft, x, u, self.path, self.dt, self.work)
        return np.asarray(x[_LATERAL])

    def output(self, state: FloatArray) -> FloatArray:
        pitch = float(self.x[STATE.pitch])
        _output(self.pilot, state, self.wanted, self.nacelle, pitch, self.out, self.room)
        return self.out.copy()

    def advance(self, lateral: FloatArray, state: FloatArray) -> FloatArray:
        x, after = self.x.copy(), state.copy()
        x[_LATERAL] = lateral
        scalars = (self.nacelle, self.airspeed, 0.0, self.dt)
        _advance(self.pilot, after, x, scalars, self.wanted, self.output(state), self.silence, self.room)
        return after


def lateral_tables(database: Database, *, dt: float = 0.004) -> Tables:
    """Prepared tables of aircraft and lateral half of the pilot, to save time on maps.

    Args:
        database: One with a lateral half.

    Raises:
        InputError: It has no lateral half, or no pilot for it.
    """
    return prepare_sideways(database), load_lateral_pilot(database, dt=dt)


def lateral_loop(
    database: Database, condition: FrozenCommand, *, dt: float = 0.004, tables: Tables | None = None
) -> FrozenLoop:
    """Linearize aircraft and pilot out of the plane of symmetry as flown, frozen at a straight flight.

    Args:
        database: One with a lateral half.
        condition: The command.
        tables: From ``lateral_tables``; None: prepared from the database.

    Returns:
        The one-frame maps; lateral stick and pedals are the controls.
    """
    frame = _Frame(database, tables if tables is not None else lateral_tables(database, dt=dt), condition, dt)
    still, rest = np.zeros(len(LATERAL_STATES)), np.zeros(2)
    state = np.zeros(interpreted(state_size)(frame.pilot.mocm))
    state[S_FILTERED] = condition.airspeed
    steps = [np.full(size, _STEP) for size in (still.size, rest.size, state.size)]
    return FrozenLoop(
        plant_a=jacobian(lambda v: frame.plant(v, rest), still, steps[0]),
        plant_b=jacobian(lambda v: frame.plant(still, v), rest, steps[1]),
        pilot_a=jacobian(lambda v: frame.advance(still, v), state, steps[2]),
        pilot_b=jacobian(lambda v: frame.advance(v, state), still, steps[0]),
        pilot_c=jacobian(frame.output, state, steps[2]),
        dt=dt,
        names=tuple(variable.name for variable in LATERAL_STATES),
    )


def lateral_stability_map(database: Database, *, mid_cells: bool = False, dt: float = 0.004) -> StabilityMap:
    """Map the frozen lateral loop's growth over all valid grid points, or the middles of all valid cells.

    Args:
        database: One with a lateral half.
        mid_cells: Middles of cells instead of grid points.

    Returns:
        The map.
    """
    tables, valid = lateral_tables(database, dt=dt), database.valid[database.level_layer]
    v, n = database.airspeed, database.nacelle
    if mid_cells:
        valid = valid[:-1, :-1] & valid[1:, :-1] & valid[:-1, 1:] & valid[1:, 1:]
        v, n = 0.5 * (v[1:] + v[:-1]), 0.5 * (n[1:] + n[:-1])
    growth = np.full(valid.shape, np.nan)
    for i, j in np.argwhere(valid):
        growth[i, j] = lateral_loop(database, FrozenCommand(float(v[i]), float(n[j])), dt=dt, tables=tables).growth()
    return StabilityMap(airspeed=v, nacelle=n, growth=growth)
