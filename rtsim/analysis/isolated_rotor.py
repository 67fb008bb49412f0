"""One rotor alone, as on a test stand or in a wind tunnel: thrust and power at any advance ratio and shaft angle.

No second rotor (side-by-side interference off), no wing below (no download), sea-level standard air. In forward flight
the longitudinal flapping is trimmed to zero by the longitudinal cyclic. The model has no lateral cyclic, since the
aircraft needs none in its plane of symmetry, so the lateral flapping stays and is reported: a gimballed rotor with
lateral flapping is one with lateral cyclic on a shaft leaned sideways by that angle, which moves thrust and power only
in its square.

Coefficients are the rotor's: C_T = T/(rho A (Omega R)^2), C_P = C_Q = Q/(rho A (Omega R)^2 R).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from rtsim.aircraft.xv15 import rotor_kernels as kernels
from rtsim.aircraft.xv15.model import Xv15
from rtsim.units import deg, to_deg

if TYPE_CHECKING:
    from rtsim.aircraft.xv15.tables import Configuration, RotorTables
    from rtsim.arrays import FloatArray

_COLLECTIVE_STEP = deg(0.5)
_EASY, _REACH = deg(5.0), deg(35.0)
"""Where the search begins and how far it goes, about the collective without incidence at 75 % radius [rad]."""
_LARGEST_CHANGE = 0.05
"""Flapping, cyclic [rad] or inflow that changes more in one step has left the branch."""
_STALL_DROP = 0.0003
"""The unstalled branch has ended, at either end, where C_T has turned back by so much."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RotorCondition:
    """The flow that a rotor works in."""

    tip_mach: float
    """Tip speed over the speed of sound."""
    advance_ratio: float = 0.0
    """Airspeed over tip speed, V/(Omega R)."""
    shaft_angle: float = 0.0
    """Tilt of the shaft from normal to the flow, positive aft [rad]; -pi/2: an airplane's propeller."""


@dataclass(frozen=True, slots=True)
class RotorPoint:
    """A rotor in equilibrium of flapping and inflow."""

    collective: float
    """Collective at 75 % radius [rad]."""
    cyclic: float
    """Longitudinal cyclic theta_1s, forward negative [rad]."""
    thrust_coefficient: float
    """C_T."""
    power_coefficient: float
    """C_P, which is C_Q."""
    coning: float
    """Coning, precone included [rad]."""
    lateral_flapping: float
    """beta_1s, which is left over [rad]."""
    _unknowns: FloatArray = field(repr=False)

    @property
    def figure_of_merit(self) -> float:
        """Ideal hover power over power; of no meaning in forward flight."""
        return math.copysign(abs(self.thrust_coefficient) ** 1.5, self.thrust_coefficient) / (
            math.sqrt(2.0) * self.power_coefficient
        )


@dataclass(frozen=True, slots=True)
class IsolatedRotor:
    """One rotor of the XV-15 without the other and without the aircraft."""

    tables: RotorTables
    """Its tables, side-by-side interference zero."""
    air: Configuration
    """Sea-level standard air; the rotor speed is the condition's."""

    @staticmethod
    def load(changes: Mapping[str, Any] | None = None) -> IsolatedRotor:
        """The rotor as the aircraft has it.

        Args:
            changes: As of ``Xv15.load``.
        """
        return IsolatedRotor.of(Xv15.load(changes))

    @staticmethod
    def of(aircraft: Xv15) -> IsolatedRotor:
        """The rotor of an aircraft.

        Args:
            aircraft: The aircraft.
        """
        rotor, air = aircraft.tables.rotor, aircraft.tables.configuration
        alone = rotor.side_by_side
        alone = alone._replace(values=np.zeros_like(alone.values), slopes=np.zeros_like(alone.slopes))
        return IsolatedRotor(rotor._replace(side_by_side=alone), air)

    @property
    def solidity(self) -> float:
        """Blade area over disc area, by the chord at 75 % radius."""
        rotor = self.tables
        chord = float(np.interp(0.75 * rotor.radius, rotor.stations, rotor.chord))
        return rotor.blades * chord / (math.pi * rotor.radius)

    def equilibrium(
        self, collective: float, condition: RotorCondition, guess: RotorPoint | None = None
    ) -> RotorPoint | None:
        """Steady flapping and inflow at a collective.

        Args:
            collective: Collective at 75 % radius [rad].
            condition: The flow.
            guess: A neighbouring point.

        Returns:
            The point; None where none was found.
        """
        from scipy.optimize import root

        rotor = self.tables
        speed = condition.tip_mach * self.air.sound_speed
        air = self.air._replace(rotor_speed=speed / rotor.radius)
        airspeed = condition.advance_ratio * speed
        hub = (
            airspeed * math.cos(condition.shaft_angle),
            -airspeed * math.sin(condition.shaft_angle),
            0.0,
            0.0,
            0.0,
            0.0,
        )
        loads = np.zeros(kernels.LOAD_COUNT)

        def residual(z: FloatArray) -> list[float]:
            cyclic, coning, side, *inflow = (float(value) for value in z)
            flapping = (coning, 0.0, 0.0, 0.0, side, 0.0)
            flow = (inflow[0], inflow[1], inflow[2])
            kernels.rotor_loads(rotor, air, hub, flapping, flow, (collective, cyclic), loads)
            flaps = kernels.flapping_accelerations(rotor, air.rotor_speed, (0.0, 0.0, 0.0, 0.0), flapping, loads)
            flows = kernels.inflow_rates(rotor, air, hub, flow, loads)
            # Flapping accelerations per rotor speed squared, inflow rates per rotor speed: all of order one.
            return [*(a / air.rotor_speed**2 for a in flaps), *(rate / air.rotor_speed for rate in flows)]

        starts = [np.array([0.0, rotor.precone, 0.0, inflow, 0.0, 0.0]) for inflow in (0.02, 0.0)]
        for start in starts if guess is None else [guess._unknowns, *starts]:
            found = root(residual, start, method="hybr", options={"xtol": 1e-12, "factor": 0.1})
            if np.max(np.abs(residual(found.x))) < 1e-9:
                break
        else:
            return None
        scale = air.density * math.pi * rotor.radius**2 * speed**2
        thrust, torque = loads[kernels.THRUST] / scale, loads[kernels.TORQUE] / scale / rotor.radius
        return RotorPoint(
            collective, float(found.x[0]), float(thrust), float(torque), float(found.x[1]), float(found.x[2]), found.x
        )

    def polar(self, condition: RotorCondition, *, lowest_thrust: float = -math.inf) -> list[RotorPoint]:
        """The unstalled branch, by growing collective, from negative thrust to where thrust falls or equilibrium ends.

        Args:
            condition: The flow.
            lowest_thrust: C_T below which nothing is asked for.
        """
        axial = -condition.advance_ratio * math.sin(condition.shaft_angle)
        easy = math.atan2(axial, 0.75) + _EASY
        middle = self.equilibrium(easy, condition)
        if middle is None:
            return []
        branches = []
        for step in (-_COLLECTIVE_STEP, _COLLECTIVE_STEP):
            points = [middle]
            while abs(points[-1].collective + step - easy) < _REACH:
                point = self.equilibrium(points[-1].collective + step, condition, points[-1])
                if point is None or np.max(np.abs(point._unknowns - points[-1]._unknowns)) > _LARGEST_CHANGE:
                    break
                sign = math.copysign(1.0, step)
                if sign * point.thrust_coefficient < max(sign * p.thrust_coefficient for p in points) - _STALL_DROP:
                    break
                points.append(point)
                if step < 0.0 and point.thrust_coefficient < lowest_thrust:
                    break
            branches.append(points)
        return [*reversed(branches[0][1:]), *branches[1]]

    def at_thrust(
        self, thrust_coefficient: float, condition: RotorCondition, points: list[RotorPoint] | None = None
    ) -> RotorPoint | None:
        """The unstalled point of a thrust.

        Args:
            thrust_coefficient: C_T.
            condition: The flow.
            points: Its polar, where it is known already.

        Returns:
            The point; None where the rotor cannot carry that thrust.
        """
        from scipy.optimize import brentq

        points = self.polar(condition) if points is None else points
        above = next((i for i, point in enumerate(points) if point.thrust_coefficient >= thrust_coefficient), 0)
        if above == 0:
            return None
        below = points[above - 1]

        def at(collective: float) -> RotorPoint:
            point = self.equilibrium(collective, condition, below)
            return replace(below, thrust_coefficient=math.nan) if point is None else point

        low, high = below.collective, points[above].collective
        collective = brentq(lambda c: at(c).thrust_coefficient - thrust_coefficient, low, high, xtol=1e-12)
        point = at(float(collective))
        return point if abs(point.thrust_coefficient - thrust_coefficient) < 1e-8 else None


def rotor_answer(rotor: IsolatedRotor, thrust_coefficient: float, condition: RotorCondition) -> dict[str, Any]:
    """What ``rtsim rotor`` says, by key; None where there is no solution.

    Args:
        rotor: The rotor.
        thrust_coefficient: C_T that it is to carry.
        condition: The flow.
    """
    points = rotor.polar(condition)
    thrusts = [point.thrust_coefficient for point in points]
    point = rotor.at_thrust(thrust_coefficient, condition, points)
    answer: dict[str, Any] = {
        "thrust_coefficient": thrust_coefficient,
        "tip_mach": condition.tip_mach,
        "advance_ratio": condition.advance_ratio,
        "shaft_deg": to_deg(condition.shaft_angle),
        "thrust_coefficient_over_solidity": thrust_coefficient / rotor.solidity,
        "thrust_coefficient_range": [min(thrusts), max(thrusts)] if thrusts else [None, None],
        "converged": point is not None,
    }
    solved: dict[str, Callable[[RotorPoint], float | None]] = {
        "power_coefficient": lambda p: p.power_coefficient,
        "torque_coefficient_over_solidity": lambda p: p.power_coefficient / rotor.solidity,
        "figure_of_merit": lambda p: p.figure_of_merit if condition.advance_ratio == 0.0 else None,
        "collective_75_deg": lambda p: to_deg(p.collective),
        "cyclic_deg": lambda p: to_deg(p.cyclic),
        "coning_deg": lambda p: to_deg(p.coning),
        "lateral_flapping_deg": lambda p: to_deg(p.lateral_flapping),
    }
    return answer | {key: None if point is None else value(point) for key, value in solved.items()}
