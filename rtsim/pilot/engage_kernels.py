"""How the pilot takes over: its first output is the present stick and lever, and it captures what is asked for."""

from __future__ import annotations

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import allocating_kernel
from rtsim.kernels.grid_kernels import bilinear
from rtsim.pilot.layout_kernels import (
    DISPLAY,
    INTEGRALS,
    LOOP_INTEGRATORS,
    NUMBER,
    OFFSETS,
    PLANT,
    S_ESTIMATE,
    S_FILTERED,
    TARGET,
    PilotTables,
    clip,
    commanded_trim,
    load_excess,
    observe,
    outer_command,
    own_reference,
    pad4,
    plant_reference,
)


@allocating_kernel
def mocm_engage(
    tables: PilotTables,
    state: FloatArray,
    x: FloatArray,
    nacelle_angle: float,
    nacelle_rate: float,  # noqa: ARG001 - one signature for all three kernels
    reference: FloatArray,
    present: FloatArray,
) -> None:
    """Let the pilot take over without a step: its first output is the present stick and lever.

    The pilot's own reference starts at the present airspeed, altitude and climb rate and leads from there to what is
    asked for. The estimate starts at the true deviations, without gusts. The integrals are set so that the present
    controls are also what the pilot wants, as far as their limits allow.

    Args:
        state: The pilot's state, overwritten.
        nacelle_rate: Nacelle rate [rad/s] (unused: its effect is known from the first frame on).
        reference: What is asked for, see the module.
        present: Stick and lever that act now.
    """
    roles = tables.roles
    n = roles.plant
    delay = roles.delay
    hands = roles.hands
    estimate = n + delay + hands
    hands_at = S_ESTIMATE + estimate
    delay_at = hands_at + hands
    integrals_at = delay_at + delay
    last_at = integrals_at + INTEGRALS
    trim = np.zeros(4 * (1 + hands))
    errors = np.zeros(pad4(roles.displays))
    cell = np.zeros(roles.end)
    for k in range(state.shape[0]):
        state[k] = 0.0
    own = np.zeros(OFFSETS)
    airspeed = observe(tables, x, reference, 0.0, 0.0, errors)
    state[S_FILTERED] = airspeed
    offset_at = last_at + n
    state[offset_at] = errors[DISPLAY.airspeed]
    state[offset_at + 2] = errors[DISPLAY.altitude]
    state[offset_at + 3] = errors[DISPLAY.climb_rate]
    own_reference(state, reference, own)
    commanded_trim(tables, own, nacelle_angle, load_excess(reference), trim)
    observe(tables, x, own, trim[0], 0.0, errors)
    bilinear(tables, tables.cells, airspeed, nacelle_angle, roles.end, cell)
    plant_reference(tables, own, trim, 0.0, state[last_at : last_at + n])
    state[S_ESTIMATE + PLANT.u] = x[roles.u] - state[last_at + PLANT.u]
    state[S_ESTIMATE + PLANT.w] = x[roles.w] - state[last_at + PLANT.w]
    state[S_ESTIMATE + PLANT.q] = x[roles.q]
    state[S_ESTIMATE + PLANT.pitch] = errors[DISPLAY.pitch]
    state[S_ESTIMATE + PLANT.altitude] = errors[DISPLAY.altitude]
    for hand in range(hands):
        held = present[hand] - trim[1 + hand]
        if tables.lags[hand] >= 0:
            state[S_ESTIMATE + tables.lags[hand]] = held
        state[S_ESTIMATE + n + delay + hand] = held
        state[hands_at + hand] = held
    rest_delay(tables, tables.model_delay_a, state, hands_at, S_ESTIMATE + n)
    rest_delay(tables, tables.output_delay_a, state, hands_at, delay_at)
    start_integrals(tables, cell, state, trim, own[TARGET.airspeed], errors)


@allocating_kernel
def rest_delay(tables: PilotTables, a: FloatArray, state: FloatArray, hands_at: int, delay_at: int) -> None:
    """Put a delay filter at rest at the present hands: a x_d = -b u_p, by elimination.

    Args:
        a: Dynamics of the filter.
        state: The pilot's state.
        hands_at: Where the hands stand in it.
        delay_at: Where the filter stands in it.
    """
    delay = tables.roles.delay
    if delay == 0:
        return
    matrix = np.zeros((delay, delay + 1))
    for k in range(delay):
        for m in range(delay):
            matrix[k, m] = a[k, m]
        for hand in range(tables.roles.hands):
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


@allocating_kernel
def start_integrals(
    tables: PilotTables, cell: FloatArray, state: FloatArray, trim: FloatArray, airspeed: float, errors: FloatArray
) -> None:
    """Choose the integrals so that the wanted controls equal the present ones, within the integrals' limits.

    Args:
        cell: Gains.
        state: The pilot's state.
        trim: Pitch, hands and slopes; for the outer loops.
        airspeed: Commanded airspeed [m/s]; for the outer loops.
        errors: Deviations of the displays; for the outer loops.
    """
    roles = tables.roles
    numbers = tables.numbers
    n = roles.plant
    delay = roles.delay
    hands = roles.hands
    hands_at = S_ESTIMATE + n + delay + hands
    integrals_at = hands_at + hands + delay
    inner = roles.loop == LOOP_INTEGRATORS
    if hands != INTEGRALS:
        return
    # two equations, effect of each integral on each hand's command = what is missing
    m = np.zeros((2, 2))
    missing = np.zeros(2)
    for hand in range(hands):
        missing[hand] = state[hands_at + hand]
        for k in range(n + delay):
            missing[hand] += cell[roles.l + hands * k + hand] * state[S_ESTIMATE + k]
        if inner:
            m[hand, 0] = -cell[roles.l + hands * (n - 2) + hand]
            m[hand, 1] = -cell[roles.l + hands * (n - 1) + hand]
        else:
            m[hand, 0] = outer_command(tables, cell, trim, airspeed, -numbers[NUMBER.ki_v], 0.0, hand)
            m[hand, 1] = outer_command(tables, cell, trim, airspeed, 0.0, -numbers[NUMBER.ki_h], hand)
            missing[hand] -= outer_command(
                tables, cell, trim, airspeed, -numbers[NUMBER.kp_v] * errors[0], -numbers[NUMBER.kp_h] * errors[1], hand
            )
    determinant = m[0, 0] * m[1, 1] - m[0, 1] * m[1, 0]
    size = (abs(m[0, 0]) + abs(m[1, 0])) * (abs(m[0, 1]) + abs(m[1, 1]))
    if abs(determinant) <= 1e-6 * size:
        return
    z_v = (missing[0] * m[1, 1] - missing[1] * m[0, 1]) / determinant
    z_h = (m[0, 0] * missing[1] - m[1, 0] * missing[0]) / determinant
    state[integrals_at] = clip(z_v, numbers[NUMBER.z_v])
    state[integrals_at + 1] = clip(z_h, numbers[NUMBER.z_h])
    if inner:
        state[S_ESTIMATE + n - 2] = state[integrals_at]
        state[S_ESTIMATE + n - 1] = state[integrals_at + 1]
