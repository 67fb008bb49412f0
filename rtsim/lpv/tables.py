"""Prepares a database for the compiled kernels: subtracts the rigid-body terms, drops what is zero, packs the cells."""

from __future__ import annotations

import functools
from typing import Literal

import numpy as np
import numpy.typing as npt

from rtsim.aircraft.variables import (
    GUST_INPUTS,
    NACELLE_INPUTS,
    RIGID_BODY_STATES,
    SCHEDULING_STATES,
    position,
    required_position,
)
from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.kernels.kept import kept
from rtsim.kernels.packed import Size, packed
from rtsim.lpv import schedule_kernels as kernels
from rtsim.lpv.database import Database
from rtsim.lpv.lateral import LateralData
from rtsim.lpv.schedule_kernels import LpvRoles, LpvTables
from rtsim.units import GRAVITY

Form = Literal["layered", "stitched", "plain"]
Refresh = Literal["step", "references", "stage"]

FORMS: dict[Form, int] = {
    "layered": kernels.FORM_LAYERED,
    "stitched": kernels.FORM_STITCHED,
    "plain": kernels.FORM_PLAIN,
}
"""Forms of the LPV aircraft by the name that people use; the first is the default."""
REFRESHES: dict[Refresh, int] = {
    "step": kernels.REFRESH_ONCE,
    "references": kernels.REFRESH_REFERENCE,
    "stage": kernels.REFRESH_EVERY_STAGE,
}
"""How often a step interpolates; the difference is measured in docs/lpv.md."""
KINEMATIC_TOLERANCE = 1e-3
"""Largest entry that may remain in the pitch and altitude rows after their kinematics are subtracted."""


def prepare_tables(database: Database, form: Form = "layered", *, refresh: Refresh = "step") -> LpvTables:
    """Pack a database for the kernels.

    Args:
        form: ``layered`` (default), ``stitched`` or the paper's ``plain``.
        refresh: Interpolate once per ``step`` (default), the ``references`` in each Runge-Kutta stage and the matrices
            once, or all in each ``stage``.

    Returns:
        The kernels' tables.

    Raises:
        InputError: The database lacks a state that the form needs, or its rows contradict the kinematics.
    """
    return _prepared(database, form, refresh)


@functools.lru_cache(maxsize=8)
def _prepared(database: Database, form: Form, refresh: Refresh) -> LpvTables:
    key = f"{database.content_hash} {form} {refresh} {scheduling_speed(database)!r}".encode()
    return packed(kept("lpv", key, lambda: _prepare(database, form, refresh)))


def _prepare(database: Database, form: Form, refresh: Refresh) -> LpvTables:
    number = FORMS[form]
    level = database.level_layer
    layers = slice(None) if form == "layered" else slice(level, level + 1)
    loads = LateralData.of(database) if form == "layered" and database.lateral is not None else None

    def stacked(name: str) -> FloatArray:
        """The layers of an array, those of the loaded trims last."""
        array: FloatArray = getattr(database, name)[layers]
        return array.copy() if loads is None else np.concatenate([array, getattr(loads, f"loaded_{name}")])

    x_ref, u_ref, y_ref, A, B, C, D, xdot_ref = (
        stacked(name) for name in ("x_ref", "u_ref", "y_ref", "A", "B", "C", "D", "xdot_ref")
    )
    if form != "plain":
        _subtract_rigid_body(database, x_ref, A, xdot_ref)
    altitude = position(database.states, "altitude")
    if altitude >= 0:
        # The altitude has no trim value: the air is the same at every height and the ground is far.
        A[..., altitude] = 0.0

    rows, state_columns, input_columns = active(A, B, xdot_ref)
    roles = _roles(
        database,
        number,
        REFRESHES[refresh],
        level if form == "layered" else 0,
        (rows, state_columns, input_columns),
    )
    padded = roles.rows
    cells = np.concatenate(
        [
            x_ref,
            u_ref,
            columns_of(xdot_ref[..., rows, None], padded),
            columns_of(A[..., rows, :][..., state_columns], padded),
            columns_of(B[..., rows, :][..., input_columns], padded),
        ],
        axis=-1,
    )
    output_cells = np.concatenate(
        [columns_of(matrix, roles.output_rows) for matrix in (y_ref[..., None], C, D)],
        axis=-1,
    )
    return LpvTables(
        airspeed=database.airspeed,
        nacelle=database.nacelle,
        alpha=layers_last(scheduling_alpha(database, database.x_ref[layers])),
        valid=np.ascontiguousarray(database.valid[level], dtype=np.float64),
        cells=layers_last(cells),
        output_cells=layers_last(output_cells),
        rows=rows,
        state_columns=state_columns,
        input_columns=input_columns,
        alpha_speed=scheduling_speed(database),
        roles=roles,
    )


def scheduling_speed(database: Database) -> float:
    """V0 of the scheduling angle of attack [m/s]."""
    return database.profile.dimensions.number("scheduling_speed_m_s", low=0.1, high=100.0)


def scheduling_alpha(
    database: Database, x: FloatArray, *, bank: FloatArray | float = 0.0, v: FloatArray | float = 0.0
) -> FloatArray:
    """Angle of attack as used for scheduling, see ``schedule_kernels.scheduling_alpha``.

    Args:
        database: Says where u, w and pitch stand.
        x: States (..., nx).
        bank: Bank angle (...) [rad].
        v: Velocity along body y (...) [m/s].

    Returns:
        The angle (...) [rad].
    """
    u, w, pitch = (x[..., required_position(database.states, name, "scheduling")] for name in SCHEDULING_STATES)
    sine, cosine = np.sin(pitch), np.cos(pitch)
    ahead = u * cosine + (v * np.sin(bank) + w * np.cos(bank)) * sine
    headwind = scheduling_speed(database) + np.maximum(0.0, -ahead)
    return np.asarray(np.arctan2(w + headwind * sine * np.cos(bank), u + headwind * cosine))


def _roles(
    database: Database, form: int, refresh: int, level: int, active: tuple[npt.NDArray[np.int64], ...]
) -> LpvRoles:
    rigid = {}
    for name in RIGID_BODY_STATES:
        if name in SCHEDULING_STATES:
            rigid[name] = required_position(database.states, name, "scheduling")
        elif form != kernels.FORM_PLAIN:
            rigid[name] = required_position(database.states, name, "the stitched form")
        else:
            rigid[name] = position(database.states, name)
    # The paper's plain form is scheduled by the state alone.
    gusts = {name: -1 if form == kernels.FORM_PLAIN else position(database.inputs, name) for name in GUST_INPUTS}
    motion = {name: position(database.inputs, name) for name in NACELLE_INPUTS}
    rows, state_columns, input_columns = active
    auxiliary = _first_auxiliary(database)
    sizes: dict[str, int] = {
        **rigid,
        **gusts,
        **motion,
        "states": len(database.states),
        "inputs": len(database.inputs),
        "outputs": len(database.outputs),
        "rows": padded_rows(rows.size),
        "output_rows": padded_rows(len(database.outputs)),
        "state_columns": state_columns.size,
        "input_columns": input_columns.size,
        "auxiliary": auxiliary,
        "auxiliary_column": int(np.count_nonzero(input_columns < auxiliary)),
    }
    return LpvRoles(form=form, level=level, refresh=refresh, **{name: Size(value) for name, value in sizes.items()})


def _first_auxiliary(database: Database) -> int:
    """Number of the first of the last inputs that are zero in most frames and in every trim."""
    first = len(database.inputs)
    while first > 0 and database.inputs[first - 1].role in ("gust", "flap", "drive"):
        if np.any(database.u_ref[..., first - 1]):
            break
        first -= 1
    return first


def _subtract_rigid_body(database: Database, x_ref: FloatArray, A: FloatArray, xdot_ref: FloatArray) -> None:
    """Take gravity, Coriolis and kinematics out of A and xdot_ref, in place, leaving the aerodynamics."""
    iu, iw, iq, ip, ih = (required_position(database.states, name, "the stitched form") for name in RIGID_BODY_STATES)
    u, w, q, pitch = x_ref[..., iu], x_ref[..., iw], x_ref[..., iq], x_ref[..., ip]
    sine, cosine = np.sin(pitch), np.cos(pitch)
    xdot_ref[..., iu] -= -GRAVITY * sine - q * w
    xdot_ref[..., iw] -= GRAVITY * cosine + q * u
    xdot_ref[..., ip] -= q
    xdot_ref[..., ih] -= u * sine - w * cosine
    A[..., iu, ip] -= -GRAVITY * cosine
    A[..., iu, iq] -= -w
    A[..., iu, iw] -= -q
    A[..., iw, ip] -= -GRAVITY * sine
    A[..., iw, iq] -= u
    A[..., iw, iu] -= q
    A[..., ip, iq] -= 1.0
    A[..., ih, iu] -= sine
    A[..., ih, iw] -= -cosine
    A[..., ih, ip] -= u * cosine + w * sine
    for row, name in ((ip, "pitch"), (ih, "altitude")):
        rest = max(np.abs(A[..., row, :]).max(), np.abs(xdot_ref[..., row]).max())
        if rest > KINEMATIC_TOLERANCE:
            raise InputError(
                f"the row of '{name}' in A differs by {rest:.3g} from symmetric-plane kinematics",
                key="A",
                allowed="pitch' = q and altitude' = u sin(pitch) - w cos(pitch), body z axis down",
                mend="correct the axes or signs, or fly the plain form",
            )
        A[..., row, :] = 0.0
        xdot_ref[..., row] = 0.0
    # Specific force does not depend on attitude; what is left is the rounding of the finite difference.
    A[..., iu, ip] = 0.0
    A[..., iw, ip] = 0.0


def active(A: FloatArray, B: FloatArray, xdot_ref: FloatArray) -> tuple[npt.NDArray[np.int64], ...]:
    """Rows and columns that are not zero in every cell.

    Args:
        A: State matrices (..., n, n).
        B: Input matrices (..., n, m).
        xdot_ref: State derivatives at the trims (..., n).

    Returns:
        Numbers of the active rows, columns of A and columns of B.
    """
    grid = tuple(range(A.ndim - 2))
    used_a, used_b = np.any(A != 0.0, axis=grid), np.any(B != 0.0, axis=grid)
    rows = used_a.any(axis=1) | used_b.any(axis=1) | np.any(xdot_ref != 0.0, axis=grid)
    picks = (rows, used_a.any(axis=0), used_b.any(axis=0))
    return tuple(np.ascontiguousarray(np.flatnonzero(pick), dtype=np.int64) for pick in picks)


def padded_rows(rows: int) -> int:
    """Rows of a column in the packed cells: at least four, a multiple of four.

    Args:
        rows: Active rows.
    """
    return max(4, -(-rows // 4) * 4)


def columns_of(matrix: FloatArray, padded: int) -> FloatArray:
    """Flatten (..., rows, columns) column after column, each padded with zeros.

    Args:
        matrix: Matrices (..., rows, columns).
        padded: Length of a column.
    """
    filled = np.zeros((*matrix.shape[:-2], matrix.shape[-1], padded))
    filled[..., : matrix.shape[-2]] = np.swapaxes(matrix, -1, -2)
    return filled.reshape(*matrix.shape[:-2], -1)


def layers_last(array: FloatArray) -> FloatArray:
    """Reorder [layer, airspeed, nacelle, ...] to [airspeed, nacelle, layer, ...]: a cell's layers lie side by side.

    Args:
        array: An array with the layers first.
    """
    return np.ascontiguousarray(np.moveaxis(array, 0, 2))
