"""``rtsim plot``, ``rtsim log info`` and ``rtsim log export``: what a flight log shows, holds, and gives to others."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rtsim.cli.help_text import App
from rtsim.cli.output import console, emit_json, progress, results, working
from rtsim.whole_file import check_writable

if TYPE_CHECKING:
    from telemetry.log.reader import FlightLog

LogArgument = Annotated[Path, typer.Argument(help="A flight log, as written by rtsim fly --log.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")]


def register(app: typer.Typer) -> None:
    """Add the commands to the app."""
    app.command("plot")(plot_command)
    group = App(help="What a flight log holds; CSV and MAT for other programs.")
    group.command("info")(info_command)
    group.command("export")(export_command)
    app.add_typer(group, name="log")


def plot_command(
    log: LogArgument,
    *,
    out: Annotated[
        Path | None, typer.Option(help="Directory for the pictures.", show_default="LOG's name with -plots")
    ] = None,
    formulas: Annotated[
        list[str] | None,
        typer.Option(
            "--property",
            help="Draw how the flight stands to this, in signal temporal logic; repeat for several.",
            show_default="what its scenario asks",
        ),
    ] = None,
    json: JsonOption = False,
) -> None:
    """Draw a recorded flight: corridor, time histories, controls, flapping, margins, timing; as SVG and PNG.

    Examples:
        rtsim plot turn.parquet  # pictures into turn-plots
        rtsim plot turn.parquet --property "always (margin_kt > 3)"
    """
    from rtsim.cli.logged_properties import stated_properties
    from telemetry.log.flight_plots import plot_flight
    from telemetry.log.reader import read_log

    folder = out or log.with_name(f"{log.stem}-plots")
    check_writable(folder, folder=True)
    flight = read_log(log)
    stated = stated_properties(flight, formulas)
    with progress("Drawing", total=1.0) as advance:
        files = plot_flight(flight, folder, on_progress=advance, properties=[one.curve for one in stated])
    if json:
        emit_json({"log": log, "files": files, "properties": [one.report for one in stated]})
        return
    for one in stated:
        results.print(f"{one.curve.formula}: {one.curve.verdict}", markup=False, soft_wrap=True)
    for file in files:
        results.print(str(file), markup=False, soft_wrap=True)


def info_command(log: LogArgument, *, json: JsonOption = False) -> None:
    """Say what a log holds, and whether its rows still have the hash it was closed with.

    Examples:
        rtsim log info turn.parquet
    """
    from telemetry.log.reader import read_log

    flight = read_log(log)
    info = _information(flight)
    if json:
        emit_json(info)
        return
    _print_information(info)


def export_command(
    log: LogArgument,
    target: Annotated[Path, typer.Argument(help="File to write: *.csv or *.mat.")],
    *,
    json: JsonOption = False,
) -> None:
    """Write all signals of a log to a CSV or MAT file.

    Examples:
        rtsim log export turn.parquet turn.csv
    """
    from telemetry.log.export import export_log
    from telemetry.log.reader import read_log

    check_writable(target)
    with working(f"Writing {target.name}"):
        flight = read_log(log)
        export_log(flight, target)
    if json:
        emit_json({"log": log, "file": target, "frames": len(flight.rows), "signals": list(flight.names)})
    else:
        console.print(f"Wrote {len(flight.rows)} frames to {target}", markup=False, soft_wrap=True)


def _information(flight: FlightLog) -> dict[str, Any]:
    metadata, summary = flight.metadata, dict(flight.summary or {})
    stated = summary.get("history_sha256")
    computed = flight.history_sha256()
    times = flight["time_s"]
    return {
        "log": flight.path,
        "scenario": metadata.scenario_name,
        "frames": len(flight.rows),
        "rate_hz": metadata.rate_hz,
        "duration_s": float(times[-1]) + 1.0 / metadata.rate_hz if len(times) else 0.0,
        "complete": flight.summary is not None,
        "end_reason": summary.get("end_reason"),
        "history_sha256": computed,
        "hash_matches": None if stated is None else stated == computed,
        "database_hash": metadata.database_hash,
        "seed": metadata.seed,
        "corridor_name": metadata.corridor.name if metadata.corridor else None,
        "versions": dict(metadata.versions),
        "setup": dict(metadata.setup),
        "signals": [{"name": name, "unit": unit} for name, unit in zip(flight.names, flight.units, strict=True)],
        "events": flight.events,
        "summary": summary or None,
    }


def _print_information(info: dict[str, Any]) -> None:
    """The same for people."""
    hashes = {
        None: "not stated: the recording was cut off",
        True: "as stated",
        False: "NOT as stated: damaged or edited",
    }
    lines = [
        f"Log        {info['log']}",
        f"Scenario   {info['scenario']}, seed {info['seed']}, corridor {info['corridor_name'] or 'unknown'}",
        f"Flight     {info['frames']} frames at {info['rate_hz']:g} Hz, {info['duration_s']:.1f} s",
        f"Ended      {info['end_reason'] or 'cut off: killed, or the disk was full'}",
        f"History    {info['history_sha256']} ({hashes[info['hash_matches']]})",
        f"Database   {info['database_hash']}",
        f"Versions   {', '.join(f'{name} {version}' for name, version in info['versions'].items())}",
        f"Signals    {len(info['signals'])}: {', '.join(signal['name'] for signal in info['signals'][:6])}, ...",
        f"Events     {len(info['events'])}",
    ]
    lines += [f"  {event.time_s:9.3f} s  {event.level:10}  {event.text}" for event in info["events"]]
    for line in lines:
        results.print(line, markup=False, soft_wrap=True)
