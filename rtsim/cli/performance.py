"""``rtsim performance``: hover ceiling, climb and level speed with the power that the engines have."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, get_args

import typer

from rtsim.cli.output import emit_json, results, working
from rtsim.errors import InputError

if TYPE_CHECKING:
    from rtsim.aircraft.points import Condition
    from rtsim.analysis.performance import Reached
    from rtsim.faults.fault import EngineRating

# Nacelle angle [deg], airspeeds in which the fastest climb is looked for, and one to speed up from [kn].
_SEARCHED = ((90.0, range(20, 101, 10), 40.0), (75.0, range(30, 131, 10), 80.0), (0.0, range(90, 201, 10), 170.0))
_WORDS = {
    "power": "the engines end it",
    "torque": "the masts end it",
    "trim": "no trim beyond",
    "range": "the search ends",
}


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command("performance")(performance_command)


def performance_command(
    *,
    weight_lb: Annotated[float, typer.Option(help="Weight [lb].")] = 13_000.0,
    altitude_ft: Annotated[
        float,
        typer.Option(
            "--altitude-ft", "--density-altitude-ft", help="Altitude of climb and level flight, standard day [ft]."
        ),
    ] = 0.0,
    cg_in: Annotated[float, typer.Option(help="Centre of gravity forward of its aft limit [in].")] = 0.0,
    rotor_rpm: Annotated[
        float | None, typer.Option(help="Rotor speed [rpm].", show_default="589, and 517 at nacelle 0")
    ] = None,
    rating: Annotated[
        str | None,
        typer.Option(
            help="Rating of the engines: contingency (2 min), takeoff (10 min), military (30 min) or normal.",
            show_default="hover takeoff, climb military, level flight normal",
        ),
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Show hover ceiling, fastest climb and highest level speed of the XV-15, and what ends each of them.

    Solved by the nonlinear model on a standard day, out of ground effect, with the published power of the engines at
    that altitude and the published torque limits of the masts. It takes some seconds.

    Examples:
        rtsim performance --weight-lb 11000 --altitude-ft 5000
    """
    from rtsim.faults.fault import EngineRating

    for key, value, low, high, unit in (
        ("--weight-lb", weight_lb, 5000.0, 20000.0, "lb"),
        ("--altitude-ft", altitude_ft, -3000.0, 36000.0, "ft"),
        ("--cg-in", cg_in, 0.0, 9.4, "in"),
        ("--rotor-rpm", rotor_rpm, 400.0, 700.0, "rpm"),
    ):
        if value is not None and not low <= value <= high:
            raise InputError("is out of range", key=key, value=value, allowed=f"{low:g} to {high:g} {unit}")
    if rating is not None and rating not in get_args(EngineRating):
        allowed = ", ".join(get_args(EngineRating))
        raise InputError("is not a rating", key="--rating", value=rating, allowed=allowed, mend="choose one")
    with working("Solving hover, climb and level flight"):
        result = _figures(weight_lb, altitude_ft, cg_in, rotor_rpm, rating)  # type: ignore[arg-type]  # one of these, just checked
    if json:
        emit_json(result)
    else:
        _print(result)


def _figures(
    weight_lb: float, altitude_ft: float, cg_in: float, rotor_rpm: float | None, rating: EngineRating | None
) -> dict[str, Any]:
    from rtsim.aircraft.condition import AircraftCondition
    from rtsim.aircraft.points import Condition
    from rtsim.aircraft.xv15.model import Xv15
    from rtsim.analysis.performance import best_climb, hover_ceiling, level_speed
    from rtsim.systems.engine import power_available
    from rtsim.units import FOOT, INCH, deg, kt, lb, rpm, to_kt, to_rpm

    mass, altitude = lb(weight_lb), altitude_ft * FOOT
    aircraft = Xv15.under(AircraftCondition(mass=mass, cg_forward=cg_in * INCH))
    full = aircraft.tables.configuration.rotor_speed if rotor_rpm is None else rpm(rotor_rpm)
    hover = hover_ceiling(aircraft, mass=mass, rotor_speed=full, rating=rating or "takeoff")
    climbs, speeds = [], []
    for nacelle_deg, airspeeds, begin in _SEARCHED:
        lowered = nacelle_deg == 0.0 and rotor_rpm is None
        rotor_speed = aircraft.airplane_rotor_speed if lowered else full
        where = {"nacelle_deg": nacelle_deg, "rotor_rpm": to_rpm(rotor_speed)}
        condition = Condition(
            airspeed=kt(begin), nacelle_angle=deg(nacelle_deg), mass=mass, rotor_speed=rotor_speed,
            pressure_altitude=altitude,
        )  # fmt: skip
        power = power_available(rating or "military", altitude)
        at, _ = best_climb(aircraft, condition, [kt(speed) for speed in airspeeds], power=power)
        near = [] if math.isnan(at) else [at + kt(offset) for offset in (-5.0, 0.0, 5.0)]
        at, climb = best_climb(aircraft, condition, near, power=power)
        climbs.append(
            {**where, "rating": rating or "military", "airspeed_kt": _number(to_kt(at)),
             "climb_rate_ft_min": _number(climb.value / FOOT * 60.0), "limit": climb.limit}
        )  # fmt: skip
        fast = level_speed(aircraft, condition, power=power_available(rating or "normal", altitude))
        speeds.append(
            {**where, "rating": rating or "normal", "airspeed_kt": _number(to_kt(fast.value)),
             "limit": fast.limit, **_burned(fast, condition)}
        )  # fmt: skip
    return {
        "weight_lb": weight_lb, "altitude_ft": altitude_ft, "cg_in": cg_in,
        "hover_ceiling": {
            "rotor_rpm": to_rpm(full), "rating": rating or "takeoff", "altitude_ft": _number(hover.value / FOOT),
            "limit": hover.limit,
        },
        "climb": climbs, "level_speed": speeds,
    }  # fmt: skip


def _burned(fast: Reached, condition: Condition) -> dict[str, float | None]:
    """Power of the rotors and fuel flow at a level speed."""
    from rtsim.aircraft.variables import OUTPUT
    from rtsim.systems.engine import fuel_flow
    from rtsim.units import HORSEPOWER, POUND_FORCE

    if fast.point is None or math.isnan(fast.value):
        return {"power_shp": None, "fuel_flow_lb_h": None}
    shaft = float(fast.point.y[OUTPUT.power])
    flow = fuel_flow(shaft, condition.pressure_altitude or 0.0) / POUND_FORCE * 3600.0
    return {"power_shp": shaft / HORSEPOWER, "fuel_flow_lb_h": flow}


def _number(value: float) -> float | None:
    return None if math.isnan(value) else value


def _print(result: dict[str, Any]) -> None:
    def say(what: str, found: dict[str, Any], figure: str) -> None:
        why = "" if figure == "none" else _WORDS[found["limit"]]
        line = f"{what:21} {found['rotor_rpm']:3.0f} rpm {found['rating']:8} {figure:21} {why}"
        results.print(line.rstrip(), highlight=False, markup=False, soft_wrap=True)

    at = f"{result['altitude_ft']:g} ft"
    results.print(f"XV-15 at {result['weight_lb']:g} lb; climb and level flight at {at}", highlight=False)
    hover = result["hover_ceiling"]
    say("hover ceiling", hover, "none" if hover["altitude_ft"] is None else f"{hover['altitude_ft']:.0f} ft")
    for climb in result["climb"]:
        rate = climb["climb_rate_ft_min"]
        figure = "none" if rate is None else f"{rate:.0f} ft/min at {climb['airspeed_kt']:.0f} kn"
        say(f"climb, nacelle {climb['nacelle_deg']:g} deg", climb, figure)
    for speed in result["level_speed"]:
        knots = speed["airspeed_kt"]
        figure = "none" if knots is None else f"{knots:.1f} kn, {speed['fuel_flow_lb_h']:.0f} lb/h"
        say(f"level, nacelle {speed['nacelle_deg']:g} deg", speed, figure)
