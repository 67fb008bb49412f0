"""Steady flight that is not symmetric: turns, sideslip, sideward flight; reached from symmetric flight in small steps.

A steady flight is a point on a branch that begins in symmetric flight. Newton's iteration is started from its neighbour
on that branch, and a step that does not arrive is halved; where the steps get too small the branch has ended.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from rtsim.aircraft.points import Condition, TrimPoint
from rtsim.aircraft.variables import ALL_INPUTS, ALL_OUTPUTS, ALL_STATES, INPUT, STATE, whole
from rtsim.aircraft.xv15 import dynamics_kernels as kernels
from rtsim.aircraft.xv15.steady_kernels import (
    DIFFERENCE_STATES,
    RESIDUAL_ROWS,
    ROTOR_STATES,
    SIDE,
    UNKNOWN,
    Steady,
    steady_jacobian,
    steady_residual,
    steady_vectors,
)
from rtsim.aircraft.xv15.tables import AircraftTables
from rtsim.aircraft.xv15.trim import CONVERGED, solve_trim
from rtsim.arrays import FloatArray
from rtsim.units import deg, kt

_LARGEST_MOVE = np.array([0.05, 0.1, 0.15, 0.05, 0.1, 0.15, *((0.03, 0.03, 0.03, 0.02, 0.02, 0.02) * 2)])
"""Largest change of each unknown in one Newton step."""
LARGEST_STEP = {SIDE.lateral_airspeed: kt(5.0), SIDE.sideslip: deg(3.0), SIDE.body: kt(5.0), SIDE.turn: deg(10.0)}
"""Steps of the continuation, by what is asked for."""
_SMALLEST_SHARE = 1.0 / 64.0
CONTROLS = ("stick", "lateral_stick", "pedal")
NEAR_STOP = 0.95
"""A control this far out ends a branch that goes no further."""


def steady_flight(condition: Condition) -> Steady:
    """A condition as the kernels take it.

    Args:
        condition: The condition.
    """
    kind, side = SIDE.lateral_airspeed, condition.lateral_airspeed
    if condition.bank != 0.0:
        kind, side = SIDE.turn, condition.bank
    elif condition.sideslip != 0.0:
        kind, side = SIDE.sideslip, condition.sideslip
    values = (condition.airspeed, condition.acceleration, condition.nacelle_angle, kind, side)
    return Steady(*(float(value) for value in values))


def unknowns_of(x: FloatArray, u: FloatArray) -> FloatArray:
    """Unknowns of a state and inputs without turn.

    Args:
        x: State.
        u: Inputs.
    """
    z = np.zeros(UNKNOWN.size)
    z[UNKNOWN.pitch], z[UNKNOWN.turn] = x[STATE.pitch], x[STATE.bank]
    z[UNKNOWN.stick], z[UNKNOWN.collective] = u[INPUT.stick], x[STATE.collective_75]
    z[UNKNOWN.lateral_stick], z[UNKNOWN.pedal] = u[INPUT.lateral_stick], u[INPUT.pedal]
    z[UNKNOWN.mean : UNKNOWN.mean + 6] = x[list(ROTOR_STATES)]
    z[UNKNOWN.difference : UNKNOWN.difference + 6] = x[list(DIFFERENCE_STATES)]
    return z


def newton(
    tables: AircraftTables, flight: Steady, z: FloatArray, jacobian: FloatArray, *, iterations: int = 12
) -> FloatArray | None:
    """Solve from a guess; None where it does not close.

    Args:
        tables: The aircraft, already at the condition.
        flight: What is flown.
        z: Unknowns to start from.
        jacobian: Work space (UNKNOWN.size, UNKNOWN.size): used as it is as long as it serves, and renewed when not, so
            that neighbours share it; all zero at first.
        iterations: Most iterations.
    """
    z, residual = z.copy(), np.empty(UNKNOWN.size)
    fresh = not jacobian.any()
    if fresh:
        steady_jacobian(tables, flight, z, jacobian)
    steady_residual(tables, flight, z, residual)
    size = float(np.max(np.abs(residual)))
    for _ in range(iterations):
        if not np.isfinite(size):
            return None
        if size < CONVERGED:
            return z
        try:
            move = np.linalg.solve(jacobian, -residual)
        except np.linalg.LinAlgError:
            return None
        move /= max(1.0, float(np.max(np.abs(move) / _LARGEST_MOVE)))
        trial = z + move
        steady_residual(tables, flight, trial, residual)
        found = float(np.max(np.abs(residual)))
        if found < 0.3 * size:
            z, size, fresh = trial, found, False
            continue
        if fresh and not found < size:
            return None
        # The old Jacobian does not serve any more, or the new one only just.
        if found < size:
            z, size = trial, found
        else:
            steady_residual(tables, flight, z, residual)
        steady_jacobian(tables, flight, z, jacobian)
        fresh = True
    return z if size < CONVERGED else None


def steady_point(tables: AircraftTables, flight: Steady, z: FloatArray, *, reached: bool = True) -> TrimPoint:
    """The flight of a set of unknowns.

    Args:
        tables: The aircraft, already at the condition.
        flight: What is flown.
        z: Unknowns.
        reached: They are those of the flight that was asked for.
    """
    x, u, residual = np.empty(len(ALL_STATES)), np.empty(len(ALL_INPUTS)), np.empty(UNKNOWN.size)
    xdot, y, work = np.zeros(x.size), np.zeros(len(ALL_OUTPUTS)), np.zeros(kernels.WORK_COUNT)
    steady_vectors(tables, flight, z, x, u)
    kernels.outputs(tables, x, u, flight.nacelle, y, xdot, work)
    steady_residual(tables, flight, z, residual)
    worst = int(np.argmax(np.abs(residual)))
    unclosed = ""
    if not reached:
        # The tables of rudder and cyclic end with the controls' travel: a branch that stops there stops for them.
        near = [name for name in CONTROLS if abs(u[getattr(INPUT, name)]) > NEAR_STOP]
        unclosed = near[0] if near else ALL_STATES[RESIDUAL_ROWS[worst]].name
    elif not abs(residual[worst]) < CONVERGED:
        unclosed = ALL_STATES[RESIDUAL_ROWS[worst]].name
    else:
        unclosed = next((name for name in CONTROLS if abs(u[getattr(INPUT, name)]) > 1.0), "")
    return TrimPoint(x, u, y, xdot, converged=unclosed == "", residual=float(abs(residual[worst])), unclosed=unclosed)


def solve_steady(tables: AircraftTables, condition: Condition) -> TrimPoint:
    """Trim a flight that is not symmetric.

    Args:
        tables: The aircraft, already at the condition.
        condition: What is flown.

    Returns:
        State, inputs and outputs in full; where the branch ends before the flight that was asked for, its last point,
        with ``converged`` False and ``unclosed`` naming a control that is on its stop or a rate that did not close.
    """
    goal = steady_flight(condition)
    airspeed = condition.airspeed
    if goal.kind == SIDE.lateral_airspeed and airspeed == 0.0 and goal.side == 0.0:
        return _widened(solve_trim(tables, condition, None))
    start = solve_trim(tables, replace(condition, bank=0.0, sideslip=0.0, lateral_airspeed=0.0), None)
    if not start.converged:
        return _widened(start)
    z, jacobian = unknowns_of(whole(start.x, ALL_STATES), whole(start.u, ALL_INPUTS)), np.zeros((UNKNOWN.size,) * 2)

    def find(flight: Steady, guess: FloatArray) -> FloatArray | None:
        found = newton(tables, flight, guess, jacobian)
        if found is None:
            jacobian[:] = 0.0
        return found

    def point(flight: Steady, found: FloatArray, reached: bool) -> TrimPoint:
        return steady_point(tables, flight, found, reached=reached)

    return continued(goal, z, find, point)


def continued(
    goal: Steady,
    z: FloatArray,
    find: Callable[[Steady, FloatArray], FloatArray | None],
    point: Callable[[Steady, FloatArray, bool], TrimPoint],
) -> TrimPoint:
    """Follow the branch of an aircraft's steady flights from the symmetric one.

    Args:
        goal: The flight at its end.
        z: Unknowns of the symmetric flight; pitch and turn stand where ``UNKNOWN`` has them.
        find: Gives the unknowns of a flight from a guess; None where there are none.
        point: Makes a trim of a flight and its unknowns, or, where the third argument is False, of the last before the
            end of the branch.

    Returns:
        The flight asked for, or the last before the branch ends.
    """
    done, share = 0.0, min(1.0, LARGEST_STEP[int(goal.kind)] / abs(goal.side))
    before: tuple[float, FloatArray] | None = None
    while True:
        part = min(done + share, 1.0)
        flight = goal._replace(side=part * goal.side)
        guess = z.copy()
        if before is not None:
            guess += (part - done) / (done - before[0]) * (z - before[1])
        if goal.kind == SIDE.turn and before is None:  # a coordinated turn to begin with
            guess[UNKNOWN.turn] = 9.80665 * np.tan(flight.side) / max(abs(goal.airspeed), 1.0)
        found = find(flight, guess)
        if found is None:
            share *= 0.5
            if share < _SMALLEST_SHARE:
                return point(flight, z, False)
            continue
        before, z, done = (done, z), found, part
        reached = point(flight, z, True)
        if done >= 1.0 or not reached.converged:
            return reached
        share = min(share * 1.5, 1.0)


def _widened(point: TrimPoint) -> TrimPoint:
    widths = ((point.x, ALL_STATES), (point.u, ALL_INPUTS), (point.y, ALL_OUTPUTS), (point.xdot, ALL_STATES))
    x, u, y, xdot = (whole(vector, variables) for vector, variables in widths)
    return replace(point, x=x, u=u, y=y, xdot=xdot)
