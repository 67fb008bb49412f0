"""Level-flight trim by damped Newton iteration on accelerations, flapping and inflow."""

from __future__ import annotations

import math

import numpy as np

from rtsim.aircraft import dynamics_kernels as kernels
from rtsim.aircraft.model import Condition, TrimPoint, Xv15
from rtsim.aircraft.signals import INPUTS, OUTPUTS, STATE, STATES
from rtsim.aircraft.table_kernels import FloatArray, curve

# Unknowns: pitch, stick, collective, coning, flap_1c, flap_1s, inflow_0, inflow_1c, inflow_1s.
_STEPS = np.array([1e-5, 1e-5, 1e-5, 1e-5, 1e-5, 1e-5, 1e-6, 1e-6, 1e-6])
_LARGEST_MOVE = np.array([0.05, 0.15, 0.05, 0.03, 0.03, 0.03, 0.02, 0.02, 0.02])
_RESIDUAL_ROWS = (
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
_RESIDUAL_SCALE = np.array([1.0, 1.0, 1.0, 1e-2, 1e-2, 1e-2, 1.0, 1.0, 1.0])
CONVERGED = 1e-9
"""Largest scaled residual of a converged trim."""


def _vectors(aircraft: Xv15, condition: Condition, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """State, inputs and wanted state derivative of a set of unknowns."""
    pitch, stick, collective = z[0], z[1], z[2]
    controls, nacelle = aircraft.tables.controls, condition.nacelle_angle
    low = curve(controls.collective_range, 0, nacelle)
    high = curve(controls.collective_range, 1, nacelle)
    x, u, wanted = np.zeros(len(STATES)), np.zeros(len(INPUTS)), np.zeros(len(STATES))
    x[STATE.u] = condition.airspeed * math.cos(pitch)
    x[STATE.w] = condition.airspeed * math.sin(pitch)
    x[STATE.pitch] = pitch
    x[STATE.coning], x[STATE.flap_1c], x[STATE.flap_1s] = z[3:6]
    x[STATE.inflow_0], x[STATE.inflow_1c], x[STATE.inflow_1s] = z[6:9]
    u[0], u[1] = stick, (collective - low) / (high - low)
    x[STATE.collective_75] = collective
    x[STATE.cyclic_1s] = -stick * curve(controls.cyclic_per_stick, 0, nacelle)
    x[STATE.elevator] = stick * controls.elevator_per_stick
    wanted[STATE.u] = condition.acceleration * math.cos(pitch)
    wanted[STATE.w] = condition.acceleration * math.sin(pitch)
    return x, u, wanted


def _residual(aircraft: Xv15, condition: Condition, z: FloatArray, work: FloatArray) -> FloatArray:
    x, u, wanted = _vectors(aircraft, condition, z)
    xdot = np.zeros(len(STATES))
    kernels.derivative(aircraft.tables, x, u, condition.nacelle_angle, xdot, work)
    return (xdot - wanted)[list(_RESIDUAL_ROWS)] * _RESIDUAL_SCALE


def _newton(aircraft: Xv15, condition: Condition, z: FloatArray) -> tuple[FloatArray, float]:
    work = np.zeros(kernels.WORK_COUNT)
    residual = _residual(aircraft, condition, z, work)
    for _ in range(60):
        if np.max(np.abs(residual)) < CONVERGED:
            break
        jacobian = np.empty((z.size, z.size))
        for i in range(z.size):
            shift = np.zeros(z.size)
            shift[i] = _STEPS[i]
            jacobian[:, i] = (
                _residual(aircraft, condition, z + shift, work) - _residual(aircraft, condition, z - shift, work)
            ) / (2.0 * _STEPS[i])
        try:
            move = np.linalg.solve(jacobian, -residual)
        except np.linalg.LinAlgError:
            break
        move /= max(1.0, float(np.max(np.abs(move) / _LARGEST_MOVE)))
        best = None
        for damping in (1.0, 0.5, 0.25, 0.1, 0.03):
            candidate = z + damping * move
            trial = _residual(aircraft, condition, candidate, work)
            if np.all(np.isfinite(trial)) and np.linalg.norm(trial) < np.linalg.norm(residual):
                best = (candidate, trial)
                break
        if best is None:
            break
        z, residual = best
    return z, float(np.max(np.abs(residual)))


def _first_guess(aircraft: Xv15, condition: Condition) -> FloatArray:
    """Values near which the helicopter or the airplane trims; Newton does the rest."""
    air, rotor = aircraft.tables.configuration, aircraft.tables.rotor
    tip = air.rotor_speed * rotor.radius
    axial = condition.airspeed * math.cos(condition.nacelle_angle)
    disc = air.density * math.pi * rotor.radius**2
    share = math.sin(condition.nacelle_angle) ** 2 * max(0.2, 1.0 - (condition.airspeed / 60.0) ** 2) + 0.1
    thrust = 0.5 * air.mass * 9.81 * min(share, 1.1)
    induced = thrust / (2.0 * disc * max(math.sqrt(thrust / (2.0 * disc)), abs(condition.airspeed)))
    collective = math.atan2(axial + induced, 0.75 * tip) + 0.08
    return np.array([0.0, 0.0, collective, 0.05, 0.0, 0.0, induced / tip, 0.0, 0.0])


def solve_trim(aircraft: Xv15, condition: Condition, guess: TrimPoint | None) -> TrimPoint:
    """Trim at a condition.

    Args:
        aircraft: The aircraft, already at the condition.
        condition: The flight condition.
        guess: A neighbouring trim, or None.
    """
    if guess is None:
        z = _first_guess(aircraft, condition)
    else:
        x = guess.x
        z = np.array(
            [
                x[STATE.pitch],
                guess.u[0],
                x[STATE.collective_75],
                x[STATE.coning],
                x[STATE.flap_1c],
                x[STATE.flap_1s],
                x[STATE.inflow_0],
                x[STATE.inflow_1c],
                x[STATE.inflow_1s],
            ]
        )
    z, residual = _newton(aircraft, condition, z)
    x, u, _ = _vectors(aircraft, condition, z)
    xdot, y, work = np.zeros(len(STATES)), np.zeros(len(OUTPUTS)), np.zeros(kernels.WORK_COUNT)
    kernels.outputs(aircraft.tables, x, u, condition.nacelle_angle, y, xdot, work)
    return TrimPoint(x=x, u=u, y=y, xdot=xdot, converged=residual < CONVERGED, residual=residual)
