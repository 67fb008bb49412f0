"""Residuals of a steady flight that is not symmetric, and their Jacobian, compiled.

Unknowns z: pitch, bank (in a turn: turn rate), stick, collective, lateral stick, pedal; coning, flap_1c, flap_1s,
inflow_0, inflow_1c, inflow_1s; the half differences of these six.
Residuals: the rates of u, w, q, v, p, r and of the rotor states, less the wanted acceleration; the flapping
accelerations are scaled down to the size of the others.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rtsim.aircraft.table_kernels import curve, surface
from rtsim.aircraft.variables import ALL_INPUTS, ALL_STATES, INPUT, STATE
from rtsim.aircraft.xv15.dynamics_kernels import WORK_COUNT, derivative
from rtsim.aircraft.xv15.tables import AircraftTables
from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import inner_kernel, kernel
from rtsim.places import Places

UNKNOWN = Places(
    "pitch", "turn", "stick", "collective", "lateral_stick", "pedal", ("mean", 6), ("difference", 6)
)  # fmt: skip
"""The unknowns."""
ROTOR_STATES = (STATE.coning, STATE.flap_1c, STATE.flap_1s, STATE.inflow_0, STATE.inflow_1c, STATE.inflow_1s)
DIFFERENCE_STATES = (
    STATE.coning_difference,
    STATE.flap_1c_difference,
    STATE.flap_1s_difference,
    STATE.inflow_0_difference,
    STATE.inflow_1c_difference,
    STATE.inflow_1s_difference,
)
RESIDUAL_ROWS = (
    STATE.u, STATE.w, STATE.q, STATE.v, STATE.p, STATE.r,
    STATE.coning_rate, STATE.flap_1c_rate, STATE.flap_1s_rate, *ROTOR_STATES[3:],
    STATE.coning_rate_difference, STATE.flap_1c_rate_difference, STATE.flap_1s_rate_difference,
    *DIFFERENCE_STATES[3:],
)  # fmt: skip
"""State whose rate each residual is."""
_ROTOR_SCALE = (1e-2, 1e-2, 1e-2, 1.0, 1.0, 1.0)
RESIDUAL_SCALE = (*(1.0,) * 6, *_ROTOR_SCALE, *_ROTOR_SCALE)
STEPS = (*(1e-5,) * 6, *((*(1e-5,) * 3, *(1e-6,) * 3) * 2))
"""Steps of the central differences, one for each unknown."""
SIDE = Places("lateral_airspeed", "sideslip", "body", "turn")
"""What is asked for: a horizontal airspeed to the right, a sideslip, a velocity along body y, or a coordinated turn (no
velocity along body y) at a bank angle."""
_STATE_COUNT, _INPUT_COUNT = len(ALL_STATES), len(ALL_INPUTS)


class Steady(NamedTuple):
    """A steady flight."""

    airspeed: float
    """Horizontal airspeed along the heading; with a sideslip the whole horizontal airspeed [m/s]."""
    acceleration: float
    """Acceleration along it [m/s^2]."""
    nacelle: float
    """Nacelle angle [rad]."""
    kind: float
    """One of ``SIDE``."""
    side: float
    """Lateral airspeed or velocity [m/s], sideslip or bank [rad]."""


@inner_kernel
def steady_motion(flight: Steady, pitch: float, turn: float, x: FloatArray) -> None:
    """Velocities, rates and attitude of a steady flight.

    Args:
        flight: What is flown.
        pitch: Pitch attitude [rad].
        turn: Bank [rad]; in a turn the turn rate [rad/s].
        x: Their places are written.
    """
    turning = flight.kind == SIDE.turn
    bank, turn_rate = (flight.side, turn) if turning else (turn, 0.0)
    st, ct, sb, cb = math.sin(pitch), math.cos(pitch), math.sin(bank), math.cos(bank)
    ahead, across = flight.airspeed, flight.side
    if flight.kind == SIDE.sideslip:
        across = 0.0
        for _ in range(4):
            across = (flight.airspeed * math.sin(flight.side) - ahead * sb * st) / cb
            ahead = math.copysign(math.sqrt(max(flight.airspeed**2 - across * across, 0.0)), flight.airspeed)
    elif flight.kind == SIDE.body:
        across = (flight.side - ahead * sb * st) / cb
    elif turning:
        across = -ahead * sb * st / cb
    x[STATE.u] = ahead * ct
    x[STATE.v] = ahead * sb * st + across * cb
    x[STATE.w] = ahead * cb * st - across * sb
    x[STATE.p], x[STATE.q], x[STATE.r] = -turn_rate * st, turn_rate * ct * sb, turn_rate * ct * cb
    x[STATE.pitch], x[STATE.bank] = pitch, bank


@kernel
def steady_vectors(tables: AircraftTables, flight: Steady, z: FloatArray, x: FloatArray, u: FloatArray) -> None:
    """State and inputs of a set of unknowns; the actuators stand where the controls ask them to, stops ignored.

    Args:
        flight: What is flown.
        z: Unknowns.
        x: Written: state.
        u: Written: inputs.
    """
    controls, lateral = tables.controls, tables.lateral.controls
    nacelle = flight.nacelle
    x[:] = 0.0
    u[:] = 0.0
    steady_motion(flight, z[UNKNOWN.pitch], z[UNKNOWN.turn], x)
    for k in range(6):
        x[ROTOR_STATES[k]] = z[UNKNOWN.mean + k]
        x[DIFFERENCE_STATES[k]] = z[UNKNOWN.difference + k]
    low, high = curve(controls.collective_range, 0, nacelle), curve(controls.collective_range, 1, nacelle)
    u[INPUT.stick], u[INPUT.lever] = z[UNKNOWN.stick], (z[UNKNOWN.collective] - low) / (high - low)
    u[INPUT.lateral_stick], u[INPUT.pedal] = z[UNKNOWN.lateral_stick], z[UNKNOWN.pedal]
    speed = math.sqrt(x[STATE.u] ** 2 + x[STATE.w] ** 2)
    x[STATE.collective_75] = z[UNKNOWN.collective]
    x[STATE.cyclic_1s] = -u[INPUT.stick] * curve(controls.cyclic_per_stick, 0, nacelle)
    x[STATE.elevator] = u[INPUT.stick] * controls.elevator_per_stick
    x[STATE.collective_difference] = -u[INPUT.lateral_stick] * curve(lateral.collective_per_stick, 0, nacelle)
    x[STATE.cyclic_difference] = u[INPUT.pedal] * surface(lateral.cyclic_per_pedal, 0, speed, nacelle)
    x[STATE.aileron] = u[INPUT.lateral_stick] * lateral.aileron_per_stick
    x[STATE.rudder] = u[INPUT.pedal] * lateral.rudder_per_pedal


@kernel
def steady_residual(tables: AircraftTables, flight: Steady, z: FloatArray, residual: FloatArray) -> None:
    """Scaled residuals of a set of unknowns.

    Args:
        flight: What is flown.
        z: Unknowns.
        residual: Written: residuals.
    """
    x, u, xdot, work = np.empty(_STATE_COUNT), np.empty(_INPUT_COUNT), np.empty(_STATE_COUNT), np.empty(WORK_COUNT)
    steady_vectors(tables, flight, z, x, u)
    derivative(tables, x, u, flight.nacelle, xdot, work)
    bank, pitch = x[STATE.bank], x[STATE.pitch]
    # Along the heading, turned into body axes.
    xdot[STATE.u] -= flight.acceleration * math.cos(pitch)
    xdot[STATE.v] -= flight.acceleration * math.sin(bank) * math.sin(pitch)
    xdot[STATE.w] -= flight.acceleration * math.cos(bank) * math.sin(pitch)
    for i in range(UNKNOWN.size):
        residual[i] = RESIDUAL_SCALE[i] * xdot[RESIDUAL_ROWS[i]]


@kernel
def steady_jacobian(tables: AircraftTables, flight: Steady, z: FloatArray, jacobian: FloatArray) -> None:
    """Jacobian of the residuals by central differences.

    Args:
        flight: What is flown.
        z: Unknowns.
        jacobian: Written: derivative of residual (row) with respect to unknown (column).
    """
    point, above, below = z.copy(), np.empty(UNKNOWN.size), np.empty(UNKNOWN.size)
    for i in range(UNKNOWN.size):
        point[i] = z[i] + STEPS[i]
        steady_residual(tables, flight, point, above)
        point[i] = z[i] - STEPS[i]
        steady_residual(tables, flight, point, below)
        point[i] = z[i]
        for k in range(UNKNOWN.size):
            jacobian[k, i] = (above[k] - below[k]) / (2.0 * STEPS[i])
