"""``rtsim flightgear``: writes the aircraft for FlightGear, and says how to start it."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from rtsim.cli.flight_text import say
from rtsim.cli.options import OPTIONAL_VALUES
from rtsim.cli.output import emit_json, results

_DEFAULT = OPTIONAL_VALUES["--flightgear"]


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command("flightgear")(flightgear_command)


def flightgear_command(
    *,
    out: Annotated[Path, typer.Option(help="Folder to write the aircraft and the start script to.")],
    listen: Annotated[
        str, typer.Option(metavar="HOST:PORT", help="Where FlightGear is to listen for rtsim fly --flightgear.")
    ] = _DEFAULT,
    origin: Annotated[
        str | None,
        typer.Option(
            metavar="LAT,LON[,M]",
            help="Where FlightGear starts: the same as for rtsim fly.",
            show_default="runway 02 of Keflavik",
        ),
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Write an XV-15 for FlightGear and a script that starts FlightGear with it, as the window of a flight.

    Examples:
        rtsim flightgear --out fg  # then sh fg/start-flightgear.sh, and rtsim fly --flightgear
    """
    from telemetry.exchange.endpoint import Endpoint
    from telemetry.exchange.globe import HomePosition
    from telemetry.flightgear.config import KEFLAVIK
    from telemetry.flightgear.files import START_SCRIPT, start_command, write_aircraft

    home = HomePosition.parse(origin) if origin is not None else KEFLAVIK
    address = Endpoint.parse(listen, key="--listen", default=_DEFAULT)
    files = write_aircraft(out, listen=address, home=home)
    command = start_command(out, listen=address, home=home)
    if json:
        emit_json({"files": [str(path) for path in files], "command": command})
        return
    say(f"Wrote {len(files)} files to {out}.")
    fly = "rtsim fly --flightgear" if str(address) == _DEFAULT else f"rtsim fly --flightgear {address}"
    if origin is not None:
        fly = f"{fly} --origin {origin}"
    script = shlex.quote(str(out / START_SCRIPT))
    results.print(
        f"First start FlightGear: sh {script}\nThen fly: {fly}", markup=False, soft_wrap=True, highlight=False
    )
