"""``rtsim scenarios``: the flights that come with rtsim, listed, and each described."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from rtsim.cli.completion import scenario_names
from rtsim.cli.output import emit_json, results

if TYPE_CHECKING:
    from scenarios.files.scenario import Scenario

KINDS = {
    "flight": "Flights",
    "nominal": "Trials: nominal, a law has nothing to do",
    "misuse": "Trials: misuse",
    "failure": "Trials: failures",
    "unprotectable": "Trials: what no law can prevent",
}
"""Kinds of scenarios in words, in the order of the list."""


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command("scenarios")(scenarios_command)


def scenarios_command(
    *,
    names: Annotated[
        list[str] | None,
        typer.Argument(
            help="Scenarios to describe, by name or file.",
            show_default="the library",
            autocompletion=scenario_names,
        ),
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """List the scenarios that come with rtsim; with names, describe these. Fly one with `rtsim fly NAME`.

    Examples:
        rtsim scenarios  # the library, by kind
        rtsim scenarios conversion_turn hover  # what these two fly and expect
    """
    from scenarios.files.loader import library_names, load_scenario

    found = [load_scenario(name) for name in names or library_names()]
    if json:
        emit_json({"scenarios": [_entry(scenario) for scenario in found]})
    elif names:
        for scenario in found:
            _describe(scenario)
    else:
        _list(found)


def _kind(scenario: Scenario) -> str:
    return "flight" if scenario.trial is None else scenario.trial.kind


def _entry(scenario: Scenario) -> dict[str, Any]:
    return {
        "name": scenario.name,
        "title": scenario.title,
        "kind": _kind(scenario),
        "duration_s": scenario.duration,
        "description": " ".join(scenario.description.split()),
    }


def _list(found: list[Scenario]) -> None:
    from rich.table import Table

    for kind, words in KINDS.items():
        table = Table(title=words, title_justify="left", box=None, pad_edge=False, header_style="bold")
        table.add_column("name", no_wrap=True)
        table.add_column("s", justify="right")
        table.add_column("title")
        for scenario in found:
            if _kind(scenario) == kind:
                table.add_row(scenario.name, f"{scenario.duration:.0f}", scenario.title)
        if table.row_count:
            results.print(table)
            results.print()
    results.print("Fly one: rtsim fly NAME. What it does: rtsim scenarios NAME. Test with a law: rtsim test NAME.")


def _describe(scenario: Scenario) -> None:
    from rtsim.units import to_deg, to_kt

    start = scenario.start
    results.print(f"{scenario.name}: {scenario.title}", style="bold", highlight=False)
    begin = f"{to_kt(start.airspeed):.0f} kn, nacelles {to_deg(start.nacelle_angle):.0f} deg, {start.altitude:.0f} m"
    results.print(f"  {scenario.duration:.0f} s from {begin}; {_kind(scenario)}", highlight=False)
    if scenario.description:
        results.print(f"  {' '.join(scenario.description.split())}", highlight=False)
    clauses = scenario.trial.clauses if scenario.trial is not None else scenario.expectations
    for clause in clauses:
        results.print(f"  expects: {clause.name}", highlight=False)
    results.print()
