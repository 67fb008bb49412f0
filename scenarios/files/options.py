"""Changes a scenario for one flight: what the command line and ``scenarios.fly`` can override."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, make_dataclass
from typing import Any

from rtsim.atmosphere.specification import Severity, Turbulence
from rtsim.choices import HAND_PILOT
from rtsim.errors import InputError
from rtsim.loop.options import declared
from rtsim.programme import AIRSPEED_RANGE, NACELLE_RANGE, START_ALTITUDE_RANGE, Programme, ProgrammePoint
from rtsim.units import kt, to_deg, to_kt
from scenarios.files.loader import load_scenario, named_start
from scenarios.files.scenario import DEFAULT_ALTITUDE, Scenario

DEFAULT_SCENARIO = "typical_conversion"
"""What ``rtsim fly`` flies when nothing is named."""
HOLD_DURATION = 60.0
"""Length of a flight that only holds its start [s]."""
JOIN_TOLERANCE = (kt(0.5), math.radians(0.5))
"""How near a start must be to a programme to join it: airspeed [m/s], nacelle angle [rad]."""
_OptionChanges: Any = make_dataclass(
    "_OptionChanges", [(name, Any, None) for name in declared()], frozen=True, slots=True, kw_only=True
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Overrides(_OptionChanges):  # type: ignore[misc]  # made from the options' declaration
    """What to change; None leaves the scenario's own. SI and radians.

    Besides the fields below, every field of :class:`~rtsim.loop.options.FlightOptions`.
    """

    turbulence: Severity | None = None
    """Dryden turbulence in place of the scenario's; its gusts stay."""
    lateral_turbulence: bool | None = None
    """Whether turbulence blows from the side, in roll and in yaw too."""
    duration: float | None = None
    start: str | None = None
    """Named start: ``hover``, ``conversion`` or ``cruise``."""
    airspeed: float | None = None
    nacelle_angle: float | None = None
    altitude: float | None = None

    @property
    def options(self) -> dict[str, Any]:
        """The options to change, by field."""
        return {name: getattr(self, name) for name in declared() if getattr(self, name) is not None}

    @property
    def moves_start(self) -> bool:
        """Whether the flight starts at another airspeed or nacelle angle than its scenario."""
        return self.start is not None or self.airspeed is not None or self.nacelle_angle is not None


def chosen_scenario(name_or_path: str | None, overrides: Overrides) -> Scenario:
    """The scenario to fly, with everything applied that was asked for.

    With a start but no scenario, the start is held. With both, the flight joins the scenario's programme where it
    passes the start. Expectations are those of a whole flight: a shortened or displaced one is not judged.

    Args:
        name_or_path: A library name or a path; None: ``typical_conversion``, or a hold where a start is given.
        overrides: What to change.

    Raises:
        InputError: If an option is out of range or the start does not lie on the programme.
    """
    if name_or_path is None and overrides.moves_start:
        return _with_options(_held(load_scenario("hover"), overrides), overrides)
    return with_overrides(load_scenario(DEFAULT_SCENARIO if name_or_path is None else name_or_path), overrides)


def with_overrides(scenario: Scenario, overrides: Overrides) -> Scenario:
    """Change a scenario.

    Args:
        scenario: What to change.
        overrides: How.

    Raises:
        InputError: If an option is out of range or the start does not lie on the programme.
    """
    return _with_options(_displaced(scenario, overrides), overrides)


def _with_options(scenario: Scenario, overrides: Overrides) -> Scenario:
    """Apply everything but the start."""
    changed = scenario.with_options(**overrides.options)
    if overrides.turbulence is not None:
        turbulence = Turbulence.of_severity(overrides.turbulence)
        changed = dataclasses.replace(changed, air=dataclasses.replace(changed.air, turbulence=turbulence))
    if overrides.lateral_turbulence is not None:
        changed = dataclasses.replace(
            changed, air=dataclasses.replace(changed.air, lateral=overrides.lateral_turbulence)
        )
    if overrides.duration is not None:
        _check_range("--duration", overrides.duration, (1.0 / changed.options.rate_hz, 36_000.0), "s")
        if overrides.duration < changed.duration:
            changed = dataclasses.replace(changed, expectations=())
        changed = dataclasses.replace(changed, duration=overrides.duration)
    return changed


def _start_point(overrides: Overrides, default: ProgrammePoint) -> ProgrammePoint:
    """The start that is asked for."""
    if overrides.start is not None and (overrides.airspeed is not None or overrides.nacelle_angle is not None):
        raise InputError(
            "the start is given twice: by name and in numbers",
            key="--start",
            mend="give either --start or --airspeed-kt and --nacelle-deg",
        )
    altitude = default.altitude if overrides.altitude is None else overrides.altitude
    _check_range("--altitude-m", altitude, START_ALTITUDE_RANGE, "m")
    if overrides.start is not None:
        return named_start(overrides.start, altitude=altitude)
    for option, value in (("--airspeed-kt", overrides.airspeed), ("--nacelle-deg", overrides.nacelle_angle)):
        if value is None:
            raise InputError("is missing", key=option, mend="give both --airspeed-kt and --nacelle-deg, or --start")
    assert overrides.airspeed is not None
    assert overrides.nacelle_angle is not None
    _check_range("--airspeed-kt", overrides.airspeed, AIRSPEED_RANGE, "kn", unit=kt(1.0))
    _check_range("--nacelle-deg", overrides.nacelle_angle, NACELLE_RANGE, "deg", unit=math.radians(1.0))
    return ProgrammePoint(overrides.airspeed, overrides.nacelle_angle, altitude)


def _held(template: Scenario, overrides: Overrides) -> Scenario:
    """A flight that holds its start."""
    start = _start_point(overrides, ProgrammePoint(0.0, 0.0, DEFAULT_ALTITUDE))
    where = f"{to_kt(start.airspeed):g} kn, nacelle {to_deg(start.nacelle_angle):g} deg"
    return dataclasses.replace(
        template,
        name="hold",
        title=f"Hold {where}",
        description="",
        programme=Programme.hold(airspeed=start.airspeed, nacelle_angle=start.nacelle_angle, altitude=start.altitude),
        start=start,
        duration=HOLD_DURATION,
        events=(),
        expectations=(),
        source="",
        file="hold",
    )


def _displaced(scenario: Scenario, overrides: Overrides) -> Scenario:
    """The scenario from another start on its programme, or at another altitude."""
    if not overrides.moves_start:
        if overrides.altitude is None:
            return scenario
        _check_range("--altitude-m", overrides.altitude, START_ALTITUDE_RANGE, "m")
        return _raised(scenario, overrides.altitude - scenario.start.altitude)
    start = _start_point(overrides, scenario.start)
    if scenario.programme.duration == 0.0 and HAND_PILOT in {overrides.pilot, scenario.options.pilot}:
        # A hand flight has no programme to join: the virtual pilot holds whatever start is asked for.
        programme = Programme.hold(airspeed=start.airspeed, nacelle_angle=start.nacelle_angle, altitude=start.altitude)
        return dataclasses.replace(scenario, programme=programme, start=start)
    time, where = _joining_time(scenario.programme, start)
    if time is None:
        raise InputError(
            f"the start does not lie on the programme of {scenario.name}",
            key="--start" if overrides.start else "--airspeed-kt, --nacelle-deg",
            value=f"{to_kt(start.airspeed):g} kn, {to_deg(start.nacelle_angle):g} deg",
            allowed=f"points of the programme, the nearest is {where}",
            mend="choose that, or name no scenario to hold the start",
        )
    if time == 0.0 and overrides.altitude is None:
        return dataclasses.replace(scenario, start=start)
    joined = dataclasses.replace(
        scenario,
        programme=scenario.programme.starting_at(time),
        start=ProgrammePoint(start.airspeed, start.nacelle_angle, scenario.programme.at(time).altitude),
        duration=max(scenario.duration - time, 1.0 / scenario.options.rate_hz),
        events=tuple(
            dataclasses.replace(event, time=event.time - time) for event in scenario.events if event.time >= time
        ),
        expectations=scenario.expectations if time == 0.0 else (),
    )
    return _raised(joined, start.altitude - scenario.start.altitude)


def _raised(scenario: Scenario, height: float) -> Scenario:
    start = dataclasses.replace(scenario.start, altitude=scenario.start.altitude + height)
    return dataclasses.replace(scenario, programme=scenario.programme.raised(height), start=start)


def _joining_time(programme: Programme, start: ProgrammePoint) -> tuple[float | None, str]:
    """First time a programme passes a start, and its nearest point in words."""
    steps = max(2, math.ceil(programme.duration / 0.02) + 1)
    times = [programme.duration * number / (steps - 1) for number in range(steps)]
    best, best_distance = 0.0, math.inf
    for time in sorted({*times, *(float(value) for value in programme.time)}):
        point = programme.at(time)
        distance = max(
            abs(point.airspeed - start.airspeed) / JOIN_TOLERANCE[0],
            abs(point.nacelle_angle - start.nacelle_angle) / JOIN_TOLERANCE[1],
        )
        if distance < best_distance - 1e-9:
            best, best_distance = time, distance
    point = programme.at(best)
    words = f"{to_kt(point.airspeed):.1f} kn, {to_deg(point.nacelle_angle):.1f} deg"
    return (best if best_distance <= 1.0 else None), words


def _check_range(option: str, value: float, allowed: tuple[float, float], unit_name: str, *, unit: float = 1.0) -> None:
    low, high = allowed
    if not low - 1e-9 <= value <= high + 1e-9:
        raise InputError(
            "is out of range",
            key=option,
            value=value / unit if unit != 1.0 else value,
            allowed=f"{low / unit:g} to {high / unit:g} {unit_name}".rstrip(),
            mend="choose a value in this range",
        )
