"""The LPV aircraft in six degrees of freedom, compiled: one Runge-Kutta step, and the outputs.

The symmetric and the lateral block of the linear model are evaluated side by side, about references that move with
load factor and sideward velocity; gravity, Coriolis, gyroscopic and kinematic terms are those of a rigid body. Where
nothing moves or acts sideways the step is that of the symmetric aircraft, to the last bit.

Legend:
    tables: The aircraft (``sideways_tables``).
    x: State, order of ``variables.ALL_STATES``.
    u: Inputs, order of ``variables.ALL_INPUTS``.
    work: Scratch of ``sideways_work_size(tables)`` values.
"""

from __future__ import annotations

import math

from rtsim.aircraft.motion_kernels import (
    Quaternion,
    advanced,
    down_of,
    euler_of,
    moves_sideways,
    quaternion_of,
    quaternion_rate,
)
from rtsim.aircraft.variables import (
    INPUT,
    INPUTS,
    LATERAL_INPUTS,
    LATERAL_OUTPUTS,
    LATERAL_STATES,
    OUTPUTS,
    STATE,
    STATES,
)
from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import inner_kernel
from rtsim.lpv.lpv_kernels import acting_inputs, add_deviations, lpv_outputs, lpv_step
from rtsim.lpv.schedule_kernels import (
    FLAG_BANK,
    FLAG_LOAD_FACTOR,
    FLAG_SIDEWARD,
    MAX_LAYERS,
    WORK,
    auxiliary_act,
    blend,
    blend_by,
    rows_at,
    scratch_at,
    share_layers,
    weigh_corners,
    work_size,
)
from rtsim.lpv.sideways_tables import SidewaysTables
from rtsim.places import Places
from rtsim.units import DEGREE, GRAVITY

NX, NU, NY = len(STATES), len(INPUTS), len(OUTPUTS)
LX, LU, LY = len(LATERAL_STATES), len(LATERAL_INPUTS), len(LATERAL_OUTPUTS)
WHOLE = NX + LX
LARGEST_BANK = 45.0 * DEGREE
SCHEDULE = Places(
    ("share", MAX_LAYERS),  # of the lateral blocks
    "node",  # trim in sideslip below the sideward velocity; -1: level flight
    "lower",  # its weight
    "upper",  # weight of the one above
    "side",  # 1 to the right, -1 to the left
    ("inertia", 4),
)
"""Where a step is in the lateral tables."""


@inner_kernel
def sideways_work_size(tables: SidewaysTables) -> int:
    """Length of the work array.

    Returns:
        The number of float64 values.
    """
    block = max(tables.cells.shape[3], tables.output_cells.shape[3])
    return int(
        work_size(tables.symmetric)
        + SCHEDULE.size
        + block
        + tables.slip.shape[3]
        + 16
        + 4 * (WHOLE + NU + LU)
        + 2 * WHOLE
    )


@inner_kernel
def turning_load_factor(x: FloatArray, down: tuple[float, float, float]) -> float:
    """Load factor of the turn that is flown: 1 as long as the wings are level, whatever the pitch rate is.

    Pulling up is what the layers of accelerated trims follow, in the symmetric aircraft too; here the pitch rate counts
    as far as it belongs to a turn about the vertical.

    Args:
        x: State.
        down: Direction of gravity in body axes.
    """
    gx, gy, gz = down
    p, r = x[STATE.p], x[STATE.r]
    across = max(gy * gy + gz * gz, 1e-9)
    q = (x[STATE.q] * gy + r * gz) * gy / across
    ahead = q * x[STATE.w] - r * x[STATE.v] - GRAVITY * gx
    below = GRAVITY * gz + q * x[STATE.u] - p * x[STATE.v]
    return math.sqrt(ahead * ahead + below * below) / GRAVITY


@inner_kernel
def _interval(nodes: FloatArray, value: float) -> tuple[int, float]:
    """The node below a value (-1: below the first), and the weight of the one above; held beyond the last."""
    last = nodes.shape[0] - 1
    if value >= nodes[last]:
        return last - 1, 1.0
    below = -1
    while below < last and value >= nodes[below + 1]:
        below += 1
    start = 0.0 if below < 0 else nodes[below]
    return below, (value - start) / (nodes[below + 1] - start)


@inner_kernel
def _at_corners(table: FloatArray, i: int, j: int, k: int, work: FloatArray) -> float:
    return float(
        work[WORK.corner] * table[i, j, k]
        + work[WORK.corner + 1] * table[i, j + 1, k]
        + work[WORK.corner + 2] * table[i + 1, j, k]
        + work[WORK.corner + 3] * table[i + 1, j + 1, k]
    )


@inner_kernel
def _schedule(
    tables: SidewaysTables,
    x: FloatArray,
    u: FloatArray,
    attitude: Quaternion,
    nacelle: float,
    work: FloatArray,
    place: FloatArray,
) -> tuple[int, int]:
    """Find where the aircraft is in all its tables: the symmetric part into ``work``, the rest into ``place``."""
    symmetric = tables.symmetric
    down = down_of(attitude)
    gx, gy, gz = down
    ct = math.sqrt(max(1.0 - gx * gx, 1e-9))
    ua, va, wa = x[STATE.u] + u[INPUT.gust_u], x[STATE.v] + u[INPUT.gust_v], x[STATE.w] + u[INPUT.gust_w]
    ahead = ua * ct - (va * gy + wa * gz) * gx / ct
    i, j = weigh_corners(symmetric, ahead, nacelle, work)
    flags = int(work[WORK.flags])
    if abs(x[STATE.bank]) > LARGEST_BANK:
        flags |= FLAG_BANK
    headwind = symmetric.alpha_speed + max(0.0, -ahead)
    alpha = math.atan2(wa - headwind * gx * gz / ct, ua + headwind * ct)

    # Load factor: two neighbouring loaded trims, level flight before the first.
    loads = tables.load_factor.shape[0]
    for k in range(loads + 1):
        place[SCHEDULE.share + k] = 0.0
    excess = max(turning_load_factor(x, down) - 1.0, 0.0)
    first = tables.load_factor[0] - 1.0
    if excess > 0.0:
        below, above = 0, min(excess / first, 1.0)
        if excess > first:
            below = 1
            while below < loads - 1 and excess > tables.load_factor[below] - 1.0:
                below += 1
            width = tables.load_factor[below] - tables.load_factor[below - 1]
            above = min((excess + 1.0 - tables.load_factor[below - 1]) / width, 1.0)
        place[SCHEDULE.share + below + 1] = above
        place[SCHEDULE.share + below] = 1.0 - above
        if (
            excess > tables.load_factor[loads - 1] - 1.0 + 1e-9
            or _at_corners(tables.load_valid, i, j, below, work) < 0.5
        ):
            flags |= FLAG_LOAD_FACTOR
    else:
        place[SCHEDULE.share] = 1.0
    for k in range(loads):
        share = place[SCHEDULE.share + k + 1]
        if share != 0.0:
            alpha -= share * _at_corners(tables.load_alpha, i, j, k, work)

    # Sideward velocity: two neighbouring trims in sideslip.
    size = abs(va)
    node, upper = _interval(tables.velocity, size)
    place[SCHEDULE.node], place[SCHEDULE.upper] = float(node), upper
    place[SCHEDULE.lower] = 0.0 if node < 0 else 1.0 - upper
    place[SCHEDULE.side] = 1.0 if va >= 0.0 else -1.0
    if size > tables.velocity[-1] or (upper > 0.0 and _at_corners(tables.slip_valid, i, j, node + 1, work) < 0.5):
        flags |= FLAG_SIDEWARD
    alpha -= upper * _at_corners(tables.slip_alpha, i, j, node + 1, work)
    if node >= 0:
        alpha -= (1.0 - upper) * _at_corners(tables.slip_alpha, i, j, node, work)
    work[WORK.flags] = flags
    share_layers(symmetric, i, j, alpha, work)
    layers, level = symmetric.alpha.shape[2], symmetric.roles.level
    work[WORK.layer_share + level] -= 1.0 - place[SCHEDULE.share]
    for k in range(loads):
        work[WORK.layer_share + layers + k] = place[SCHEDULE.share + k + 1]
    weight = work[WORK.corner + 1] + work[WORK.corner + 3]
    for k in range(4):
        place[SCHEDULE.inertia + k] = (1.0 - weight) * tables.inertia[j, k] + weight * tables.inertia[j + 1, k]
    return i, j


@inner_kernel
def _add_slip(
    table: FloatArray, i: int, j: int, place: FloatArray, work: FloatArray, target: FloatArray, count: int
) -> None:
    """Interpolate what trims in sideslip change."""
    node, lower, upper = int(place[SCHEDULE.node]), place[SCHEDULE.lower], place[SCHEDULE.upper]
    for k in range(count):
        target[k] = 0.0
    for end in range(2):
        weight = lower if end == 0 else upper
        if weight == 0.0:
            continue
        at = node + end
        w0, w1 = weight * work[WORK.corner], weight * work[WORK.corner + 1]
        w2, w3 = weight * work[WORK.corner + 2], weight * work[WORK.corner + 3]
        c0, c1, c2, c3 = table[i, j, at], table[i, j + 1, at], table[i + 1, j, at], table[i + 1, j + 1, at]
        for k in range(count):
            target[k] += w0 * c0[k] + w1 * c1[k] + w2 * c2[k] + w3 * c3[k]


@inner_kernel
def _add_lateral(
    tables: SidewaysTables,
    x: FloatArray,
    u: FloatArray,
    slope: FloatArray,
    reference: FloatArray,
    columns: FloatArray,
    deviation: FloatArray,
    total: FloatArray,
    side: float,
    of_inputs: int,
) -> None:
    """Evaluate the lateral block: rates of the lateral states into ``slope``.

    Args:
        reference: Lateral states, inputs and specific rates of the trim in sideslip to the right.
        columns: The blended block.
        side: 1 to the right, -1 to the left.
        of_inputs: How many active columns of B are used.
    """
    roles = tables.roles
    rows, of_states = roles.rows, roles.state_columns
    for c in range(of_states):
        column = tables.state_columns[c]
        deviation[c] = x[NX + column] - side * reference[column]
    for c in range(of_inputs):
        column = tables.input_columns[c]
        deviation[of_states + c] = u[NU + column] - side * reference[LX + column]
    # Row by row over the columns that always act: their number is known when this is compiled.
    always = of_states + roles.pilot_columns
    for k in range(rows):
        row = side * reference[LX + LU + k]
        for c in range(always):
            row += columns[rows * c + k] * deviation[c]
        total[k] = row
    for c in range(always, of_states + of_inputs):
        for k in range(rows):
            total[k] += columns[rows * c + k] * deviation[c]
    for k in range(LX):
        slope[NX + k] = 0.0
    for k in range(tables.rows.shape[0]):
        slope[NX + tables.rows[k]] = total[k]


@inner_kernel
def _acting_inputs(tables: SidewaysTables, u: FloatArray) -> int:
    """How many of the lateral inputs are needed: gusts and the ground, which stand last, often do nothing."""
    for k in range(INPUT.gust_v, INPUT.contact_yaw + 1):
        if u[k] != 0.0:
            return int(tables.roles.input_columns)
    return int(tables.roles.pilot_columns)


@inner_kernel
def _add_rigid_body(x: FloatArray, e: Quaternion, inertia: FloatArray, slope: FloatArray) -> None:
    """Add gravity, Coriolis and gyroscopic terms, and the altitude's rate; the attitude moves by its quaternion."""
    gx, gy, gz = down_of(e)
    u, v, w = x[STATE.u], x[STATE.v], x[STATE.w]
    p, q, r = x[STATE.p], x[STATE.q], x[STATE.r]
    xx, yy, zz, xz = inertia[0], inertia[1], inertia[2], inertia[3]
    slope[STATE.u] += GRAVITY * gx - q * w + r * v
    slope[STATE.v] += GRAVITY * gy - r * u + p * w
    slope[STATE.w] += GRAVITY * gz + q * u - p * v
    slope[STATE.altitude] -= gx * u + gy * v + gz * w
    roll = (yy - zz) * q * r + xz * p * q
    yaw = (xx - yy) * p * q - xz * q * r
    both = xx * zz - xz * xz
    slope[STATE.p] += (zz * roll + xz * yaw) / both
    slope[STATE.r] += (xz * roll + xx * yaw) / both
    slope[STATE.q] -= ((xx - zz) * p * r + xz * (p * p - r * r)) / yy


@inner_kernel
def sideways_step(
    tables: SidewaysTables, x: FloatArray, u: FloatArray, nacelle_path: FloatArray, dt: float, work: FloatArray
) -> None:
    """Advance the state by one classical Runge-Kutta step, in place; where it is over the ground is the caller's.

    Args:
        nacelle_path: Rows start, middle, end of the step; columns angle [rad], rate [rad/s], acceleration [rad/s^2].
    """
    symmetric = tables.symmetric
    if not moves_sideways(x, u):
        lpv_step(symmetric, x, u, nacelle_path, dt, work)
        return
    rows = symmetric.roles.rows
    of_inputs, block = acting_inputs(symmetric, u)
    scratch = scratch_at(symmetric)
    model = work[WORK.size : WORK.size + block]
    reference = work[WORK.size : WORK.size + NX + NU]
    columns = work[WORK.size + NX + NU : WORK.size + block]
    row_sums = work[rows_at(symmetric) : scratch]
    at = work_size(symmetric)
    place = work[at : at + SCHEDULE.size]
    at += SCHEDULE.size
    acting = _acting_inputs(tables, u)
    count = tables.roles.rows * (tables.roles.state_columns + acting)
    lateral = work[at : at + count]
    at += max(tables.cells.shape[3], tables.output_cells.shape[3])
    slip = work[at : at + tables.slip.shape[3]]
    lateral_reference = slip[NX + NU + rows :]
    at += tables.slip.shape[3]
    lateral_sums = work[at : at + tables.roles.rows]
    at += tables.roles.rows
    deviation = work[at : at + WHOLE + NU + LU]
    at += WHOLE + NU + LU
    stage_u = work[at : at + NU + LU]
    at += NU + LU
    stage_x = work[at : at + WHOLE]
    slope = work[at + WHOLE : at + 2 * WHOLE]
    total = work[at + 2 * WHOLE : at + 3 * WHOLE]

    work[WORK.flags] = 0.0
    heading = x[STATE.heading]
    start = quaternion_of(x[STATE.bank], x[STATE.pitch], heading)
    i, j = _schedule(tables, x, u, start, nacelle_path[1, 0], work, place)
    blend(symmetric.cells, i, j, block, work, model)
    _add_slip(tables.slip, i, j, place, work, slip, slip.shape[0])
    for k in range(NX + NU + rows):
        model[k] += slip[k]
    blend_by(tables.cells, i, j, count, work, place[SCHEDULE.share :], lateral)
    side = place[SCHEDULE.side]
    for k in range(NU + LU):
        stage_u[k] = u[k]
    for k in range(WHOLE):
        stage_x[k] = x[k]
        total[k] = 0.0
    attitude, sums = start, start
    for stage in range(4):
        row = (stage + 1) // 2
        stage_u[INPUT.nacelle_rate] = nacelle_path[row, 1]
        stage_u[INPUT.nacelle_acceleration] = nacelle_path[row, 2]
        add_deviations(symmetric, stage_x, stage_u, slope, reference, columns, deviation, row_sums, of_inputs)
        _add_lateral(tables, stage_x, stage_u, slope, lateral_reference, lateral, deviation, lateral_sums, side, acting)
        _add_rigid_body(stage_x, attitude, place[SCHEDULE.inertia :], slope)
        rate = quaternion_rate(attitude, stage_x[STATE.p], stage_x[STATE.q], stage_x[STATE.r])
        weight = 2.0 if 0 < stage < 3 else 1.0
        ahead = dt if stage == 2 else 0.5 * dt
        attitude = advanced(start, rate, ahead)
        sums = advanced(sums, rate, dt / 6.0 * weight)
        for k in range(WHOLE):
            total[k] += weight * slope[k]
            stage_x[k] = x[k] + ahead * slope[k]
    for k in range(WHOLE):
        x[k] += dt / 6.0 * total[k]
    x[STATE.bank], x[STATE.pitch], x[STATE.heading] = euler_of(sums, heading)


@inner_kernel
def sideways_outputs(
    tables: SidewaysTables, x: FloatArray, u: FloatArray, nacelle_angle: float, y: FloatArray, work: FloatArray
) -> None:
    """Outputs.

    Args:
        y: Receives the outputs, order of ``variables.ALL_OUTPUTS``.
    """
    symmetric = tables.symmetric
    if not moves_sideways(x, u):
        lpv_outputs(symmetric, x, u, nacelle_angle, y, work)
        for k in range(LY):
            y[NY + k] = 0.0
        return
    roles = symmetric.roles
    rows = roles.output_rows
    at = work_size(symmetric)
    place = work[at : at + SCHEDULE.size]
    at += SCHEDULE.size
    count = tables.output_cells.shape[3]
    lateral = work[at : at + count]
    at += max(count, tables.cells.shape[3])
    slip = work[at : at + tables.slip.shape[3]]
    attitude = quaternion_of(x[STATE.bank], x[STATE.pitch], 0.0)
    i, j = _schedule(tables, x, u, attitude, nacelle_angle, work, place)
    acting = roles.inputs if auxiliary_act(symmetric, u) else roles.auxiliary
    block = symmetric.output_cells.shape[3] - (roles.inputs - acting) * rows
    model = work[WORK.size : WORK.size + max(block, NX + NU)]
    blend(symmetric.cells, i, j, NX + NU, work, model)
    _add_slip(tables.slip, i, j, place, work, slip, slip.shape[0])
    lateral_reference = slip[NX + NU + roles.rows :]
    deviation = work[scratch_at(symmetric) :]
    for k in range(NX):
        deviation[k] = x[k] - model[k] - slip[k]
    deviation[STATE.altitude] = 0.0
    for k in range(NU):
        deviation[NX + k] = u[k] - model[NX + k] - slip[NX + k]
    blend(symmetric.output_cells, i, j, block, work, model)
    for k in range(NY):
        row = model[k]
        for column in range(NX + acting):
            row += model[rows * (1 + column) + k] * deviation[column]
        y[k] = row
    side = place[SCHEDULE.side]
    blend_by(tables.output_cells, i, j, count, work, place[SCHEDULE.share :], lateral)
    for k in range(LY):
        row = 0.0
        for column in range(LX):
            row += lateral[tables.roles.output_rows * column + k] * (x[NX + column] - side * lateral_reference[column])
        for column in range(LU):
            moved = u[NU + column] - side * lateral_reference[LX + column]
            row += lateral[tables.roles.output_rows * (LX + column) + k] * moved
        y[NY + k] = row
    _add_slip(tables.slip_outputs, i, j, place, work, slip, NY + LY)
    for k in range(NY):
        y[k] += slip[k]
    for k in range(LY):
        y[NY + k] += side * slip[NY + k]
