"""``rtsim trim`` and ``rtsim linearize``: one trim point or linear model, from the database or solved afresh."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from rtsim.analysis.flight_condition import (
    AskedCondition,
    checked,
    checked_outer_loop,
    closed_loop_model,
    database_model,
    database_trim,
    eigenvalues,
    no_trim,
    nonlinear_model,
    nonlinear_trim,
    solvable,
)
from rtsim.analysis.lateral_condition import checked_axis, joined, lateral_closed_loop, lateral_model
from rtsim.cli.output import console, emit_json, results, working

_AIRSPEED = typer.Option(help="Horizontal airspeed [kn].")
_NACELLE = typer.Option(help="Nacelle angle [deg], 90 helicopter, 0 airplane.")
_NONLINEAR = typer.Option("--nonlinear", help="Solve the nonlinear model instead of reading the database.")
_FLAP = typer.Option(
    help="Flap deflection [deg]; solves the nonlinear model.", show_default="scheduled", rich_help_panel="Condition"
)
_RPM = typer.Option(
    help="Rotor speed [rpm]; solves the nonlinear model.", show_default="scheduled", rich_help_panel="Condition"
)
_WEIGHT = typer.Option(
    help="Weight [lb]; solves the nonlinear model.", show_default="13000", rich_help_panel="Condition"
)
_ALTITUDE = typer.Option(
    help="Pressure altitude [m], standard atmosphere; solves the nonlinear model.",
    show_default="0",
    rich_help_panel="Condition",
)
_DENSITY = typer.Option(
    help="Density altitude [ft], the same as --altitude-m; solves the nonlinear model.",
    show_default="0",
    rich_help_panel="Condition",
)
_CENTRE = typer.Option(
    help="Centre of gravity forward of its aft limit [in]; solves the nonlinear model.",
    show_default="0",
    rich_help_panel="Condition",
)
_ACCELERATION = typer.Option(
    help="Acceleration in level flight [kn/s]; solves the nonlinear model.",
    show_default="0",
    rich_help_panel="Condition",
)
_DATABASE = typer.Option(
    help="Another LPV database than the shipped one (.nc or .mat).", show_default="the shipped XV-15"
)
_CLOSED_LOOP = typer.Option("--closed-loop", help="Aircraft, pilot and outer loops together, sampled as flown.")
_OUTER_LOOP = typer.Option(help="How the pilot holds airspeed and altitude: integrators or pi (with --closed-loop).")
_BANK = typer.Option(
    help="Bank angle of a coordinated level turn, right positive [deg].",
    show_default="0",
    rich_help_panel="Turn and sideward flight",
)
_SLIP = typer.Option(
    help="Sideslip in straight flight, wind from the right positive [deg].",
    show_default="0",
    rich_help_panel="Turn and sideward flight",
)
_SIDE = typer.Option(
    help="Airspeed to the right, besides the one ahead [kn].",
    show_default="0",
    rich_help_panel="Turn and sideward flight",
)
_AXIS = typer.Option(help="Motion in the plane of symmetry, out of it, or both: longitudinal, lateral or both.")
_JSON = typer.Option("--json", help="Print one JSON object on stdout.")


def register(app: typer.Typer) -> None:
    """Add the commands to the app."""
    app.command("trim")(trim_command)
    app.command("linearize")(linearize_command)


def trim_command(
    *,
    airspeed_kt: Annotated[float, _AIRSPEED],
    nacelle_deg: Annotated[float, _NACELLE],
    nonlinear: Annotated[bool, _NONLINEAR] = False,
    flap_deg: Annotated[float | None, _FLAP] = None,
    rotor_rpm: Annotated[float | None, _RPM] = None,
    weight_lb: Annotated[float | None, _WEIGHT] = None,
    altitude_m: Annotated[float | None, _ALTITUDE] = None,
    density_altitude_ft: Annotated[float | None, _DENSITY] = None,
    cg_in: Annotated[float | None, _CENTRE] = None,
    acceleration_kt_s: Annotated[float | None, _ACCELERATION] = None,
    bank_deg: Annotated[float | None, _BANK] = None,
    sideslip_deg: Annotated[float | None, _SLIP] = None,
    lateral_kt: Annotated[float | None, _SIDE] = None,
    database: Annotated[Path | None, _DATABASE] = None,
    json: Annotated[bool, _JSON] = False,
) -> None:
    """Show one trim point: attitude, controls, loads and power in level flight.

    From the LPV database; with --nonlinear, or with any of --flap-deg, --rotor-rpm, --weight-lb, --altitude-m,
    --density-altitude-ft, --cg-in and --acceleration-kt-s, solved by the nonlinear model at exactly that condition. At
    the edge of what the database covers, where a grid point around has no trim, the nonlinear model is asked too.

    Turns, sideslip and sideward flight (one of --bank-deg, --sideslip-deg, --lateral-kt) are solved by the nonlinear
    model, or, with --database FILE, by the LPV aircraft of that file as far as it is valid; a wind from any direction
    is an airspeed ahead (negative: from behind) and one to the right. Where there is no such flight it says how far
    there is one and what ends it.

    Examples:
        rtsim trim --airspeed-kt 100 --nacelle-deg 75  # from the database
        rtsim trim --airspeed-kt 80 --nacelle-deg 75 --bank-deg 30  # a coordinated turn
        rtsim trim --airspeed-kt 0 --nacelle-deg 90 --lateral-kt 20  # hover in a wind from the right
    """
    request = checked(
        AskedCondition(airspeed_kt, nacelle_deg, nonlinear, flap_deg, rotor_rpm, weight_lb, altitude_m,
                       acceleration_kt_s, database, density_altitude_ft, cg_in, bank_deg, sideslip_deg, lateral_kt)
    )  # fmt: skip
    request = solvable(request)
    with working("Solving the trim"):
        result, point = nonlinear_trim(request) if request.solves_nonlinear else database_trim(request)
    if json:
        emit_json(result)
    if not point.converged:
        raise no_trim(request, point)
    if result["beyond_limits"]:
        console.print(f"This trim is beyond the aircraft: {', '.join(result['beyond_limits'])}.", soft_wrap=True)
    if not json:
        _print_trim(result, sideways=request.sideways)


def linearize_command(
    *,
    airspeed_kt: Annotated[float, _AIRSPEED],
    nacelle_deg: Annotated[float, _NACELLE],
    nonlinear: Annotated[bool, _NONLINEAR] = False,
    flap_deg: Annotated[float | None, _FLAP] = None,
    rotor_rpm: Annotated[float | None, _RPM] = None,
    weight_lb: Annotated[float | None, _WEIGHT] = None,
    altitude_m: Annotated[float | None, _ALTITUDE] = None,
    density_altitude_ft: Annotated[float | None, _DENSITY] = None,
    cg_in: Annotated[float | None, _CENTRE] = None,
    acceleration_kt_s: Annotated[float | None, _ACCELERATION] = None,
    database: Annotated[Path | None, _DATABASE] = None,
    axis: Annotated[str, _AXIS] = "longitudinal",
    closed_loop: Annotated[bool, _CLOSED_LOOP] = False,
    outer_loop: Annotated[str, _OUTER_LOOP] = "integrators",
    json: Annotated[bool, _JSON] = False,
) -> None:
    """Show one linear model: matrices with named states, inputs and outputs, and the eigenvalues.

    From the LPV database; with --nonlinear, or with any of --flap-deg, --rotor-rpm, --weight-lb, --altitude-m,
    --density-altitude-ft, --cg-in and --acceleration-kt-s, from the nonlinear model trimmed at exactly that condition.
    With --closed-loop, aircraft, pilot and outer loops as flown: A is the map over one 4 ms frame, and the eigenvalues
    are log(z)/dt.

    About straight flight the motion in the plane of symmetry and the one out of it do not meet: --axis says which is
    shown. The lateral states are v, p, r, bank, heading, the half differences right less left of the two rotors' states
    and of their pitch, aileron and rudder.

    Examples:
        rtsim linearize --airspeed-kt 100 --nacelle-deg 75  # eigenvalues; with --json the matrices
        rtsim linearize --airspeed-kt 100 --nacelle-deg 75 --axis lateral
        rtsim linearize --airspeed-kt 100 --nacelle-deg 75 --closed-loop  # with the pilot
    """
    request = checked(
        AskedCondition(airspeed_kt, nacelle_deg, nonlinear, flap_deg, rotor_rpm, weight_lb, altitude_m,
                       acceleration_kt_s, database, density_altitude_ft, cg_in)
    )  # fmt: skip
    checked_outer_loop(outer_loop)
    wanted = checked_axis(axis)
    with working("Linearizing"):
        if closed_loop:
            model = lateral_closed_loop(request) if wanted == "lateral" else closed_loop_model(request, outer_loop)
            if wanted == "both":
                model = joined(model, lateral_closed_loop(request))
        else:
            request = solvable(request)
            model = nonlinear_model(request) if request.solves_nonlinear else database_model(request)
            if wanted != "longitudinal":
                lateral = lateral_model(request)
                model = lateral if wanted == "lateral" else joined(model, lateral)
            model["eigenvalues"] = eigenvalues(model["A"])
        result = {"airspeed_kt": airspeed_kt, "nacelle_deg": nacelle_deg, **model}
    if json:
        emit_json(result)
    else:
        _print_model(result)


_TRIM_ROWS = (
    ("flap_deg", "flaps", "deg", 1),
    ("rotor_rpm", "rotor speed", "rpm", 0),
    ("pitch_deg", "pitch attitude, nose up positive", "deg", 2),
    ("stick_in", "stick from neutral, forward positive", "in", 2),
    ("elevator_deg", "elevator, trailing edge down positive", "deg", 2),
    ("cyclic_deg", "longitudinal cyclic, forward negative", "deg", 2),
    ("collective_75_deg", "collective at 75 % radius", "deg", 2),
    ("lever_fraction", "power lever, 0 to 1", "-", 3),
    ("thrust_per_rotor_lb", "thrust of each rotor", "lb", 0),
    ("power_shp", "shaft power of both rotors", "shp", 0),
    ("engine_power_shp", "power of both engines", "shp", 0),
    ("mast_torque_inlb", "torque of each mast", "in lb", 0),
    ("flapping_deg", "cyclic flapping", "deg", 2),
)
"""What people are shown of a trim: key, words, unit, decimals."""


_SIDEWAYS_ROWS = (
    ("bank_deg", "bank, right positive", "deg", 2),
    ("sideslip_deg", "sideslip, wind from the right positive", "deg", 2),
    ("load_factor", "load factor", "-", 3),
    ("lateral_stick_in", "lateral stick, right positive", "in", 2),
    ("pedal_in", "pedals, right positive", "in", 2),
    ("aileron_deg", "aileron, right one up positive", "deg", 2),
    ("rudder_deg", "rudder, positive turns the nose right", "deg", 2),
    ("differential_collective_deg", "half difference of collective, right less left", "deg", 2),
    ("differential_cyclic_deg", "half difference of cyclic, right less left", "deg", 2),
    ("flapping_right_deg", "flapping of the right rotor", "deg", 2),
    ("flapping_left_deg", "flapping of the left rotor", "deg", 2),
    ("mast_torque_right_inlb", "torque of the right mast", "in lb", 0),
    ("mast_torque_left_inlb", "torque of the left mast", "in lb", 0),
)
"""What they are shown besides of a turn, of sideslip and of sideward flight."""


def _print_trim(result: dict[str, Any], *, sideways: bool) -> None:
    from rich.table import Table

    table = Table(
        title=f"Trim at {result['airspeed_kt']:g} kn, nacelle {result['nacelle_deg']:g} deg", show_header=False
    )
    for justify in ("left", "right", "left"):
        table.add_column(justify=justify)
    for key, words, unit, decimals in (*_TRIM_ROWS, *(_SIDEWAYS_ROWS if sideways else ())):
        table.add_row(words, f"{round(result[key], decimals) + 0.0:,.{decimals}f}".replace(",", " "), unit)
    results.print(table)
    inside = "inside" if result["inside_corridor"] else "OUTSIDE"
    origin = "solved by the nonlinear model" if result["source"] == "nonlinear" else "from the LPV database"
    results.print(f"{inside.capitalize()} the design corridor; {origin}. The same with --json, by key.")


def _print_model(result: dict[str, Any]) -> None:
    from rich.table import Table

    title = f"Linear model at {result['airspeed_kt']:g} kn, nacelle {result['nacelle_deg']:g} deg"
    table = Table(title=f"{title}: eigenvalues")
    for column in ("real, 1/s", "imaginary, rad/s", "natural frequency, rad/s", "damping ratio"):
        table.add_column(column, justify="right")
    for root in result["eigenvalues"]:
        table.add_row(*(f"{root[key]:.4f}" for key in ("re", "im", "wn_rad_s", "zeta")))
    results.print(table)
    if "stable" in result:
        verdict = "stable" if result["stable"] else "unstable"
        growth = result["growth_rad_s"]
        pace = f"the slowest motion decays by {-growth:.4f}" if growth < 0.0 else f"a motion grows by {growth:.4f}"
        results.print(f"The loop as flown is {verdict}: {pace} 1/s")
    for hand, margin in result.get("margins", {}).items():
        phase = f"{margin['phase_deg']:.0f} deg at {margin['crossover_rad_s']:.2f} rad/s"
        results.print(f"Margins of {hand.replace('_', ' ')}: {phase}, {margin['gain_db']:.1f} dB")
    for kind in ("states", "inputs", "outputs"):
        if result[kind]:
            named = [pair for pair in zip(result[kind], result["units"][kind], strict=True) if pair[0][:6] != "pilot_"]
            words = [f"{name} [{unit or '-'}]" for name, unit in named]
            if len(named) < len(result[kind]):
                words.append(f"and {len(result[kind]) - len(named)} of pilot and outer loops")
            results.print(f"{kind.capitalize()}: " + ", ".join(words))
    results.print("The matrices A, B, C and D are printed with --json.")
