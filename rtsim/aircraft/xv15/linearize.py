"""Jacobians of the nonlinear model by central differences with steps scaled to each variable."""

from __future__ import annotations

import numpy as np

from rtsim.aircraft.points import Condition, LinearModel, TrimPoint
from rtsim.aircraft.variables import (
    ALL_INPUTS,
    ALL_OUTPUTS,
    ALL_STATES,
    FLAP_INPUTS,
    INPUT,
    INPUTS,
    OUTPUTS,
    STATE,
    STATES,
    whole,
)
from rtsim.aircraft.xv15 import dynamics_kernels as kernels
from rtsim.aircraft.xv15.tables import AircraftTables
from rtsim.arrays import FloatArray

# Large enough to average over table curvature, small enough for second-order accuracy (docs/model.md).
STATE_STEPS = {
    ("rigid", "m/s"): 0.05,
    ("rigid", "rad/s"): 2e-3,
    ("rigid", "rad"): 1e-3,
    ("navigation", "m"): 1.0,
    ("rotor", "rad"): 1e-4,
    ("rotor", "rad/s"): 1e-2,
    ("inflow", ""): 1e-4,
    ("actuator", "rad"): 1e-4,
}
"""Steps of the states, by role and unit."""
ELEVATOR_STEP = 1e-3
INPUT_STEPS = {
    "stick": 1e-3,
    "lever": 1e-3,
    "nacelle_rate": 1e-3,
    "nacelle_acceleration": 1e-3,
    "gust_u": 0.05,
    "gust_w": 0.05,
    "gust_q": 2e-3,
    "rotor_speed": 0.1,
    "contact_x": 1.0,
    "contact_z": 1.0,
    "contact_pitch": 1.0,
}
"""Steps of the inputs; those of flaps and ground effect are taken over their whole interval."""
NACELLE_STEP = 1e-4


def _evaluate(tables: AircraftTables, x: FloatArray, u: FloatArray, nacelle: float) -> FloatArray:
    x, u = whole(x, ALL_STATES), whole(u, ALL_INPUTS)
    xdot, y = np.zeros(x.size), np.zeros(len(ALL_OUTPUTS))
    kernels.outputs(tables, x, u, nacelle, y, xdot, np.zeros(kernels.WORK_COUNT))
    return np.concatenate([xdot[: len(STATES)], y[: len(OUTPUTS)]])


def _flap_column(tables: AircraftTables, trim: TrimPoint, condition: Condition, interval: int) -> FloatArray:
    """Effect of the flaps in one interval between published settings, wherever in the travel the trim has them.

    A small step at the trim would mix two intervals: the schedule stands at the corner between them.
    """
    nacelle, u = condition.nacelle_angle, trim.u.copy()
    present = tables.configuration.flap
    if present < 0.0:
        speed = float(np.hypot(trim.x[STATE.u] + u[INPUT.gust_u], trim.x[STATE.w] + u[INPUT.gust_w]))
        present = float(kernels.flap_schedule(tables.controls, speed, nacelle))
    for name in FLAP_INPUTS:
        u[getattr(INPUT, name)] = 0.0
    ends = []
    for node in tables.wing.flap_nodes[interval : interval + 2]:
        u[INPUT.flap_0_20] = node - present
        ends.append(_evaluate(tables, trim.x, u, nacelle))
    low, high = tables.wing.flap_nodes[interval : interval + 2]
    return np.asarray((ends[1] - ends[0]) / (high - low))


def linearize_at(tables: AircraftTables, condition: Condition, trim: TrimPoint, *, step_scale: float) -> LinearModel:
    """Jacobians at a trim point.

    Args:
        tables: The aircraft, already at the condition.
        trim: The trim point.
        step_scale: Multiplies every step.
    """
    x, u, nacelle = trim.x, trim.u, condition.nacelle_angle
    columns = []
    for i, variable in enumerate(STATES):
        size = ELEVATOR_STEP if variable.name == "elevator" else STATE_STEPS[variable.role, variable.unit]
        size *= step_scale
        shift = np.zeros(x.size)
        shift[i] = size
        above, below = _evaluate(tables, x + shift, u, nacelle), _evaluate(tables, x - shift, u, nacelle)
        columns.append((above - below) / (2 * size))
    for i, variable in enumerate(INPUTS):
        if variable.name in FLAP_INPUTS:
            columns.append(_flap_column(tables, trim, condition, FLAP_INPUTS.index(variable.name)))
            continue
        if variable.name == "ground_effect":
            near = u.copy()
            near[i] = 1.0
            columns.append(_evaluate(tables, x, near, nacelle) - _evaluate(tables, x, u, nacelle))
            continue
        size = INPUT_STEPS[variable.name] * step_scale
        shift = np.zeros(u.size)
        shift[i] = size
        above, below = _evaluate(tables, x, u + shift, nacelle), _evaluate(tables, x, u - shift, nacelle)
        columns.append((above - below) / (2 * size))
    step = NACELLE_STEP * step_scale
    by_nacelle = (_evaluate(tables, x, u, nacelle + step) - _evaluate(tables, x, u, nacelle - step)) / (2 * step)
    jacobian = np.array(columns).T
    n = x.size
    return LinearModel(
        A=np.ascontiguousarray(jacobian[:n, :n]),
        B=np.ascontiguousarray(jacobian[:n, n:]),
        C=np.ascontiguousarray(jacobian[n:, :n]),
        D=np.ascontiguousarray(jacobian[n:, n:]),
        df_dnacelle=by_nacelle[:n].copy(),
    )
