"""What would keep a scenario that reads well from being flown: pilots, laws and a start that are not there."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from rtsim.choices import BUILT_IN_PILOT
from rtsim.errors import InputError, RtsimError
from rtsim.loop.options import declared
from rtsim.toml_file import parse_toml
from rtsim.units import to_deg, to_kt
from scenarios.files.nacelle_laws import load_nacelle_law
from scenarios.files.scenario import START_CONDITIONS, Scenario
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
    """Whether the aircraft can be trimmed where a scenario starts; an empty list where it can."""
    start = scenario.start
    if (start.airspeed, start.nacelle_angle) in START_CONDITIONS.values():
        return []
    from rtsim.lpv.aircraft import load_aircraft

    try:
        aircraft = load_aircraft(scenario.options.database or None)
    except InputError:
        return []  # which preflight_problems tells
    try:
        trimmed = aircraft.trim(airspeed=start.airspeed, nacelle=start.nacelle_angle).converged
    except RtsimError:
        trimmed = False
    if trimmed:
        return []
    return [
        InputError(
            "the aircraft has no level-flight trim there",
            file=scenario.file,
            key="start",
            value=f"{to_kt(start.airspeed):g} kn at nacelle {to_deg(start.nacelle_angle):g} deg",
            mend="start inside the conversion corridor (rtsim corridor shows it)",
        )
    ]


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
