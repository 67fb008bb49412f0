"""``rtsim reproduce``: every figure and claim of the paper from flights of this simulator, with a report."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rtsim.cli.output import emit_json, progress, results
from rtsim.whole_file import check_writable

if TYPE_CHECKING:
    from scenarios.reproduction.run import Reproduction


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command("reproduce")(reproduce_command)


def reproduce_command(
    *,
    out: Annotated[Path, typer.Option(help="Directory for the report, the claims and the figures.")],
    jobs: Annotated[
        int | None, typer.Option(help="Processes that fly.", show_default="one per core", min=1, max=256)
    ] = None,
    database: Annotated[
        Path | None, typer.Option(help="Another LPV database of the XV-15.", show_default="the shipped XV-15")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Regenerate the paper's figures from flights, judge its claims and write a report.

    The paper is "Simulation of tiltrotor maneuvers using linear parameter varying models"; the README says what we know
    of it. A claim that does not hold is a result, not a fault: the exit code is 0 whenever the report is written.

    Examples:
        rtsim reproduce --out report
    """
    from scenarios.reproduction.run import reproduce, total_work

    check_writable(out, folder=True)
    file = "" if database is None else str(database.resolve())
    with progress("Flying the paper", total=total_work()) as advance:
        done = reproduce(out, jobs=jobs if jobs is not None else os.cpu_count() or 1, progress=advance, database=file)
    if json:
        emit_json(
            {
                "claims": [claim.to_json() for claim in done.claims],
                "held": sum(claim.holds for claim in done.claims),
                "report": done.report,
                "figures": done.figures,
            }
        )
    else:
        _print(done)


def _print(done: Reproduction) -> None:
    from rich.table import Table

    table = Table(title="The paper's claims", title_justify="left")
    for heading in ("claim", "verdict", "measured"):
        table.add_column(heading)
    for claim in done.claims:
        verdict = "holds" if claim.holds else "does not hold"
        table.add_row(claim.text.id, verdict, claim.measured_text)
    results.print(table)
    held = sum(claim.holds for claim in done.claims)
    results.print(f"{held} of {len(done.claims)} claims hold. Report: {done.report}", markup=False)
