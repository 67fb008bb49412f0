"""``rtsim corridor``: the boundaries and centre line of the conversion corridor, and the margins of a point."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rtsim.cli.options import takes_options
from rtsim.cli.output import console, emit_json, results, working
from rtsim.drawing import check_picture, drawing
from rtsim.errors import InputError
from rtsim.loop.options import CONDITION, FlightOptions
from rtsim.whole_file import check_writable, whole_file

if TYPE_CHECKING:
    from rtsim.aircraft.condition import AircraftName
    from rtsim.command import Margins
    from rtsim.corridor.boundaries import Boundary, Corridor

_DIGITS = 6
_TABLE_ANGLES_DEG = (90.0, 85.0, 80.0, 75.0, 70.0, 65.0, 60.0, 55.0, 50.0, 45.0, 40.0, 30.0, 20.0, 10.0, 0.5, 0.0)


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command("corridor")(corridor_command)


@takes_options("database", *CONDITION, own="that of the shipped aircraft")
def corridor_command(
    *,
    corridor: Annotated[
        str, typer.Option(help="Which corridor: design, flight, or model (what the aircraft's trims allow).")
    ] = "design",
    airspeed_kt: Annotated[
        float | None, typer.Option(help="Airspeed of a point [kn].", show_default="no point")
    ] = None,
    nacelle_deg: Annotated[
        float | None, typer.Option(help="Nacelle angle of the point [deg], 90 helicopter.", show_default="no point")
    ] = None,
    bank_deg: Annotated[
        float, typer.Option(help="Bank of a level turn [deg]: its load factor moves the sides.", min=-60.0, max=60.0)
    ] = 0.0,
    consistency: Annotated[
        bool, typer.Option("--consistency", help="Say where the corridor allows what the aircraft cannot trim.")
    ] = False,
    options: dict[str, Any],
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
    plot: Annotated[
        Path | None, typer.Option(help="Draw the corridor into FILE (.png, .svg or .pdf).", show_default="none")
    ] = None,
) -> None:
    """Show the boundaries and centre line of the conversion corridor; with a point, its margins.

    Examples:
        rtsim corridor --airspeed-kt 60 --nacelle-deg 75  # margins of a point
        rtsim corridor --corridor flight --bank-deg 30 --plot corridor.png  # in a turn, as a picture
    """
    if plot is not None:
        check_picture(plot, "--plot")
        check_writable(plot)
    from rtsim.corridor.boundaries import load_corridor
    from rtsim.units import deg, kt

    point = _point(airspeed_kt, nacelle_deg)
    flown = FlightOptions().changed(options)
    if corridor == "model" or flown.database or bank_deg:
        from rtsim.loop.aircraft import database_of
        from rtsim.protection.boundary import load_boundary

        chosen = load_boundary(corridor, database_of(flown.aircraft))
    else:
        chosen = load_corridor(corridor).in_true_airspeed(flown.condition.true_over_calibrated)
    result: dict[str, Any] = {"corridor_name": chosen.name, "boundaries": _boundaries(chosen)}
    load = 1.0 / math.cos(deg(bank_deg))
    if bank_deg:
        result["turn"] = _turn_result(chosen, bank_deg, load)
    if point is not None:
        margins = chosen.margins(kt(point[0]), deg(point[1]), deg(bank_deg))
        result |= _point_result(chosen, point, margins)
    if consistency:
        with working("Comparing with the trims"):
            result["consistency"] = _inconsistencies(chosen, flown.aircraft)
    if plot is not None:
        _draw(chosen, point, plot, load)
        result["plot_file"] = str(plot)
    if json:
        emit_json(result)
        return
    if point is not None:
        _print_point(result)
    else:
        _print_table(chosen, load)
    if consistency:
        _print_consistency(result["consistency"])
    if plot is not None:
        console.print(f"Drew {plot}")


def _inconsistencies(corridor: Corridor, aircraft: AircraftName) -> list[dict[str, Any]]:
    """Stretches where the corridor is wider than the level trims of the aircraft within their limits."""
    from rtsim.loop.aircraft import database_of
    from rtsim.protection.boundary import check_consistency
    from rtsim.units import to_deg, to_kt

    return [
        {
            "side": found.side,
            "nacelle_from_deg": round(to_deg(found.nacelle_from), _DIGITS),
            "nacelle_to_deg": round(to_deg(found.nacelle_to), _DIGITS),
            "depth_kt": round(to_kt(found.depth), _DIGITS),
            "nacelle_deepest_deg": round(to_deg(found.nacelle_deepest), _DIGITS),
            "sentence": found.sentence(),
        }
        for found in check_consistency(corridor, database_of(aircraft))
    ]


def _print_consistency(found: list[dict[str, Any]]) -> None:
    if not found:
        results.print("The aircraft's level trims reach all of this corridor within their limits.")
    for item in found:
        sentence = item["sentence"]
        results.print(f"{sentence[0].upper()}{sentence[1:]}.", highlight=False)


def _point(airspeed_kt: float | None, nacelle_deg: float | None) -> tuple[float, float] | None:
    if airspeed_kt is None and nacelle_deg is None:
        return None
    if airspeed_kt is None or nacelle_deg is None:
        missing = "--airspeed-kt" if airspeed_kt is None else "--nacelle-deg"
        raise InputError("a point needs airspeed and nacelle angle", key=missing, mend=f"add {missing}")
    if not math.isfinite(airspeed_kt) or not -100.0 <= airspeed_kt <= 400.0:
        raise InputError("airspeed out of range", key="--airspeed-kt", value=airspeed_kt, allowed="-100 to 400 kn")
    if not 0.0 <= nacelle_deg <= 95.0:
        raise InputError("nacelle angle out of range", key="--nacelle-deg", value=nacelle_deg, allowed="0 to 95 deg")
    return airspeed_kt, nacelle_deg


def _side(boundary: Boundary) -> dict[str, Any]:
    from rtsim.units import to_deg, to_kt

    return {
        "nacelle_deg": [round(to_deg(angle), _DIGITS) for angle in boundary.nacelle.tolist()],
        "speed_kt": [round(to_kt(speed), _DIGITS) for speed in boundary.speed.tolist()],
        "kind": boundary.kind,
        "source": boundary.source,
    }


def _boundaries(corridor: Corridor) -> dict[str, Any]:
    from rtsim.units import deg, to_deg, to_kt

    angles = sorted(
        {round(angle, 9) for angle in _side(corridor.low)["nacelle_deg"] + _side(corridor.high)["nacelle_deg"]}
    )
    return {
        "low": _side(corridor.low),
        "high": _side(corridor.high),
        "centre": {
            "nacelle_deg": angles,
            "speed_kt": [round(to_kt(float(corridor.centre_speed(deg(angle)))), _DIGITS) for angle in angles],
        },
        "downstop": {
            "nacelle_deg": round(to_deg(corridor.downstop_nacelle), _DIGITS),
            "high_kt": round(to_kt(corridor.downstop_speed), _DIGITS),
        },
    }


def _turn_result(corridor: Corridor, bank_deg: float, load: float) -> dict[str, Any]:
    """Where both sides lie in a level turn."""
    import numpy as np

    from rtsim.units import deg, to_kt

    angles = deg(1.0) * np.array(_TABLE_ANGLES_DEG[::-1])
    sides = {"low_kt": corridor.low_speed(angles, load), "high_kt": corridor.high_speed(angles, load)}
    return {
        "bank_deg": bank_deg,
        "load_factor": round(load, _DIGITS),
        "nacelle_deg": list(_TABLE_ANGLES_DEG[::-1]),
        **{name: [round(to_kt(float(speed)), _DIGITS) for speed in np.asarray(side)] for name, side in sides.items()},
    }


def _point_result(corridor: Corridor, point: tuple[float, float], margins: Margins) -> dict[str, Any]:
    from rtsim.units import deg, to_deg, to_kt

    airspeed_kt, nacelle_deg = point
    # Rounded first: a point on a boundary is inside, and there is no -0.
    margin_low = round(to_kt(margins.low), _DIGITS) + 0.0
    margin_high = round(to_kt(margins.high), _DIGITS) + 0.0
    return {
        "airspeed_kt": airspeed_kt,
        "nacelle_deg": nacelle_deg,
        "low_kt": round(airspeed_kt - to_kt(margins.low), _DIGITS) + 0.0,
        "high_kt": round(airspeed_kt + to_kt(margins.high), _DIGITS) + 0.0,
        "centre_kt": round(to_kt(float(corridor.centre_speed(deg(nacelle_deg)))), _DIGITS),
        "margin_low_kt": margin_low,
        "margin_high_kt": margin_high,
        "nacelle_forward_deg": round(to_deg(margins.nacelle_forward), _DIGITS),
        "nacelle_aft_deg": round(to_deg(margins.nacelle_aft), _DIGITS),
        "inside": min(margin_low, margin_high) >= 0.0,
    }


def _print_point(result: dict[str, Any]) -> None:
    where = "inside" if result["inside"] else "OUTSIDE"
    results.print(
        f"{result['airspeed_kt']:g} kn at nacelle {result['nacelle_deg']:g} deg is {where} "
        f"the {result['corridor_name']} corridor ({result['low_kt']:.1f} to {result['high_kt']:.1f} kn)."
    )
    results.print(f"  margin to the low-speed side   {result['margin_low_kt']:+8.1f} kn")
    results.print(f"  margin to the high-speed side  {result['margin_high_kt']:+8.1f} kn")
    results.print(f"  nacelle travel forward         {result['nacelle_forward_deg']:+8.1f} deg")
    results.print(f"  nacelle travel aft             {result['nacelle_aft_deg']:+8.1f} deg")


def _print_table(corridor: Corridor, load: float) -> None:
    from rich.table import Table

    from rtsim.units import deg, to_kt

    turn = "" if load == 1.0 else f", level turn at load factor {load:.2f}"
    table = Table(title=f"{corridor.title}{turn}")
    for heading in ("nacelle [deg]", "low [kn]", "centre [kn]", "high [kn]"):
        table.add_column(heading, justify="right")
    for angle in _TABLE_ANGLES_DEG:
        low, high = corridor.low_speed(deg(angle), load), corridor.high_speed(deg(angle), load)
        speeds = (low, corridor.centre_speed(deg(angle)), high)
        # Adding zero turns a rounded -0.0 into 0.0.
        table.add_row(f"{angle:g}", *(f"{round(to_kt(float(speed)), 1) + 0.0:.1f}" for speed in speeds))
    results.print(table)
    results.print(f"Low side: {corridor.low.kind}. {corridor.low.source}", markup=False)
    results.print(f"High side: {corridor.high.kind}. {corridor.high.source}", markup=False)


@drawing()
def _draw(corridor: Corridor, point: tuple[float, float] | None, path: Path, load: float) -> None:
    """Draw the corridor, airspeed across and nacelle angle up, helicopter mode on top as in the paper."""
    import numpy as np
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from rtsim.units import to_deg, to_kt

    end = min(corridor.low.nacelle[-1], corridor.high.nacelle[-1])
    angle = np.union1d(np.linspace(0.0, end, 191), [corridor.downstop_nacelle, corridor.downstop_nacelle * 1.0001])
    low, high = np.asarray(corridor.low_speed(angle, load)), np.asarray(corridor.high_speed(angle, load))
    figure = Figure(figsize=(7.0, 5.0), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.fill_betweenx(to_deg(angle), to_kt(low), to_kt(high), color="#2a9d54", alpha=0.12, label="inside")
    axes.plot(
        to_kt(low), to_deg(angle), color="#d98a00", linewidth=2.0, label=_wrapped(f"low side: {corridor.low.kind}")
    )
    axes.plot(
        to_kt(high), to_deg(angle), color="#d03c3c", linewidth=2.0, label=_wrapped(f"high side: {corridor.high.kind}")
    )
    if load != 1.0:
        for side in (corridor.low_speed(angle), corridor.high_speed(angle)):
            axes.plot(to_kt(np.asarray(side)), to_deg(angle), color="#888888", linewidth=0.9)
        axes.plot([], [], color="#888888", linewidth=0.9, label="in straight flight")
    axes.plot(to_kt(np.asarray(corridor.centre_speed(angle))), to_deg(angle), "k--", linewidth=1.0, label="centre line")
    if point is not None:
        axes.plot(point[0], point[1], "o", color="#1d3557", label=f"{point[0]:g} kn, {point[1]:g} deg")
    axes.set(
        xlabel="airspeed [kn]", ylabel="nacelle angle [deg], 90 helicopter", ylim=(-2.0, 97.0),
        title=corridor.title if load == 1.0 else f"{corridor.title}, turn at load factor {load:.2f}",
    )  # fmt: skip
    if point is None:
        downstop = f"downstop: to {to_kt(corridor.downstop_speed):.0f} kn"
        axes.annotate(downstop, (195.0, 2.0), fontsize="small")
    axes.grid(alpha=0.3)
    axes.legend(loc="lower left", bbox_to_anchor=(0.02, 0.03), fontsize="small")
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=150)


def _wrapped(words: str) -> str:
    """In lines short enough for the corner the legend has."""
    from textwrap import fill

    return fill(words, 30)
