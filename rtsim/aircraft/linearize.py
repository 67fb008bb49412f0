"""Jacobians of the nonlinear model by central differences with steps scaled to each variable."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtsim.aircraft import dynamics_kernels as kernels
from rtsim.aircraft.points import Condition, LinearModel, TrimPoint
from rtsim.aircraft.signals import OUTPUTS
from rtsim.aircraft.table_kernels import FloatArray

# Large enough to average over table curvature, small enough for second-order accuracy (docs/model.md).
STATE_STEPS = np.array(
    [0.05, 0.05, 2e-3, 1e-3, 1.0, 1e-4, 1e-2, 1e-4, 1e-2, 1e-4, 1e-2, 1e-4, 1e-4, 1e-4, 1e-4, 1e-4, 1e-3]
)

if TYPE_CHECKING:
    from rtsim.aircraft.model import Xv15
INPUT_STEPS = np.array([1e-3, 1e-3, 1e-3, 1e-3, 0.05, 0.05, 2e-3])
NACELLE_STEP = 1e-4


def _evaluate(aircraft: Xv15, x: FloatArray, u: FloatArray, nacelle: float) -> FloatArray:
    xdot, y = np.zeros(x.size), np.zeros(len(OUTPUTS))
    kernels.outputs(aircraft.tables, x, u, nacelle, y, xdot, np.zeros(kernels.WORK_COUNT))
    return np.concatenate([xdot, y])


def linearize_at(aircraft: Xv15, condition: Condition, trim: TrimPoint, *, step_scale: float) -> LinearModel:
    """Jacobians at a trim point.

    Args:
        aircraft: The aircraft, already at the condition.
        condition: The flight condition.
        trim: The trim point.
        step_scale: Multiplies every step.
    """
    x, u, nacelle = trim.x, trim.u, condition.nacelle_angle
    columns = []
    for i, size in enumerate(STATE_STEPS * step_scale):
        shift = np.zeros(x.size)
        shift[i] = size
        above, below = _evaluate(aircraft, x + shift, u, nacelle), _evaluate(aircraft, x - shift, u, nacelle)
        columns.append((above - below) / (2 * size))
    for i, size in enumerate(INPUT_STEPS * step_scale):
        shift = np.zeros(u.size)
        shift[i] = size
        above, below = _evaluate(aircraft, x, u + shift, nacelle), _evaluate(aircraft, x, u - shift, nacelle)
        columns.append((above - below) / (2 * size))
    step = NACELLE_STEP * step_scale
    by_nacelle = (_evaluate(aircraft, x, u, nacelle + step) - _evaluate(aircraft, x, u, nacelle - step)) / (2 * step)
    jacobian = np.array(columns).T
    n = x.size
    return LinearModel(
        A=np.ascontiguousarray(jacobian[:n, :n]),
        B=np.ascontiguousarray(jacobian[:n, n:]),
        C=np.ascontiguousarray(jacobian[n:, :n]),
        D=np.ascontiguousarray(jacobian[n:, n:]),
        df_dnacelle=by_nacelle[:n].copy(),
    )
