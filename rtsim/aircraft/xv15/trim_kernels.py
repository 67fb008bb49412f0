"""Residuals of a level-flight trim and their Jacobian, compiled: one call per Newton step.

Unknowns z: pitch, stick, collective, coning, flap_1c, flap_1s, inflow_0, inflow_1c, inflow_1s.
Residuals: rates of u, w, q, coning_rate, flap_1c_rate, flap_1s_rate, inflow_0, inflow_1c, inflow_1s, less the wanted
acceleration; the three flapping accelerations are scaled down to the size of the others.
"""

from __future__ import annotations

import math

import numpy as np

from rtsim.aircraft.table_kernels import curve
from rtsim.aircraft.variables import ALL_INPUTS, ALL_STATES, INPUT, STATE
from rtsim.aircraft.xv15.dynamics_kernels import WORK_COUNT, derivative
from rtsim.aircraft.xv15.tables import AircraftTables
from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import kernel
from rtsim.units import GRAVITY

UNKNOWNS = 9
RESIDUAL_ROWS = (
    STATE.u,
    STATE.w,
    STATE.q,
    STATE.coning_rate,
    STATE.flap_1c_rate,
    STATE.flap_1s_rate,
    STATE.inflow_0,
    STATE.inflow_1c,
    STATE.inflow_1s,
)
"""State whose rate each residual is."""
RESIDUAL_SCALE = (1.0, 1.0, 1.0, 1e-2, 1e-2, 1e-2, 1.0, 1.0, 1.0)
STEPS = (1e-5, 1e-5, 1e-5, 1e-5, 1e-5, 1e-5, 1e-6, 1e-6, 1e-6)
"""Steps of the central differences, one for each unknown."""
_STATE_COUNT, _INPUT_COUNT = len(ALL_STATES), len(ALL_INPUTS)

Flight = tuple[float, float, float, float]
"""Horizontal airspeed [m/s], acceleration along it [m/s^2], nacelle angle [rad], load factor."""


@kernel
def trim_vectors(tables: AircraftTables, flight: Flight, z: FloatArray, x: FloatArray, u: FloatArray) -> None:
    """State and inputs of a set of unknowns; the actuators stand where stick and lever ask them to, stops ignored.

    Args:
        flight: Airspeed, acceleration, nacelle angle, load factor.
        z: Unknowns.
        x: Written: state.
        u: Written: inputs.
    """
    airspeed, _, nacelle, _ = flight
    controls = tables.controls
    low = curve(controls.collective_range, 0, nacelle)
    high = curve(controls.collective_range, 1, nacelle)
    x[:] = 0.0
    u[:] = 0.0
    x[STATE.u] = airspeed * math.cos(z[0])
    x[STATE.w] = airspeed * math.sin(z[0])
    x[STATE.pitch] = z[0]
    x[STATE.collective_75] = z[2]
    x[STATE.cyclic_1s] = -z[1] * curve(controls.cyclic_per_stick, 0, nacelle)
    x[STATE.elevator] = z[1] * controls.elevator_per_stick
    x[STATE.coning], x[STATE.flap_1c], x[STATE.flap_1s] = z[3], z[4], z[5]
    x[STATE.inflow_0], x[STATE.inflow_1c], x[STATE.inflow_1s] = z[6], z[7], z[8]
    u[INPUT.stick] = z[1]
    u[INPUT.lever] = (z[2] - low) / (high - low)


@kernel
def trim_residual(tables: AircraftTables, flight: Flight, z: FloatArray, residual: FloatArray) -> None:
    """Scaled residuals of a set of unknowns.

    Args:
        flight: Airspeed, acceleration, nacelle angle, load factor.
        z: Unknowns.
        residual: Written: residuals.
    """
    x, u, xdot, work = np.empty(_STATE_COUNT), np.empty(_INPUT_COUNT), np.empty(_STATE_COUNT), np.empty(WORK_COUNT)
    trim_vectors(tables, flight, z, x, u)
    derivative(tables, x, u, flight[2], xdot, work)
    heavier = GRAVITY * (flight[3] - 1.0)
    xdot[STATE.u] -= flight[1] * math.cos(z[0]) + heavier * math.sin(z[0])
    xdot[STATE.w] -= flight[1] * math.sin(z[0]) - heavier * math.cos(z[0])
    for i in range(UNKNOWNS):
        residual[i] = RESIDUAL_SCALE[i] * xdot[RESIDUAL_ROWS[i]]


@kernel
def trim_jacobian(tables: AircraftTables, flight: Flight, z: FloatArray, jacobian: FloatArray) -> None:
    """Jacobian of the residuals by central differences.

    Args:
        flight: Airspeed, acceleration, nacelle angle, load factor.
        z: Unknowns.
        jacobian: Written: derivative of residual (row) with respect to unknown (column).
    """
    point, above, below = z.copy(), np.empty(UNKNOWNS), np.empty(UNKNOWNS)
    for i in range(UNKNOWNS):
        point[i] = z[i] + STEPS[i]
        trim_residual(tables, flight, point, above)
        point[i] = z[i] - STEPS[i]
        trim_residual(tables, flight, point, below)
        point[i] = z[i]
        for k in range(UNKNOWNS):
            jacobian[k, i] = (above[k] - below[k]) / (2.0 * STEPS[i])
