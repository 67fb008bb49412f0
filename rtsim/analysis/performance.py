"""What the engines make of the aircraft: hover ceiling, climb and level speed of the nonlinear XV-15.

Every figure is the last steady flight, going up, faster or steeper, that has a trim, no more power than there is and no
more mast torque than is allowed; which of the three ended it is part of the answer. A steady climb at the angle g is
trimmed as a level acceleration of G tan g at the mass m cos g, whose air loads are the same.

Legend:
    aircraft: The nonlinear aircraft.
    power: Rotor shaft power of all engines that there is [W], as ``rtsim.systems.engine.power_available`` gives it.
    torque: Largest torque of one mast [N m].
    rating: Rating of the engines.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Literal

from rtsim.aircraft.points import Condition, TrimPoint
from rtsim.aircraft.variables import OUTPUT
from rtsim.aircraft.xv15.model import Xv15
from rtsim.faults.fault import EngineRating
from rtsim.kernels.compiled import interpreted
from rtsim.protection.limiter_kernels import torque_limit
from rtsim.protection.limits import load_limits
from rtsim.systems.engine import power_available
from rtsim.units import GRAVITY, deg, kt

Ended = Literal["", "power", "torque", "trim", "range"]
"""What ended a search: no more power, no more torque, no trim beyond, or the end of what was searched."""
HIGHEST = 11_000.0
"""Altitude up to which there is a standard atmosphere here [m]."""
FASTEST = kt(320.0)
STEEPEST = math.radians(60.0)
_ALTITUDE_STEP, _ALTITUDE_WITHIN = 1000.0, 1.0
_SPEED_STEP, _SPEED_WITHIN = kt(8.0), kt(0.02)
_ANGLE_STEP, _ANGLE_WITHIN = 0.02, 1e-5


@dataclass(frozen=True, slots=True)
class Reached:
    """The last steady flight within the limits."""

    value: float
    """Altitude [m], climb rate or airspeed [m/s]; NaN where the search began beyond a limit."""
    limit: Ended
    """What ended it."""
    point: TrimPoint | None = None
    """That flight."""


def mast_torque_limit(condition: Condition) -> float:
    """Largest torque of one mast at a condition [N m]: that of take-off near hover, else that of cruise."""
    return float(interpreted(torque_limit)(load_limits().torque, condition.airspeed, condition.nacelle_angle))


def hover_ceiling(
    aircraft: Xv15,
    *,
    mass: float | None = None,
    rotor_speed: float | None = None,
    rating: EngineRating = "takeoff",
    torque: float | None = None,
) -> Reached:
    """Highest altitude of a hover out of ground effect on a standard day [m].

    Args:
        mass: Mass [kg]; None: the aircraft's.
        rotor_speed: Rotor speed [rad/s]; None: the aircraft's.
        torque: None: the take-off torque.
    """
    hover = Condition(airspeed=0.0, nacelle_angle=deg(90.0), mass=mass, rotor_speed=rotor_speed)
    allowed = mast_torque_limit(hover) if torque is None else torque

    def fly(altitude: float, guess: TrimPoint | None) -> tuple[TrimPoint, Ended]:
        point = aircraft.trim(replace(hover, pressure_altitude=altitude), guess)
        return point, _passed(point, power_available(rating, altitude), allowed)

    return _furthest(fly, 0.0, HIGHEST, _ALTITUDE_STEP, _ALTITUDE_WITHIN)


def climb_rate(aircraft: Xv15, condition: Condition, *, power: float, torque: float | None = None) -> Reached:
    """Fastest steady climb at an airspeed [m/s]; negative: the slowest descent, where level flight takes too much.

    NaN where no descent takes as little either.

    Args:
        condition: Airspeed along the flight path, nacelle angle and whatever else; no acceleration.
        torque: None: what is allowed there.
    """
    allowed = mast_torque_limit(condition) if torque is None else torque
    mass = aircraft.tables.configuration.mass if condition.mass is None else condition.mass

    def fly(angle: float, guess: TrimPoint | None) -> tuple[TrimPoint, Ended]:
        slope = replace(condition, acceleration=GRAVITY * math.tan(angle), mass=mass * math.cos(angle))
        point = aircraft.trim(slope, guess)
        return point, _passed(point, power, allowed)

    level, limit = fly(0.0, None)
    if limit == "trim":
        return Reached(math.nan, limit, level)
    if limit:
        descends = _furthest(_until(fly, limit), 0.0, -STEEPEST, _ANGLE_STEP, _ANGLE_WITHIN)
        if descends.limit != limit:  # the trims end before a descent takes as little
            return replace(descends, value=math.nan)
        return replace(descends, value=condition.airspeed * math.sin(descends.value), limit=limit)
    climbs = _furthest(fly, 0.0, STEEPEST, _ANGLE_STEP, _ANGLE_WITHIN)
    return replace(climbs, value=condition.airspeed * math.sin(climbs.value))


def best_climb(
    aircraft: Xv15, condition: Condition, airspeeds: Iterable[float], *, power: float, torque: float | None = None
) -> tuple[float, Reached]:
    """The fastest climb of several airspeeds.

    Args:
        condition: Nacelle angle and whatever else; its airspeed does not count.
        airspeeds: Airspeeds to try [m/s].
        torque: None: what is allowed at each.

    Returns:
        Its airspeed [m/s], and the climb; NaN where there is none.
    """
    best, at = Reached(math.nan, "trim"), math.nan
    for airspeed in airspeeds:
        climb = climb_rate(aircraft, replace(condition, airspeed=airspeed), power=power, torque=torque)
        if not climb.value <= best.value and not math.isnan(climb.value):
            best, at = climb, airspeed
    return at, best


def level_speed(aircraft: Xv15, condition: Condition, *, power: float, torque: float | None = None) -> Reached:
    """Highest airspeed of level flight [m/s].

    Args:
        condition: Nacelle angle and whatever else, and an airspeed within the limits from which the search goes up.
        torque: None: what is allowed at each airspeed.
    """

    def fly(airspeed: float, guess: TrimPoint | None) -> tuple[TrimPoint, Ended]:
        flown = replace(condition, airspeed=airspeed)
        point = aircraft.trim(flown, guess)
        return point, _passed(point, power, mast_torque_limit(flown) if torque is None else torque)

    return _furthest(fly, condition.airspeed, FASTEST, _SPEED_STEP, _SPEED_WITHIN)


_Fly = Callable[[float, TrimPoint | None], tuple[TrimPoint, Ended]]
"""Trims at a value, starting from a neighbouring trim; tells what it passes, nothing where all is well."""


def _passed(point: TrimPoint, power: float, torque: float) -> Ended:
    if not point.converged:
        return "trim"
    shares: dict[Ended, float] = {"power": point.y[OUTPUT.power] / power, "torque": point.y[OUTPUT.torque] / torque}
    worst = max(shares, key=lambda name: shares[name])
    return worst if shares[worst] > 1.0 else ""


def _until(fly: _Fly, limit: Ended) -> _Fly:
    """The same search the other way: on as long as the limits are passed."""

    def inverted(value: float, guess: TrimPoint | None) -> tuple[TrimPoint, Ended]:
        point, passed = fly(value, guess)
        return point, passed if passed == "trim" else "" if passed else limit

    return inverted


def _furthest(fly: _Fly, begin: float, end: float, step: float, within: float) -> Reached:
    """The last value on the way from one to another that passes nothing, each trim started from the one before."""
    point, limit = fly(begin, None)
    if limit:
        return Reached(math.nan, limit, point)
    value = begin
    while value != end:
        trial = value + math.copysign(min(step, abs(end - value)), end - begin)
        found, limit = fly(trial, point)
        if not limit:
            value, point = trial, found
            continue
        step *= 0.5
        if step < within:
            return Reached(value, limit, point)
    return Reached(end, "range", point)
