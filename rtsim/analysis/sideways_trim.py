"""Steady turns, sideslip and sideward flight of the LPV aircraft: what its step leaves as it is."""

from __future__ import annotations

import numpy as np

from rtsim.aircraft.points import Condition, TrimPoint
from rtsim.aircraft.variables import ALL_INPUTS, ALL_OUTPUTS, ALL_STATES, INPUT, STATE, of_role, whole
from rtsim.aircraft.xv15.steady import CONTROLS, continued, steady_flight
from rtsim.aircraft.xv15.steady_kernels import UNKNOWN, Steady, steady_motion
from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import interpreted
from rtsim.loop.plant_kernels import outputs_of_sideways, step_of_sideways
from rtsim.lpv.aircraft import LpvAircraft
from rtsim.lpv.schedule_kernels import (
    FLAG_AIRSPEED_HIGH,
    FLAG_AIRSPEED_LOW,
    FLAG_BANK,
    FLAG_LOAD_FACTOR,
    FLAG_NACELLE,
    FLAG_NO_TRIM,
    FLAG_SIDEWARD,
)
from rtsim.lpv.sideways_kernels import sideways_work_size
from rtsim.lpv.sideways_tables import prepare_sideways

VALIDITY = {
    FLAG_BANK: "the database is not valid beyond 45 deg of bank",
    FLAG_LOAD_FACTOR: "the database holds no trims at the load factor of a steeper turn",
    FLAG_SIDEWARD: "the database holds no trims in more sideslip",
    FLAG_NO_TRIM: "the database has no trim around",
    FLAG_AIRSPEED_LOW: "the database holds no slower airspeed",
    FLAG_AIRSPEED_HIGH: "the database holds no faster airspeed",
    FLAG_NACELLE: "the database holds no such nacelle angle",
}
"""What ends the validity, in words, the foremost first; a trim beyond it has them in ``unclosed``."""
_motion = interpreted(steady_motion)
_RATES = tuple(getattr(STATE, name) for name in ("u", "w", "q", "v", "p", "r"))
_SETTLED = of_role(ALL_STATES, "rotor", "inflow", "actuator")
_ROWS = (*_RATES, *_SETTLED)
_HANDS = (INPUT.stick, INPUT.lever, INPUT.lateral_stick, INPUT.pedal)
_DT = 0.004
_CLOSED, _STEP = 1e-7, 1e-6
"""Largest rate left, and step of the differences [SI]."""


class _SteadyLpv:
    """Unknowns: pitch and turn, the four hands, and every state of rotors and actuators."""

    def __init__(self, aircraft: LpvAircraft) -> None:
        self.tables = prepare_sideways(aircraft.database)
        self.work = np.zeros(interpreted(sideways_work_size)(self.tables))
        self.left = 0
        """Flags of the validity that the last flight found leaves."""

    def vectors(self, flight: Steady, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """State and inputs."""
        x, u = np.zeros(len(ALL_STATES)), np.zeros(len(ALL_INPUTS))
        _motion(flight, float(z[UNKNOWN.pitch]), float(z[UNKNOWN.turn]), x)
        u[list(_HANDS)] = z[2 : 2 + len(_HANDS)]
        x[list(_SETTLED)] = z[2 + len(_HANDS) :]
        return x, u

    def rates(self, flight: Steady, x: FloatArray, u: FloatArray) -> tuple[FloatArray, int]:
        """State derivative, as a step has it, and what of the validity it leaves."""
        path, after = np.zeros((3, 3)), x.copy()
        path[:, 0] = flight.nacelle
        flags = step_of_sideways(self.tables, after, u, path, _DT, self.work)
        return (after - x) / _DT, int(flags)

    def residual(self, flight: Steady, z: FloatArray) -> FloatArray:
        """Rates that a steady flight does not have."""
        return self.rates(flight, *self.vectors(flight, z))[0][list(_ROWS)]

    def find(self, flight: Steady, guess: FloatArray) -> FloatArray | None:
        """Newton's iteration; None where it does not close or leaves the validity."""
        z, residual, self.left = guess.copy(), self.residual(flight, guess), 0
        for _ in range(12):
            if np.max(np.abs(residual)) < _CLOSED:
                self.left = self.rates(flight, *self.vectors(flight, z))[1]
                return None if self.left else z
            jacobian = np.empty((residual.size, z.size))
            for k in range(z.size):
                shifted = z.copy()
                shifted[k] += _STEP
                jacobian[:, k] = (self.residual(flight, shifted) - residual) / _STEP
            z = z + np.linalg.lstsq(jacobian, -residual, rcond=None)[0]
            residual = self.residual(flight, z)
        return None

    def point(self, flight: Steady, z: FloatArray, reached: bool) -> TrimPoint:
        """The flight of a set of unknowns; where the branch ends, why it does."""
        x, u = self.vectors(flight, z)
        xdot, _ = self.rates(flight, x, u)
        y = np.zeros(len(ALL_OUTPUTS))
        outputs_of_sideways(self.tables, x, u, flight.nacelle, y, xdot.copy(), self.work)
        worst = int(np.argmax(np.abs(xdot[list(_ROWS)])))
        unclosed = next((name for name in CONTROLS if abs(u[getattr(INPUT, name)]) > 1.0), "")
        if not reached:
            rate = ALL_STATES[_ROWS[worst]].name
            unclosed = next((words for flag, words in VALIDITY.items() if self.left & flag), rate)
        residual = float(np.abs(xdot[_ROWS[worst]]))
        return TrimPoint(x, u, y, xdot, converged=unclosed == "", residual=residual, unclosed=unclosed)


def sideways_trim(aircraft: LpvAircraft, condition: Condition) -> TrimPoint:
    """Find a steady flight of the LPV aircraft that is not symmetric.

    Args:
        aircraft: One with a lateral half, its variables in the order of the closed loop.
        condition: What is flown.

    Returns:
        The trim, with every state, input and output; where the branch ends before the flight that was asked for, its
        last point, with ``converged`` False and ``unclosed`` naming what ends it: a control, a rate, or ``VALIDITY``.
    """
    start = aircraft.trim(airspeed=condition.airspeed, nacelle=condition.nacelle_angle)
    if not start.converged:
        return start
    x, u = whole(start.x, ALL_STATES), whole(start.u, ALL_INPUTS)
    z = np.concatenate([[x[STATE.pitch], 0.0], u[list(_HANDS)], x[list(_SETTLED)]])
    steady, goal = _SteadyLpv(aircraft), steady_flight(condition)
    return continued(goal, z, steady.find, steady.point)
