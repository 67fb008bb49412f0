"""Compiled LPV aircraft: state derivative, outputs and one Runge-Kutta step.

Every sum has a fixed order and no library routine is called, so results are bit-reproducible on one machine type. The
tables and their legend are in ``rtsim.lpv.schedule_kernels``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import inner_kernel, part
from rtsim.lpv.schedule_kernels import (
    FLAG_AIRSPEED_HIGH,
    FLAG_AIRSPEED_LOW,
    FLAG_NACELLE,
    FLAG_NO_TRIM,
    FORM_LAYERED,
    FORM_PLAIN,
    FORM_STITCHED,
    REFRESH_EVERY_STAGE,
    REFRESH_ONCE,
    REFRESH_REFERENCE,
    WORK,
    LpvRoles,
    LpvTables,
    auxiliary_act,
    blend,
    locate,
    rows_at,
    scheduling_alpha,
    scratch_at,
    work_size,
)
from rtsim.units import GRAVITY

__all__ = [
    "FLAG_AIRSPEED_HIGH",
    "FLAG_AIRSPEED_LOW",
    "FLAG_NACELLE",
    "FLAG_NO_TRIM",
    "FORM_LAYERED",
    "FORM_PLAIN",
    "FORM_STITCHED",
    "REFRESH_EVERY_STAGE",
    "REFRESH_ONCE",
    "REFRESH_REFERENCE",
    "WORK",
    "LpvTables",
    "lpv_derivative",
    "lpv_outputs",
    "lpv_step",
    "lpv_step_steady",
    "scheduling_alpha",
    "work_size",
]


@inner_kernel
def _apply(
    tables: LpvTables,
    x: FloatArray,
    u: FloatArray,
    xdot: FloatArray,
    reference: FloatArray,
    columns: FloatArray,
    deviation: FloatArray,
    total: FloatArray,
    of_inputs: int,
) -> None:
    """Evaluate the blended model at (x, u) with the first so many inputs.

    Views come from the caller: making them here costs as much as the sums.
    """
    add_deviations(tables, x, u, xdot, reference, columns, deviation, total, of_inputs)
    if tables.roles.form != FORM_PLAIN:
        _add_rigid_body(tables.roles, x, xdot)


@inner_kernel
def add_deviations(
    tables: LpvTables,
    x: FloatArray,
    u: FloatArray,
    xdot: FloatArray,
    reference: FloatArray,
    columns: FloatArray,
    deviation: FloatArray,
    total: FloatArray,
    of_inputs: int,
) -> None:
    """Evaluate the linear part of the blended model at (x, u) with the first so many inputs.

    Args:
        u: Total input.
        xdot: Receives the state derivative (nx,).
        reference: Blended trim state and input.
        columns: The blended columns: derivative at the trim, then those of A and B.
        deviation: Scratch.
        total: Scratch of as many values as there are rows.
        of_inputs: How many active columns of B are used.
    """
    roles = tables.roles
    states = roles.states
    rows = roles.rows
    of_states, always = roles.state_columns, roles.auxiliary_column
    for c in range(of_states):
        column = tables.state_columns[c]
        deviation[c] = x[column] - reference[column]
    for c in range(of_inputs):
        column = tables.input_columns[c]
        deviation[of_states + c] = u[column] - reference[states + column]
    # Row by row over the columns that always act: their number is known when this is compiled.
    for k in range(rows):
        row = columns[k]
        for c in range(of_states + always):
            row += columns[rows * (1 + c) + k] * deviation[c]
        total[k] = row
    for c in range(of_states + always, of_states + of_inputs):
        for k in range(rows):
            total[k] += columns[rows * (1 + c) + k] * deviation[c]
    for k in range(states):
        xdot[k] = 0.0
    for k in range(tables.rows.shape[0]):
        xdot[tables.rows[k]] = total[k]


@inner_kernel
def _add_rigid_body(roles: LpvRoles, x: FloatArray, xdot: FloatArray) -> None:
    """Add gravity, Coriolis and kinematics of the symmetric plane (body axes, z down, altitude up)."""
    u = x[roles.u]
    w = x[roles.w]
    q = x[roles.q]
    pitch = x[roles.pitch]
    sine = math.sin(pitch)
    cosine = math.cos(pitch)
    xdot[roles.u] += -GRAVITY * sine - q * w
    xdot[roles.w] += GRAVITY * cosine + q * u
    xdot[roles.pitch] += q
    xdot[roles.altitude] += u * sine - w * cosine


@inner_kernel
def acting_inputs(tables: LpvTables, u: FloatArray) -> tuple[int, int]:
    """How many active columns of B are needed, and the length of a cell up to the last of them."""
    of_inputs = tables.roles.input_columns
    block = tables.cells.shape[3]
    if not auxiliary_act(tables, u):
        needed = tables.roles.auxiliary_column
        block -= (of_inputs - needed) * tables.roles.rows
        of_inputs = needed
    return of_inputs, block


@inner_kernel
def lpv_derivative(
    tables: LpvTables, x: FloatArray, u: FloatArray, nacelle_angle: float, xdot: FloatArray, work: FloatArray
) -> None:
    """State derivative of the LPV aircraft.

    ``work[W_FLAGS]`` collects the flags (bitwise or with what stands there); the caller clears it.

    Args:
        u: Total input (nu,), nacelle rate and acceleration included.
        xdot: Receives the state derivative (nx,).
        work: Scratch of ``work_size(tables)`` values.
    """
    inputs_end = WORK.size + tables.roles.states + tables.roles.inputs
    of_inputs, block = acting_inputs(tables, u)
    sums, scratch = rows_at(tables), scratch_at(tables)
    i, j = locate(tables, x, u, nacelle_angle, work)
    blend(tables.cells, i, j, block, work, work[WORK.size : WORK.size + block])
    _apply(
        tables,
        x,
        u,
        xdot,
        work[WORK.size : inputs_end],
        work[inputs_end : WORK.size + block],
        work[scratch:],
        work[sums:scratch],
        of_inputs,
    )


@inner_kernel
def lpv_outputs(
    tables: LpvTables, x: FloatArray, u: FloatArray, nacelle_angle: float, y: FloatArray, work: FloatArray
) -> None:
    """Outputs of the LPV aircraft.

    Args:
        u: Total input (nu,), nacelle rate and acceleration included.
        y: Receives the outputs (ny,).
        work: Scratch of ``work_size(tables)`` values.
    """
    roles = tables.roles
    states = roles.states
    inputs = roles.inputs
    outputs = roles.outputs
    rows = roles.output_rows
    i, j = locate(tables, x, u, nacelle_angle, work)
    block = tables.output_cells.shape[3]
    acting = inputs if auxiliary_act(tables, u) else roles.auxiliary
    block -= (inputs - acting) * rows
    model = work[WORK.size : WORK.size + max(block, states + inputs)]
    blend(tables.cells, i, j, states + inputs, work, model)
    deviation = work[scratch_at(tables) :]
    for k in range(states):
        deviation[k] = x[k] - model[k]
    if roles.altitude >= 0:
        deviation[roles.altitude] = 0.0
    for k in range(inputs):
        deviation[states + k] = u[k] - model[states + k]
    blend(tables.output_cells, i, j, block, work, model)
    total = work[rows_at(tables) : rows_at(tables) + rows]
    always = states + roles.auxiliary
    for k in range(rows):
        row = model[k]
        for column in range(always):
            row += model[rows * (1 + column) + k] * deviation[column]
        total[k] = row
    for column in range(always, states + acting):
        for k in range(rows):
            total[k] += model[rows * (1 + column) + k] * deviation[column]
    for k in range(outputs):
        y[k] = total[k]


@inner_kernel
def lpv_step(
    tables: LpvTables, x: FloatArray, u: FloatArray, nacelle_path: FloatArray, dt: float, work: FloatArray
) -> None:
    """Advance the state by one classical Runge-Kutta step, in place.

    Stick, lever and gusts are held over the step; nacelle angle, rate and acceleration follow the path. The flags in
    ``work[W_FLAGS]`` are cleared first and then hold those of all four stages.

    Args:
        x: Total state (nx,); replaced by the state at the end of the step.
        u: Total input (nu,); its nacelle rate and acceleration are ignored, the path's are used.
        nacelle_path: Rows start, middle, end of the step; columns angle [rad], rate [rad/s], acceleration [rad/s^2].
        work: Scratch of ``work_size(tables)`` values.
    """
    roles = tables.roles
    states = roles.states
    inputs = roles.inputs
    refresh = roles.refresh
    rate = roles.nacelle_rate
    acceleration = roles.nacelle_acceleration
    of_inputs, block = acting_inputs(tables, u)
    scratch = scratch_at(tables)
    model = work[WORK.size : WORK.size + block]
    reference = work[WORK.size : WORK.size + states + inputs]
    columns = work[WORK.size + states + inputs : WORK.size + block]
    row_sums = work[rows_at(tables) : scratch]
    stage_x = work[scratch : scratch + states]
    slope = work[scratch + states : scratch + 2 * states]
    total = work[scratch + 2 * states : scratch + 3 * states]
    stage_u = work[scratch + 3 * states : scratch + 3 * states + inputs]
    deviation = work[scratch + 3 * states + inputs : scratch + 4 * states + 2 * inputs]
    for k in range(inputs):
        stage_u[k] = u[k]
    for k in range(states):
        stage_x[k] = x[k]
        total[k] = 0.0
    work[WORK.flags] = 0.0
    if refresh == REFRESH_ONCE:
        i, j = locate(tables, x, u, nacelle_path[1, 0], work)
        blend(tables.cells, i, j, block, work, model)
    for stage in range(4):
        row = (stage + 1) // 2
        if rate >= 0:
            stage_u[rate] = nacelle_path[row, 1]
        if acceleration >= 0:
            stage_u[acceleration] = nacelle_path[row, 2]
        if refresh != REFRESH_ONCE:
            i, j = locate(tables, stage_x, stage_u, nacelle_path[row, 0], work)
            whole = refresh == REFRESH_EVERY_STAGE or stage == 0
            blend(tables.cells, i, j, block if whole else states + inputs + row_sums.shape[0], work, model)
        _apply(tables, stage_x, stage_u, slope, reference, columns, deviation, row_sums, of_inputs)
        weight = 2.0 if 0 < stage < 3 else 1.0
        ahead = dt if stage == 2 else 0.5 * dt
        for k in range(states):
            total[k] += weight * slope[k]
            stage_x[k] = x[k] + ahead * slope[k]
    for k in range(states):
        x[k] += dt / 6.0 * total[k]


class Stepping(NamedTuple):
    """An LPV aircraft with the work space of its steps."""

    tables: LpvTables
    """Prepared tables."""
    work: FloatArray
    """Scratch of ``work_size(tables)`` values."""
    path: FloatArray
    """Scratch (3, 3) for the nacelle path."""


@part
def lpv_step_steady(
    stepping: Stepping,
    x: FloatArray,
    u: FloatArray,
    nacelle_angle: float,
    nacelle_rate: float,
    nacelle_acceleration: float,
    dt: float,
) -> float:
    """``lpv_step`` with constant nacelle acceleration over the step.

    Args:
        stepping: The aircraft and its work space.
        x: Total state (nx,); replaced by the state at the end of the step.
        nacelle_angle: Angle at the start of the step [rad].
        nacelle_rate: Rate at the start of the step [rad/s].
        nacelle_acceleration: Acceleration during the step [rad/s^2].

    Returns:
        The flags of the step (``FLAG_*``), 0 where all was inside the grid.
    """
    path = stepping.path
    for row in range(3):
        t = 0.5 * dt * row
        path[row, 0] = nacelle_angle + t * (nacelle_rate + 0.5 * t * nacelle_acceleration)
        path[row, 1] = nacelle_rate + t * nacelle_acceleration
        path[row, 2] = nacelle_acceleration
    lpv_step(stepping.tables, x, u, path, dt, stepping.work)
    return float(stepping.work[WORK.flags])
