"""Reads scenario files: TOML in, :class:`~scenarios.files.scenario.Scenario` out, every mistake one clear sentence."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rtsim.errors import InputError, suggestion
from rtsim.loop.option_tables import given
from rtsim.loop.options import FlightOptions
from rtsim.programme import TURN, Programme, ProgrammePoint, Waypoint, timed_programme
from rtsim.strict import Examined
from rtsim.toml_file import named_text, parse_toml, shipped_names
from rtsim.units import deg, kt
from scenarios.files.disturbances import air_of, disturbance_problems, faults_of
from scenarios.files.expectation import clause_of, clause_problems
from scenarios.files.nacelle_laws import automatic_problems, automatic_settings
from scenarios.files.scenario import DEFAULT_ALTITUDE, START_CONDITIONS, Scenario, ScenarioEvent
from scenarios.files.schema import TURN_KEYS, PointTable, ProgrammeTable, ScenarioFile, StartTable
from scenarios.files.trial import pulses_of, trial_of, trial_problems

LIBRARY = "scenarios/library"
"""Where the scenarios lie that come with rtsim."""
MAX_FILE_BYTES = 4_000_000
"""A scenario file larger than this is refused before it is read [bytes]."""


def library_names() -> list[str]:
    """Names of the scenarios that come with rtsim, sorted."""
    return shipped_names(LIBRARY)


def load_scenario(name_or_path: str | Path) -> Scenario:
    """Load a scenario of the library by name, or any scenario file by path.

    Args:
        name_or_path: A library name such as ``typical_conversion``, or a path; a word with a ``/`` or ending in
            ``.toml`` is a path.

    Raises:
        InputError: For the first mistake found; :func:`scenario_problems` gives all of them.
    """
    text, file = _read(name_or_path)
    scenario, problems = parse_scenario(text, file=file)
    if scenario is None:
        raise problems[0]
    return scenario


def scenario_problems(path: str | Path) -> list[InputError]:
    """All mistakes of a scenario file; an empty list means it can be flown.

    Args:
        path: The file, or a library name.
    """
    try:
        text, file = _read(path)
    except InputError as error:
        return [error]
    return parse_scenario(text, file=file)[1]


def parse_scenario(text: str, *, file: str) -> tuple[Scenario | None, list[InputError]]:
    """Check the text of a scenario file.

    Args:
        text: The TOML text.

    Returns:
        The scenario and no problems, or None and at least one.
    """
    try:
        examined = examine_scenario(text, file=file)
        if examined.problems:
            return None, examined.problems
        return scenario_of(examined.content, text, file), []
    except InputError as error:
        return None, [error]


def examine_scenario(text: str, *, file: str) -> Examined[ScenarioFile]:
    """Find every mistake that a text shows by itself.

    Args:
        text: The TOML text.

    Raises:
        InputError: It is not valid TOML.
    """
    examined = Examined(ScenarioFile, parse_toml(text, file=file), file=file)
    examined.ask(*(functools.partial(check, file=file) for check in _CHECKS))
    return examined


def named_start(condition: str, *, altitude: float = DEFAULT_ALTITUDE) -> ProgrammePoint:
    """A named start as a point.

    Args:
        condition: ``hover``, ``conversion`` or ``cruise``.
    """
    if condition not in START_CONDITIONS:
        raise InputError(
            "is not a known start",
            key="start",
            value=condition,
            allowed=", ".join(START_CONDITIONS),
            mend=suggestion(condition, START_CONDITIONS, otherwise="choose one"),
        )
    airspeed, nacelle_angle = START_CONDITIONS[condition]
    return ProgrammePoint(airspeed, nacelle_angle, altitude)


def _read(name_or_path: str | Path) -> tuple[str, str]:
    """The text of a scenario and how to call its file in messages."""
    return named_text(name_or_path, folder=LIBRARY, noun="scenario", key="scenario", largest=MAX_FILE_BYTES)


def _other_contradictions(content: ScenarioFile, file: str) -> list[InputError]:
    found = disturbance_problems(content.air, content.faults, file)
    found += automatic_problems(content.automatic, given(content.flight).get("nacelle", ""), file)
    events, flight = bool(content.events), given(content.flight)
    return found + trial_problems(content.pulses, content.trial, has_events=events, flight=flight, file=file)


def _expectation_contradictions(content: ScenarioFile, file: str) -> list[InputError]:
    found = []
    for number, clause in enumerate(content.expect):
        from rtsim.measures.metrics import METRIC_NAMES  # loads compiled code

        key = f"expect[{number}]"
        found += clause_problems(
            clause,
            known=METRIC_NAMES,
            noun="a metric",
            twin=False,
            file=file,
            key=key,
        )
    return found


def _start_contradictions(content: ScenarioFile, file: str) -> list[InputError]:
    start, found = content.start, []
    if content.programme is None and content.duration_s is None:
        found.append(InputError("is missing", file=file, key="duration_s", mend="add it: a hold has no end of its own"))
    numbers = start.airspeed_kt is not None or start.nacelle_deg is not None
    if start.condition is not None and numbers:
        found.append(
            InputError(
                "is given twice: by name and in numbers",
                file=file,
                key="start",
                mend="keep either condition or airspeed_kt and nacelle_deg",
            )
        )
    if (start.airspeed_kt is None) != (start.nacelle_deg is None):
        key = "airspeed_kt" if start.airspeed_kt is None else "nacelle_deg"
        found.append(InputError("is missing", file=file, key=f"start.{key}", mend="give both numbers of the start"))
    if content.programme is None and start.condition is None and not numbers:
        found.append(
            InputError("is missing", file=file, key="start", mend="say where the flight starts, or give a programme")
        )
    return found


def _point_contradictions(content: ScenarioFile, file: str) -> list[InputError]:
    """Points are either all timed, or none is; a timed point has no rates."""
    programme = content.programme
    if programme is None:
        return []
    timed = [point.time_s is not None for point in programme.points]
    if any(timed) and not all(timed):
        key = f"programme.points[{timed.index(False)}].time_s"
        return [InputError("is missing", file=file, key=key, mend="give every point a time, or none")]
    found = []
    for number, point in enumerate(programme.points):
        for name in ("acceleration_kt_s", "nacelle_rate_deg_s", "climb_rate_m_s", "hold_s"):
            if timed[0] and getattr(point, name) is not None:
                key = f"programme.points[{number}].{name}"
                found.append(InputError("has no meaning beside time_s", file=file, key=key, mend="delete one of them"))
        asked = [name for name in TURN_KEYS if getattr(point, name) is not None]
        if len(asked) > 1:
            key, mend = f"programme.points[{number}].{asked[1]}", f"keep it or {asked[0]}"
            problem = f"cannot be asked for beside {asked[0]}"
            found.append(InputError(problem, file=file, key=key, value=getattr(point, asked[1]), mend=mend))
    return found


_CHECKS = (
    _start_contradictions,
    _point_contradictions,
    _other_contradictions,
    _expectation_contradictions,
)
"""Mistakes that involve more than one key."""


def scenario_of(content: ScenarioFile, text: str, file: str) -> Scenario:
    """Bring checked content to SI.

    Args:
        content: The content.
        text: The TOML text.

    Raises:
        InputError: Something that shows only when times are worked out.
    """
    try:
        return _scenario(content, text, file)
    except InputError as error:
        raise InputError(str(error).rstrip("."), file=file) from error


def _scenario(content: ScenarioFile, text: str, file: str) -> Scenario:
    altitude = DEFAULT_ALTITUDE if content.start.altitude_m is None else content.start.altitude_m
    start = _start(content.start, altitude)
    if content.programme is not None:
        programme = _programme(content.programme, altitude)
        start = programme.at(0.0) if start is None else start
    else:
        assert start is not None  # _start_contradictions refuses a hold without start
        programme = Programme.hold(airspeed=start.airspeed, nacelle_angle=start.nacelle_angle, altitude=start.altitude)
    duration = programme.duration if content.duration_s is None else content.duration_s
    if duration <= 0.0:
        raise InputError("is missing", key="duration_s", mend="add it: a programme of one point has no end of its own")
    return Scenario(
        name=content.name,
        title=content.title,
        description=content.description.strip(),
        programme=programme,
        duration=duration,
        start=start,
        options=FlightOptions(**given(content.flight, file)),
        air=air_of(content.air),
        faults=faults_of(content.faults),
        events=tuple(
            ScenarioEvent(event.time_s, event.pilot) for event in sorted(content.events, key=lambda event: event.time_s)
        ),
        expectations=tuple(clause_of(clause.name, clause) for clause in content.expect),
        source=text,
        file=file,
        automatic=automatic_settings(content.automatic),
        pulses=pulses_of(content.pulses),
        reaction=content.reaction_s,
        trial=trial_of(content.trial, given(content.flight).get("protection")),
    )


def _start(table: StartTable, altitude: float) -> ProgrammePoint | None:
    if table.condition is not None:
        return named_start(table.condition, altitude=altitude)
    if table.airspeed_kt is None or table.nacelle_deg is None:
        return None
    return ProgrammePoint(kt(table.airspeed_kt), deg(table.nacelle_deg), altitude)


def _programme(table: ProgrammeTable, altitude: float) -> Programme:
    points: list[tuple[PointTable, float]] = []
    for point in table.points:
        altitude = altitude if point.altitude_m is None else point.altitude_m
        points.append((point, altitude))
    sideways = _sideways(table.points)
    if points[0][0].time_s is not None:
        rows: list[tuple[Any, ...]] = [
            (point.time_s, kt(point.airspeed_kt), deg(point.nacelle_deg), height, *turn, lateral, track)
            for (point, height), (turn, lateral, track) in zip(points, sideways, strict=True)
        ]
        return Programme(*np.array(rows, dtype=np.float64).T)
    return timed_programme(
        [
            Waypoint(
                kt(point.airspeed_kt),
                deg(point.nacelle_deg),
                height,
                acceleration=kt(point.acceleration_kt_s or table.acceleration_kt_s),
                nacelle_rate=deg(point.nacelle_rate_deg_s or table.nacelle_rate_deg_s),
                climb_rate=point.climb_rate_m_s or table.climb_rate_m_s,
                hold=point.hold_s or 0.0,
                turn=turn,
                lateral=lateral,
                track=track,
            )
            for (point, height), (turn, lateral, track) in zip(points, sideways, strict=True)
        ],
        nacelle_motion=table.nacelle_motion,
    )


def _sideways(points: Sequence[PointTable]) -> list[tuple[tuple[int, float], float, bool]]:
    """What turn, lateral speed and track each point asks for; what it does not say it takes from the one before."""
    found, turn, lateral, track = [], (TURN.bank, 0.0), 0.0, False
    for point in points:
        if point.heading_deg is not None:
            heading = deg(point.heading_deg)
            if turn[0] == TURN.heading:  # the nearest way round
                heading = turn[1] + math.remainder(heading - turn[1], 2.0 * math.pi)
            turn = (TURN.heading, heading)
        elif point.bank_deg is not None:
            turn = (TURN.bank, deg(point.bank_deg))
        elif point.turn_rate_deg_s is not None:
            turn = (TURN.rate, deg(point.turn_rate_deg_s))
        lateral = lateral if point.lateral_kt is None else kt(point.lateral_kt)
        track = track if point.track is None else point.track
        found.append((turn, lateral, track))
    return found
