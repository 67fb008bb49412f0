"""What would keep a scenario that reads well from being flown: pilots, laws and a start that are not there."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rtsim.choices import BUILT_IN_PILOT
from rtsim.errors import InputError, TrimError
from rtsim.loop.options import declared
from rtsim.toml_file import parse_toml
from rtsim.units import to_deg, to_kt
from scenarios.files.loader import examine_scenario, scenario_of
from scenarios.files.nacelle_laws import load_nacelle_law
from scenarios.files.scenario import START_CONDITIONS, Scenario
from scenarios.files.schema import ScenarioFile, StartTable
from scenarios.flight.hands import pilot_modes
from scenarios.flight.mavlink_options import flown_by_hand
from scenarios.flight.pilots import load_pilot


def preflight_problems(scenario: Scenario) -> list[InputError]:
    """Names in a scenario behind which there is nothing; an empty list where all can be found.

    Args:
        scenario: What is to be flown. Modules of MODULE:CLASS are imported.
    """
    from rtsim.lpv.files.storage import load_database
    from rtsim.protection.laws import load_laws

    found = []
    named: dict[str, Callable[[str], object]] = {
        "pilot": load_pilot, "nacelle": load_nacelle_law, "protection": load_laws,
    }  # fmt: skip
    if scenario.options.database:  # the shipped one is there, and a flight need not wait for it here
        named["database"] = load_database
    try:
        scenario.options.aircraft  # noqa: B018 - it may be refused
    except InputError as error:
        return [_placed(error, scenario, "database")]
    for key, look_up in named.items():
        try:
            look_up(getattr(scenario.options, key))
        except InputError as error:
            found.append(_placed(error, scenario, key))
    plug_in = scenario.options.pilot != BUILT_IN_PILOT
    available = pilot_modes(plug_in=plug_in, hands=flown_by_hand(scenario.options.pilot))
    for number, event in enumerate(scenario.events):
        if event.pilot not in available:
            found.append(
                InputError(
                    "is not a pilot of this flight",
                    file=scenario.file,
                    key=f"events[{number}].pilot",
                    value=event.pilot,
                    allowed=", ".join(available),
                    mend="choose one, or name a plug-in as flight.pilot or by --pilot",
                )
            )
    return found


def start_problems(scenario: Scenario) -> list[InputError]:
    """Whether there is an aircraft, and whether it can be trimmed where a scenario starts; empty where it can."""
    try:
        start, own = scenario.start, scenario.options.aircraft
    except InputError:
        return []  # which preflight_problems tells
    if not own and (start.airspeed, start.nacelle_angle) in START_CONDITIONS.values():
        return []
    from rtsim.lpv.aircraft import load_aircraft

    try:
        aircraft = load_aircraft(own or None)
    except InputError:
        return []  # which preflight_problems tells, or it is yet to be built
    try:
        if aircraft.trim(airspeed=start.airspeed, nacelle=start.nacelle_angle).converged:
            return []
    except TrimError:
        pass
    except InputError as error:
        return [_elsewhere(error, scenario)]
    return [
        InputError(
            "the aircraft has no level-flight trim there",
            file=scenario.file,
            key="start",
            value=f"{to_kt(start.airspeed):g} kn at nacelle {to_deg(start.nacelle_angle):g} deg",
            mend="start inside the conversion corridor (rtsim corridor shows it)",
        )
    ]


def _elsewhere(error: InputError, scenario: Scenario) -> InputError:
    """What is wrong with a start, where it stands."""
    key = f"start.{error.key}" if error.key else "start"
    return InputError(
        error.problem, file=scenario.file, key=key, value=error.value, allowed=error.allowed, mend=error.mend
    )


def every_problem(text: str, *, file: str) -> list[InputError]:
    """All that would keep the text of a scenario from being flown, in one round.

    Args:
        text: The TOML text.
    """
    try:
        examined = examine_scenario(text, file=file)
    except InputError as error:
        return [error]

    def flown(check: Callable[[Scenario], list[InputError]], content: ScenarioFile) -> list[InputError]:
        if examined.problems:  # where the flight begins and ends may be among them, and matters to no name
            changes: dict[str, Any] = {"duration_s": content.duration_s or 1.0}
            if content.programme is None and content.start.condition is None and content.start.airspeed_kt is None:
                changes["start"] = StartTable(condition="hover")
            content = content.model_copy(update=changes)
        return check(scenario_of(content, text, file))

    try:
        examined.ask(*(functools.partial(flown, check) for check in (preflight_problems, start_problems)))
    except InputError as error:  # times that do not add up
        return [error]
    return examined.problems


def _placed(error: InputError, scenario: Scenario, key: str) -> InputError:
    """The error where its value stands: in the scenario's file, or else on the command line."""
    table = parse_toml(scenario.source, file=scenario.file).get("flight", {}) if scenario.source else {}
    said, flown = table.get(key), getattr(scenario.options, key)
    if said != flown and not (
        declared()[key].is_file and said and (Path(scenario.file).parent / said).resolve() == Path(flown)
    ):
        return error
    return InputError(
        error.problem,
        file=scenario.file,
        key=f"flight.{key}",
        value=flown if error.value is None else error.value,
        allowed=error.allowed,
        mend=error.mend,
    )
