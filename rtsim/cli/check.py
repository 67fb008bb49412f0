"""``rtsim check``: validates any file that rtsim reads without flying it, and tells every mistake at once."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args

import typer

from rtsim.cli.completion import scenario_names
from rtsim.cli.output import console, emit_json, results, working
from rtsim.errors import EXIT_BAD_INPUT, InputError, RtsimError, closest, suggestion
from rtsim.outside import read_text
from rtsim.toml_file import named_text, parse_toml, shipped_names

if TYPE_CHECKING:
    from rtsim.lpv.database import Database

DATABASE_SUFFIXES = (".nc", ".mat")
"""Files with these endings are read as LPV databases."""
PROFILE_SUFFIX = ".profile.toml"
"""Files with this ending are read as aircraft profiles."""


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command("check")(check_command)


def check_command(
    files: Annotated[
        list[str],
        typer.Argument(
            help="Scenarios, campaigns, searches, stick maps, pilot cases, parameters, profiles (.toml), names of "
            "those that come with rtsim, databases (.nc, .mat), flight logs.",
            autocompletion=scenario_names,
        ),
    ],
    *,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Validate files of every kind without flying them; every mistake is one sentence, exit 2 for any.

    Examples:
        rtsim check my_flight.toml turn.parquet
    """
    with working("Checking"):
        findings = {name: file_problems(name) for name in files}
    for name, problems in findings.items():
        for problem in problems:
            console.print(f"rtsim: error: {problem}", markup=False, soft_wrap=True)
        if not problems and not json:
            results.print(f"{name}: good", markup=False)
    if json:
        emit_json(
            {
                "valid": not any(findings.values()),
                "files": [
                    {"file": name, "valid": not problems, "problems": problems} for name, problems in findings.items()
                ],
            }
        )
    if any(findings.values()):
        raise typer.Exit(EXIT_BAD_INPUT)


def file_problems(name: str) -> list[str]:
    """All mistakes of one file, as sentences.

    Args:
        name: A path, or the name of a scenario, campaign or stick map that comes with rtsim.

    Returns:
        No sentence where the file can be used.
    """
    try:
        return [str(problem) for problem in _problems(name)]
    except RtsimError as error:
        return [str(error)]


def _problems(name: str) -> list[InputError]:
    """All mistakes of one file that are told apart; others are raised."""
    path = Path(name)
    suffix = path.suffix.lower()
    if not suffix and "/" not in name:
        return _library_problems(name)
    if path.is_dir():
        from telemetry.log.reader import read_log

        read_log(path)
        return []
    if suffix in DATABASE_SUFFIXES:
        return _database_problems(path)
    if suffix and suffix != ".toml":
        choices = [".toml", *DATABASE_SUFFIXES]
        mend = suggestion(suffix, choices, otherwise="name a scenario file or a database")
        raise InputError("is no kind of file that rtsim reads", file=name, allowed=", ".join(choices), mend=mend)
    from scenarios.files.loader import MAX_FILE_BYTES

    text = read_text(path, noun="scenario", largest=MAX_FILE_BYTES)
    return _text_problems(text, name)


def _library_problems(name: str) -> list[InputError]:
    """Mistakes of what comes with rtsim, by name; a law or an aircraft that it needs may be missing here."""
    from scenarios.campaign.spec import LIBRARY as CAMPAIGNS
    from scenarios.files.loader import LIBRARY as SCENARIOS
    from telemetry.joystick.stick_map import LIBRARY as STICK_MAPS

    names = {shipped: folder for folder in (STICK_MAPS, CAMPAIGNS, SCENARIOS) for shipped in shipped_names(folder)}
    if name not in names:
        raise InputError(
            "is not a scenario, campaign or stick map of the library",
            key="FILE",
            value=name,
            allowed=", ".join(closest(name, names)),
            mend=f"{suggestion(name, names, otherwise='choose one')}, or give a path ending in .toml",
        )
    text, file = named_text(name, folder=names[name], noun="file", key="FILE")
    return _text_problems(text, file)


def _text_problems(text: str, file: str) -> list[InputError]:
    """Mistakes of a TOML file, judged by what its keys say it is."""
    data = parse_toml(text, file=file)
    kind = kind_of(data, file)
    if kind == "campaign":
        from scenarios.campaign import preflight as campaigns

        return campaigns.every_problem(text, file=file)
    if kind == "search":
        return _search_problems(data, file)
    if kind == "stick map":
        from telemetry.joystick.stick_map import examine_stick_map

        return examine_stick_map(data, file=file)[1]
    if kind == "profile":
        return _profile_problems(text, Path(file))
    if kind == "pilot cases":
        return _case_problems(file, data)
    if kind == "parameters":
        from telemetry.mavlink.parameters import ParameterStore

        return ParameterStore.every_aid().problems(data, file=file)
    from scenarios.flight import preflight as scenarios

    return scenarios.every_problem(text, file=file)


def kind_of(data: Mapping[str, Any], file: str) -> str:
    """What a TOML file is: the kind that has most of its keys and shares them with no other.

    Args:
        data: Its tables.

    Returns:
        A key of the table in this function; ``scenario`` where nothing speaks for another.
    """
    from rtsim.aircraft.profile import PARTS
    from rtsim.optimization.spec import SearchSpec
    from rtsim.pilot.problem import FIELDS
    from scenarios.campaign.spec import CampaignFile
    from scenarios.files.schema import ScenarioFile
    from telemetry.joystick.stick_map import GamepadMap, VehicleMap

    if file.endswith(PROFILE_SUFFIX):
        return "profile"
    if data and all(key.startswith("XV_") for key in data):
        return "parameters"
    keys = {
        "scenario": set(ScenarioFile.model_fields),
        "campaign": set(CampaignFile.model_fields),
        "search": set(SearchSpec.model_fields),
        "stick map": {*VehicleMap.model_fields, *GamepadMap.model_fields},
        "profile": {"borrows", *PARTS},
        "pilot cases": {"case", "reject", "input", "tolerance", *FIELDS},
    }
    shared = [key for kind in keys.values() for key in kind]
    return max(keys, key=lambda kind: sum(shared.count(key) == 1 and key in keys[kind] for key in data))


def _search_problems(data: dict[str, Any], file: str) -> list[InputError]:
    from rtsim.lpv.files.storage import load_database
    from rtsim.optimization.spec import place_database, spec_problems

    place_database(data, file)
    found = spec_problems(data, file=file)
    database = data["flight"].get("database") if isinstance(data.get("flight"), dict) else None
    if isinstance(database, str) and database:
        try:
            load_database(database)
        except InputError as error:
            found.append(InputError(str(error).rstrip("."), file=file, key="flight.database"))
    return found


def _case_problems(file: str, data: dict[str, Any]) -> list[InputError]:
    """Mistakes of every case that should be solved."""
    from rtsim.pilot.cases import cases_of

    found = []
    for case in cases_of(data, file).cases:
        try:
            if case.kind == "case":
                case.problem()
        except InputError as error:
            found.append(InputError(str(error).rstrip("."), file=file, key=f"{case.kind}.{case.name}.input"))
    return found


def _profile_problems(text: str, path: Path) -> list[InputError]:
    """Mistakes of an aircraft's profile; read with its database where that stands beside it."""
    from rtsim.aircraft.profile import parse_profile

    for suffix in DATABASE_SUFFIXES:
        database = path.with_name(path.name.removesuffix(PROFILE_SUFFIX) + suffix)
        if path.name.endswith(PROFILE_SUFFIX) and database.is_file():
            return _database_problems(database)
    parse_profile(text, file=str(path))
    return []


def profile_problems(database: Database) -> list[InputError]:
    """Read every part of an aircraft's profile and its pilots, as its flights do.

    Returns:
        The first number of each part that is missing or out of range.
    """
    from rtsim.aids.design import design_aids
    from rtsim.aids.lateral_design import design_lateral_aids
    from rtsim.aircraft.controls import control_tables
    from rtsim.atmosphere.air import gust_tables
    from rtsim.atmosphere.specification import CALM
    from rtsim.choices import ChartName, OuterLoop
    from rtsim.corridor.boundaries import load_corridor
    from rtsim.faults.schedule import fault_tables
    from rtsim.nacelle.switch import load_nacelle_tables
    from rtsim.optimization.paths import conversion_end_kt
    from rtsim.pilot.tables import load_pilot_tables
    from rtsim.pilot.weights import pilot_settings
    from rtsim.protection.limits import load_levels
    from rtsim.protection.tables import law_tables
    from rtsim.systems.engine import load_engine_tables
    from rtsim.systems.settings import load_drive_tables, load_flap_tables

    of_profile = (
        control_tables, load_nacelle_tables, load_levels, load_flap_tables, load_drive_tables, load_engine_tables,
        pilot_settings,
    )  # fmt: skip
    profile = database.profile
    reads: list[Callable[[], object]] = [functools.partial(read, profile) for read in of_profile]
    reads += [functools.partial(load_corridor, name, profile) for name in get_args(ChartName)]
    reads += [functools.partial(gust_tables, CALM, profile), functools.partial(fault_tables, (), profile)]
    reads += [functools.partial(conversion_end_kt, database), functools.partial(design_aids, database)]
    reads += [functools.partial(design_lateral_aids, database)]
    reads += [functools.partial(law_tables, "full", database, dt=0.004)]
    reads += [
        functools.partial(load_pilot_tables, database, name) for name in get_args(OuterLoop) if name in database.pilot
    ]
    found: dict[tuple[str, str], InputError] = {}  # a part is read by several, who stumble over the same number
    for read in reads:
        try:
            read()
        except InputError as error:
            found.setdefault((error.problem, str(error) if error.value is None else repr(error.value)), error)
    return list(found.values())


def _database_problems(path: Path) -> list[InputError]:
    from rtsim.lpv.files.storage import load_database

    return profile_problems(load_database(path))
