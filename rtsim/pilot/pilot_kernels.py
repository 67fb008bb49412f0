"""The scheduled pilot on line: one frame of the MOCM, compiled.

One frame is two calls, so that protection can sit between them: ``mocm_output`` gives stick and lever for the frame that
starts, ``mocm_advance`` then moves the pilot to the next frame, knowing the controls that were really applied.

``reference`` is what the pilot is asked for: ``[airspeed, airspeed rate, altitude, climb rate, nacelle command rate]``
(m/s, m/s^2, m, m/s, rad/s). Trim and feed-forward follow the *commanded* airspeed, acceleration and the nacelle angle.

Legend (docs/pilot.md): x_hat = [plant | delay | hands] estimated deviations from the moving trim; u_p hands before the
delay; x_d true delay filter; z integrals of airspeed and altitude error; A B C l G2 F as in the design; e applied minus
demanded controls. Everything is summed in a fixed order; no library routine is called.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

REF_AIRSPEED = 0
"""Position in ``reference``: filtered airspeed asked for [m/s]."""
REF_AIRSPEED_RATE = 1
"""Position in ``reference``: its rate [m/s^2]."""
REF_ALTITUDE = 2
"""Position in ``reference``: altitude asked for [m]."""
REF_CLIMB = 3
"""Position in ``reference``: its rate [m/s]."""
REF_NACELLE_RATE = 4
"""Position in ``reference``: nacelle rate commanded for the frame [rad/s]; the pilot's third channel, not used here."""
REFERENCE_SIZE = 5
"""Length of ``reference``."""

LOOP_INTEGRATORS = 0
"""Airspeed and altitude held by integrators inside the design (default)."""
LOOP_PI = 1
"""Airspeed and altitude held by outer PI loops that move the state reference (the paper's structure)."""

# positions in PilotTables.roles
R_LOOP = 0
R_PLANT = 1
R_DELAY = 2
R_HANDS = 3
R_DISPLAYS = 4
R_U = 5
R_W = 6
R_Q = 7
R_PITCH = 8
R_ALTITUDE = 9
R_A = 10
R_B = 11
R_N = 12
R_C = 13
R_F = 14
R_L = 15
R_G = 16
R_V = 17
R_END = 18
R_COUNT = 19

# positions in PilotTables.numbers
N_GUST_LEAST = 0
N_FILTER = 1
N_ACCELERATION_LIMIT = 2
N_CLIMB_SPEED = 3
N_KP_V = 4
N_KI_V = 5
N_KP_H = 6
N_KI_H = 7
N_Z_V = 8
N_Z_H = 9
N_DT = 10
N_COUNT = 11

SAME_CONTROL = 1e-9
"""Applied and demanded controls closer than this are the same (rounding must not freeze the integrals)."""
CAPTURE_FREQUENCY = 0.4
"""After taking over, the pilot leads its own reference from where the aircraft is to what is asked, at this rate [rad/s]."""
CAPTURE_AIRSPEED_RATE = 1.5
"""Fastest capture of an airspeed [m/s^2]."""
CAPTURE_CLIMB = 4.0
"""Fastest capture of an altitude [m/s]."""
CAPTURE_AIRSPEED_JERK = 1.5
"""Largest rate of change of the capture's acceleration [m/s^3]."""
CAPTURE_CLIMB_RATE = 4.0
"""Largest vertical acceleration of the capture [m/s^2]."""
LARGEST_AIRSPEED_ERROR = 10.0
"""Farther from its reference the pilot gives the reference up and captures it again [m/s]."""
LARGEST_ALTITUDE_ERROR = 20.0
"""The same for altitude [m]."""
OFFSETS = 4
"""Distance of the pilot's own reference from what is asked: airspeed, its rate, altitude, climb rate."""
INTEGRALS = 2
"""Airspeed and altitude are integrated."""
S_FILTERED = 0
"""Position in the state: filtered airspeed that schedules the gains [m/s]."""
S_LIMITED = 1
"""Position in the state: 1 while a hand was limited or overruled in the last frame."""
S_ESTIMATE = 2
"""Position in the state of the estimate; hands, delay filter, integrals and last reference follow."""


class PilotTables(NamedTuple):
    """A scheduled pilot prepared by ``rtsim.pilot.tables.load_pilot_tables``; read-only."""

    airspeed: FloatArray
    """Airspeed axis (V,) [m/s]."""
    nacelle: FloatArray
    """Nacelle axis (N,) [rad]."""
    trim: FloatArray
    """[pitch, hands] of the level trim; coefficients of acceleration, of its square; slopes with airspeed (V, N, ...)."""
    cells: FloatArray
    """Design plant and gains of each grid point, flattened by columns (V, N, block)."""
    a_columns: IntArray
    """Plant states with a column in A."""
    c_columns: IntArray
    """Plant states with a column in C."""
    lags: IntArray
    """Plant state that is the actuator lag of each hand; -1 where there is none (nu,)."""
    model_delay_a: FloatArray
    """Dynamics of the internal model's delay filter (nd, nd)."""
    delay_b: FloatArray
    """Input of the delay filters (nd, nu)."""
    model_delay_c: FloatArray
    """Output of the internal model's delay filter (nu, nd)."""
    delay_d: FloatArray
    """Feed-through of the delay filters (nu,)."""
    output_delay_a: FloatArray
    """Dynamics of the true delay filter, shorter by one frame (nd, nd)."""
    output_delay_c: FloatArray
    """Output of the true delay filter (nu, nd)."""
    limits: FloatArray
    """Rows: least, greatest, fastest [1/s]; columns: hands (3, nu)."""
    numbers: FloatArray
    """Scalars (``N_*``)."""
    roles: IntArray
    """Loop, sizes, positions of aircraft states and of the sections of a cell (``R_*``)."""


@njit(cache=True, error_model="numpy")
def pad4(count: int) -> int:
    """Round up to a multiple of four, the width of a vector register.

    Args:
        count: A number of rows.

    Returns:
        The padded number.
    """
    return 4 * ((count + 3) // 4)


@njit(cache=True, error_model="numpy")
def pilot_state_size(tables: PilotTables) -> int:
    """Length of the pilot's state array.

    Args:
        tables: Prepared pilot.

    Returns:
        The number of float64 values.
    """
    roles = tables.roles
    estimate = roles[R_PLANT] + roles[R_DELAY] + roles[R_HANDS]
    return S_ESTIMATE + estimate + roles[R_HANDS] + roles[R_DELAY] + INTEGRALS + roles[R_PLANT] + OFFSETS


@njit(cache=True, error_model="numpy")
def noise_width(tables: PilotTables) -> int:
    """Standard normals the pilot takes per frame when its noise is on: one per display and hand.

    Args:
        tables: Prepared pilot.

    Returns:
        The number.
    """
    return tables.roles[R_DISPLAYS] + tables.roles[R_HANDS]


@njit(cache=True, error_model="numpy")
def _clip(value: float, limit: float) -> float:
    return min(limit, max(-limit, value))


@njit(cache=True, error_model="numpy")
def _cell_below(axis: FloatArray, value: float) -> int:
    low = 0
    high = axis.shape[0] - 1
    while high - low > 1:
        middle = (low + high) >> 1
        if axis[middle] <= value:
            low = middle
        else:
            high = middle
    return low


@njit(cache=True, error_model="numpy")
def _interpolate(
    tables: PilotTables, cells: FloatArray, where: tuple[float, float], bounds: tuple[int, int], out: FloatArray
) -> None:
    """Interpolate entries of the cells around (airspeed, nacelle), clamped to the grid, into ``out``."""
    i = _cell_below(tables.airspeed, where[0])
    j = _cell_below(tables.nacelle, where[1])
    s = (where[0] - tables.airspeed[i]) / (tables.airspeed[i + 1] - tables.airspeed[i])
    t = (where[1] - tables.nacelle[j]) / (tables.nacelle[j + 1] - tables.nacelle[j])
    s = min(1.0, max(0.0, s))
    t = min(1.0, max(0.0, t))
    w0 = (1.0 - s) * (1.0 - t)
    w1 = (1.0 - s) * t
    w2 = s * (1.0 - t)
    w3 = s * t
    first, last = bounds
    c0 = cells[i, j, first:last]
    c1 = cells[i, j + 1, first:last]
    c2 = cells[i + 1, j, first:last]
    c3 = cells[i + 1, j + 1, first:last]
    for k in range(last - first):
        out[k] = w0 * c0[k] + w1 * c1[k] + w2 * c2[k] + w3 * c3[k]


@njit(cache=True, error_model="numpy")
def _trim(tables: PilotTables, reference: FloatArray, nacelle_angle: float, out: FloatArray) -> None:
    """Pitch and hands of the commanded trim into ``out[:1 + nu]``, their slopes with airspeed into its last 1 + nu."""
    count = 1 + tables.roles[R_HANDS]
    _interpolate(tables, tables.trim, (reference[REF_AIRSPEED], nacelle_angle), (0, 4 * count), out)
    limit = tables.numbers[N_ACCELERATION_LIMIT]
    a = min(limit, max(-limit, reference[REF_AIRSPEED_RATE]))
    for k in range(count):
        out[k] += a * (out[count + k] + a * out[2 * count + k])
    # climbing keeps the angle of attack: pitch rises by the path angle, which fades out towards hover
    climb_speed = tables.numbers[N_CLIMB_SPEED]
    speed = reference[REF_AIRSPEED]
    out[0] += reference[REF_CLIMB] * speed / (speed * speed + climb_speed * climb_speed)


@njit(cache=True, error_model="numpy")
def _own_reference(state: FloatArray, reference: FloatArray, out: FloatArray) -> None:
    """What is asked for plus the offset of a capture in progress (zero in ordinary flight)."""
    first = state.shape[0] - OFFSETS
    for k in range(OFFSETS):
        out[k] = reference[k] + state[first + k]


@njit(cache=True, error_model="numpy")
def _capture(state: FloatArray, place: int, limits: tuple[float, float], dt: float) -> None:
    """Lead one offset and its rate to zero: critically damped, its speed and acceleration limited."""
    speed, acceleration = limits
    far = 2.0 * speed / CAPTURE_FREQUENCY
    offset = _clip(state[place], far)
    change = _clip(-CAPTURE_FREQUENCY * (CAPTURE_FREQUENCY * offset + 2.0 * state[place + 1]), acceleration)
    state[place] += dt * (state[place + 1] + 0.5 * dt * change)
    state[place + 1] += dt * change


@njit(cache=True, error_model="numpy")
def _demand(tables: PilotTables, state: FloatArray, hand: int) -> float:
    """Deviation of a hand's control after the true delay."""
    roles = tables.roles
    delay = roles[R_DELAY]
    hands_at = S_ESTIMATE + roles[R_PLANT] + delay + roles[R_HANDS]
    delay_at = hands_at + roles[R_HANDS]
    total = tables.delay_d[hand] * state[hands_at + hand]
    for k in range(delay):
        total += tables.output_delay_c[hand, k] * state[delay_at + k]
    return total


@njit(cache=True, error_model="numpy")
def mocm_output(
    tables: PilotTables,
    state: FloatArray,
    x: FloatArray,
    nacelle_angle: float,
    nacelle_rate: float,
    reference: FloatArray,
    noise: FloatArray,
    out: FloatArray,
) -> None:
    """Stick and lever for the frame that starts now; changes no state.

    The delay stands between what is seen and what is done, so the present aircraft state, nacelle rate and noise do
    not reach this output: they act in `mocm_advance`.

    Args:
        tables: Prepared pilot.
        state: The pilot's state.
        x: Aircraft state (unused, see above).
        nacelle_angle: Nacelle angle [rad].
        nacelle_rate: Nacelle rate [rad/s] (unused).
        reference: What is asked for, see the module.
        noise: Standard normals of this frame (unused).
        out: Receives stick (-1..1) and lever (0..1).
    """
    work = np.empty(4 * (1 + tables.roles[R_HANDS]) + OFFSETS)
    own = work[4 * (1 + tables.roles[R_HANDS]) :]
    _own_reference(state, reference, own)
    _trim(tables, own, nacelle_angle, work)
    for hand in range(tables.roles[R_HANDS]):
        value = work[1 + hand] + _demand(tables, state, hand)
        out[hand] = min(tables.limits[1, hand], max(tables.limits[0, hand], value))


@njit(cache=True, error_model="numpy")
def _rates(
    tables: PilotTables, cell: FloatArray, s: FloatArray, constant: FloatArray, frozen: bool, out: FloatArray
) -> None:
    """Rates of [x_hat | u_p | x_d] at held displays.

    ``constant`` = [plant rows (padded) | displays (padded) | hands' command | hands' limits | hands' noise].
    """
    roles = tables.roles
    n = roles[R_PLANT]
    delay = roles[R_DELAY]
    hands = roles[R_HANDS]
    displays = roles[R_DISPLAYS]
    estimate = n + delay + hands
    rows = pad4(n)
    seen = pad4(displays)
    wide = pad4(estimate)
    command = rows + seen
    limit = command + hands
    motor = limit + hands
    # plant
    for k in range(rows):
        out[k] = constant[k]
    place = roles[R_A]
    for c in range(tables.a_columns.shape[0]):
        value = s[tables.a_columns[c]]
        column = cell[place : place + rows]
        for k in range(rows):
            out[k] += column[k] * value
        place += rows
    # internal delay filter and hands
    place = roles[R_B]
    for hand in range(hands):
        value = tables.delay_d[hand] * s[n + delay + hand]
        for k in range(delay):
            value += tables.model_delay_c[hand, k] * s[n + k]
        column = cell[place : place + rows]
        for k in range(rows):
            out[k] += column[k] * value
        place += rows
    if frozen:
        for k in range(n - INTEGRALS, n):
            out[k] = 0.0
    for k in range(delay):
        value = 0.0
        for m in range(delay):
            value += tables.model_delay_a[k, m] * s[n + m]
        for hand in range(hands):
            value += tables.delay_b[k, hand] * s[n + delay + hand]
        out[n + k] = value
    # commanded hands, and the hands of model and man
    true_hands = wide
    true_delay = wide + hands
    for hand in range(hands):
        total = constant[command + hand]
        place = roles[R_L] + hand
        for k in range(n + delay):
            total -= cell[place + hands * k] * s[k]
        out[true_hands + hand] = total
    for hand in range(hands):
        model = constant[limit + hand]
        man = model + constant[motor + hand]
        for other in range(hands):
            lag = cell[roles[R_G] + hands * hand + other]
            model += lag * (out[true_hands + other] - s[n + delay + other])
            man += lag * (out[true_hands + other] - s[true_hands + other])
        out[n + delay + hand] = model
        # the commands are still needed by the next hand: park the true hand's rate in the delay section
        out[true_delay + hand] = man
    for hand in range(hands):
        out[true_hands + hand] = out[true_delay + hand]
    for k in range(estimate, wide):
        out[k] = 0.0
    for k in range(delay):
        value = 0.0
        for m in range(delay):
            value += tables.output_delay_a[k, m] * s[true_delay + m]
        for hand in range(hands):
            value += tables.delay_b[k, hand] * s[true_hands + hand]
        out[true_delay + k] = value
    # innovation
    residual = out[true_delay + pad4(delay) : true_delay + pad4(delay) + seen]
    for k in range(seen):
        residual[k] = constant[rows + k]
    place = roles[R_C]
    for c in range(tables.c_columns.shape[0]):
        value = s[tables.c_columns[c]]
        column = cell[place : place + seen]
        for k in range(seen):
            residual[k] -= column[k] * value
        place += seen
    place = roles[R_F]
    for d in range(displays):
        value = residual[d]
        column = cell[place : place + wide]
        for k in range(wide):
            out[k] += column[k] * value
        place += wide


@njit(cache=True, error_model="numpy")
def _observe(
    tables: PilotTables, x: FloatArray, reference: FloatArray, pitch: float, pitch_rate: float, out: FloatArray
) -> float:
    """Deviations of the displays from the reference into ``out``; returns the airspeed."""
    roles = tables.roles
    sine = math.sin(x[roles[R_PITCH]])
    cosine = math.cos(x[roles[R_PITCH]])
    u = x[roles[R_U]]
    w = x[roles[R_W]]
    airspeed = u * cosine + w * sine
    out[0] = airspeed - reference[REF_AIRSPEED]
    out[1] = x[roles[R_ALTITUDE]] - reference[REF_ALTITUDE]
    out[2] = u * sine - w * cosine - reference[REF_CLIMB]
    out[3] = x[roles[R_PITCH]] - pitch
    out[4] = x[roles[R_Q]] - pitch_rate
    return airspeed


@njit(cache=True, error_model="numpy")
def _plant_reference(
    tables: PilotTables, reference: FloatArray, trim: FloatArray, pitch_rate: float, out: FloatArray
) -> None:
    """The moving trim in the design plant's states."""
    roles = tables.roles
    sine = math.sin(trim[0])
    cosine = math.cos(trim[0])
    for k in range(roles[R_PLANT]):
        out[k] = 0.0
    out[0] = reference[REF_AIRSPEED] * cosine + reference[REF_CLIMB] * sine
    out[1] = reference[REF_AIRSPEED] * sine - reference[REF_CLIMB] * cosine
    out[2] = pitch_rate
    out[3] = trim[0]
    out[4] = reference[REF_ALTITUDE]
    for hand in range(roles[R_HANDS]):
        if tables.lags[hand] >= 0:
            out[tables.lags[hand]] = trim[1 + hand]


@njit(cache=True, error_model="numpy")
def _outer_command(
    tables: PilotTables, cell: FloatArray, trim: FloatArray, airspeed: float, dv: float, dh: float, hand: int
) -> float:
    """What a hand is asked for by moving the reference to the trim of an airspeed dv faster, and dh upwards.

    The whole trim moves, pitch and controls too: moving only the speed has the wrong sign on the back side of the power
    curve, where slower flight takes more power.
    """
    hands = tables.roles[R_HANDS]
    slopes = 3 * (1 + hands)
    place = tables.roles[R_L] + hand
    sine = math.sin(trim[0])
    cosine = math.cos(trim[0])
    pitch_slope = trim[slopes]
    along = trim[slopes + 1 + hand]
    along += cell[place] * (cosine - airspeed * sine * pitch_slope)
    along += cell[place + hands] * (sine + airspeed * cosine * pitch_slope)
    along += cell[place + 3 * hands] * pitch_slope
    for other in range(hands):
        if tables.lags[other] >= 0:
            along += cell[place + hands * tables.lags[other]] * trim[slopes + 1 + other]
    return along * dv + cell[place + 4 * hands] * dh


@njit(cache=True, error_model="numpy")
def _limit_hands(
    tables: PilotTables, cell: FloatArray, state: FloatArray, trim: FloatArray, constant: FloatArray
) -> bool:
    """Limit rate and travel of the hands; writes what is taken off their rates, returns whether anything was."""
    roles = tables.roles
    n = roles[R_PLANT]
    delay = roles[R_DELAY]
    hands = roles[R_HANDS]
    command = pad4(n) + pad4(roles[R_DISPLAYS])
    limit = command + hands
    hands_at = S_ESTIMATE + n + delay + hands
    limited = False
    for hand in range(hands):
        rate = 0.0
        for other in range(hands):
            wanted = constant[command + other]
            for k in range(n + delay):
                wanted -= cell[roles[R_L] + hands * k + other] * state[S_ESTIMATE + k]
            rate += cell[roles[R_G] + hands * hand + other] * (wanted - state[hands_at + other])
        allowed = min(tables.limits[2, hand], max(-tables.limits[2, hand], rate))
        position = trim[1 + hand] + state[hands_at + hand]
        if (position >= tables.limits[1, hand] and allowed > 0.0) or (
            position <= tables.limits[0, hand] and allowed < 0.0
        ):
            allowed = 0.0
        constant[limit + hand] = allowed - rate
        if allowed != rate:
            limited = True
    return limited


@njit(cache=True, error_model="numpy")
def mocm_advance(
    tables: PilotTables,
    state: FloatArray,
    x: FloatArray,
    nacelle_angle: float,
    nacelle_rate: float,
    reference: FloatArray,
    applied: FloatArray,
    noise: FloatArray,
    dt: float,
) -> None:
    """Move the pilot to the start of the next frame: displays read now, held over the frame.

    Args:
        tables: Prepared pilot.
        state: The pilot's state, updated in place.
        x: Aircraft state at the start of the frame.
        nacelle_angle: Nacelle angle at the start of the frame [rad].
        nacelle_rate: Nacelle rate at the start of the frame [rad/s].
        reference: What is asked for at the start of the frame, see the module.
        applied: Stick and lever that act during the frame, after protection and stops.
        noise: Standard normals, `noise_width` of them, or none: noise off.
        dt: Length of the frame [s].
    """
    roles = tables.roles
    n = roles[R_PLANT]
    delay = roles[R_DELAY]
    hands = roles[R_HANDS]
    displays = roles[R_DISPLAYS]
    estimate = n + delay + hands
    rows = pad4(n)
    seen = pad4(displays)
    wide = pad4(estimate)
    command = rows + seen
    motor = command + 2 * hands
    size = wide + hands + delay
    span = size + 4 + seen
    count = 4 * (1 + hands)
    block = roles[R_END]
    work = np.zeros(count + n + block + motor + hands + 3 * span + OFFSETS)
    trim = work[:count]
    target = work[count : count + n]
    cell = work[count + n : count + n + block]
    constant = work[count + n + block : count + n + block + motor + hands]
    start = count + n + block + motor + hands
    y0 = work[start : start + span]
    y1 = work[start + span : start + 2 * span]
    total = work[start + 2 * span : start + 3 * span]
    own = work[start + 3 * span :]
    integrals_at = S_ESTIMATE + estimate + hands + delay
    last_at = integrals_at + INTEGRALS
    offset_at = last_at + n

    # the moving trim: what it moved since the last frame comes off the estimated deviation
    _own_reference(state, reference, own)
    _trim(tables, own, nacelle_angle, trim)
    pitch_rate = (trim[0] - state[last_at + 3]) / dt
    _plant_reference(tables, own, trim, pitch_rate, target)
    for k in range(n):
        state[S_ESTIMATE + k] -= target[k] - state[last_at + k]
        state[last_at + k] = target[k]

    noisy = noise.shape[0] > 0
    _interpolate(tables, tables.cells, (state[S_FILTERED], nacelle_angle), (0, block if noisy else roles[R_V]), cell)
    airspeed = _observe(tables, x, own, trim[0], pitch_rate, constant[rows : rows + seen])
    error_v = constant[rows]
    error_h = constant[rows + 1]
    if roles[R_LOOP] == LOOP_INTEGRATORS:
        for k in range(INTEGRALS):
            constant[rows + displays - INTEGRALS + k] = state[integrals_at + k]
    else:
        numbers = tables.numbers
        dv = -numbers[N_KP_V] * error_v - numbers[N_KI_V] * state[integrals_at]
        dh = -numbers[N_KP_H] * error_h - numbers[N_KI_H] * state[integrals_at + 1]
        for hand in range(hands):
            constant[command + hand] = _outer_command(tables, cell, trim, own[REF_AIRSPEED], dv, dh, hand)

    # known accelerations of the moving trim, nacelle motion, and what stops or protection did to the controls
    sine = math.sin(trim[0])
    cosine = math.cos(trim[0])
    pitch_column = -1
    for c in range(tables.a_columns.shape[0]):
        if tables.a_columns[c] == 2:
            pitch_column = roles[R_A] + rows * c
    for k in range(n):
        constant[k] = cell[roles[R_N] + k] * nacelle_rate
        if pitch_column >= 0:
            constant[k] += cell[pitch_column + k] * pitch_rate
    constant[0] += own[REF_AIRSPEED_RATE] * cosine
    constant[1] += own[REF_AIRSPEED_RATE] * sine
    frozen = _limit_hands(tables, cell, state, trim, constant)
    for hand in range(hands):
        overruled = applied[hand] - (trim[1 + hand] + _demand(tables, state, hand))
        if abs(overruled) > SAME_CONTROL:
            frozen = True
            for k in range(n):
                constant[k] += cell[roles[R_B] + rows * hand + k] * overruled
    if noisy:
        root = 1.0 / math.sqrt(dt)
        for k in range(displays):
            constant[rows + k] += cell[roles[R_V] + k] * noise[k] * root
        for hand in range(hands):
            for other in range(hands):
                lag = cell[roles[R_G] + hands * hand + other]
                constant[motor + hand] += lag * cell[roles[R_V] + displays + other] * noise[displays + other] * root

    # the pilot is linear over a held frame, so RK4 is the Taylor series to fourth order
    for k in range(estimate):
        y0[k] = state[S_ESTIMATE + k]
    for k in range(hands + delay):
        y0[wide + k] = state[S_ESTIMATE + estimate + k]
    holds = frozen and roles[R_LOOP] == LOOP_INTEGRATORS
    factor = dt
    for order in range(1, 5):
        _rates(tables, cell, y0, constant, holds, y1)
        for k in range(size):
            total[k] += factor * y1[k]
            y0[k] = y1[k]
        if order == 1:
            for k in range(constant.shape[0]):
                constant[k] = 0.0
        factor *= dt / (order + 1.0)
    for k in range(estimate):
        state[S_ESTIMATE + k] += total[k]
    for k in range(hands + delay):
        state[S_ESTIMATE + estimate + k] += total[wide + k]
    if not frozen:
        state[integrals_at] += dt * error_v
        state[integrals_at + 1] += dt * error_h
    # capture: lead the own reference on, and give it up where the aircraft is too far from it
    _capture(state, offset_at, (CAPTURE_AIRSPEED_RATE, CAPTURE_AIRSPEED_JERK), dt)
    _capture(state, offset_at + 2, (CAPTURE_CLIMB, CAPTURE_CLIMB_RATE), dt)
    state[offset_at] += error_v - _clip(error_v, LARGEST_AIRSPEED_ERROR)
    state[offset_at + 2] += error_h - _clip(error_h, LARGEST_ALTITUDE_ERROR)
    state[S_FILTERED] += tables.numbers[N_FILTER] * (airspeed - state[S_FILTERED])
    state[S_LIMITED] = 1.0 if frozen else 0.0


@njit(cache=True, error_model="numpy")
def mocm_engage(
    tables: PilotTables,
    state: FloatArray,
    x: FloatArray,
    nacelle_angle: float,
    nacelle_rate: float,
    reference: FloatArray,
    present: FloatArray,
) -> None:
    """Let the pilot take over without a step: its first output is the present stick and lever.

    The pilot's own reference starts at the present airspeed, altitude and climb rate and leads from there to what is
    asked for. The estimate starts at the true deviations, without gusts. The integrals are set so that the present controls are
    also what the pilot wants, as far as their limits allow; from there it steers to the reference.

    Args:
        tables: Prepared pilot.
        state: The pilot's state, overwritten.
        x: Aircraft state.
        nacelle_angle: Nacelle angle [rad].
        nacelle_rate: Nacelle rate [rad/s] (unused: its effect is known from the first frame on).
        reference: What is asked for, see the module.
        present: Stick and lever that act now.
    """
    roles = tables.roles
    n = roles[R_PLANT]
    delay = roles[R_DELAY]
    hands = roles[R_HANDS]
    estimate = n + delay + hands
    hands_at = S_ESTIMATE + estimate
    delay_at = hands_at + hands
    integrals_at = delay_at + delay
    last_at = integrals_at + INTEGRALS
    trim = np.zeros(4 * (1 + hands))
    errors = np.zeros(pad4(roles[R_DISPLAYS]))
    cell = np.zeros(roles[R_END])
    for k in range(state.shape[0]):
        state[k] = 0.0
    own = np.zeros(OFFSETS)
    airspeed = _observe(tables, x, reference, 0.0, 0.0, errors)
    state[S_FILTERED] = airspeed
    offset_at = last_at + n
    state[offset_at] = errors[0]
    state[offset_at + 2] = errors[1]
    state[offset_at + 3] = errors[2]
    _own_reference(state, reference, own)
    _trim(tables, own, nacelle_angle, trim)
    _observe(tables, x, own, trim[0], 0.0, errors)
    _interpolate(tables, tables.cells, (airspeed, nacelle_angle), (0, roles[R_END]), cell)
    _plant_reference(tables, own, trim, 0.0, state[last_at : last_at + n])
    state[S_ESTIMATE + 0] = x[roles[R_U]] - state[last_at + 0]
    state[S_ESTIMATE + 1] = x[roles[R_W]] - state[last_at + 1]
    state[S_ESTIMATE + 2] = x[roles[R_Q]]
    state[S_ESTIMATE + 3] = errors[3]
    state[S_ESTIMATE + 4] = errors[1]
    for hand in range(hands):
        held = present[hand] - trim[1 + hand]
        if tables.lags[hand] >= 0:
            state[S_ESTIMATE + tables.lags[hand]] = held
        state[S_ESTIMATE + n + delay + hand] = held
        state[hands_at + hand] = held
    _rest_delay(tables, tables.model_delay_a, state, hands_at, S_ESTIMATE + n)
    _rest_delay(tables, tables.output_delay_a, state, hands_at, delay_at)
    _start_integrals(tables, cell, state, trim, own[REF_AIRSPEED], errors)


@njit(cache=True, error_model="numpy")
def _rest_delay(tables: PilotTables, a: FloatArray, state: FloatArray, hands_at: int, delay_at: int) -> None:
    """Put a delay filter at rest at the present hands: a x_d = -b u_p, by elimination."""
    delay = tables.roles[R_DELAY]
    if delay == 0:
        return
    matrix = np.zeros((delay, delay + 1))
    for k in range(delay):
        for m in range(delay):
            matrix[k, m] = a[k, m]
        for hand in range(tables.roles[R_HANDS]):
            matrix[k, delay] -= tables.delay_b[k, hand] * state[hands_at + hand]
    for k in range(delay):
        pivot = k
        for m in range(k + 1, delay):
            if abs(matrix[m, k]) > abs(matrix[pivot, k]):
                pivot = m
        for column in range(delay + 1):
            matrix[k, column], matrix[pivot, column] = matrix[pivot, column], matrix[k, column]
        for m in range(delay):
            if m != k:
                factor = matrix[m, k] / matrix[k, k]
                for column in range(k, delay + 1):
                    matrix[m, column] -= factor * matrix[k, column]
    for k in range(delay):
        state[delay_at + k] = matrix[k, delay] / matrix[k, k]


@njit(cache=True, error_model="numpy")
def _start_integrals(
    tables: PilotTables, cell: FloatArray, state: FloatArray, trim: FloatArray, airspeed: float, errors: FloatArray
) -> None:
    """Choose the integrals so that the wanted controls equal the present ones, within the integrals' limits."""
    roles = tables.roles
    numbers = tables.numbers
    n = roles[R_PLANT]
    delay = roles[R_DELAY]
    hands = roles[R_HANDS]
    hands_at = S_ESTIMATE + n + delay + hands
    integrals_at = hands_at + hands + delay
    inner = roles[R_LOOP] == LOOP_INTEGRATORS
    if hands != INTEGRALS:
        return
    # two equations, effect of each integral on each hand's command = what is missing
    m = np.zeros((2, 2))
    missing = np.zeros(2)
    for hand in range(hands):
        missing[hand] = state[hands_at + hand]
        for k in range(n + delay):
            missing[hand] += cell[roles[R_L] + hands * k + hand] * state[S_ESTIMATE + k]
        if inner:
            m[hand, 0] = -cell[roles[R_L] + hands * (n - 2) + hand]
            m[hand, 1] = -cell[roles[R_L] + hands * (n - 1) + hand]
        else:
            m[hand, 0] = _outer_command(tables, cell, trim, airspeed, -numbers[N_KI_V], 0.0, hand)
            m[hand, 1] = _outer_command(tables, cell, trim, airspeed, 0.0, -numbers[N_KI_H], hand)
            missing[hand] -= _outer_command(
                tables, cell, trim, airspeed, -numbers[N_KP_V] * errors[0], -numbers[N_KP_H] * errors[1], hand
            )
    determinant = m[0, 0] * m[1, 1] - m[0, 1] * m[1, 0]
    size = (abs(m[0, 0]) + abs(m[1, 0])) * (abs(m[0, 1]) + abs(m[1, 1]))
    if abs(determinant) <= 1e-6 * size:
        return
    z_v = (missing[0] * m[1, 1] - missing[1] * m[0, 1]) / determinant
    z_h = (m[0, 0] * missing[1] - m[1, 0] * missing[0]) / determinant
    state[integrals_at] = _clip(z_v, numbers[N_Z_V])
    state[integrals_at + 1] = _clip(z_h, numbers[N_Z_H])
    if inner:
        state[S_ESTIMATE + n - 2] = state[integrals_at]
        state[S_ESTIMATE + n - 1] = state[integrals_at + 1]
