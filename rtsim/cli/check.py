"""``rtsim check``: validates scenario and campaign files, stick maps and databases without flying them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, get_args

import typer

from rtsim.cli.output import console, emit_json, results
from rtsim.errors import EXIT_BAD_INPUT, InputError, RtsimError, suggestion
from rtsim.outside import read_text
from rtsim.toml_file import read_toml

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
            help="Scenarios, campaigns, stick maps (.toml), names, databases (.nc, .mat), aircraft profiles."
        ),
    ],
    *,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Validate scenario and campaign files, stick maps, databases; every mistake is one sentence, exit 2 for any."""
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
        name: A path, or the name of a library scenario.

    Returns:
        No sentence where the file can be used.
    """
    if Path(name).suffix in DATABASE_SUFFIXES:
        return _database_problems(Path(name))
    from scenarios.files.loader import scenario_problems

    suffix = Path(name).suffix
    if suffix and suffix != ".toml" and "/" not in suffix:
        choices = [".toml", *DATABASE_SUFFIXES]
        mend = suggestion(suffix, choices, otherwise="name a scenario file or a database")
        return [
            str(InputError("is no kind of file that rtsim reads", file=name, allowed=", ".join(choices), mend=mend))
        ]
    if name.endswith(PROFILE_SUFFIX):
        return _profile_problems(Path(name))
    if suffix == ".toml":
        keys = _top_keys(Path(name))
        # Scenarios have neither key.
        if "kind" in keys:
            return _stick_map_problems(name)
        if "classes" in keys:
            return _campaign_problems(name)
    problems = scenario_problems(name)
    if not problems:
        from scenarios.files.loader import load_scenario
        from scenarios.flight.preflight import preflight_problems, start_problems

        scenario = load_scenario(name)
        problems = preflight_problems(scenario) + start_problems(scenario)
    return [str(problem) for problem in problems]


def _top_keys(path: Path) -> set[str]:
    """Keys of a TOML file, which tell what it is; none where it cannot be read."""
    try:
        return set(read_toml(path, noun="scenario"))
    except InputError:
        return set()  # the scenario reader tells what is wrong


def _campaign_problems(name: str) -> list[str]:
    from scenarios.campaign.spec import parse_campaign

    return [str(problem) for problem in parse_campaign(read_text(name, noun="campaign"), file=name)[1]]


def _profile_problems(path: Path) -> list[str]:
    """Mistakes of an aircraft's profile; read with its database where that stands beside it."""
    from rtsim.aircraft.profile import read_profile

    for suffix in DATABASE_SUFFIXES:
        database = path.with_name(path.name.removesuffix(PROFILE_SUFFIX) + suffix)
        if database.is_file():
            return _database_problems(database)
    try:
        read_profile(path)
    except RtsimError as error:
        return [str(error)]
    return []


def _stick_map_problems(name: str) -> list[str]:
    from telemetry.joystick.stick_map import load_stick_map

    try:
        load_stick_map(Path(name))
    except InputError as error:
        return [str(error)]
    return []


def check_profile(database: Database) -> None:
    """Read every part of an aircraft's profile, as its flights do.

    Raises:
        InputError: The first number that is missing or out of range.
    """
    from rtsim.aids.design import design_aids
    from rtsim.aircraft.controls import control_tables
    from rtsim.atmosphere.air import gust_tables
    from rtsim.atmosphere.specification import CALM
    from rtsim.choices import ChartName
    from rtsim.corridor.boundaries import load_corridor
    from rtsim.faults.schedule import fault_tables
    from rtsim.nacelle.switch import load_nacelle_tables
    from rtsim.optimization.paths import conversion_end_kt
    from rtsim.pilot.weights import pilot_settings
    from rtsim.protection.limits import load_levels
    from rtsim.protection.tables import law_tables
    from rtsim.systems.settings import load_drive_tables, load_flap_tables

    profile = database.profile
    for read in (control_tables, load_nacelle_tables, load_levels, load_flap_tables, load_drive_tables, pilot_settings):
        read(profile)
    for name in get_args(ChartName):
        load_corridor(name, profile)
    gust_tables(CALM, profile)
    fault_tables((), profile)
    conversion_end_kt(database)
    design_aids(database)
    law_tables("full", database, dt=0.004)


def _database_problems(path: Path) -> list[str]:
    if not path.is_file():
        return [str(InputError("does not exist", file=str(path), mend="check the path"))]
    try:
        from rtsim.lpv.files.storage import load_database

        check_profile(load_database(path))
    except RtsimError as error:
        return [str(error)]
    return []
