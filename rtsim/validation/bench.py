"""The model on the bench: asked for trims, loads, boundaries and linear models, each found once.

Legend:
    airspeed_kt: Airspeed [kn].
    nacelle_deg: Nacelle angle [deg].
    flap_deg: Flap deflection [deg]; None: the schedule.
    rotor_rpm: Rotor speed [rpm]; None: 589.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any, TypeVar

import numpy as np

from rtsim.aircraft.points import Condition, LinearModel, TrimPoint
from rtsim.aircraft.variables import INPUT, OUTPUT, STATE, STATES
from rtsim.aircraft.xv15.model import Xv15
from rtsim.analysis.isolated_rotor import IsolatedRotor, RotorCondition, RotorPoint
from rtsim.analysis.performance import climb_rate
from rtsim.arrays import FloatArray
from rtsim.units import (
    DEGREE,
    FOOT,
    FOOT_POUND,
    GRAVITY,
    HORSEPOWER,
    INCH_POUND,
    POUND,
    POUND_FORCE,
    deg,
    kt,
    rpm,
    to_deg,
)

ROOT_TWIST_DEG = 34.43
"""Twist at the root above 0.75 R (NASA TP-2004-212262): GTRS prints the collective at the root [deg]."""
STICK_HALF_TRAVEL_IN, STICK_NEUTRAL_IN = 4.8, 4.8
TRANSMISSION = 0.93
"""Rotor shaft power over engine power (TM X-62407 sec. 5)."""
_SLOW = [STATE.u, STATE.w, STATE.q, STATE.pitch]
_FAST = [i for i in range(len(STATES)) if i not in {*_SLOW, STATE.altitude}]
Found = TypeVar("Found")


@dataclass(frozen=True, slots=True)
class Level:
    """A trim in the units of the sources; every number is NaN where there is none."""

    point: TrimPoint
    """The trim."""
    tip_speed: float
    """Tip speed of the rotors [m/s]."""

    def _number(self, value: float) -> float:
        return float(value) if self.point.converged else math.nan

    @property
    def pitch_deg(self) -> float:
        """Pitch attitude [deg]."""
        return self._number(to_deg(self.point.x[STATE.pitch]))

    @property
    def stick_in(self) -> float:
        """Stick from the aft stop, 0 to 9.6 [in]."""
        return self._number(STICK_NEUTRAL_IN + STICK_HALF_TRAVEL_IN * self.point.u[INPUT.stick])

    @property
    def stick_percent(self) -> float:
        """Stick from the aft stop [% of travel]."""
        return self._number(50.0 + 50.0 * self.point.u[INPUT.stick])

    @property
    def elevator_deg(self) -> float:
        """Elevator, trailing edge down positive [deg]."""
        return self._number(to_deg(self.point.x[STATE.elevator]))

    @property
    def cyclic_deg(self) -> float:
        """Longitudinal cyclic [deg]."""
        return self._number(to_deg(self.point.x[STATE.cyclic_1s]))

    @property
    def root_collective_deg(self) -> float:
        """Collective at the blade's root, as GTRS prints it [deg]."""
        return self._number(to_deg(self.point.x[STATE.collective_75]) + ROOT_TWIST_DEG)

    @property
    def thrust_lb(self) -> float:
        """Thrust of each rotor [lb]."""
        return self._number(self.point.y[OUTPUT.thrust] / POUND_FORCE)

    @property
    def power_shp(self) -> float:
        """Shaft power of both rotors [shp]."""
        return self._number(self.point.y[OUTPUT.power] / HORSEPOWER)

    @property
    def power_kw(self) -> float:
        """Shaft power of both rotors [kW]."""
        return self._number(self.point.y[OUTPUT.power] / 1e3)

    @property
    def torque_inlb(self) -> float:
        """Torque of each mast [in lb]."""
        return self._number(self.point.y[OUTPUT.torque] / INCH_POUND)

    @property
    def flapping_deg(self) -> float:
        """Total cyclic flapping [deg]."""
        return self._number(to_deg(self.point.y[OUTPUT.flapping]))

    @property
    def wing_angle_deg(self) -> float:
        """Angle of attack of the wing [deg]."""
        return self._number(to_deg(self.point.y[OUTPUT.wing_angle_of_attack]))

    @property
    def induced_ft_s(self) -> float:
        """Mean induced velocity [ft/s]."""
        return self._number(self.point.x[STATE.inflow_0] * self.tip_speed / FOOT)


class Bench:
    """An aircraft and what was found about it."""

    def __init__(self, changes: Mapping[str, Any] | None = None) -> None:
        """Take an aircraft.

        Args:
            changes: As of ``Xv15.load``.
        """
        self._changes = dict(changes or {})
        self.aircraft = Xv15.load(self._changes)
        self._found: dict[Any, Any] = {}

    def once(self, key: object, find: Callable[[], Found]) -> Found:
        """Whatever was asked before, or found now.

        Args:
            key: What is asked.
            find: Finds it.
        """
        if key not in self._found:
            self._found[key] = find()
        found: Found = self._found[key]
        return found

    @property
    def without_tail_wake(self) -> Bench:
        """The same aircraft without rotor wake at the tail."""
        return self.changed({"tail.rotor_wake": False})

    def changed(self, changes: Mapping[str, Any]) -> Bench:
        """The same aircraft with further changes.

        Args:
            changes: As of ``Xv15.load``.
        """
        return self.once(tuple(changes.items()), lambda: Bench(self._changes | dict(changes)))

    def condition(
        self,
        airspeed_kt: float,
        nacelle_deg: float,
        *,
        flap_deg: float | None = None,
        rotor_rpm: float | None = None,
        weight_lb: float | None = None,
        height_ft: float = 0.0,
    ) -> Condition:
        """A flight condition.

        Args:
            weight_lb: Weight [lb]; None: 13000.
            height_ft: Height in the standard atmosphere [ft].
        """
        return Condition(
            airspeed=kt(airspeed_kt),
            nacelle_angle=deg(nacelle_deg),
            flap=None if flap_deg is None else deg(flap_deg),
            rotor_speed=None if rotor_rpm is None else rpm(rotor_rpm),
            mass=None if weight_lb is None else weight_lb * POUND,
            pressure_altitude=height_ft * FOOT,
        )

    def point(self, condition: Condition) -> TrimPoint:
        """The unstalled trim at a condition.

        Args:
            condition: The condition.
        """
        return self.once(condition, lambda: self.aircraft.trim(condition))

    def level(self, airspeed_kt: float, nacelle_deg: float, **rest: Any) -> Level:
        """Level flight.

        Args:
            **rest: As of :meth:`condition`.
        """
        condition = self.condition(airspeed_kt, nacelle_deg, **rest)
        return self.shown(condition, self.point(condition))

    def shown(self, condition: Condition, point: TrimPoint) -> Level:
        """A trim in the units of the sources.

        Args:
            condition: Its condition.
            point: The trim.
        """
        speed = condition.rotor_speed or self.aircraft.tables.configuration.rotor_speed
        return Level(point, speed * self.aircraft.tables.rotor.radius)

    # -- loads by component

    def loads(self, airspeed_kt: float) -> Mapping[str, FloatArray]:
        """X, Z [lb] and M [ft lb] of each component in level flight at nacelle 90, as GTRS groups them."""
        return self.once(("loads", airspeed_kt), lambda: self._grouped(airspeed_kt, self._state(airspeed_kt)))

    def loads_at(self, airspeed_kt: float, *, pitch_deg: float, induced_ft_s: float) -> Mapping[str, FloatArray]:
        """The same in the flow that the source prints instead of the model's own trim.

        Args:
            pitch_deg: Pitch attitude [deg].
            induced_ft_s: Mean induced velocity [ft/s].
        """

        def find() -> Mapping[str, FloatArray]:
            x, u = self._state(airspeed_kt)
            x = x.copy()
            x[STATE.u] = kt(airspeed_kt) * math.cos(deg(pitch_deg))
            x[STATE.w] = kt(airspeed_kt) * math.sin(deg(pitch_deg))
            x[STATE.pitch] = deg(pitch_deg)
            tables = self.aircraft.tables
            x[STATE.inflow_0] = induced_ft_s * FOOT / (tables.configuration.rotor_speed * tables.rotor.radius)
            return self._grouped(airspeed_kt, (x, u))

        return self.once(("loads at", airspeed_kt, pitch_deg, induced_ft_s), find)

    def _state(self, airspeed_kt: float) -> tuple[FloatArray, FloatArray]:
        point = self.point(self.condition(airspeed_kt, 90.0))
        return point.x, point.u

    def _grouped(self, airspeed_kt: float, state: tuple[FloatArray, FloatArray]) -> Mapping[str, FloatArray]:
        condition = self.condition(airspeed_kt, 90.0)
        unit = np.array([POUND_FORCE, POUND_FORCE, FOOT_POUND])
        found = self.aircraft.at(condition).component_loads(*state, condition.nacelle_angle)
        found = {name: np.asarray(load[: unit.size]) for name, load in found.items()}  # those in the plane of symmetry
        loads = {name: np.asarray(load / unit) for name, load in found.items()}
        loads["rotor total"] = loads["rotors"] + loads["spinners"]
        loads["airframe"] = np.sum(list(found.values()), axis=0) / unit - loads["rotor total"]
        return loads

    # -- lines of trims

    def least_airspeed(self, nacelle_deg: float, *, alpha_limit: float = 16.0, flap_deg: float = 40.0) -> float:
        """Lowest airspeed reached from the fast side with the wing below an angle of attack [kn].

        Args:
            alpha_limit: The angle [deg].
        """

        def find() -> float:
            last = None
            for speed in np.arange(125.0, 45.0, -1.0):
                condition = self.condition(float(speed), nacelle_deg, flap_deg=flap_deg)
                point = self.aircraft.trim(condition, guess=last)
                jumped = last is not None and abs(point.x[STATE.pitch] - last.x[STATE.pitch]) > 3.0 * DEGREE
                if not point.converged or jumped or self.shown(condition, point).wing_angle_deg > alpha_limit:
                    return float(speed) + 1.0
                last = point
            return 45.0

        return self.once(("least airspeed", nacelle_deg, alpha_limit, flap_deg), find)

    def highest_airspeed(self, nacelle_deg: float, *, flap_deg: float = 40.0) -> float:
        """Highest airspeed of level trims, within 0.5 kn [kn]."""

        def find() -> float:
            for speed in np.arange(90.0, 200.0, 0.5):
                if not self.point(self.condition(float(speed), nacelle_deg, flap_deg=flap_deg)).converged:
                    return float(speed) - 0.5
            return 200.0

        return self.once(("highest airspeed", nacelle_deg, flap_deg), find)

    def speed_of_least_power(self, nacelle_deg: float, span: tuple[float, float], **rest: Any) -> float:
        """Airspeed of least power, by a parabola through the least of a line and its neighbours [kn].

        Args:
            span: Airspeeds between which it is looked for [kn].
            **rest: As of :meth:`condition`.
        """
        speeds = np.arange(span[0], span[1], 2.0)
        powers = np.array([self.level(float(v), nacelle_deg, **rest).power_kw for v in speeds])
        if not np.isfinite(powers).any():
            return math.nan
        k = int(np.clip(np.nanargmin(powers), 1, speeds.size - 2))
        a, b, _ = np.polyfit(speeds[k - 1 : k + 2] - speeds[k], powers[k - 1 : k + 2], 2)
        return float(np.clip(speeds[k] - b / (2.0 * a), speeds[0], speeds[-1]))

    def speed_at_torque(self, limit_inlb: float, **rest: Any) -> float:
        """Airspeed of level flight in airplane mode that takes a mast torque [kn].

        Args:
            limit_inlb: Torque [in lb].
            **rest: As of :meth:`condition`.
        """
        speeds = np.arange(200.0, 295.0, 5.0)
        torques = [self.level(float(v), 0.0, **rest).torque_inlb for v in speeds]
        return float(np.interp(limit_inlb, torques, speeds, left=math.nan, right=math.nan))

    def climb(self, airspeed_kt: float, nacelle_deg: float, power_shp: float, **rest: Any) -> float:
        """Steady rate of climb at a shaft power of both rotors, descent negative [ft/min].

        Args:
            power_shp: Shaft power of both rotors [shp]; 0: autorotation.
            **rest: As of :meth:`condition`.
        """
        condition = self.condition(airspeed_kt, nacelle_deg, **rest)
        # A watt for nothing: what there is, is compared with what is needed by division.
        found = climb_rate(self.aircraft, condition, power=max(power_shp * HORSEPOWER, 1.0), torque=math.inf)
        ended = found.point.y[OUTPUT.power] / HORSEPOWER if found.point is not None else math.nan
        # Ended by anything else than the power asked for, there is no such climb.
        return found.value / FOOT * 60.0 if abs(ended - power_shp) < 1.0 else math.nan

    def least_power_in_descent(self, airspeed_kt: float, nacelle_deg: float, **rest: Any) -> tuple[float, float]:
        """Least shaft power of both rotors [shp] over the angles of descent, and the sink there [ft/min].

        Args:
            **rest: As of :meth:`condition`.
        """

        def find() -> tuple[float, float]:
            level = self.condition(airspeed_kt, nacelle_deg, **rest)
            point, found = self.point(level), []
            mass = self.aircraft.tables.configuration.mass
            for angle in np.arange(0.01, 0.8, 0.01):
                slope = replace(level, acceleration=-GRAVITY * math.tan(angle), mass=mass * math.cos(angle))
                point = self.aircraft.trim(slope, guess=point)
                if not point.converged:
                    break
                found.append((self.shown(slope, point).power_shp, level.airspeed * math.sin(angle) / FOOT * 60.0))
            return min(found, default=(math.nan, math.nan))

        return self.once(("descent", airspeed_kt, nacelle_deg, *rest.items()), find)

    # -- hover and linear models

    @cached_property
    def hover(self) -> Level:
        """Hover at 13000 lb, sea level."""
        return self.level(0.0, 90.0)

    def linear(self, airspeed_kt: float, nacelle_deg: float, **rest: Any) -> LinearModel:
        """Jacobians at a level trim.

        Args:
            **rest: As of :meth:`condition`.
        """
        condition = self.condition(airspeed_kt, nacelle_deg, **rest)
        return self.once(("linear", condition), lambda: self.aircraft.linearize(condition, self.point(condition)))

    def eigenvalues(self, airspeed_kt: float, nacelle_deg: float, **rest: Any) -> np.ndarray:
        """Roots of the linear model without height; complex.

        Args:
            **rest: As of :meth:`condition`.
        """
        keep = [i for i in range(len(STATES)) if i != STATE.altitude]
        return np.asarray(np.linalg.eigvals(self.linear(airspeed_kt, nacelle_deg, **rest).A[np.ix_(keep, keep)]))

    def rigid_body(self, airspeed_kt: float, nacelle_deg: float, **rest: Any) -> tuple[FloatArray, FloatArray]:
        """Quasi-static A and B of u, w, q, pitch: rotors and actuators in equilibrium.

        Args:
            **rest: As of :meth:`condition`.
        """
        model = self.linear(airspeed_kt, nacelle_deg, **rest)
        a, b = model.A, model.B
        fast = np.linalg.solve(a[np.ix_(_FAST, _FAST)], np.hstack([a[np.ix_(_FAST, _SLOW)], b[_FAST]]))
        across = a[np.ix_(_SLOW, _FAST)]
        return a[np.ix_(_SLOW, _SLOW)] - across @ fast[:, :4], b[_SLOW] - across @ fast[:, 4:]

    # -- the rotor alone

    @cached_property
    def rotor(self) -> IsolatedRotor:
        """One rotor."""
        return IsolatedRotor.of(self.aircraft)

    def polar(self, tip_mach: float, advance_ratio: float = 0.0) -> list[RotorPoint]:
        """Its unstalled branch.

        Args:
            tip_mach: Tip Mach number.
            advance_ratio: Advance ratio, shaft normal to the flow.
        """
        condition = RotorCondition(tip_mach=tip_mach, advance_ratio=advance_ratio)
        return self.once(("polar", condition), lambda: self.rotor.polar(condition, lowest_thrust=0.0))

    def rotor_at(self, thrust_coefficient: float, tip_mach: float) -> RotorPoint | None:
        """The rotor in hover at a thrust.

        Args:
            thrust_coefficient: C_T.
            tip_mach: Tip Mach number.
        """
        condition = RotorCondition(tip_mach=tip_mach)
        return self.once(
            ("rotor", thrust_coefficient, tip_mach),
            lambda: self.rotor.at_thrust(thrust_coefficient, condition, self.polar(tip_mach)),
        )


@cache
def the_bench() -> Bench:
    """The aircraft as it is."""
    return Bench()
