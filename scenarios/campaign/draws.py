"""Draws flights from a campaign's classes: the same flight for a seed, a class and a run, whoever draws it and when."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import numpy as np

from rtsim.aircraft.condition import AircraftName
from rtsim.atmosphere.specification import AirSpecification, Gust, Turbulence
from rtsim.corridor.boundaries import Corridor
from rtsim.errors import InputError
from rtsim.faults.fault import Fault
from rtsim.loop.aircraft import database_of
from rtsim.loop.option_tables import given
from rtsim.loop.options import FlightOptions
from rtsim.loop.script import Pulse
from rtsim.loop.setup import FlightSetup
from rtsim.programme import AIRSPEED_RANGE, LARGEST_BANK, LARGEST_TURN_RATE, TURN, Programme, ProgrammePoint
from rtsim.protection.boundary import load_boundary
from rtsim.random_streams import STREAM_CAMPAIGN, stream_generator
from rtsim.units import deg, kt
from scenarios.campaign.spec import CLASS_OPTIONS, CampaignFile, ClassTable, Generator, PulseDraw, draw, fault_of
from scenarios.campaign.trial import FlightPlan, has_trim
from scenarios.files.loader import load_scenario

ATTEMPTS = 200
"""Starts drawn before a class is said to have none inside the corridor."""


def draw_plan(
    spec: CampaignFile, *, seed: int, class_number: int, run: int, options: FlightOptions | None = None
) -> FlightPlan:
    """Draw one flight.

    Args:
        spec: The campaign.
        seed: Its seed.
        class_number: Place of the class in the campaign.
        run: Number of the run within the class.
        options: What all flights have in common; None: what the campaign's file says.

    Raises:
        InputError: No start of the class lies inside the corridor.
    """
    item = spec.classes[class_number]
    common = options or FlightOptions(**given(spec))
    generator = stream_generator(seed, STREAM_CAMPAIGN, class_number, run)
    if item.scenarios:
        scenario = load_scenario(item.scenarios[int(generator.integers(len(item.scenarios)))])
        programme, start = scenario.programme, scenario.start
        duration = scenario.duration if item.duration_s is None else item.duration_s
    else:
        corridor = load_boundary(spec.corridor, database_of(common.aircraft))
        start = _start(item, corridor, common.aircraft, generator)
        programme = _programme(item, start, corridor, generator)
        duration = spec.duration_s if item.duration_s is None else item.duration_s
    pulses = tuple(pulse for table in item.pulses for pulse in _pulses(table, generator))
    faults = tuple(_faults(item, generator))
    gusts = tuple(_gusts(item, generator))
    severity = draw(item.turbulence_kt, generator)
    turbulence = Turbulence(wind_at_20_ft=kt(severity)) if severity > 0.0 else None
    drawn = _options(item, generator)
    yields = generator.random() < item.pilot.yields
    reaction = draw(item.pilot.reaction_s, generator)
    drawn |= {"pilot_noise": item.pilot.noise, "seed": int(generator.integers(2**62))}
    setup = FlightSetup(
        programme=programme,
        options=dataclasses.replace(common, **drawn),
        start=start,
        air=AirSpecification(turbulence=turbulence, gusts=gusts, lateral=item.lateral_turbulence),
        faults=faults,
        pulses=pulses,
        reaction=reaction if yields else None,
    )
    return FlightPlan(setup, duration)


def _options(item: ClassTable, generator: Generator) -> dict[str, Any]:
    """Options that a class gives, in the order in which they are declared; numbers are drawn."""
    values = {option: getattr(item, option.key) for option in CLASS_OPTIONS}
    return {
        option.name: option.inside(draw(value, generator) if option.is_number else value)
        for option, value in values.items()
        if value is not None
    }


def _start(item: ClassTable, corridor: Corridor, aircraft: AircraftName, generator: Generator) -> ProgrammePoint:
    table = item.start
    assert table is not None  # the file was checked
    for _ in range(ATTEMPTS):
        nacelle = float(np.clip(draw(table.nacelle_deg, generator), 0.0, 90.0))
        angle = deg(nacelle)
        low = float(corridor.low.at(angle))
        high = corridor.downstop_speed if angle <= corridor.downstop_nacelle else float(corridor.high.at(angle))
        if table.airspeed_kt is not None:
            airspeed = kt(draw(table.airspeed_kt, generator))
        else:
            assert table.above_low_kt is not None  # the file was checked
            airspeed = low + kt(draw(table.above_low_kt, generator))
        altitude = draw(table.altitude_m, generator)
        margin = min(airspeed - low, high - airspeed)
        if margin >= kt(table.margin_kt) and _has_trim(airspeed, angle, aircraft):
            return ProgrammePoint(airspeed, angle, altitude)
    raise InputError(
        f"no start of the class {item.name} lies inside the corridor and has a trim",
        key=f"classes.{item.name}.start",
        allowed=f"margins of {table.margin_kt:g} kn and more",
        mend="widen its distributions",
    )


@functools.lru_cache(maxsize=64)
def _has_trim(airspeed: float, angle: float, aircraft: AircraftName) -> bool:
    return has_trim("lpv", airspeed, angle, aircraft=aircraft)


def _programme(item: ClassTable, start: ProgrammePoint, corridor: Corridor, generator: Generator) -> Programme:
    """Ramps of airspeed, nacelle angle and turn from the start."""
    ramps: list[tuple[float, float, float, float]] = []  # begin, end, from, to of airspeed, then of the nacelle
    if item.speed is not None:
        begin = max(draw(item.speed.begin_s, generator), 0.0)
        acceleration = max(abs(draw(item.speed.acceleration_kt_s, generator)), 0.1)
        target = _target(item, start, corridor, generator)
        ramps.append((begin, begin + abs(target - start.airspeed) / kt(acceleration), start.airspeed, target))
    else:
        ramps.append((0.0, 0.0, start.airspeed, start.airspeed))
    if item.nacelle is not None:
        begin = max(draw(item.nacelle.begin_s, generator), 0.0)
        rate = float(np.clip(abs(draw(item.nacelle.rate_deg_s, generator)), 0.1, 12.0))
        goal = deg(float(np.clip(draw(item.nacelle.target_deg, generator), 0.0, 90.0)))
        ramps.append((begin, begin + abs(goal - start.nacelle_angle) / deg(rate), start.nacelle_angle, goal))
    else:
        ramps.append((0.0, 0.0, start.nacelle_angle, start.nacelle_angle))
    kind, turning = _turn(item, generator)
    ramps.append(turning)
    times = np.unique([0.0, *(time for ramp in ramps for time in ramp[:2])])
    values = [
        np.interp(times, ramp[:2], ramp[2:]) if ramp[1] > ramp[0] else np.full(times.shape, ramp[3]) for ramp in ramps
    ]
    turns = np.full(times.shape, float(kind))
    return Programme(times, values[0], values[1], np.full(times.shape, start.altitude), turns, values[2])


def _turn(item: ClassTable, generator: Generator) -> tuple[int, tuple[float, float, float, float]]:
    """What turning is asked for, one of ``TURN``, and when: begin, end, from, to."""
    table = item.turn
    if table is None:
        return TURN.bank, (0.0, 0.0, 0.0, 0.0)
    begin, rolls = max(draw(table.begin_s, generator), 0.0), max(draw(table.roll_s, generator), 0.1)
    by_bank = table.bank_deg is not None
    wanted = table.bank_deg if table.bank_deg is not None else table.turn_rate_deg_s
    assert wanted is not None  # the file was checked
    goal = deg(draw(wanted, generator))
    largest = LARGEST_BANK if by_bank else LARGEST_TURN_RATE
    goal = float(np.clip(goal, -largest, largest))
    if table.either_sign and generator.random() < 0.5:
        goal = -goal
    return (TURN.bank if by_bank else TURN.rate), (begin, begin + rolls, 0.0, goal)


def _target(item: ClassTable, start: ProgrammePoint, corridor: Corridor, generator: Generator) -> float:
    """Airspeed the pilot goes for [m/s]."""
    table = item.speed
    assert table is not None  # asked for by the caller only where there is one
    angle = start.nacelle_angle
    if table.target_kt is not None:
        target = kt(draw(table.target_kt, generator))
    elif table.beyond_high_kt is not None:
        high = corridor.downstop_speed if angle <= corridor.downstop_nacelle else float(corridor.high.at(angle))
        target = high + kt(draw(table.beyond_high_kt, generator))
    else:
        assert table.beyond_low_kt is not None  # the file was checked
        target = float(corridor.low.at(angle)) - kt(draw(table.beyond_low_kt, generator))
    return float(np.clip(target, AIRSPEED_RANGE[0], AIRSPEED_RANGE[1]))


def _pulses(table: PulseDraw, generator: Generator) -> list[Pulse]:
    time = draw(table.time_s, generator)
    found = []
    for _ in range(round(draw(table.count, generator))):
        duration = max(draw(table.duration_s, generator), 0.02)
        amount = draw(table.amount, generator)
        if table.either_sign and generator.random() < 0.5:
            amount = -amount
        found.append(
            Pulse(
                channel=table.channel,
                start=max(time, 0.0),
                duration=duration,
                amount=deg(amount) if table.channel == "switch" else amount,
                shape=table.shape,
                period=max(draw(table.period_s, generator), 0.05),
                replaces=table.replaces,
            )
        )
        time += duration + draw(table.gap_s, generator)
    return found


def _faults(item: ClassTable, generator: Generator) -> list[Fault]:
    found = []
    for table in item.faults:
        begins = max(draw(table.time_s, generator), 0.0)
        found.append(
            fault_of(
                table,
                lambda number: draw(number, generator),
                lambda listed: listed[int(generator.integers(len(listed)))],
                begins,
            )
        )
    return found


def _gusts(item: ClassTable, generator: Generator) -> list[Gust]:
    found = []
    for table in item.gusts:
        start = max(draw(table.time_s, generator), 0.0)
        duration = max(draw(table.duration_s, generator), 0.1)
        sign = -1.0 if table.either_sign and generator.random() < 0.5 else 1.0
        ahead, below = sign * kt(draw(table.ahead_kt, generator)), sign * kt(draw(table.below_kt, generator))
        lateral = sign * kt(draw(table.lateral_kt, generator))
        found.append(Gust(start=start, duration=duration, ahead=ahead, below=below, lateral=lateral))
    return found
