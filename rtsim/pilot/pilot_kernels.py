"""The scheduled pilot on line: one frame of the MOCM, compiled.

One frame is two calls, so that protection can sit between them: ``mocm_output`` gives stick and lever for the frame
that starts, ``mocm_advance`` then moves the pilot to the next frame, knowing the controls that were really applied.
``mocm_engage`` sets the pilot's state when it takes over.

``reference`` is what the pilot is asked for: ``[airspeed, airspeed rate, altitude, climb rate, nacelle command rate]``
(m/s, m/s^2, m, m/s, rad/s). Trim and feed-forward follow the *commanded* airspeed and acceleration and the nacelle
angle.
The equations stand in docs/pilot.md; sums have a fixed order and no library routine is called.

Legend:
    reference: What is asked for, see the module.
    out: Receives stick (-1..1) and lever (0..1).
    work: Scratch of `pilot_work_size(tables)` numbers.
"""

from __future__ import annotations

import math

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import inner_kernel, kernel
from rtsim.kernels.grid_kernels import bilinear
from rtsim.pilot.dynamics_kernels import (
    Held,
    gains_of,
    held_of,
    held_size,
    limit_hands,
    motion_of,
    motion_size,
    rates,
)
from rtsim.pilot.engage_kernels import mocm_engage
from rtsim.pilot.layout_kernels import (
    CAPTURE_AIRSPEED_JERK,
    CAPTURE_AIRSPEED_RATE,
    CAPTURE_CLIMB,
    CAPTURE_CLIMB_RATE,
    DISPLAY,
    GIVE_WAY_TIME,
    INTEGRALS,
    LARGEST_AIRSPEED_ERROR,
    LARGEST_ALTITUDE_ERROR,
    LEVER,
    LOOP_INTEGRATORS,
    NUMBER,
    OFFSETS,
    PLANT,
    S_ESTIMATE,
    S_FILTERED,
    S_LIMITED,
    SAME_CONTROL,
    TARGET,
    PilotTables,
    capture,
    clip,
    commanded_trim,
    demand,
    load_excess,
    noise_width,
    observe,
    outer_command,
    own_reference,
    pad4,
    pilot_state_size,
    plant_reference,
)

__all__ = [
    "PilotTables",
    "mocm_advance",
    "mocm_advance_in",
    "mocm_engage",
    "mocm_output",
    "mocm_output_in",
    "noise_width",
    "pilot_state_size",
    "pilot_work_size",
]


@kernel
def mocm_output(
    tables: PilotTables,
    state: FloatArray,
    x: FloatArray,  # noqa: ARG001 - one signature for the kernels of the frame
    nacelle_angle: float,
    nacelle_rate: float,  # noqa: ARG001
    reference: FloatArray,
    noise: FloatArray,  # noqa: ARG001
    out: FloatArray,
) -> None:
    """Stick and lever for the frame that starts now; changes no state.

    The delay stands between what is seen and what is done, so the present aircraft state, nacelle rate and noise do
    not reach this output: they act in `mocm_advance`.

    Args:
        x: Aircraft state (unused, see above).
        nacelle_rate: Nacelle rate [rad/s] (unused).
        noise: Standard normals of this frame (unused).
    """
    work = np.empty(4 * (1 + tables.roles.hands) + OFFSETS)
    mocm_output_in(tables, state, nacelle_angle, reference, out, work)


@inner_kernel
def mocm_output_in(
    tables: PilotTables,
    state: FloatArray,
    nacelle_angle: float,
    reference: FloatArray,
    out: FloatArray,
    work: FloatArray,
) -> None:
    """`mocm_output` in given work space."""
    own = work[4 * (1 + tables.roles.hands) :]
    own_reference(state, reference, own)
    commanded_trim(tables, own, nacelle_angle, load_excess(reference), work)
    for hand in range(tables.roles.hands):
        value = work[1 + hand] + demand(tables, state, hand)
        out[hand] = min(tables.limits[1, hand], max(tables.limits[0, hand], value))


@inner_kernel
def _known_accelerations(
    tables: PilotTables,
    cell: FloatArray,
    held: Held,
    trim: FloatArray,
    own: FloatArray,
    pitch_rate: float,
    nacelle_rate: float,
) -> None:
    """Accelerations of the plant that follow from the moving trim and the moving nacelles."""
    n = tables.roles.plant
    rows = pad4(n)
    for k in range(n):
        held.plant[k] = cell[tables.roles.nacelle + k] * nacelle_rate
    for c in range(tables.a_columns.shape[0]):
        if tables.a_columns[c] == PLANT.q:
            for k in range(n):
                held.plant[k] += cell[rows * c + k] * pitch_rate
    held.plant[PLANT.u] += own[TARGET.airspeed_rate] * math.cos(trim[0])
    held.plant[PLANT.w] += own[TARGET.airspeed_rate] * math.sin(trim[0])


@inner_kernel
def _outer_loops(
    tables: PilotTables, cell: FloatArray, held: Held, trim: FloatArray, own: FloatArray, integrals: FloatArray
) -> None:
    """Hand the integrals to the displays, or the PI loops' commands to the hands."""
    roles = tables.roles
    if roles.loop == LOOP_INTEGRATORS:
        for k in range(INTEGRALS):
            held.displays[roles.displays - INTEGRALS + k] = integrals[k]
        return
    numbers = tables.numbers
    dv = -numbers[NUMBER.kp_v] * held.displays[DISPLAY.airspeed] - numbers[NUMBER.ki_v] * integrals[0]
    dh = -numbers[NUMBER.kp_h] * held.displays[DISPLAY.altitude] - numbers[NUMBER.ki_h] * integrals[1]
    for hand in range(roles.hands):
        held.command[hand] = outer_command(tables, cell, trim, own[TARGET.airspeed], dv, dh, hand)


@kernel
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
        state: The pilot's state, updated in place.
        x: Aircraft state at the start of the frame.
        nacelle_angle: Nacelle angle at the start of the frame [rad].
        nacelle_rate: Nacelle rate at the start of the frame [rad/s].
        reference: What is asked for at the start of the frame, see the module.
        applied: Stick and lever that act during the frame, after protection and stops.
        noise: Standard normals, `noise_width` of them, or none: noise off.
    """
    work = np.empty(pilot_work_size(tables))
    mocm_advance_in(tables, state, x, (nacelle_angle, nacelle_rate, dt), reference, applied, noise, work)


@inner_kernel
def pilot_work_size(tables: PilotTables) -> int:
    """Length of the work array that `mocm_output_in` and `mocm_advance_in` need.

    Returns:
        The number of float64 values.
    """
    roles = tables.roles
    hands = roles.hands
    fixed = 4 * (1 + hands) + OFFSETS + roles.plant + roles.end + pad4(roles.displays) + hands
    fixed += roles.a_columns + roles.c_columns + hands
    return fixed + held_size(tables) + 3 * motion_size(tables)


@inner_kernel
def mocm_advance_in(
    tables: PilotTables,
    state: FloatArray,
    x: FloatArray,
    scalars: tuple[float, float, float],
    reference: FloatArray,
    applied: FloatArray,
    noise: FloatArray,
    work: FloatArray,
) -> None:
    """`mocm_advance` in given work space. Counting references to its many views would cost more than the arithmetic.

    Args:
        state: The pilot's state, updated in place.
        x: Aircraft state at the start of the frame.
        scalars: Nacelle angle [rad] and rate [rad/s], length of the frame [s].
        applied: Stick and lever that act during the frame.
        noise: Standard normals, or none.
    """
    nacelle_angle, nacelle_rate, dt = scalars
    roles = tables.roles
    n = roles.plant
    hands = roles.hands
    displays = roles.displays
    delay = roles.delay
    estimate = n + delay + hands
    hands_at = S_ESTIMATE + estimate
    integrals_at = hands_at + hands + delay
    last_at = integrals_at + INTEGRALS
    offset_at = last_at + n
    count = 4 * (1 + hands)
    motion = motion_size(tables)

    trim = work[:count]
    own = work[count : count + OFFSETS]
    first = count + OFFSETS
    target = work[first : first + n]
    first += n
    cell = work[first : first + roles.end]
    first += roles.end
    for k in range(first, work.shape[0]):
        work[k] = 0.0
    constant = work[first : first + held_size(tables)]
    held = held_of(tables, constant)
    first += held_size(tables)
    y = motion_of(tables, work[first : first + motion])
    rate = motion_of(tables, work[first + motion : first + 2 * motion])
    total = motion_of(tables, work[first + 2 * motion : first + 3 * motion])
    scratch = work[first + 3 * motion :]

    # the moving trim: what it moved since the last frame comes off the estimated deviation
    own_reference(state, reference, own)
    commanded_trim(tables, own, nacelle_angle, load_excess(reference), trim)
    pitch_rate = (trim[0] - state[last_at + PLANT.pitch]) / dt
    plant_reference(tables, own, trim, pitch_rate, target)
    for k in range(n):
        state[S_ESTIMATE + k] -= target[k] - state[last_at + k]
        state[last_at + k] = target[k]
    for k in range(estimate):
        y.x[k] = state[S_ESTIMATE + k]
    for k in range(hands):
        y.u[k] = state[hands_at + k]
    for k in range(delay):
        y.d[k] = state[hands_at + hands + k]

    noisy = noise.shape[0] > 0
    bilinear(tables, tables.cells, state[S_FILTERED], nacelle_angle, roles.end if noisy else roles.v, cell)
    gains = gains_of(tables, cell)
    airspeed = observe(tables, x, own, trim[0], pitch_rate, held.displays)
    error_v = held.displays[DISPLAY.airspeed]
    error_h = held.displays[DISPLAY.altitude]
    _outer_loops(tables, cell, held, trim, own, state[integrals_at : integrals_at + INTEGRALS])
    _known_accelerations(tables, cell, held, trim, own, pitch_rate, nacelle_rate)
    frozen = limit_hands(tables, gains, held, y, trim)
    short = False
    for hand in range(hands):
        # what stops or protection did to the controls, the internal model is told
        overruled = applied[hand] - (trim[1 + hand] + demand(tables, state, hand))
        if abs(overruled) > SAME_CONTROL:
            # Less power than asked for, and slower than wanted: the pilot is told, and lets the speed go.
            less = hand == LEVER and overruled < 0.0 and error_v < 0.0 and airspeed < reference[TARGET.airspeed]
            short = short or less
            frozen = frozen or not less
            for k in range(n):
                held.plant[k] += gains.B[pad4(n) * hand + k] * overruled
    if noisy:
        root = 1.0 / math.sqrt(dt)
        for k in range(displays):
            held.displays[k] += cell[roles.v + k] * noise[k] * root
        for hand in range(hands):
            for other in range(hands):
                strength = cell[roles.v + displays + other]
                held.motor[hand] += gains.G[hands * hand + other] * strength * noise[displays + other] * root

    # the pilot is linear over a held frame, so RK4 is the Taylor series to fourth order
    holds = 0
    if roles.loop == LOOP_INTEGRATORS:
        holds = INTEGRALS if frozen else 1 if short else 0
    factor = dt
    for order in range(1, 5):
        rates(tables, gains, held, y, holds, rate, scratch)
        for k in range(y.x.shape[0]):
            total.x[k] += factor * rate.x[k]
            y.x[k] = rate.x[k]
        for k in range(hands):
            total.u[k] += factor * rate.u[k]
            y.u[k] = rate.u[k]
        for k in range(delay):
            total.d[k] += factor * rate.d[k]
            y.d[k] = rate.d[k]
        if order == 1:
            for k in range(constant.shape[0]):
                constant[k] = 0.0
        factor *= dt / (order + 1.0)
    for k in range(estimate):
        state[S_ESTIMATE + k] += total.x[k]
    for k in range(hands):
        state[hands_at + k] += total.u[k]
    for k in range(delay):
        state[hands_at + hands + k] += total.d[k]

    if not frozen:
        state[integrals_at] += 0.0 if short else dt * error_v
        state[integrals_at + 1] += dt * error_h
    # capture: lead the own reference on, and give it up where the aircraft is too far from it
    if short:
        speeding = tables.numbers[NUMBER.filter] * (airspeed - state[S_FILTERED]) / dt
        state[offset_at + 1] += dt / GIVE_WAY_TIME * (speeding - own[TARGET.airspeed_rate])
        state[offset_at] += dt * (state[offset_at + 1] + error_v / GIVE_WAY_TIME)
    else:
        capture(state, offset_at, (CAPTURE_AIRSPEED_RATE, CAPTURE_AIRSPEED_JERK), dt)
    capture(state, offset_at + 2, (CAPTURE_CLIMB, CAPTURE_CLIMB_RATE), dt)
    state[offset_at] += error_v - clip(error_v, LARGEST_AIRSPEED_ERROR)
    state[offset_at + 2] += error_h - clip(error_h, LARGEST_ALTITUDE_ERROR)
    state[S_FILTERED] += tables.numbers[NUMBER.filter] * (airspeed - state[S_FILTERED])
    state[S_LIMITED] = 1.0 if frozen or short else 0.0
