"""The lateral half of a database prepared for the compiled kernels.

Legend: i, j number the airspeed and nacelle intervals; a cell of the lateral blocks is flattened as those of
``schedule_kernels`` are, without references: about symmetric flight they are zero.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from rtsim.aircraft.variables import INPUTS, LATERAL_INPUTS, LATERAL_OUTPUTS, LATERAL_STATES, STATES, position
from rtsim.arrays import FloatArray, IntArray
from rtsim.errors import InputError
from rtsim.kernels.kept import kept
from rtsim.kernels.packed import Size, packed
from rtsim.lpv.database import Database
from rtsim.lpv.lateral import LateralData
from rtsim.lpv.schedule_kernels import LpvTables
from rtsim.lpv.tables import (
    KINEMATIC_TOLERANCE,
    active,
    columns_of,
    layers_last,
    padded_rows,
    prepare_tables,
    scheduling_alpha,
    scheduling_speed,
)
from rtsim.units import GRAVITY

_V, _P, _R, _BANK, _HEADING = (position(LATERAL_STATES, name) for name in ("v", "p", "r", "bank", "heading"))
_FIRST_GUST = position(LATERAL_INPUTS, "gust_v")
_U, _W, _PITCH = (position(STATES, name) for name in ("u", "w", "pitch"))


class SidewaysRoles(NamedTuple):
    """Sizes: constants to the compiler."""

    rows: Size
    """Active rows of the lateral block, padded."""
    state_columns: Size
    """Active columns of A and of B."""
    input_columns: Size
    pilot_columns: Size
    """Those of B that belong to stick and pedals; they stand first."""
    output_rows: Size
    """Lateral outputs, padded."""


class SidewaysTables(NamedTuple):
    """An LPV aircraft that can turn, slip and move sideward."""

    symmetric: LpvTables
    """Its symmetric half; the layers of the loaded trims stand last."""
    load_factor: FloatArray
    """Load factors of these (K,)."""
    load_alpha: FloatArray
    """Scheduling angle of attack of the loaded trims less that of the level one (V, N, K) [rad]."""
    load_valid: FloatArray
    """1 where they exist (V, N, K)."""
    velocity: FloatArray
    """Sideward velocity of the trims in sideslip (M,) [m/s]."""
    slip_alpha: FloatArray
    """Their scheduling angle of attack less that of the level one (V, N, M) [rad]."""
    slip_valid: FloatArray
    """1 where they exist (V, N, M)."""
    slip: FloatArray
    """What they change in the references of level flight (V, N, M, block): symmetric states, inputs and active rows of
    the specific rates, then lateral states, inputs and active rows of the lateral block."""
    slip_outputs: FloatArray
    """What they change in the outputs (V, N, M, ny + 3)."""
    cells: FloatArray
    """Lateral block of level flight, then of the loaded trims (V, N, K + 1, block): active columns of A, then of B."""
    output_cells: FloatArray
    """Columns of C, then of D, rows padded."""
    rows: IntArray
    """Lateral state of each active row."""
    state_columns: IntArray
    """Lateral state of each active column of A."""
    input_columns: IntArray
    """Lateral input of each active column of B."""
    inertia: FloatArray
    """Ixx, Iyy, Izz, Ixz in each nacelle row (N, 4) [kg m^2]."""
    roles: SidewaysRoles
    """Sizes."""


def prepare_sideways(database: Database) -> SidewaysTables:
    """Pack a database with a lateral half, in the layered form.

    Args:
        database: The database, its variables in the order of the closed loop.

    Raises:
        InputError: Its lateral rows contradict the kinematics.
    """
    return _prepared(database)


@functools.lru_cache(maxsize=8)
def _prepared(database: Database) -> SidewaysTables:
    symmetric = prepare_tables(database, "layered")
    key = f"{database.content_hash} sideways {scheduling_speed(database)!r}".encode()
    return packed(kept("lpv_sideways", key, lambda: _prepare(database, symmetric))._replace(symmetric=symmetric))


def _prepare(database: Database, symmetric: LpvTables) -> SidewaysTables:
    data, level = LateralData.of(database), database.level_layer
    x = np.concatenate([database.x_ref[level : level + 1], data.loaded_x_ref])
    A, B = data.A.copy(), data.B.copy()
    _subtract_rigid_body(x, A)
    rows, state_columns, input_columns = active(A, B, np.zeros(A.shape[:-1]))
    padded, output_rows = padded_rows(rows.size), padded_rows(len(LATERAL_OUTPUTS))
    cells = np.concatenate(
        [
            columns_of(A[..., rows, :][..., state_columns], padded),
            columns_of(B[..., rows, :][..., input_columns], padded),
        ],
        axis=-1,
    )
    level_alpha = scheduling_alpha(database, database.x_ref[level])
    n = len(STATES)
    slip_x = data.slip_x_ref
    slip_alpha = scheduling_alpha(database, slip_x[..., :n], bank=slip_x[..., n + _BANK], v=slip_x[..., n + _V])
    outputs = np.zeros((*slip_x.shape[:-1], len(database.outputs) + len(LATERAL_OUTPUTS)))
    outputs[:] = data.slip_y_ref
    outputs[..., : len(database.outputs)] -= database.y_ref[level]
    return SidewaysTables(
        symmetric=symmetric,
        load_factor=data.load_factor,
        load_alpha=layers_last(scheduling_alpha(database, data.loaded_x_ref) - level_alpha),
        load_valid=layers_last(data.loaded_valid),
        velocity=data.lateral_velocity,
        slip_alpha=layers_last(slip_alpha - level_alpha),
        slip_valid=layers_last(data.slip_valid),
        slip=layers_last(_slip(database, data, symmetric, rows, padded)),
        slip_outputs=layers_last(outputs),
        cells=layers_last(cells),
        output_cells=layers_last(
            np.concatenate([columns_of(data.C, output_rows), columns_of(data.D, output_rows)], axis=-1)
        ),
        rows=rows,
        state_columns=state_columns,
        input_columns=input_columns,
        inertia=data.inertia,
        roles=SidewaysRoles(
            rows=Size(padded),
            state_columns=Size(state_columns.size),
            input_columns=Size(input_columns.size),
            pilot_columns=Size(int(np.count_nonzero(input_columns < _FIRST_GUST))),
            output_rows=Size(output_rows),
        ),
    )


def _slip(database: Database, data: LateralData, symmetric: LpvTables, rows: IntArray, padded: int) -> FloatArray:
    """What trims in sideslip change in the references, and in the specific rates that go with them."""
    n, m, level = len(STATES), len(INPUTS), database.level_layer
    x, u = data.slip_x_ref, data.slip_u_ref
    bank, pitch = x[..., n + _BANK], x[..., _PITCH]
    # A steady flight: the specific forces are what balances gravity; nothing turns.
    forces = np.zeros((*x.shape[:-1], n))
    forces[..., _U] = GRAVITY * np.sin(pitch)
    forces[..., _W] = -GRAVITY * np.cos(pitch) * np.cos(bank)
    level_pitch = database.x_ref[level][..., _PITCH]
    forces[..., _U] -= GRAVITY * np.sin(level_pitch)
    forces[..., _W] += GRAVITY * np.cos(level_pitch)
    lateral = np.zeros((*x.shape[:-1], len(LATERAL_STATES)))
    lateral[..., _V] = -GRAVITY * np.cos(pitch) * np.sin(bank)
    # Where the trim is missing, the one before is repeated, down to the level one: then nothing changes.
    return np.concatenate(
        [
            x[..., :n] - database.x_ref[level],
            u[..., :m] - database.u_ref[level],
            columns_of(forces[..., symmetric.rows, None], int(symmetric.roles.rows)),
            x[..., n:],
            u[..., m:],
            columns_of(lateral[..., rows, None], padded),
        ],
        axis=-1,
    )


def _subtract_rigid_body(x: FloatArray, A: FloatArray) -> None:
    """Take gravity, Coriolis and kinematics out of the lateral blocks, in place, leaving the aerodynamics."""
    u, w, pitch = x[..., _U], x[..., _W], x[..., _PITCH]
    A[..., _V, _BANK] -= GRAVITY * np.cos(pitch)
    A[..., _V, _R] += u
    A[..., _V, _P] -= w
    A[..., _BANK, _P] -= 1.0
    A[..., _BANK, _R] -= np.tan(pitch)
    A[..., _HEADING, _R] -= 1.0 / np.cos(pitch)
    for row in (_BANK, _HEADING):
        rest = np.abs(A[..., row, :]).max()
        if rest > KINEMATIC_TOLERANCE:
            raise InputError(
                f"the row of '{LATERAL_STATES[row].name}' differs by {rest:.3g} from the kinematics of a rigid body",
                key="lateral/A",
                allowed="bank' = p + r tan(pitch) and heading' = r / cos(pitch)",
                mend="correct the axes or signs",
            )
        A[..., row, :] = 0.0
    A[..., :, [_BANK, _HEADING]] = 0.0
