"""A drawn flight as the tables of a scenario file, and the file's text."""

from __future__ import annotations

from typing import Any

import tomli_w

from rtsim.faults.fault import Fault
from rtsim.loop.options import FlightOptions, declared
from rtsim.loop.script import Pulse
from rtsim.programme import TURN, Programme
from rtsim.units import HORSEPOWER, to_deg, to_kt
from scenarios.campaign.trial import FlightPlan

DIGITS = 6
"""Significant digits of numbers at first."""
Tables = dict[str, Any]


def scenario_tables(plan: FlightPlan, *, name: str, title: str, law: str) -> Tables:
    """The tables of a scenario that flies a plan.

    Args:
        plan: The plan.
        name: Name of the scenario.
        title: Its title.
        law: Law that is flown.
    """
    setup = plan.setup
    start = setup.start or setup.programme.at(0.0)
    tables: Tables = {
        "format": 1,
        "name": name,
        "title": title,
        "description": "",
        "duration_s": plan.duration,
        "flight": _flight(setup.options) | {"protection": law},
        "start": {
            "airspeed_kt": rounded(to_kt(start.airspeed)),
            "nacelle_deg": rounded(to_deg(start.nacelle_angle)),
            "altitude_m": rounded(start.altitude),
        },
        "programme": {"points": _points(setup.programme)},
    }
    if setup.reaction is not None:
        tables["reaction_s"] = rounded(setup.reaction)
    air: Tables = {}
    if setup.air.turbulence is not None:
        air |= {"wind_at_20_ft_kt": rounded(to_kt(setup.air.turbulence.wind_at_20_ft)), "lateral": setup.air.lateral}
    if setup.air.gusts:
        air["gusts"] = [
            {"time_s": rounded(gust.start), "duration_s": rounded(gust.duration or 0.0)}
            | {
                f"{axis}_kt": rounded(to_kt(getattr(gust, axis)))
                for axis in ("ahead", "below", "lateral")
                if getattr(gust, axis)
            }
            for gust in setup.air.gusts
        ]
    if air:
        tables["air"] = air
    if setup.faults:
        tables["faults"] = [_fault(fault) for fault in setup.faults]
    if setup.pulses:
        tables["pulses"] = [_pulse(pulse) for pulse in setup.pulses]
    return tables


def scenario_text(tables: Tables) -> str:
    """The tables as the text of a scenario file.

    Args:
        tables: The tables; plain keys may stand in any order.
    """
    plain = {key: value for key, value in tables.items() if not isinstance(value, dict | list)}
    return tomli_w.dumps(plain | tables, multiline_strings=True)


def rounded(value: float, digits: int = DIGITS) -> float:
    """A number with so many significant digits.

    Args:
        value: The number.
        digits: How many.
    """
    return float(f"{value:.{digits}g}")


def _flight(options: FlightOptions) -> Tables:
    """Options that are not what a flight has anyway; who flies and what protects is said elsewhere."""
    found, usual = {}, FlightOptions()
    for name, item in declared().items():
        value = getattr(options, name)
        if value != getattr(usual, name) and name not in {"pilot", "protection", "nacelle"} and value is not None:
            shown = item.shown(value)
            found[item.key] = rounded(shown) if item.is_number else shown
    return found


def _points(programme: Programme) -> list[Tables]:
    points = []
    turns = programme.turn_kind if len(programme.turn_kind) else [float(TURN.bank)] * len(programme.time)
    for k, time in enumerate(programme.time.tolist()):
        point = {
            "time_s": rounded(time),
            "airspeed_kt": rounded(to_kt(float(programme.airspeed[k]))),
            "nacelle_deg": rounded(to_deg(float(programme.nacelle_angle[k]))),
            "altitude_m": rounded(float(programme.altitude[k])),
        }
        if len(programme.turn) and programme.turn.any():
            key = {TURN.bank: "bank_deg", TURN.rate: "turn_rate_deg_s", TURN.heading: "heading_deg"}[int(turns[k])]
            angle = to_deg(float(programme.turn[k]))
            point[key] = rounded(angle % 360.0 if key == "heading_deg" else angle)
        if len(programme.lateral) and programme.lateral.any():
            point["lateral_kt"] = rounded(to_kt(float(programme.lateral[k])))
            point["track"] = bool(programme.track[k])
        points.append(point)
    return points


def _fault(fault: Fault) -> Tables:
    found: Tables = {"kind": fault.kind, "time_s": rounded(fault.start)}
    scaled = {"rate_deg_s": (fault.rate, to_deg), "bias_kt": (fault.bias, to_kt)}
    found |= {key: rounded(change(value)) for key, (value, change) in scaled.items() if value is not None}
    if fault.power is not None:
        found["power_shp"] = rounded(fault.power / HORSEPOWER)
    if fault.end is not None:
        found["end_s"] = rounded(fault.end)
    words = {"actuator": fault.actuator, "control": fault.control, "stop": fault.stop}
    found |= {key: value for key, value in words.items() if value is not None}
    return found | ({"other_engine": fault.other_engine} if fault.kind.startswith("engine") else {})


def _pulse(pulse: Pulse) -> Tables:
    amount = to_deg(pulse.amount) if pulse.channel == "switch" else pulse.amount
    found: Tables = {
        "channel": pulse.channel,
        "time_s": rounded(pulse.start),
        "duration_s": rounded(pulse.duration),
        "amount": rounded(amount),
    }
    if pulse.shape != "step":
        found["shape"] = pulse.shape
    if pulse.shape == "sine":
        found["period_s"] = rounded(pulse.period)
    return found | ({"replaces": True} if pulse.replaces and pulse.channel != "switch" else {})
