"""``rtsim model``: build, describe, export and import the LPV database."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rtsim.cli.help_text import App
from rtsim.cli.options import takes_options
from rtsim.cli.output import console, emit_json, progress, results
from rtsim.errors import InputError
from rtsim.loop.options import CONDITION, FlightOptions
from rtsim.whole_file import check_writable

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from rtsim.lpv.database import Database

_JSON = typer.Option("--json", help="Print one JSON object on stdout.")
_SUFFIXES = (".nc", ".mat")
_JOBS = 2


def register(app: typer.Typer) -> None:
    """Add the command group to the app."""
    group = App(help="The LPV database: trim map, linear models and pilot gains.")
    group.callback()(_group)
    group.command("build")(build_command)
    group.command("info")(info_command)
    group.command("export")(export_command)
    group.command("import")(import_command)
    app.add_typer(group, name="model")


def _group() -> None:
    """The LPV database: trim map, linear models and pilot gains."""


@takes_options(*CONDITION, own="the shipped one's")
def build_command(
    *,
    out: Annotated[
        Path | None,
        typer.Option(
            help="File to write.",
            show_default="the shipped database; at another condition the place where flights look for it",
        ),
    ] = None,
    options: dict[str, Any],
    jobs: Annotated[int, typer.Option(help="Processes to use.", min=1, max=64)] = _JOBS,
    without_pilot: Annotated[bool, typer.Option("--without-pilot", help="Leave the pilot's gains out.")] = False,
    json: Annotated[bool, _JSON] = False,
) -> None:
    """Build the database from the nonlinear model: trims, linear models, and the pilot's gains at every grid point.

    Examples:
        rtsim model build --weight-lb 11000 --density-altitude-ft 4000  # ahead of flights there
    """
    from rtsim.aircraft.condition import SHIPPED as SHIPPED_CONDITION
    from rtsim.lpv.files.kept_databases import place_for
    from rtsim.lpv.files.netcdf import SHIPPED
    from rtsim.lpv.files.storage import save_database
    from rtsim.pilot.database import build_xv15

    condition = FlightOptions().changed(options).condition
    target = out if out is not None else SHIPPED if condition == SHIPPED_CONDITION else place_for(condition)
    _require_suffix(target)
    check_writable(target)
    with progress("Solving trims and linear models", total=1.0) as advance:
        database = build_xv15(condition, jobs=jobs, pilots=not without_pilot, progress=advance)
    save_database(database, target)
    result = {"file": str(target), **summary(database)}
    if json:
        emit_json(result)
    else:
        _print_summary(result)


def info_command(
    file: Annotated[Path | None, typer.Argument(help="Database file.", show_default="the shipped one")] = None,
    *,
    json: Annotated[bool, _JSON] = False,
) -> None:
    """Say what a database holds: grid, variables, condition, pilots, hash, and how dense its grid is.

    Examples:
        rtsim model info
    """
    from rtsim.lpv.files.netcdf import SHIPPED
    from rtsim.lpv.files.storage import load_database

    database = load_database(file)
    result = {"file": str(file if file is not None else SHIPPED), **summary(database)}
    if json:
        emit_json(result)
    else:
        _print_summary(result)


def export_command(
    file: Annotated[Path, typer.Argument(help="File to write, .nc or .mat.")],
    *,
    database: Annotated[Path | None, typer.Option(help="Database to export.", show_default="the shipped one")] = None,
) -> None:
    """Write the database for other programs: NetCDF (.nc) or MATLAB (.mat).

    Examples:
        rtsim model export xv15.mat
    """
    from rtsim.lpv.files.storage import load_database, save_database

    _require_suffix(file)
    check_writable(file)
    save_database(load_database(database), file)
    console.print(f"Wrote {file}", soft_wrap=True)


def import_command(
    file: Annotated[Path, typer.Argument(help="A database of your own, .nc or .mat (layout: docs/lpv.md).")],
    *,
    out: Annotated[
        Path | None, typer.Option(help="NetCDF file to write.", show_default="beside FILE, named *.rtsim.nc")
    ] = None,
    design_pilots: Annotated[
        bool, typer.Option("--design-pilots", help="Design the MOCM for it, in place of the gains it carries.")
    ] = False,
    json: Annotated[bool, _JSON] = False,
) -> None:
    """Check a database of your own and write it as rtsim's NetCDF file.

    Fly it with 'rtsim fly --database FILE', look at it with 'rtsim trim --database FILE', or take it into Python with
    rtsim.load_aircraft(FILE).

    Examples:
        rtsim model import mine.mat --design-pilots
    """
    from rtsim.lpv.files.storage import load_database, save_database

    _require_suffix(file)
    target = out if out is not None else file.with_name(f"{file.stem}.rtsim.nc")
    if target.suffix.lower() != ".nc":
        raise InputError("not the name of a NetCDF file", key="--out", value=str(target), mend="end it in .nc")
    check_writable(target)
    database = load_database(file)
    if design_pilots:
        from rtsim.pilot.database import with_pilots

        with progress("Designing the pilots", total=1.0) as advance:
            database = with_pilots(database, jobs=_JOBS, progress=advance)
    save_database(database, target)
    result = {"file": str(target), **summary(database)}
    if json:
        emit_json(result)
    else:
        _print_summary(result)


def summary(database: Database) -> dict[str, Any]:
    """Describe a database in numbers.

    Returns:
        What ``rtsim model info --json`` prints, without the file name.
    """
    import numpy as np

    from rtsim.lpv.building.checks import NEIGHBOUR_LIMIT, check_neighbours
    from rtsim.units import DEGREE, KNOT

    inside = _inside_corridor(database)
    report = check_neighbours(database, inside=inside)
    check: dict[str, Any] = {"limit": NEIGHBOUR_LIMIT, "pairs": len(report.errors), "above": len(report.above())}
    if report.errors:
        check["largest"] = report.largest().error
    level = database.level_layer
    return {
        "content_hash": database.content_hash,
        "profile": {"name": database.profile.name, "borrowed": list(database.profile.borrowed)},
        "attributes": dict(database.attributes),
        "current": _is_current(database),
        "layer_acceleration_kt_s": np.round(database.layer_acceleration / KNOT, 9),
        "airspeed_kt": np.round(database.airspeed / KNOT, 9),
        "nacelle_deg": np.round(database.nacelle / DEGREE, 9),
        "points": int(database.valid[0].size),
        "valid_points": [int(layer.sum()) for layer in database.valid],
        "valid_airspeed_kt": [_valid_range(database, level, n) for n in range(database.nacelle.size)],
        "corridor_points": int(inside.sum()),
        "corridor_points_without_trim": int((inside & ~database.valid[level]).sum()),
        "states": [variable.name for variable in database.states],
        "inputs": [variable.name for variable in database.inputs],
        "outputs": [variable.name for variable in database.outputs],
        "pilots": {name: dict(pilot.attributes) for name, pilot in database.pilot.items()},
        "neighbour_check": check,
    }


def _inside_corridor(database: Database) -> npt.NDArray[np.bool_]:
    import numpy as np

    from rtsim.protection.boundary import load_boundary

    corridor = load_boundary("design", database)
    # 1e-6 m/s: a grid point on the boundary is inside whatever the rounding
    rows = [
        [corridor.low_speed(n) - 1e-6 <= v <= corridor.high_speed(n) + 1e-6 for n in database.nacelle]
        for v in database.airspeed
    ]
    return np.array(rows, dtype=np.bool_)


def _is_current(database: Database) -> bool | None:
    """Whether the aircraft has not changed since the database was built; None where it is not ours."""
    from rtsim.lpv.building.xv15_grid import source_sha256, still_trims

    stored = database.attributes.get("source_sha256")
    return None if stored is None else stored == source_sha256() and still_trims(database)


def _valid_range(database: Database, layer: int, nacelle: int) -> list[float]:
    import numpy as np

    from rtsim.units import KNOT

    speeds = database.airspeed[database.valid[layer, :, nacelle]] / KNOT
    return [float(np.round(speeds[0], 9)), float(np.round(speeds[-1], 9))] if speeds.size else []


def _require_suffix(file: Path) -> None:
    if file.suffix.lower() not in _SUFFIXES:
        raise InputError(
            "a database file is NetCDF or MATLAB", key="FILE", value=str(file), allowed="a name ending in .nc or .mat"
        )


def _print_summary(result: dict[str, Any]) -> None:
    from rich.table import Table

    table = Table(title=result["file"], show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for name, value in result["attributes"].items():
        table.add_row(name, f"{value:.7g}" if isinstance(value, float) else str(value))
    speeds, angles = result["airspeed_kt"], result["nacelle_deg"]
    table.add_row("hash", result["content_hash"])
    if result["current"] is not None:
        table.add_row("aircraft", "as built" if result["current"] else "changed since: run 'rtsim model build'")
    table.add_row("layers, kn/s", ", ".join(f"{value:g}" for value in result["layer_acceleration_kt_s"]))
    table.add_row("airspeed, kn", f"{speeds[0]:g} to {speeds[-1]:g}, {len(speeds)} values")
    table.add_row("nacelle, deg", f"{angles[0]:g} to {angles[-1]:g}, {len(angles)} values")
    table.add_row("trims by layer", ", ".join(f"{n} of {result['points']}" for n in result["valid_points"]))
    missing = f"{result['corridor_points_without_trim']} of {result['corridor_points']} points without trim"
    table.add_row("design corridor", missing)
    check = result["neighbour_check"]
    largest = f"largest {check['largest']:.4f}, " if "largest" in check else ""
    table.add_row("neighbour check", f"{largest}{check['above']} of {check['pairs']} pairs above {check['limit']:g}")
    for kind in ("states", "inputs", "outputs"):
        table.add_row(f"{len(result[kind])} {kind}", ", ".join(result[kind]))
    profile = result["profile"]
    borrowed = f"; the XV-15's {', '.join(profile['borrowed'])}" if profile["borrowed"] else ""
    table.add_row("profile", f"{profile['name']}{borrowed}")
    table.add_row("pilots", ", ".join(result["pilots"]) or "none")
    results.print(table)
