"""Where the LPV aircraft is in its tables, compiled: scheduling variables, corner weights, layer shares, blending.

Legend: x total state, u total input, y output, rho = (airspeed V, nacelle angle n, angle of attack alpha). A cell is
one grid point of one layer, flattened to ``[x_ref | u_ref | xdot_ref | columns of A | columns of B]``; rows of
``xdot_ref``, ``A`` and ``B`` are the *active* ones (not zero everywhere), padded with zeros to a multiple of four, and
the columns are the active ones, stored one after the other so that each multiply-add runs down contiguous memory.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rtsim.arrays import FloatArray, IntArray
from rtsim.kernels.compiled import inner_kernel
from rtsim.kernels.grid_kernels import cell_below
from rtsim.kernels.packed import Size
from rtsim.places import Places

FORM_PLAIN = 0
"""The paper's form: linear models interpolated in airspeed and nacelle angle."""
FORM_STITCHED = 1
"""Gravity, Coriolis and kinematic terms nonlinear; aerodynamics from the level layer."""
FORM_LAYERED = 2
"""Stitched, with the aerodynamics blended between the layers by angle of attack (the default)."""

REFRESH_ONCE = 0
"""Interpolate once per step, at the state at its start and the nacelle angle at its middle."""
REFRESH_REFERENCE = 1
"""Interpolate the matrices once per step, trim state and input in each of its four stages."""
REFRESH_EVERY_STAGE = 2
"""Interpolate everything in each stage."""

FLAG_AIRSPEED_LOW = 1
"""Bit of the flags: below the slowest airspeed of the grid; the slowest is used."""
FLAG_AIRSPEED_HIGH = 2
"""Bit of the flags: above the fastest airspeed of the grid; the fastest is used."""
FLAG_NACELLE = 4
"""Bit of the flags: nacelle angle outside the grid; the nearest is used."""
FLAG_NO_TRIM = 8
"""Bit of the flags: a neighbouring grid point has no trim and was filled from the nearest airspeed that has one."""

FLAG_SIDEWARD = 16
"""Bit of the flags: sideward velocity beyond the trims in sideslip (their end is the pedal's); the last is used."""
FLAG_LOAD_FACTOR = 32
"""Bit of the flags: a turn beyond the loaded trims; the last is used."""
FLAG_BANK = 64
"""Bit of the flags: bank beyond 45 deg, further than the aircraft was compared with the nonlinear one."""

GAP_NONE = math.radians(1.0)
"""Layers whose angles of attack differ by less than this are not blended [rad]."""
GAP_FULL = math.radians(2.0)
"""From this difference on they are blended in full; between the two the blend fades in [rad]."""

MAX_LAYERS = 12
"""Layers a database can have, loaded trims included."""
WORK = Places(
    "flags",
    "alpha",
    ("corner", 4),  # weights of the cell's corners
    ("layer_share", MAX_LAYERS),
)
"""Places in the work array; the sections after the last are laid out by ``work_size``."""


class LpvRoles(NamedTuple):
    """How a database is flown: sizes and positions are constants to the compiler, the rest is read."""

    form: int
    """``FORM_*``."""
    level: int
    """The layer of level flight."""
    refresh: int
    """``REFRESH_*``."""
    u: Size
    """Positions of the rigid body in the state; -1 where there is none."""
    w: Size
    q: Size
    pitch: Size
    altitude: Size
    nacelle_rate: Size
    """Positions among the inputs; -1 where there is none."""
    nacelle_acceleration: Size
    gust_u: Size
    gust_w: Size
    states: Size
    """How many there are."""
    inputs: Size
    outputs: Size
    rows: Size
    """Active rows and rows of the outputs, padded."""
    output_rows: Size
    state_columns: Size
    """Active columns of A and of B."""
    input_columns: Size
    auxiliary: Size
    """The first of the last inputs, which are zero in most frames; the number of inputs where there are none."""
    auxiliary_column: Size
    """The same, counted in active columns of B."""


class LpvTables(NamedTuple):
    """A database prepared for the kernels by ``rtsim.lpv.tables.prepare_tables``; read-only."""

    airspeed: FloatArray
    """Airspeed axis (V,) [m/s], ascending."""
    nacelle: FloatArray
    """Nacelle axis (N,) [rad], ascending."""
    alpha: FloatArray
    """Scheduling angle of attack of each trim (V, N, L) [rad]."""
    valid: FloatArray
    """1.0 where the level layer has a trim, 0.0 where it was filled (V, N)."""
    cells: FloatArray
    """Dynamics of each cell (V, N, L, block), see the module's legend."""
    output_cells: FloatArray
    """Outputs of each cell (V, N, L, block): ``[y_ref | columns of C | columns of D]``, rows padded."""
    rows: IntArray
    """State number of each active row."""
    state_columns: IntArray
    """State number of each active column of A."""
    input_columns: IntArray
    """Input number of each active column of B."""
    alpha_speed: float
    """V0 of the scheduling angle of attack [m/s]: keeps it defined in hover."""
    roles: LpvRoles
    """Form, sizes and positions of the variables that have a meaning here."""


@inner_kernel
def rows_at(tables: LpvTables) -> int:
    """Where the row sums stand in the work array; the scratch vectors follow at ``scratch_at``.

    Returns:
        The position.
    """
    return int(WORK.size + max(tables.cells.shape[3], tables.output_cells.shape[3]))


@inner_kernel
def scratch_at(tables: LpvTables) -> int:
    """Where the scratch vectors stand in the work array.

    Returns:
        The position.
    """
    return int(rows_at(tables) + max(tables.roles.rows, tables.roles.output_rows))


@inner_kernel
def work_size(tables: LpvTables) -> int:
    """Give the length of the work array that the kernels need.

    Returns:
        The number of float64 values.
    """
    return int(scratch_at(tables) + 4 * tables.roles.states + 2 * tables.roles.inputs)


@inner_kernel
def auxiliary_act(tables: LpvTables, u: FloatArray) -> bool:
    """Tell whether any of the inputs acts that are zero in most frames; where none does, their columns are left out."""
    act = False
    for k in range(tables.roles.auxiliary, tables.roles.inputs):
        act = act or u[k] != 0.0
    return act


@inner_kernel
def _smoothstep(s: float) -> float:
    if s <= 0.0:
        return 0.0
    if s >= 1.0:
        return 1.0
    return s * s * (3.0 - 2.0 * s)


@inner_kernel
def _layer_step(alpha: float, here: float, beyond: float) -> float:
    """How far the angle of attack has gone from one layer towards the next, smoothed, in [0, 1]."""
    gap = beyond - here
    size = abs(gap)
    if size < GAP_NONE:
        return 0.0
    fade = _smoothstep((size - GAP_NONE) / (GAP_FULL - GAP_NONE))
    return fade * _smoothstep((alpha - here) / gap)


@inner_kernel
def scheduling_alpha(u: float, w: float, sine: float, cosine: float, speed: float) -> float:
    """Angle of attack as used for scheduling: with a headwind of V0 added, so that it is defined in hover.

    In rearward flight the headwind grows by the rearward speed; the angle then stays continuous at -V0, where it would
    otherwise turn by half a circle.

    Args:
        u: Air-relative velocity along body x [m/s].
        w: Air-relative velocity along body z [m/s].
        sine: Sine of the pitch attitude.
        cosine: Cosine of the pitch attitude.
        speed: V0 [m/s].

    Returns:
        The angle [rad]; the pitch attitude in any level flight.
    """
    headwind = speed + max(0.0, -(u * cosine + w * sine))
    return math.atan2(w + headwind * sine, u + headwind * cosine)


@inner_kernel
def locate(
    tables: LpvTables, x: FloatArray, inputs: FloatArray, nacelle_angle: float, work: FloatArray
) -> tuple[int, int]:
    """Find the cell of the present state: corner weights, layer shares and flags into ``work``.

    The forms whose aerodynamics stand alone are scheduled by the motion through the air, gusts included: the tail's
    tables are curved, and a gust of 3 m/s at 40 kn would otherwise pitch the aircraft by 2 deg too much.

    Args:
        inputs: Total input (nu,); its gusts count, where the form knows them.
        work: Scratch of ``work_size(tables)`` values.

    Returns:
        Numbers of the airspeed and nacelle intervals.
    """
    roles = tables.roles
    u = x[roles.u]
    w = x[roles.w]
    if roles.gust_u >= 0:
        u += inputs[roles.gust_u]
    if roles.gust_w >= 0:
        w += inputs[roles.gust_w]
    pitch = x[roles.pitch]
    sine = math.sin(pitch)
    cosine = math.cos(pitch)
    i, j = weigh_corners(tables, u * cosine + w * sine, nacelle_angle, work)
    alpha = scheduling_alpha(u, w, sine, cosine, tables.alpha_speed)
    share_layers(tables, i, j, alpha, work)
    return i, j


@inner_kernel
def weigh_corners(tables: LpvTables, airspeed: float, nacelle_angle: float, work: FloatArray) -> tuple[int, int]:
    """Find the cell of an airspeed and a nacelle angle: corner weights and flags into ``work``.

    Args:
        airspeed: Forward airspeed [m/s].
        work: Scratch of ``work_size(tables)`` values.

    Returns:
        Numbers of the airspeed and nacelle intervals.
    """
    flags = int(work[WORK.flags])
    last_v = tables.airspeed.shape[0] - 1
    last_n = tables.nacelle.shape[0] - 1
    i = cell_below(tables.airspeed, airspeed)
    j = cell_below(tables.nacelle, nacelle_angle)
    s = (airspeed - tables.airspeed[i]) / (tables.airspeed[i + 1] - tables.airspeed[i])
    t = (nacelle_angle - tables.nacelle[j]) / (tables.nacelle[j + 1] - tables.nacelle[j])
    # 1e-9 of a cell: rounding of an angle on the stop is not an excursion
    if i == 0 and s < -1e-9:
        flags |= FLAG_AIRSPEED_LOW
    if i == last_v - 1 and s > 1.0 + 1e-9:
        flags |= FLAG_AIRSPEED_HIGH
    if (j == 0 and t < -1e-9) or (j == last_n - 1 and t > 1.0 + 1e-9):
        flags |= FLAG_NACELLE
    s = min(1.0, max(0.0, s))
    t = min(1.0, max(0.0, t))
    w00 = (1.0 - s) * (1.0 - t)
    w01 = (1.0 - s) * t
    w10 = s * (1.0 - t)
    w11 = s * t
    work[WORK.corner] = w00
    work[WORK.corner + 1] = w01
    work[WORK.corner + 2] = w10
    work[WORK.corner + 3] = w11
    covered = (
        w00 * tables.valid[i, j]
        + w01 * tables.valid[i, j + 1]
        + w10 * tables.valid[i + 1, j]
        + w11 * tables.valid[i + 1, j + 1]
    )
    if covered < 1.0 - 1e-9:
        flags |= FLAG_NO_TRIM
    work[WORK.flags] = flags
    return i, j


@inner_kernel
def share_layers(tables: LpvTables, i: int, j: int, alpha: float, work: FloatArray) -> None:
    """Share the model out between the layers by angle of attack, into ``work``; loaded trims get nothing.

    Args:
        i: Number of the airspeed interval.
        j: Number of the nacelle interval.
        alpha: Angle of attack as used for scheduling [rad].
        work: Holds the corners' weights.
    """
    layers = tables.alpha.shape[2]
    level = tables.roles.level
    for layer in range(tables.cells.shape[2]):
        work[WORK.layer_share + layer] = 0.0
    if layers == 1:
        work[WORK.layer_share] = 1.0
        return
    work[WORK.alpha] = alpha
    # Walk outwards from the level layer. `gone` is the share that has left the layer before; the decelerating side
    # gets its part of what the accelerating side left, so that the shares always add up to one.
    rest = 1.0
    for side in range(2):
        direction = 1 - 2 * side
        gone = rest
        layer = level
        here = _corner_alpha(tables, i, j, layer, work)
        while 0 <= layer + direction < layers:
            beyond = _corner_alpha(tables, i, j, layer + direction, work)
            further = gone * _layer_step(alpha, here, beyond)
            if layer == level:
                rest -= further
            else:
                work[WORK.layer_share + layer] = gone - further
            layer += direction
            gone = further
            here = beyond
        if layer != level:
            work[WORK.layer_share + layer] = gone
    work[WORK.layer_share + level] = rest


@inner_kernel
def _corner_alpha(tables: LpvTables, i: int, j: int, layer: int, work: FloatArray) -> float:
    return float(
        work[WORK.corner] * tables.alpha[i, j, layer]
        + work[WORK.corner + 1] * tables.alpha[i, j + 1, layer]
        + work[WORK.corner + 2] * tables.alpha[i + 1, j, layer]
        + work[WORK.corner + 3] * tables.alpha[i + 1, j + 1, layer]
    )


@inner_kernel
def blend(cells: FloatArray, i: int, j: int, count: int, work: FloatArray, target: FloatArray) -> None:
    """Interpolate the first entries of the cells around (i, j).

    Args:
        cells: Cells (V, N, L, block).
        i: Number of the airspeed interval.
        j: Number of the nacelle interval.
        count: How many entries.
        work: Holds the weights that ``locate`` found.
        target: Receives the entries.
    """
    blend_by(cells, i, j, count, work, work[WORK.layer_share :], target)


@inner_kernel
def blend_by(
    cells: FloatArray, i: int, j: int, count: int, work: FloatArray, shares: FloatArray, target: FloatArray
) -> None:
    """Interpolate with other shares of the layers than ``locate`` found.

    Args:
        cells: Cells (V, N, L, block).
        i: Number of the airspeed interval.
        j: Number of the nacelle interval.
        count: How many entries.
        work: Holds the corners' weights.
        shares: Share of each layer.
        target: Receives the entries.
    """
    fresh = True
    for layer in range(cells.shape[2]):
        share = shares[layer]
        if share == 0.0:
            continue
        w0 = share * work[WORK.corner]
        w1 = share * work[WORK.corner + 1]
        w2 = share * work[WORK.corner + 2]
        w3 = share * work[WORK.corner + 3]
        c0 = cells[i, j, layer]
        c1 = cells[i, j + 1, layer]
        c2 = cells[i + 1, j, layer]
        c3 = cells[i + 1, j + 1, layer]
        if fresh:
            for k in range(count):
                target[k] = w0 * c0[k] + w1 * c1[k] + w2 * c2[k] + w3 * c3[k]
            fresh = False
        else:
            for k in range(count):
                target[k] += w0 * c0[k] + w1 * c1[k] + w2 * c2[k] + w3 * c3[k]
