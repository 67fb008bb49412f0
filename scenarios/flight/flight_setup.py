"""What a scenario means to the simulation, and how that is kept for a replay: setup, frames, outline."""

from __future__ import annotations

import dataclasses
import math
from typing import Any, get_type_hints

import numpy as np
from pydantic import TypeAdapter

from rtsim.aircraft.condition import AircraftName
from rtsim.corridor.boundaries import STRAIGHT
from rtsim.loop.aircraft import database_of
from rtsim.loop.simulation import FlightSetup
from rtsim.programme import Programme
from rtsim.protection.boundary import load_boundary
from rtsim.units import to_deg, to_kt
from scenarios.files.nacelle_laws import automatic_nacelle
from scenarios.files.scenario import Scenario
from telemetry.log.corridor_outline import CorridorOutline


def flight_frames(scenario: Scenario) -> int:
    """Frames of a flight: the last one starts before its end."""
    return max(1, math.ceil(scenario.duration * scenario.options.rate_hz - 1e-6))


def flight_setup(scenario: Scenario) -> FlightSetup:
    """What the simulation needs to know of a scenario."""
    return FlightSetup(
        programme=scenario.programme,
        options=scenario.options,
        start=scenario.start,
        air=scenario.air,
        faults=scenario.faults,
        pulses=scenario.pulses,
        reaction=scenario.reaction,
        automatic_nacelle=automatic_nacelle(scenario.options.nacelle, scenario.automatic, scenario.programme),
    )


def corridor_outline(name: str, aircraft: AircraftName = "") -> CorridorOutline:
    """The boundaries of a corridor as plain arrays, for views and logs.

    Args:
        name: ``design``, ``flight`` or ``model``.
        aircraft: A database file, empty for the shipped XV-15, or a condition.
    """
    corridor = load_boundary(name, database_of(aircraft))
    high_nacelle = [0.0, corridor.downstop_nacelle, *(float(v) for v in corridor.high.nacelle)]
    high_nacelle = sorted({angle for angle in high_nacelle if angle >= 0.0})
    high = [(to_deg(angle), to_kt(float(corridor.high.at(angle)))) for angle in high_nacelle]
    low = [(to_deg(float(n)), to_kt(float(v))) for n, v in zip(corridor.low.nacelle, corridor.low.speed, strict=True)]
    corners = sorted({*high_nacelle, *(float(n) for n in corridor.low.nacelle)})
    centre = [(to_deg(angle), to_kt(float(corridor.centre_speed(angle)))) for angle in corners]
    lines = [tuple(zip(*line, strict=True)) for line in (low, high, centre)]
    turning = corridor.turning
    angles = [] if turning is STRAIGHT else np.degrees(turning.nacelle).tolist()
    moved = [[to_kt(float(value)) for value in side[: len(angles)]] for side in (turning.low, turning.high)]
    return CorridorOutline.from_lines(
        name, low=lines[0], high=lines[1], centre=lines[2], turn_low=(angles, moved[0]), turn_high=(angles, moved[1])
    )


def replay_setup(scenario: Scenario) -> dict[str, Any]:
    """Everything a replay must know besides commands and events, as JSON values that read back exactly."""
    return {"flight": setup_to_json(flight_setup(scenario))}


def setup_to_json(setup: FlightSetup) -> dict[str, Any]:
    """A flight setup as JSON values: every field, since defaults may change between versions.

    Args:
        setup: What flies, how and from where.
    """
    values: dict[str, Any] = {"programme": setup.programme.to_dict()}
    for field in dataclasses.fields(setup):
        if field.name != "programme":
            values[field.name] = _json_form(field.name).dump_python(getattr(setup, field.name), mode="json")
    return values


def setup_from_json(values: dict[str, Any]) -> FlightSetup:
    """Read back what :func:`setup_to_json` wrote.

    Args:
        values: The JSON values.
    """
    read: dict[str, Any] = {
        name: Programme.from_dict(value) if name == "programme" else _json_form(name).validate_python(value)
        for name, value in values.items()
    }
    return FlightSetup(**read)


def _json_form(name: str) -> TypeAdapter[Any]:
    """How a field of the setup is written to JSON and read back, from its type."""
    return TypeAdapter(get_type_hints(FlightSetup)[name])
