"""Level-flight trim by damped Newton iteration on accelerations, flapping and inflow.

Where the wing stalls the trim map folds and two trims exist. From a guess, Newton's answer is taken as it comes: the
caller continues from its own neighbour. Without a guess, an answer with the wing near or beyond stall counts only if it
is reached in small steps of airspeed from an easy condition at the same nacelle angle: that is the unstalled branch.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rtsim.aircraft.points import Condition, TrimPoint
from rtsim.aircraft.variables import (
    ALL_INPUTS,
    ALL_OUTPUTS,
    ALL_STATES,
    INPUT,
    INPUTS,
    OUTPUT,
    OUTPUTS,
    STATE,
    STATES,
)
from rtsim.aircraft.xv15 import dynamics_kernels as kernels
from rtsim.aircraft.xv15.tables import AircraftTables
from rtsim.aircraft.xv15.trim_kernels import (
    RESIDUAL_ROWS,
    UNKNOWNS,
    Flight,
    trim_jacobian,
    trim_residual,
    trim_vectors,
)
from rtsim.arrays import FloatArray
from rtsim.units import GRAVITY, KNOT

CONVERGED = 1e-9
"""Largest scaled residual of a converged trim."""
STALL_WATCH = math.radians(11.0)
"""Wing angle of attack from which a trim found without a guess must be reached by continuation."""
WING_BORNE_AIRSPEED = 15.0
"""Airspeed below which the wing's angle of attack says nothing about the branch [m/s]."""
_LARGEST_MOVE = np.array([0.05, 0.15, 0.05, 0.03, 0.03, 0.03, 0.02, 0.02, 0.02])
"""Largest change of each unknown in one Newton step."""
_STAGNATION_WINDOW = 6
"""Newton gives up when the residual falls by less than 30 % over this many iterations."""
# Easy airspeeds to start the continuation from, in knots at 13000 lb and sea level, by nacelle angle [deg].
_ANCHORS = ((75.0, (60.0, 30.0, 0.0, 85.0)), (45.0, (110.0, 90.0, 130.0, 60.0)), (-90.0, (150.0, 130.0, 175.0, 210.0)))
_LONGEST_STEP, _SHORTEST_STEP = 12.0, 0.25
"""Steps of the continuation [m/s]."""
_LARGEST_PITCH_CHANGE = math.radians(3.0)
"""Largest change of pitch accepted in one step near stall: a larger one is a jump to the other branch."""
_MOST_STEPS = 40


def _flight(condition: Condition) -> Flight:
    values = (condition.airspeed, condition.acceleration, condition.nacelle_angle, condition.load_factor)
    airspeed, acceleration, nacelle, load_factor = (float(value) for value in values)
    return airspeed, acceleration, nacelle, load_factor


def _newton(tables: AircraftTables, condition: Condition, z: FloatArray, iterations: int) -> FloatArray:
    flight = _flight(condition)
    residual, trial, jacobian = np.empty(UNKNOWNS), np.empty(UNKNOWNS), np.empty((UNKNOWNS, UNKNOWNS))
    trim_residual(tables, flight, z, residual)
    norms = [float(np.linalg.norm(residual))]
    for _ in range(iterations):
        if np.max(np.abs(residual)) < CONVERGED:
            break
        if len(norms) > _STAGNATION_WINDOW and norms[-1] > 0.7 * norms[-1 - _STAGNATION_WINDOW]:
            break
        trim_jacobian(tables, flight, z, jacobian)
        try:
            move = np.linalg.solve(jacobian, -residual)
        except np.linalg.LinAlgError:
            break
        move /= max(1.0, float(np.max(np.abs(move) / _LARGEST_MOVE)))
        for damping in (1.0, 0.5, 0.25, 0.1, 0.03):
            candidate = z + damping * move
            trim_residual(tables, flight, candidate, trial)
            norm = float(np.linalg.norm(trial))
            if norm < norms[-1]:  # False also where the trial is not a number
                break
        else:
            break
        z = candidate
        residual[:] = trial
        norms.append(norm)
    return z


def _first_guess(tables: AircraftTables, condition: Condition) -> FloatArray:
    """Values near which the helicopter or the airplane trims; Newton does the rest."""
    air, rotor = tables.configuration, tables.rotor
    tip = air.rotor_speed * rotor.radius
    axial = condition.airspeed * math.cos(condition.nacelle_angle)
    disc = air.density * math.pi * rotor.radius**2
    share = math.sin(condition.nacelle_angle) ** 2 * max(0.2, 1.0 - (condition.airspeed / 60.0) ** 2) + 0.1
    thrust = 0.5 * air.mass * GRAVITY * min(share, 1.1)
    induced = thrust / (2.0 * disc * max(math.sqrt(thrust / (2.0 * disc)), abs(condition.airspeed)))
    collective = math.atan2(axial + induced, 0.75 * tip) + 0.08
    return np.array([0.0, 0.0, collective, 0.05, 0.0, 0.0, induced / tip, 0.0, 0.0])


def _unknowns(point: TrimPoint) -> FloatArray:
    x = point.x
    states = (
        STATE.collective_75,
        STATE.coning,
        STATE.flap_1c,
        STATE.flap_1s,
        STATE.inflow_0,
        STATE.inflow_1c,
        STATE.inflow_1s,
    )
    return np.array([x[STATE.pitch], point.u[INPUT.stick], *(x[i] for i in states)])


def _point(tables: AircraftTables, condition: Condition, z: FloatArray) -> TrimPoint:
    """Trim point of a set of unknowns, saying which residual did not close."""
    x, u, residuals = np.empty(len(ALL_STATES)), np.empty(len(ALL_INPUTS)), np.empty(UNKNOWNS)
    trim_vectors(tables, _flight(condition), z, x, u)
    xdot, y, work = np.zeros(x.size), np.zeros(len(ALL_OUTPUTS)), np.zeros(kernels.WORK_COUNT)
    kernels.outputs(tables, x, u, condition.nacelle_angle, y, xdot, work)
    trim_residual(tables, _flight(condition), z, residuals)
    sizes = np.where(np.isfinite(residuals), np.abs(residuals), np.inf)
    worst = int(np.argmax(sizes))
    residual = float(sizes[worst])
    unclosed = ""
    if not residual < CONVERGED:
        unclosed = STATES[RESIDUAL_ROWS[worst]].name
    elif abs(u[INPUT.stick]) > 1.0:
        # The actuators stop: what closes on paper is not an equilibrium of the aircraft.
        unclosed = STATES[STATE.elevator].name
    states, inputs, outputs = (slice(len(variables)) for variables in (STATES, INPUTS, OUTPUTS))
    return TrimPoint(
        x[states], u[inputs], y[outputs], xdot[states], converged=unclosed == "", residual=residual, unclosed=unclosed
    )


def _solve(tables: AircraftTables, condition: Condition, z: FloatArray, iterations: int = 40) -> TrimPoint:
    return _point(tables, condition, _newton(tables, condition, z, iterations))


def _near_stall(point: TrimPoint, airspeed: float) -> bool:
    return airspeed > WING_BORNE_AIRSPEED and bool(point.y[OUTPUT.wing_angle_of_attack] > STALL_WATCH)


def _anchor(tables: AircraftTables, condition: Condition) -> tuple[TrimPoint, float] | None:
    """An unstalled trim at the same nacelle angle, from where the continuation starts, and its airspeed, or None."""
    air = tables.configuration
    # At the same lift coefficient the airspeed grows with the root of weight over density.
    scale = math.sqrt(air.mass / 5896.7 * 1.225 / air.density) * KNOT
    angle = math.degrees(condition.nacelle_angle)
    airspeeds = next(speeds for lowest, speeds in _ANCHORS if angle >= lowest)
    for airspeed in airspeeds:
        easy = replace(condition, airspeed=airspeed * scale)
        point = _solve(tables, easy, _first_guess(tables, easy))
        if point.converged and not _near_stall(point, easy.airspeed):
            return point, easy.airspeed
    return None


def _continue_to(tables: AircraftTables, condition: Condition, start: TrimPoint, airspeed: float) -> TrimPoint:
    """Walk in airspeed from a trim to the wanted one, shortening the step wherever the branch is lost."""
    point, step = start, _LONGEST_STEP
    for _ in range(_MOST_STEPS):
        left = condition.airspeed - airspeed
        last = abs(left) <= step
        goal = condition if last else replace(condition, airspeed=airspeed + math.copysign(step, left))
        trial = _solve(tables, goal, _unknowns(point), iterations=12)
        turn = abs(trial.x[STATE.pitch] - point.x[STATE.pitch])
        if trial.converged and not (_near_stall(trial, goal.airspeed) and turn > _LARGEST_PITCH_CHANGE):
            if last:
                return trial
            point, airspeed, step = trial, goal.airspeed, min(2.0 * step, _LONGEST_STEP)
        else:
            step = 0.3 * min(step, abs(left))
            if step < _SHORTEST_STEP:
                break
    # The branch ends before the wanted airspeed: report what does not close there.
    return _lost(_point(tables, condition, _unknowns(point)))


def _lost(point: TrimPoint) -> TrimPoint:
    """The same point, not converged whatever its residual."""
    return replace(point, converged=False, unclosed=point.unclosed or STATES[STATE.w].name)


def solve_trim(tables: AircraftTables, condition: Condition, guess: TrimPoint | None) -> TrimPoint:
    """Trim at a condition.

    Args:
        tables: The aircraft, already at the condition.
        guess: A neighbouring trim, or None to search for the unstalled trim.

    Returns:
        The trim; where none was found ``converged`` is False and ``unclosed`` names the residual left over.
    """
    if guess is not None:
        return _solve(tables, condition, _unknowns(guess))
    direct = _solve(tables, condition, _first_guess(tables, condition))
    if direct.converged and not _near_stall(direct, condition.airspeed):
        return direct
    start = _anchor(tables, condition)
    if start is None:
        return _lost(direct)
    return _continue_to(tables, condition, *start)
