"""``rtsim rotor``: one rotor alone at a thrust, a tip speed and a flow."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from rtsim.cli.output import emit_json, results
from rtsim.errors import InputError, TrimError
from rtsim.units import deg


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command("rotor")(rotor_command)


def rotor_command(
    *,
    thrust_coefficient: Annotated[float, typer.Option(help="C_T = T/(rho A (Omega R)^2) that the rotor carries.")],
    tip_mach: Annotated[float, typer.Option(help="Tip speed over the speed of sound; 0.69 at 589 rpm.")],
    advance_ratio: Annotated[float, typer.Option(help="Airspeed over tip speed, V/(Omega R); 0 is hover.")] = 0.0,
    shaft_deg: Annotated[
        float, typer.Option(help="Tilt of the shaft from normal to the flow [deg], positive aft; -90: a propeller.")
    ] = 0.0,
    stall_delay: Annotated[
        str | None,
        typer.Option(
            help="How rotation keeps the inner sections from stalling: corrigan_schillings, du_selig or none.",
            show_default="the aircraft's, corrigan_schillings",
        ),
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Solve one rotor alone, without the other rotor and the wing, in sea-level standard air.

    In forward flight the longitudinal cyclic is trimmed to zero longitudinal flapping; the model has no lateral
    cyclic, so the lateral flapping that is left is reported. Where the rotor stalls before that thrust: exit 2.

    Examples:
        rtsim rotor --thrust-coefficient 0.01 --tip-mach 0.69  # a hover
        rtsim rotor --thrust-coefficient 0.003 --tip-mach 0.6 --advance-ratio 0.5
    """
    from rtsim.analysis.isolated_rotor import IsolatedRotor, RotorCondition, rotor_answer

    _check("--thrust-coefficient", thrust_coefficient, -0.01, 0.05)
    _check("--tip-mach", tip_mach, 0.1, 0.9)
    _check("--advance-ratio", advance_ratio, 0.0, 1.5)
    _check("--shaft-deg", shaft_deg, -90.0, 90.0)
    condition = RotorCondition(tip_mach=tip_mach, advance_ratio=advance_ratio, shaft_angle=deg(shaft_deg))
    answer = rotor_answer(
        IsolatedRotor.load({} if stall_delay is None else {"rotor.stall_delay": stall_delay}),
        thrust_coefficient,
        condition,
    )
    if json:
        emit_json(answer)
    if not answer["converged"]:
        raise TrimError(
            "the rotor has no steady state with that thrust below stall",
            key="--thrust-coefficient",
            value=thrust_coefficient,
            allowed=_range(answer),
        )
    if not json:
        _print(answer)


def _check(key: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise InputError("is out of range", key=key, value=value, allowed=f"{low:g} to {high:g}")


def _range(answer: dict[str, Any]) -> str:
    low, high = answer["thrust_coefficient_range"]
    return "none here" if low is None else f"{low:.4f} to {high:.4f} here"


_ROWS = (
    ("thrust_coefficient_over_solidity", "thrust coefficient over solidity", 4),
    ("power_coefficient", "power coefficient", 6),
    ("torque_coefficient_over_solidity", "torque coefficient over solidity", 5),
    ("figure_of_merit", "figure of merit", 3),
    ("collective_75_deg", "collective at 75 % radius, deg", 2),
    ("cyclic_deg", "longitudinal cyclic, forward negative, deg", 2),
    ("coning_deg", "coning, deg", 2),
    ("lateral_flapping_deg", "lateral flapping left over, deg", 2),
)


def _print(answer: dict[str, Any]) -> None:
    from rich.table import Table

    title = f"One rotor at C_T {answer['thrust_coefficient']:g}, tip Mach {answer['tip_mach']:g}"
    if answer["advance_ratio"]:
        title += f", advance ratio {answer['advance_ratio']:g}, shaft {answer['shaft_deg']:g} deg aft"
    table = Table(title=title, title_justify="left", show_header=False)
    table.add_column()
    table.add_column(justify="right")
    for key, words, decimals in _ROWS:
        if answer[key] is not None:
            table.add_row(words, f"{round(answer[key], decimals) + 0.0:.{decimals}f}")
    results.print(table)
    results.print(f"Thrust coefficients below stall: {_range(answer)}.")
