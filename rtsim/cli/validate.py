"""``rtsim validate``: the aircraft model against everything published, with a report."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rtsim.cli.output import emit_json, progress, results
from rtsim.whole_file import check_writable

if TYPE_CHECKING:
    from rtsim.validation.report import Report


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command("validate")(validate_command)


def validate_command(
    *,
    out: Annotated[Path, typer.Option(help="Directory for the report, the results and the plots.")],
    sensitivity: Annotated[
        bool, typer.Option("--sensitivity", help="Also move every uncertain input to both ends of its range.")
    ] = False,
    jobs: Annotated[int | None, typer.Option(help="Processes.", show_default="one per core", min=1, max=256)] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Compare the aircraft model with everything published about the XV-15 and write a report.

    A check that misses its band is a result, not a fault: the exit code is 0 whenever the report is written.

    Examples:
        rtsim validate --out report
    """
    from rtsim.validation.report import total_work, write_report

    check_writable(out, folder=True)
    with progress("Validating", total=total_work(sensitivity=sensitivity)) as advance:
        report = write_report(
            out, sensitivity=sensitivity, jobs=jobs if jobs is not None else os.cpu_count() or 1, progress=advance
        )
    if json:
        emit_json(report.to_json())
    else:
        _print(report)


def _print(report: Report) -> None:
    from rich.table import Table

    from rtsim.validation.declared import GROUPS
    from rtsim.validation.summary import series_of, series_row

    found = report.validation
    table = Table(title="The model against what is published", title_justify="left")
    for heading, justify in (("group", "left"), ("hold", "right"), ("miss", "right"), ("no band", "right")):
        table.add_column(heading, justify="right" if justify == "right" else "left")
    for name, (title, _) in GROUPS.items():
        counts = [
            sum(one.status == status for one in found.of_group(name)) for status in ("holds", "misses", "reported")
        ]
        table.add_row(title, *map(str, counts))
    results.print(table)
    missing = Table(title="What misses", title_justify="left")
    for heading in ("check", "verdict", "model less published"):
        missing.add_column(heading)
    for name, checks in series_of(found.results).items():
        row = series_row(checks)
        if row.verdict.startswith("misses"):
            missing.add_row(name, row.verdict, row.found)
    results.print(missing)
    totals = found.counts()
    results.print(
        f"{totals['holds']} hold, {totals['misses']} miss, {totals['reported']} are reported without a band, "
        f"{totals['outside']} are not judged. Report: {report.page}",
        markup=False,
    )
