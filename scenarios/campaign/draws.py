"""Draws flights from a campaign's classes: the same flight for a seed, a class and a run, whoever draws it and when."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rtsim.aircraft.condition import AircraftName
from rtsim.atmosphere.specification import CALM, AirSpecification, Gust, Turbulence
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
from scenarios.campaign.chance import Chance, RandomChance
from scenarios.campaign.spec import CLASS_OPTIONS, CampaignFile, ClassTable, PulseDraw, SignalDraw, fault_of
from scenarios.campaign.trial import FlightPlan, has_trim
from scenarios.files.loader import load_scenario


class NoStart(InputError):
    """No start that was drawn lies inside the corridor and has a trim."""


def draw_plan(
    spec: CampaignFile, *, seed: int, class_number: int, run: int, options: FlightOptions | None = None
) -> FlightPlan:
    """Draw one flight of a campaign.

    Args:
        spec: The campaign.
        seed: Its seed.
        class_number: Place of the class in the campaign.
        run: Number of the run within the class.
        options: What all flights have in common; None: what the campaign's file says.

    Raises:
        InputError: No start of the class lies inside the corridor.
    """
    chance = RandomChance(stream_generator(seed, STREAM_CAMPAIGN, class_number, run))
    return plan_by(chance, spec, class_number, options)


def plan_by(chance: Chance, spec: CampaignFile, class_number: int, options: FlightOptions | None = None) -> FlightPlan:
    """Draw one flight.

    Args:
        chance: Where its numbers come from.
        spec: The campaign.
        class_number: Place of the class in the campaign.
        options: What all flights have in common; None: what the campaign's file says.

    Raises:
        NoStart: No start that was drawn lies inside the corridor.
    """
    item = spec.classes[class_number]
    common = options or FlightOptions(**given(spec))
    own = _Own()
    if item.scenarios:
        scenario = load_scenario(item.scenarios[chance.index("scenario", len(item.scenarios))])
        programme, start = scenario.programme, scenario.start
        duration = scenario.duration if item.duration_s is None else item.duration_s
        own = _Own(scenario.air, scenario.faults, scenario.pulses, scenario.reaction)
        common = dataclasses.replace(
            common, **{option.name: getattr(scenario.options, option.name) for option in CLASS_OPTIONS}
        )
    else:
        corridor = load_boundary(spec.corridor, database_of(common.aircraft))
        start = _start(item, corridor, common.aircraft, chance)
        programme = _programme(item, start, corridor, chance)
        duration = spec.duration_s if item.duration_s is None else item.duration_s
    pulses = [pulse for place, table in _placed(item.pulses, "pulses") for pulse in _pulses(table, place, chance)]
    faults = tuple(_faults(item, chance))
    gusts = tuple(_gusts(item, chance))
    severity = chance.number("turbulence_kt", item.turbulence_kt)
    turbulence = Turbulence(wind_at_20_ft=kt(severity)) if severity > 0.0 else own.air.turbulence
    drawn = _options(item, chance)
    yields = chance.share("pilot.yields") < item.pilot.yields
    reaction = chance.number("pilot.reaction_s", item.pilot.reaction_s)
    drawn |= {"pilot_noise": item.pilot.noise, "seed": chance.seed("seed")}
    pulses += [pulse for place, table in _placed(item.signals, "signals") for pulse in _signal(table, place, chance)]
    setup = FlightSetup(
        programme=programme,
        options=dataclasses.replace(common, **drawn),
        start=start,
        air=dataclasses.replace(
            own.air,
            turbulence=turbulence,
            gusts=(*own.air.gusts, *gusts),
            lateral=item.lateral_turbulence or own.air.lateral,
        ),
        faults=(*own.faults, *faults),
        pulses=(*own.pulses, *pulses),
        reaction=reaction if yields else own.reaction,
    )
    return FlightPlan(setup, duration)


@dataclass(frozen=True, slots=True)
class _Own:
    """What a scenario brings itself."""

    air: AirSpecification = CALM
    faults: tuple[Fault, ...] = ()
    pulses: tuple[Pulse, ...] = ()
    reaction: float | None = None


def _placed(tables: Sequence[Any], noun: str) -> list[tuple[str, Any]]:
    """Tables of a class with their places."""
    return [(f"{noun}[{number}]", table) for number, table in enumerate(tables)]


def _options(item: ClassTable, chance: Chance) -> dict[str, Any]:
    """Options that a class gives, in the order in which they are declared; numbers are drawn."""
    values = {option: getattr(item, option.key) for option in CLASS_OPTIONS}
    return {
        option.name: option.inside(chance.number(option.key, value) if option.is_number else value)
        for option, value in values.items()
        if value is not None
    }


def _start(item: ClassTable, corridor: Corridor, aircraft: AircraftName, chance: Chance) -> ProgrammePoint:
    table = item.start
    assert table is not None  # the file was checked
    for _ in range(max(chance.attempts, 1)):
        nacelle = float(np.clip(chance.number("start.nacelle_deg", table.nacelle_deg), 0.0, 90.0))
        angle = deg(nacelle)
        low, high = float(corridor.low_speed(angle)), float(corridor.high_speed(angle))
        if table.airspeed_kt is not None:
            airspeed = kt(chance.number("start.airspeed_kt", table.airspeed_kt))
        else:
            assert table.above_low_kt is not None  # the file was checked
            airspeed = low + kt(chance.number("start.above_low_kt", table.above_low_kt))
        altitude = chance.number("start.altitude_m", table.altitude_m)
        margin = min(airspeed - low, high - airspeed)
        inside = margin >= kt(table.margin_kt) and _has_trim(airspeed, angle, aircraft)
        if inside or not chance.attempts:
            return ProgrammePoint(airspeed, angle, altitude)
    raise NoStart(
        f"no start of the class {item.name} lies inside the corridor and has a trim",
        key=f"classes.{item.name}.start",
        allowed=f"margins of {table.margin_kt:g} kn and more",
        mend="widen its distributions",
    )


@functools.lru_cache(maxsize=64)
def _has_trim(airspeed: float, angle: float, aircraft: AircraftName) -> bool:
    return has_trim("lpv", airspeed, angle, aircraft=aircraft)


def _programme(item: ClassTable, start: ProgrammePoint, corridor: Corridor, chance: Chance) -> Programme:
    """Ramps of airspeed, nacelle angle and turn from the start."""
    ramps: list[tuple[float, float, float, float]] = []  # begin, end, from, to of airspeed, then of the nacelle
    if item.speed is not None:
        begin = max(chance.number("speed.begin_s", item.speed.begin_s), 0.0)
        acceleration = max(abs(chance.number("speed.acceleration_kt_s", item.speed.acceleration_kt_s)), 0.1)
        target = _target(item, start, corridor, chance)
        ramps.append((begin, begin + abs(target - start.airspeed) / kt(acceleration), start.airspeed, target))
    else:
        ramps.append((0.0, 0.0, start.airspeed, start.airspeed))
    if item.nacelle is not None:
        begin = max(chance.number("nacelle.begin_s", item.nacelle.begin_s), 0.0)
        rate = float(np.clip(abs(chance.number("nacelle.rate_deg_s", item.nacelle.rate_deg_s)), 0.1, 12.0))
        goal = deg(float(np.clip(chance.number("nacelle.target_deg", item.nacelle.target_deg), 0.0, 90.0)))
        ramps.append((begin, begin + abs(goal - start.nacelle_angle) / deg(rate), start.nacelle_angle, goal))
    else:
        ramps.append((0.0, 0.0, start.nacelle_angle, start.nacelle_angle))
    kind, turning = _turn(item, chance)
    ramps.append(turning)
    times = np.unique([0.0, *(time for ramp in ramps for time in ramp[:2])])
    values = [
        np.interp(times, ramp[:2], ramp[2:]) if ramp[1] > ramp[0] else np.full(times.shape, ramp[3]) for ramp in ramps
    ]
    turns = np.full(times.shape, float(kind))
    return Programme(times, values[0], values[1], np.full(times.shape, start.altitude), turns, values[2])


def _turn(item: ClassTable, chance: Chance) -> tuple[int, tuple[float, float, float, float]]:
    """What turning is asked for, one of ``TURN``, and when: begin, end, from, to."""
    table = item.turn
    if table is None:
        return TURN.bank, (0.0, 0.0, 0.0, 0.0)
    begin, rolls = (
        max(chance.number("turn.begin_s", table.begin_s), 0.0),
        max(chance.number("turn.roll_s", table.roll_s), 0.1),
    )
    by_bank = table.bank_deg is not None
    wanted = table.bank_deg if table.bank_deg is not None else table.turn_rate_deg_s
    assert wanted is not None  # the file was checked
    goal = deg(chance.number("turn.bank_deg" if by_bank else "turn.turn_rate_deg_s", wanted))
    largest = LARGEST_BANK if by_bank else LARGEST_TURN_RATE
    goal = float(np.clip(goal, -largest, largest))
    if table.either_sign and chance.share("turn.sign") < 0.5:
        goal = -goal
    return (TURN.bank if by_bank else TURN.rate), (begin, begin + rolls, 0.0, goal)


def _target(item: ClassTable, start: ProgrammePoint, corridor: Corridor, chance: Chance) -> float:
    """Airspeed the pilot goes for [m/s]."""
    table = item.speed
    assert table is not None  # asked for by the caller only where there is one
    angle = start.nacelle_angle
    if table.target_kt is not None:
        target = kt(chance.number("speed.target_kt", table.target_kt))
    elif table.beyond_high_kt is not None:
        target = float(corridor.high_speed(angle)) + kt(chance.number("speed.beyond_high_kt", table.beyond_high_kt))
    else:
        assert table.beyond_low_kt is not None  # the file was checked
        target = float(corridor.low_speed(angle)) - kt(chance.number("speed.beyond_low_kt", table.beyond_low_kt))
    return float(np.clip(target, AIRSPEED_RANGE[0], AIRSPEED_RANGE[1]))


def _pulses(table: PulseDraw, place: str, chance: Chance) -> list[Pulse]:
    time = chance.number(f"{place}.time_s", table.time_s)
    found = []
    for number in range(round(chance.number(f"{place}.count", table.count))):
        one = f"{place}[{number}]"
        duration = max(chance.number(f"{one}.duration_s", table.duration_s), 0.02)
        amount = chance.number(f"{one}.amount", table.amount)
        if table.either_sign and chance.share(f"{one}.sign") < 0.5:
            amount = -amount
        found.append(
            Pulse(
                channel=table.channel,
                start=max(time, 0.0),
                duration=duration,
                amount=deg(amount) if table.channel == "switch" else amount,
                shape=table.shape,
                period=max(chance.number(f"{one}.period_s", table.period_s), 0.05),
                replaces=table.replaces,
            )
        )
        time += duration + chance.number(f"{one}.gap_s", table.gap_s)
    return found


def _signal(table: SignalDraw, place: str, chance: Chance) -> list[Pulse]:
    """A signal held from sample to sample, two of them in a period of its bandwidth."""
    begin, step = max(chance.number(f"{place}.begin_s", table.begin_s), 0.0), 0.5 / table.bandwidth_hz
    found = []
    for number in range(max(1, round(table.duration_s / step))):
        amount = chance.number(f"{place}[{number}].amount", table.amount)
        found.append(
            Pulse(
                channel=table.channel,
                start=begin + number * step,
                duration=step,
                amount=deg(amount) if table.channel == "switch" else amount,
                replaces=table.replaces,
            )
        )
    return found


def _faults(item: ClassTable, chance: Chance) -> list[Fault]:
    found = []
    for place, table in _placed(item.faults, "faults"):
        begins = max(chance.number(f"{place}.time_s", table.time_s), 0.0)
        found.append(
            fault_of(
                table,
                lambda key, number, place=place: chance.number(f"{place}.{key}", number),  # type: ignore[misc]
                lambda key, listed, place=place: listed[chance.index(f"{place}.{key}", len(listed))],  # type: ignore[misc]
                begins,
            )
        )
    return found


def _gusts(item: ClassTable, chance: Chance) -> list[Gust]:
    found = []
    for place, table in _placed(item.gusts, "gusts"):
        start = max(chance.number(f"{place}.time_s", table.time_s), 0.0)
        duration = max(chance.number(f"{place}.duration_s", table.duration_s), 0.1)
        sign = -1.0 if table.either_sign and chance.share(f"{place}.sign") < 0.5 else 1.0
        ahead, below, lateral = (
            sign * kt(chance.number(f"{place}.{key}", getattr(table, key)))
            for key in ("ahead_kt", "below_kt", "lateral_kt")
        )
        found.append(Gust(start=start, duration=duration, ahead=ahead, below=below, lateral=lateral))
    return found
