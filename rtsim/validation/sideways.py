"""The bench out of the plane of symmetry: control power, roots, and what a step of the controls does.

Legend:
    bench: The model.
    airspeed_kt: Airspeed [kn].
    nacelle_deg: Nacelle angle [deg].
    **rest: As of ``Bench.condition``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from rtsim.aircraft.points import Condition, LateralModel
from rtsim.aircraft.variables import (
    ALL_INPUTS,
    ALL_STATES,
    LATERAL_INPUTS,
    LATERAL_STATES,
    of_role,
    position,
    whole,
)
from rtsim.arrays import FloatArray
from rtsim.units import deg, kt, to_deg
from rtsim.validation.bench import Bench
from rtsim.validation.published import Table

TRAVEL_IN = {"lateral_stick": 4.8, "pedal": 2.5}
"""From neutral to the stop [in]."""
_FRAME = 0.004
_SLOW = of_role(LATERAL_STATES, "rigid")
_FAST = of_role(LATERAL_STATES, "rotor", "inflow", "actuator")


def with_inertia_of_1975(bench: Bench) -> Bench:
    """The same aircraft with the moments of inertia that the predictions of 1975 were made with."""
    table, changes = Table("lateral.inertia_1975"), {}
    for axis, name in (("xx", "roll"), ("zz", "yaw")):
        upright, airplane = table.values(f"{name}_slugft2")
        changes[f"mass.I{axis}_heli_slugft2"] = upright
        changes[f"mass.dI{axis}_dbetam_slugft2_per_deg"] = (airplane - upright) / 90.0
    return bench.changed(changes)


def lateral_model(bench: Bench, airspeed_kt: float, nacelle_deg: float, **rest: Any) -> LateralModel | None:
    """Jacobians at a level trim; None where there is none."""
    condition = bench.condition(airspeed_kt, nacelle_deg, **rest)
    point = bench.point(condition)
    if not point.converged:
        return None
    return bench.once(("lateral", condition), lambda: bench.aircraft.linearize_lateral(condition, point))


def acceleration(bench: Bench, control: str, rate: str, airspeed_kt: float, nacelle_deg: float, **rest: Any) -> float:
    """Angular acceleration per inch of a control, rotors and actuators settled [rad/s^2/in].

    Args:
        control: ``lateral_stick`` or ``pedal``.
        rate: ``p`` or ``r``.
    """
    model = lateral_model(bench, airspeed_kt, nacelle_deg, **rest)
    if model is None:
        return math.nan
    _, b = _settled(model)
    row = _SLOW.index(position(LATERAL_STATES, rate))
    return float(b[row, position(LATERAL_INPUTS, control)]) / TRAVEL_IN[control]


def damping(bench: Bench, rate: str, airspeed_kt: float, nacelle_deg: float, **rest: Any) -> float:
    """Damping of a rate, rotors and actuators settled [1/s].

    Args:
        rate: ``p`` or ``r``.
    """
    model = lateral_model(bench, airspeed_kt, nacelle_deg, **rest)
    if model is None:
        return math.nan
    row = _SLOW.index(position(LATERAL_STATES, rate))
    return -float(_settled(model)[0][row, row])


def _settled(model: LateralModel) -> tuple[FloatArray, FloatArray]:
    """A and B of the rigid body with everything fast in equilibrium."""
    a, b = model.A, model.B
    slow, fast = np.array(_SLOW), np.array(_FAST)
    follows = np.linalg.solve(a[np.ix_(fast, fast)], np.hstack([a[np.ix_(fast, slow)], b[fast]]))
    across = a[np.ix_(slow, fast)]
    return a[np.ix_(slow, slow)] - across @ follows[:, : slow.size], b[slow] - across @ follows[:, slow.size :]


def roots(bench: Bench, airspeed_kt: float, nacelle_deg: float, **rest: Any) -> Sequence[complex]:
    """Roots slower than 4 rad/s, heading left out; none where there is no trim."""
    model = lateral_model(bench, airspeed_kt, nacelle_deg, **rest)
    if model is None:
        return []
    kept = np.array(sorted((*_SLOW, *_FAST)))
    found = np.linalg.eigvals(model.A[np.ix_(kept, kept)])
    return [complex(root) for root in found if abs(root) < 4.0]


def oscillation(found: Sequence[complex]) -> complex:
    """The least damped of the oscillations, upper half; NaN where there is none.

    Args:
        found: Roots.
    """
    pairs = [root for root in found if root.imag > 1e-6]
    return max(pairs, key=lambda root: root.real / abs(root), default=complex(math.nan, math.nan))


def roll_root(found: Sequence[complex]) -> float:
    """The fastest of the real roots [1/s]; NaN where there is none.

    Args:
        found: Roots.
    """
    return min((root.real for root in found if abs(root.imag) < 1e-6), default=math.nan)


def turned(
    bench: Bench, control: str, inches: float, seconds: float, airspeed_kt: float, nacelle_deg: float, **rest: Any
) -> float:
    """Bank or heading [deg] of the nonlinear aircraft that long after a step of lateral stick or pedal.

    Args:
        control: ``lateral_stick``: bank; ``pedal``: heading.
        inches: Its deflection [in].
        seconds: How long it is held [s].
    """
    condition = bench.condition(airspeed_kt, nacelle_deg, **rest)
    point = bench.point(condition)
    if not point.converged:
        return math.nan
    x, u = whole(point.x, ALL_STATES), whole(point.u, ALL_INPUTS)
    u[position(ALL_INPUTS, control)] = inches / TRAVEL_IN[control]
    x = _flown(bench, condition, x, u, seconds)
    return to_deg(float(x[position(ALL_STATES, "bank" if control == "lateral_stick" else "heading")]))


def _flown(bench: Bench, condition: Condition, x: FloatArray, u: FloatArray, seconds: float) -> FloatArray:
    """The state after some time with the controls held, by the classical Runge-Kutta method."""
    aircraft, nacelle, h = bench.aircraft.at(condition), condition.nacelle_angle, _FRAME
    for _ in range(round(seconds / h)):
        one = aircraft.derivative(x, u, nacelle)
        two = aircraft.derivative(x + 0.5 * h * one, u, nacelle)
        three = aircraft.derivative(x + 0.5 * h * two, u, nacelle)
        four = aircraft.derivative(x + h * three, u, nacelle)
        x = x + h / 6.0 * (one + 2.0 * two + 2.0 * three + four)
    return x


def largest_control(bench: Bench, airspeed_kt: float, lateral_kt: float) -> float:
    """Share of its travel of the control that a flight in helicopter mode needs most; NaN: there is no trim.

    Args:
        lateral_kt: Airspeed to the right [kn].
    """
    condition = Condition(airspeed=kt(airspeed_kt), nacelle_angle=deg(90.0), lateral_airspeed=kt(lateral_kt))
    point = bench.point(condition)
    if not point.converged:
        return math.nan
    u = whole(point.u, ALL_INPUTS)
    return max(abs(float(u[position(ALL_INPUTS, name)])) for name in ("stick", "lateral_stick", "pedal"))
