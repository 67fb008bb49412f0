"""The lateral half of the linear model: Jacobians out of the plane of symmetry, by central differences.

In a mirror every lateral variable changes its sign and every symmetric one stays: at a symmetric state the two halves
of the linear model do not meet, so the lateral one is found by moving lateral variables alone.
"""

from __future__ import annotations

import numpy as np

from rtsim.aircraft.points import LateralModel
from rtsim.aircraft.variables import (
    ALL_INPUTS,
    ALL_OUTPUTS,
    ALL_STATES,
    INPUTS,
    LATERAL_INPUTS,
    LATERAL_OUTPUTS,
    LATERAL_STATES,
    OUTPUTS,
    STATES,
    whole,
)
from rtsim.aircraft.xv15 import dynamics_kernels as kernels
from rtsim.aircraft.xv15.linearize import STATE_STEPS
from rtsim.aircraft.xv15.tables import AircraftTables
from rtsim.arrays import FloatArray

_LATERAL = slice(len(STATES), len(STATES) + len(LATERAL_STATES))
_STATE_STEPS = STATE_STEPS | {("navigation", "rad"): 1e-3}
_INPUT_STEPS = {("pilot", ""): 1e-3, ("gust", "m/s"): 0.05, ("gust", "rad/s"): 2e-3, ("ground", "m/s^2"): 1.0,
                ("ground", "rad/s^2"): 1.0}  # fmt: skip


def linearize_lateral_at(
    tables: AircraftTables, nacelle: float, x: FloatArray, u: FloatArray, *, step_scale: float = 1.0
) -> LateralModel:
    """Lateral Jacobians at a symmetric state.

    Args:
        tables: The aircraft, already at its condition.
        nacelle: Nacelle angle [rad].
        x: State; the symmetric ones alone will do.
        u: Inputs; the symmetric ones alone will do.
        step_scale: Multiplies every step.
    """
    x, u = whole(x[: len(STATES)], ALL_STATES), whole(u[: len(INPUTS)], ALL_INPUTS)
    xdot, y, work = np.zeros(x.size), np.zeros(len(ALL_OUTPUTS)), np.zeros(kernels.WORK_COUNT)

    def column(vector: FloatArray, place: int, size: float) -> FloatArray:
        """Derivative of lateral rates and outputs with one variable."""
        # Every lateral quantity is odd: the difference of both sides is twice the one.
        vector[place] = size
        kernels.outputs(tables, x, u, nacelle, y, xdot, work)
        vector[place] = 0.0
        return np.concatenate([xdot[_LATERAL], y[len(OUTPUTS) :]]) / size

    states = [
        column(x, len(STATES) + k, _STATE_STEPS[variable.role, variable.unit] * step_scale)
        for k, variable in enumerate(LATERAL_STATES)
    ]
    inputs = [
        column(u, len(INPUTS) + k, _INPUT_STEPS[variable.role, variable.unit] * step_scale)
        for k, variable in enumerate(LATERAL_INPUTS)
    ]
    n = len(LATERAL_STATES)
    by_state, by_input = np.array(states).T, np.array(inputs).T
    assert by_state.shape == (n + len(LATERAL_OUTPUTS), n)
    return LateralModel(
        A=np.ascontiguousarray(by_state[:n]),
        B=np.ascontiguousarray(by_input[:n]),
        C=np.ascontiguousarray(by_state[n:]),
        D=np.ascontiguousarray(by_input[n:]),
    )
