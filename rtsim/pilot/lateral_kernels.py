"""The pilot's lateral half on line: lateral stick and pedals, one frame of a second MOCM, compiled.

It is built and moved as the longitudinal one (``pilot_kernels``); what differs is what it follows: it is asked for a
turn rate, a heading and a lateral velocity. Bank, rates and hands of that motion are reckoned from trims and linear
model and lead the hands: without a lead a turn would be flown with sideslip, the pedals holding the heading against
the bank.

Legend:
    tables: The pilot.
    state: The pilot's state.
    wanted: What is asked for, ``WANTED``.
    x: Aircraft state as the pilot sees it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rtsim.aircraft.variables import STATE
from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import allocating_kernel, inner_kernel
from rtsim.kernels.grid_kernels import bilinear
from rtsim.pilot.dynamics_kernels import gains_of, held_of, held_size, limit_hands, motion_of, motion_size, rates
from rtsim.pilot.engage_kernels import rest_delay, start_integrals
from rtsim.pilot.layout_kernels import (
    INTEGRALS,
    NUMBER,
    OFFSETS,
    S_ESTIMATE,
    S_FILTERED,
    S_LIMITED,
    SAME_CONTROL,
    PilotTables,
    capture,
    clip,
    demand,
    pad4,
)
from rtsim.pilot.pilot_kernels import pilot_work_size
from rtsim.places import Places
from rtsim.units import DEGREE, GRAVITY

WANTED = Places(
    "heading",  # [rad]
    "turn_rate",  # rate of the heading [rad/s]
    "lateral_velocity",  # air-relative, along body y [m/s]
    "lateral_acceleration",  # its rate [m/s^2]
    "turn_acceleration",  # rate of the turn rate [rad/s^2]
    "turn_jerk",  # rate of that [rad/s^3]
    "airspeed",  # filtered airspeed asked for [m/s]
)
"""What the lateral half is asked for; the first four can be led from where the aircraft is."""
PLANT = Places("v", "p", "r", "bank", "heading")
"""Rigid-body states of the design plant."""
DISPLAY = Places("lateral_velocity", "roll_rate", "bank", "yaw_rate", "heading")
"""What it sees; the integrals of heading and lateral velocity follow."""
TRIM = Places("bank", ("hand", 2), "p", "r")
"""What it follows: bank, hands and rates of the commanded motion."""
SLIP_ENTRIES = 3
"""Bank, lateral stick and pedals of each trim in sideslip."""
CAPTURE_TURN_RATE, CAPTURE_TURN_ACCELERATION = 6.0 * DEGREE, 4.0 * DEGREE
"""Fastest capture of a heading [rad/s], and its acceleration [rad/s^2]."""
CAPTURE_LATERAL_RATE, CAPTURE_LATERAL_JERK = 1.0, 1.0
"""Fastest capture of a lateral velocity [m/s^2], and its rate of change [m/s^3]."""
LARGEST_HEADING_ERROR = 20.0 * DEGREE
"""Farther from its heading the pilot gives it up and captures it again [rad]."""
LARGEST_VELOCITY_ERROR = 6.0
"""The same for lateral velocity [m/s]."""


class LateralPilotTables(NamedTuple):
    """The lateral half, prepared by ``rtsim.pilot.lateral_tables.load_lateral_pilot``; read-only."""

    mocm: PilotTables
    """Gains and what goes with them; ``trim`` holds bank, lateral stick and pedals of each trim in sideslip, then the
    hands per roll and yaw rate, then per roll and yaw acceleration (V, N, 3 M + 8)."""
    velocity: FloatArray
    """Sideward velocities of these trims (M,) [m/s]."""


@inner_kernel
def lateral_work_size(tables: LateralPilotTables) -> int:
    """Length of the work array.

    Returns:
        The number of float64 values.
    """
    return int(pilot_work_size(tables.mocm) + tables.mocm.trim.shape[2] + WANTED.size + TRIM.size)


@inner_kernel
def _own(state: FloatArray, wanted: FloatArray, own: FloatArray) -> None:
    """Write what is asked for plus the offset of a capture in progress."""
    first = state.shape[0] - OFFSETS
    for k in range(WANTED.size):
        own[k] = wanted[k]
    for k in range(OFFSETS):
        own[k] += state[first + k]


@inner_kernel
def lateral_trim(
    tables: LateralPilotTables, own: FloatArray, nacelle: float, pitch: float, entries: FloatArray, trim: FloatArray
) -> None:
    """Bank, hands and rates of the commanded motion.

    Args:
        own: What is followed, ``WANTED``.
        nacelle: Nacelle angle [rad].
        pitch: Pitch attitude [rad].
        entries: Scratch of as many values as the trim table has entries.
        trim: Receives ``TRIM``.
    """
    nodes = tables.velocity.shape[0]
    airspeed = own[WANTED.airspeed]
    bilinear(tables.mocm, tables.mocm.trim, airspeed, nacelle, tables.mocm.trim.shape[2], entries)
    velocity, size = own[WANTED.lateral_velocity], abs(own[WANTED.lateral_velocity])
    side = 1.0 if velocity >= 0.0 else -1.0
    for k in range(SLIP_ENTRIES):
        trim[k] = 0.0
    if size > 0.0:
        node = 0
        while node < nodes - 1 and size > tables.velocity[node]:
            node += 1
        below = 0.0 if node == 0 else tables.velocity[node - 1]
        share = min((size - below) / (tables.velocity[node] - below), 1.0)
        for k in range(SLIP_ENTRIES):
            before = 0.0 if node == 0 else entries[SLIP_ENTRIES * (node - 1) + k]
            trim[k] = side * (before + share * (entries[SLIP_ENTRIES * node + k] - before))
    # A coordinated turn: the bank that the turn rate needs, and how it moves.
    speed = max(airspeed, 0.0)
    slope = speed * own[WANTED.turn_rate] / GRAVITY
    level = speed / GRAVITY / (1.0 + slope * slope)
    bank_rate, bank_acceleration = level * own[WANTED.turn_acceleration], level * own[WANTED.turn_jerk]
    trim[TRIM.bank] += math.atan(slope) + own[WANTED.lateral_acceleration] / GRAVITY
    st, ct = math.sin(pitch), math.cos(pitch)
    trim[TRIM.p] = bank_rate - own[WANTED.turn_rate] * st
    trim[TRIM.r] = own[WANTED.turn_rate] * ct * math.cos(trim[TRIM.bank])
    lead = SLIP_ENTRIES * nodes
    for hand in range(2):
        at = lead + 2 * hand
        trim[TRIM.hand + hand] += entries[at] * trim[TRIM.p] + entries[at + 1] * trim[TRIM.r]
        at += 4
        trim[TRIM.hand + hand] += entries[at] * bank_acceleration + entries[at + 1] * own[WANTED.turn_acceleration] * ct


@inner_kernel
def lateral_output_in(
    tables: LateralPilotTables,
    state: FloatArray,
    wanted: FloatArray,
    nacelle: float,
    pitch: float,
    out: FloatArray,
    work: FloatArray,
) -> None:
    """Lateral stick and pedals for the frame that starts now; changes no state.

    Args:
        nacelle: Nacelle angle [rad].
        pitch: Pitch attitude [rad].
        out: Receives lateral stick and pedals.
        work: Scratch of `lateral_work_size` numbers.
    """
    entries = tables.mocm.trim.shape[2]
    own, trim = work[entries : entries + WANTED.size], work[entries + WANTED.size :]
    _own(state, wanted, own)
    lateral_trim(tables, own, nacelle, pitch, work[:entries], trim)
    for hand in range(2):
        out[hand] = clip(trim[TRIM.hand + hand] + demand(tables.mocm, state, hand), 1.0)


@inner_kernel
def _deviations(x: FloatArray, own: FloatArray, trim: FloatArray, seen_velocity: float, out: FloatArray) -> None:
    """Deviations of the displays."""
    out[DISPLAY.lateral_velocity] = seen_velocity - own[WANTED.lateral_velocity]
    out[DISPLAY.roll_rate] = x[STATE.p] - trim[TRIM.p]
    out[DISPLAY.bank] = x[STATE.bank] - trim[TRIM.bank]
    out[DISPLAY.yaw_rate] = x[STATE.r] - trim[TRIM.r]
    out[DISPLAY.heading] = x[STATE.heading] - own[WANTED.heading]


@inner_kernel
def lateral_advance_in(
    tables: LateralPilotTables,
    state: FloatArray,
    x: FloatArray,
    scalars: tuple[float, float, float, float],
    wanted: FloatArray,
    applied: FloatArray,
    noise: FloatArray,
    work: FloatArray,
) -> None:
    """Move the lateral half to the start of the next frame.

    Args:
        state: The pilot's state, updated in place.
        scalars: Nacelle angle [rad], airspeed [m/s], gust along body y [m/s], length of the frame [s].
        applied: Lateral stick and pedals that act during the frame.
        noise: Standard normals, one per display and hand, or none: noise off.
        work: Scratch of `lateral_work_size` numbers.
    """
    nacelle, airspeed, gust, dt = scalars
    mocm = tables.mocm
    roles = mocm.roles
    n, hands, displays, delay = roles.plant, roles.hands, roles.displays, roles.delay
    estimate = n + delay + hands
    hands_at = S_ESTIMATE + estimate
    integrals_at = hands_at + hands + delay
    last_at = integrals_at + INTEGRALS
    offset_at = last_at + n
    count = mocm.trim.shape[2]
    own, trim = work[count : count + WANTED.size], work[count + WANTED.size : count + WANTED.size + TRIM.size]
    first = count + WANTED.size + TRIM.size
    cell = work[first : first + roles.end]
    first += roles.end
    for k in range(first, work.shape[0]):
        work[k] = 0.0
    constant = work[first : first + held_size(mocm)]
    held = held_of(mocm, constant)
    first += held_size(mocm)
    motion = motion_size(mocm)
    y = motion_of(mocm, work[first : first + motion])
    rate = motion_of(mocm, work[first + motion : first + 2 * motion])
    total = motion_of(mocm, work[first + 2 * motion : first + 3 * motion])
    scratch = work[first + 3 * motion :]

    _own(state, wanted, own)
    lateral_trim(tables, own, nacelle, x[STATE.pitch], work[:count], trim)
    # The commanded motion is one that the aircraft can follow: only the lags, which follow the hands, see it move.
    for k in range(n):
        if k != mocm.lags[0] and k != mocm.lags[1]:
            state[last_at + k] = 0.0
    for hand in range(hands):
        lag = mocm.lags[hand]
        state[S_ESTIMATE + lag] -= trim[TRIM.hand + hand] - state[last_at + lag]
        state[last_at + lag] = trim[TRIM.hand + hand]
    for k in range(estimate):
        y.x[k] = state[S_ESTIMATE + k]
    for k in range(hands):
        y.u[k] = state[hands_at + k]
    for k in range(delay):
        y.d[k] = state[hands_at + hands + k]

    noisy = noise.shape[0] > 0
    bilinear(mocm, mocm.cells, state[S_FILTERED], nacelle, roles.end if noisy else roles.v, cell)
    gains = gains_of(mocm, cell)
    _deviations(x, own, trim, x[STATE.v] + gust, held.displays)
    heading_error = held.displays[DISPLAY.heading]
    velocity_error = x[STATE.v] - own[WANTED.lateral_velocity]
    for k in range(INTEGRALS):
        held.displays[displays - INTEGRALS + k] = state[integrals_at + k]
    frozen = limit_hands(mocm, gains, held, y, trim)
    for hand in range(hands):
        overruled = applied[hand] - (trim[TRIM.hand + hand] + demand(mocm, state, hand))
        if abs(overruled) > SAME_CONTROL:
            frozen = True
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

    factor = dt
    for order in range(1, 5):
        rates(mocm, gains, held, y, INTEGRALS if frozen else 0, rate, scratch)
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
        state[integrals_at] += dt * heading_error
        state[integrals_at + 1] += dt * velocity_error
    capture(state, offset_at, (CAPTURE_TURN_RATE, CAPTURE_TURN_ACCELERATION), dt)
    capture(state, offset_at + 2, (CAPTURE_LATERAL_RATE, CAPTURE_LATERAL_JERK), dt)
    state[offset_at] += heading_error - clip(heading_error, LARGEST_HEADING_ERROR)
    state[offset_at + 2] += velocity_error - clip(velocity_error, LARGEST_VELOCITY_ERROR)
    state[S_FILTERED] += mocm.numbers[NUMBER.filter] * (airspeed - state[S_FILTERED])
    state[S_LIMITED] = 1.0 if frozen else 0.0


@allocating_kernel
def lateral_engage(
    tables: LateralPilotTables,
    state: FloatArray,
    x: FloatArray,
    nacelle: float,
    airspeed: float,
    wanted: FloatArray,
    present: FloatArray,
) -> None:
    """Let the lateral half take over without a step: its first output is the present lateral stick and pedals.

    Args:
        state: The pilot's state, overwritten.
        nacelle: Nacelle angle [rad].
        airspeed: Airspeed [m/s].
        present: Lateral stick and pedals that act now.
    """
    mocm = tables.mocm
    roles = mocm.roles
    n, hands, delay = roles.plant, roles.hands, roles.delay
    hands_at = S_ESTIMATE + n + delay + hands
    delay_at = hands_at + hands
    last_at = delay_at + delay + INTEGRALS
    offset_at = last_at + n
    for k in range(state.shape[0]):
        state[k] = 0.0
    state[S_FILTERED] = airspeed
    ct, st = math.cos(x[STATE.bank]), math.sin(x[STATE.bank])
    turn_rate = (x[STATE.q] * st + x[STATE.r] * ct) / math.cos(x[STATE.pitch])
    state[offset_at] = x[STATE.heading] - wanted[WANTED.heading]
    state[offset_at + 1] = turn_rate - wanted[WANTED.turn_rate]
    state[offset_at + 2] = x[STATE.v] - wanted[WANTED.lateral_velocity]
    own, trim, entries = np.zeros(WANTED.size), np.zeros(TRIM.size), np.zeros(mocm.trim.shape[2])
    errors, cell = np.zeros(pad4(roles.displays)), np.zeros(roles.end)
    _own(state, wanted, own)
    lateral_trim(tables, own, nacelle, x[STATE.pitch], entries, trim)
    _deviations(x, own, trim, x[STATE.v], errors)
    bilinear(mocm, mocm.cells, airspeed, nacelle, roles.end, cell)
    state[S_ESTIMATE + PLANT.v] = errors[DISPLAY.lateral_velocity]
    state[S_ESTIMATE + PLANT.p] = errors[DISPLAY.roll_rate]
    state[S_ESTIMATE + PLANT.r] = errors[DISPLAY.yaw_rate]
    state[S_ESTIMATE + PLANT.bank] = errors[DISPLAY.bank]
    state[S_ESTIMATE + PLANT.heading] = errors[DISPLAY.heading]
    for hand in range(hands):
        held = present[hand] - trim[TRIM.hand + hand]
        state[last_at + mocm.lags[hand]] = trim[TRIM.hand + hand]
        state[S_ESTIMATE + mocm.lags[hand]] = held
        state[S_ESTIMATE + n + delay + hand] = held
        state[hands_at + hand] = held
    rest_delay(mocm, mocm.model_delay_a, state, hands_at, S_ESTIMATE + n)
    rest_delay(mocm, mocm.output_delay_a, state, hands_at, delay_at)
    start_integrals(mocm, cell, state, trim, airspeed, errors)
