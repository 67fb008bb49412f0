"""``rtsim view``: recorded flights in the viewer, one or one over another."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from rtsim.cli.output import console, emit_json, progress, results
from rtsim.errors import InputError, OutputError

Layout = Literal["pilot", "cockpit", "engineer", "compare"]

if TYPE_CHECKING:
    from telemetry.log.reader import FlightLog

_WORDS = (
    ("apart", "apart", "m"),
    ("airspeed", "airspeed", "kn"),
    ("nacelle", "nacelle", "deg"),
    ("altitude", "altitude", "m"),
    ("bank", "bank", "deg"),
    ("margin", "margin", "kn"),
)
"""Name, words and unit of the differences that are told."""


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command("view")(view_command)


def view_command(
    log: Annotated[Path, typer.Argument(help="A flight log, as written by rtsim fly --log.")],
    other: Annotated[
        Path | None, typer.Argument(help="Another, which is laid over it as a ghost.", show_default="none")
    ] = None,
    *,
    layout: Annotated[
        Literal["pilot", "cockpit", "engineer", "compare"] | None,
        typer.Option(help="Layout.", show_default="pilot; compare with two logs"),
    ] = None,
    record: Annotated[
        Path | None, typer.Option(help="Keep the recording for Rerun, NAME.rrd.", show_default="not kept")
    ] = None,
    headless: Annotated[bool, typer.Option("--headless", help="Open no viewer.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Look at a recorded flight in the viewer, or at two of them on one time axis.

    Examples:
        rtsim view turn.parquet  # a flight, with its time axis
        rtsim view without.parquet with.parquet  # two on one axis, their differences side by side
    """
    from telemetry.log.reader import read_log
    from telemetry.view.logged import flights_of, greatest_differences
    from telemetry.view.options import display_available

    window = not headless and display_available()
    if not window and record is None:
        why = "no viewer is wanted" if headless else "there is no display for a viewer"
        raise InputError(why, key="--record", mend="give --record FILE.rrd")
    logs = [read_log(path) for path in (log, other) if path is not None]
    if layout == "compare" and other is None:
        raise InputError(
            "a comparison needs two logs", key="--layout", value=layout, allowed="pilot, cockpit, engineer"
        )
    flights = flights_of(logs)
    found = greatest_differences(logs) if other is not None else None
    if found is not None:
        _tell_corridors(logs)
        if not json:
            results.print(_in_words(found, flights[1].name, flights[0].name), markup=False, soft_wrap=True)
    chosen: Layout = layout or ("compare" if other is not None else "pilot")
    with tempfile.TemporaryDirectory(prefix="rtsim-view-") as folder:
        recording = record or Path(folder) / "flight.rrd"
        _record(logs, recording, chosen)
        if window:
            _show(recording)
    if json:
        emit_json({"logs": [one.path for one in logs], "recording": record, "difference": found})
    elif record is not None:
        results.print(str(record), markup=False, soft_wrap=True)


def _record(logs: list[FlightLog], recording: Path, layout: Layout) -> None:
    from telemetry.view.logged import record_logs

    with progress("Drawing the flight", total=1.0) as advance:
        record_logs(logs, recording, layout=layout, on_progress=advance)


def _show(recording: Path) -> None:
    """Open a viewer and wait until it is closed."""
    from telemetry.view.options import ViewOptions
    from telemetry.view.viewer import Viewer

    try:
        viewer = Viewer(ViewOptions(), str(recording))
    except OSError as failure:
        raise OutputError(f"The viewer cannot be started ({failure}); --record keeps the recording.") from failure
    console.print("The viewer is open; close its window or press Ctrl-C to end.")
    try:
        while (code := viewer.ended()) is None:
            time.sleep(0.1)
    except BaseException:
        viewer.close()
        raise
    if code:
        raise OutputError(f"The viewer could not show its window (exit code {code}); --record keeps the recording.")


def _tell_corridors(logs: list[FlightLog]) -> None:
    a, b = (log.metadata.corridor for log in logs)
    if a != b:
        first, second = (outline.name if outline else "none" for outline in (a, b))
        console.print(f"The corridors differ ({first} and {second}); that of the first flight is drawn.")


def _in_words(found: dict[str, float], second: str, first: str) -> str:
    if len(found) == 1:
        return "The flights have no time in common."
    told = ", ".join(
        f"{words} {found[name]:{'' if name == 'apart' else '+'}.1f} {unit}" for name, words, unit in _WORDS
    )
    return f"{second} less {first} at most, in {found['both_fly_s']:.1f} s: {told}"
