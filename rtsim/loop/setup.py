"""What a flight is set up with, and the tables and start state that follow from it."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rtsim.aids.aids_kernels import AUTOMATIC_FLAPS, AUTOMATIC_ROTOR_SPEED, GOVERNOR, MEMORY
from rtsim.aids.design import design_aids, switches_of
from rtsim.aids.lateral_design import LATERAL_AIDS, design_lateral_aids, knows_lateral_aids
from rtsim.aircraft.condition import AircraftCondition
from rtsim.aircraft.controls import control_tables
from rtsim.aircraft.points import Condition
from rtsim.aircraft.variables import (
    ALL_INPUTS,
    ALL_OUTPUTS,
    ALL_STATES,
    FLAP_INPUTS,
    GROUND_INPUTS,
    STATE,
    of_role,
    whole,
)
from rtsim.aircraft.xv15 import dynamics_kernels as nonlinear_kernels
from rtsim.aircraft.xv15.model import Xv15
from rtsim.arrays import FloatArray
from rtsim.atmosphere.air import gust_tables, new_gust_state, wind_tables
from rtsim.atmosphere.specification import CALM, AirSpecification
from rtsim.atmosphere.wind_kernels import WindTables, wind_share
from rtsim.choices import CorridorName, PlantName, SwitchName
from rtsim.command import SENSOR
from rtsim.corridor.corridor_kernels import MARGIN_COUNT, CorridorTables, new_level_state
from rtsim.errors import InputError
from rtsim.faults.actuator_kernels import PLANNED
from rtsim.faults.fault import Fault, check_sides
from rtsim.faults.schedule import fault_tables, new_fault_state
from rtsim.frame import SIGNAL_COUNT, UNIT_SCALES
from rtsim.kernels.compiled import interpreted
from rtsim.kernels.packed import Address, packed
from rtsim.loop import beside
from rtsim.loop import frame_kernels as frames_of
from rtsim.loop.aircraft import database_of
from rtsim.loop.data import (
    CHANNEL,
    CLOCK,
    HELD,
    KNOWN,
    MODES,
    MOTION,
    REFERENCE,
    STATION,
    PlantTables,
    Scratch,
    ScriptTables,
    SimulationState,
    SimulationTables,
)
from rtsim.loop.flying import Flying, Measure, new_normals, new_streams
from rtsim.loop.lateral_reference_kernels import line_by_heading
from rtsim.loop.options import FULL_ROTOR_SPEED, FULL_TANKS, FlightOptions, declared
from rtsim.loop.script import Pulse, pulse_table
from rtsim.loop.script_kernels import new_script_state
from rtsim.lpv.aircraft import LpvAircraft
from rtsim.lpv.database import Database
from rtsim.lpv.flown import flown_database, meets_ground, moves_flaps, turns_rotors
from rtsim.lpv.lateral import slip_trim
from rtsim.lpv.lpv_kernels import work_size
from rtsim.lpv.schedule_kernels import LpvTables
from rtsim.lpv.sideways_kernels import sideways_work_size
from rtsim.lpv.sideways_tables import SidewaysTables, prepare_sideways
from rtsim.lpv.tables import Form, prepare_tables, scheduling_speed
from rtsim.nacelle.automatic import AutomaticNacelle, inactive_tables
from rtsim.nacelle.automatic_kernels import AUTOMATIC_STATE_SIZE
from rtsim.nacelle.nacelle_kernels import new_actuator_state
from rtsim.nacelle.switch import load_nacelle_tables
from rtsim.pilot.lateral_kernels import WANTED, lateral_work_size
from rtsim.pilot.lateral_tables import load_lateral_pilot
from rtsim.pilot.layout_kernels import TARGET
from rtsim.pilot.pilot_kernels import pilot_work_size
from rtsim.pilot.tables import load_pilot_tables, noise_width, pilot_state_size
from rtsim.programme import LATERAL_ROWS, Programme, ProgrammePoint
from rtsim.protection.boundary import load_boundary
from rtsim.protection.chain import compiled_law
from rtsim.protection.law_data import LAW, WORK_SIZE, ProtectionTables
from rtsim.protection.law_kernels import law_start
from rtsim.protection.laws import load_laws
from rtsim.protection.tables import law_tables
from rtsim.systems.drive_kernels import DRIVE_STATE_SIZE, GOVERNED, HELD_OFFSET, HELD_SETTING
from rtsim.systems.engine import load_engine_tables
from rtsim.systems.flap_kernels import FLAP_FOLLOWS, FLAP_SETTING, FLAP_STATE_SIZE, NO_SETTING
from rtsim.systems.ground import light_on_wheels, load_ground_tables, no_ground
from rtsim.systems.requests import check_slow_rotors, held_offset
from rtsim.systems.settings import load_drive_tables, load_flap_tables
from rtsim.units import to_deg, to_kt

PLANT_FORMS: dict[PlantName, Form] = {"lpv": "layered", "lpv-plain": "plain", "nonlinear": "layered"}
REFERENCE_FREQUENCY = 1.5
"""Natural frequency of the airspeed reference filter [rad/s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightSetup:
    """What flies, how and from where. SI and radians."""

    programme: Programme
    """Airspeed, nacelle angle and altitude over time."""
    options: FlightOptions = FlightOptions(protection="off")
    """Who flies what; by default nothing watches or protects."""
    start: ProgrammePoint | None = None
    """Trimmed condition at frame 0; None: the programme's first point."""
    air: AirSpecification = CALM
    """Gusts and turbulence."""
    pulses: tuple[Pulse, ...] = ()
    """What scripted hands do to the controls besides the pilot."""
    reaction: float | None = None
    """A pilot who yields: how long a warning lasts before he gives up his plan [s]; None: he never does."""
    faults: tuple[Fault, ...] = ()
    """Failures and their times."""
    automatic_nacelle: AutomaticNacelle | None = None
    """Automatic nacelle control, which sets the nacelle rate whoever flies; None: the pilot does."""

    def with_options(self, **changes: Any) -> FlightSetup:
        """The setup with other options.

        Args:
            changes: Values by field of :class:`~rtsim.loop.options.FlightOptions`, SI.
        """
        return dataclasses.replace(self, options=self.options.changed(changes))


@dataclass(frozen=True, slots=True)
class Parts:
    """Everything of a flight that flying does not change."""

    tables: SimulationTables
    """Parameters of the frame."""
    nonlinear: bool
    """The nonlinear aircraft flies."""
    noise_width: int
    """Standard normals the pilot takes per frame; 0 with the noise off."""
    database: Database = field(repr=False)
    """The LPV database in use, with the aircraft's profile."""
    database_hash: str
    """Hash of the aircraft."""
    needed_aids: tuple[SwitchName, ...]
    """Aids that cannot be switched off: the database does not say what the aircraft does without them."""
    lateral_aids: bool
    """The aircraft moves out of its plane of symmetry, and the database says how: the lateral aids have gains."""
    start_x: FloatArray = field(repr=False)
    """Trimmed state at the start."""
    start_u: FloatArray = field(repr=False)
    """Trimmed inputs at the start."""
    start_held: float = 0.0
    """Held rotor speed at the start, less the governed one [rad/s]."""


def _start(setup: FlightSetup) -> tuple[float, float, float]:
    start = setup.programme.at(0.0) if setup.start is None else setup.start
    return start.airspeed, start.nacelle_angle, start.altitude


def _start_lateral(programme: Programme, wind: WindTables, altitude: float) -> float:
    """Airspeed to the right at the start: that asked for; on a track that is held by sideward flight, over the ground.

    Args:
        programme: What is asked for.
        wind: The steady wind.
        altitude: Altitude at the start [m].
    """
    first = min(1, programme.time.size - 1)  # a track is asked for on the way to a point
    lateral = float(programme.lateral[0])
    if programme.track[first] == 0.0:
        return lateral
    by_flying_sideward = 1.0 - interpreted(line_by_heading)(max(float(programme.airspeed[0]), 1.0))
    return lateral - by_flying_sideward * interpreted(wind_share)(wind, altitude) * wind.right


@functools.lru_cache(maxsize=16)
def start_trim(
    nonlinear: bool,
    database: Database,
    airspeed: float,
    nacelle: float,
    held: tuple[float, float] | None = None,
    lateral: float = 0.0,
) -> tuple[FloatArray, FloatArray]:
    """Trimmed state and inputs in level flight, altitude 0, read-only; kept, since batches start alike.

    Args:
        nonlinear: Trim the nonlinear aircraft; else the LPV aircraft.
        held: Rotor speed [rad/s], and its place on the database's nacelle axis [rad]; None: the conversion's.
        lateral: Airspeed to the right [m/s].

    Raises:
        InputError: There is no trim.
    """
    if nonlinear:
        aircraft = Xv15.under(AircraftCondition.stored(database.attributes))
        condition = Condition(
            airspeed=airspeed, nacelle_angle=nacelle, rotor_speed=held and held[0], lateral_airspeed=lateral
        )
        trim = aircraft.trim(condition)
        converged, x, u = trim.converged, trim.x.copy(), trim.u.copy()
    else:
        point = LpvAircraft(database).trim(airspeed=airspeed, nacelle=held[1] if held else nacelle)
        converged, x, u = point.converged, point.x.copy(), point.u.copy()
        if lateral != 0.0:
            dx, du, exists = slip_trim(
                database, airspeed=airspeed, nacelle=held[1] if held else nacelle, lateral=lateral
            )
            converged = converged and exists
            x, u = whole(x, ALL_STATES), whole(u, ALL_INPUTS)
            x[: dx.size] += dx
            u[: du.size] += du
    if not converged:
        sideways = f", {to_kt(lateral):.1f} kn to the right" if lateral else ""
        raise InputError(
            "the aircraft has no level-flight trim there",
            key="start",
            value=f"{to_kt(airspeed):.1f} kn{sideways} at nacelle {to_deg(nacelle):.1f} deg",
            mend="start inside the conversion corridor (rtsim corridor shows it)",
        )
    x.setflags(write=False)
    u.setflags(write=False)
    return x, u


@functools.lru_cache(maxsize=8)
def _corridor_tables(name: CorridorName, database: Database) -> CorridorTables:
    return packed(load_boundary(name, database).tables())


@functools.lru_cache(maxsize=16)
def _law(name: str, boundary: CorridorName, database: Database, dt: float) -> ProtectionTables:
    return packed(law_tables(name, database, dt=dt, boundary=boundary))


def build_parts(setup: FlightSetup) -> Parts:
    """Load database, gains and corridor, and trim at the start; everything costly is loaded once and shared.

    Args:
        setup: The flight.

    Raises:
        InputError: The start has no trim.
    """
    options = setup.options
    nonlinear = options.plant == "nonlinear"
    beside.start("nonlinear" if nonlinear else "lpv")
    loaded = database_of(options.aircraft)
    database = flown_database(loaded, options.database or None)
    profile = database.profile
    if nonlinear and not profile.is_xv15:
        raise InputError(
            f"there is no nonlinear model of the {profile.name}", key="plant", value=options.plant,
            allowed="lpv, lpv-plain", mend="fly the LPV aircraft",
        )  # fmt: skip
    own = Xv15.under(AircraftCondition.stored(loaded.attributes)).tables
    airspeed, nacelle, altitude = _start(setup)
    drive = load_drive_tables(profile, rotor_speed=database.rotor_speed, nacelle=database.nacelle, nonlinear=nonlinear)
    if options.automatic_rotor_speed:
        check_slow_rotors(drive)
    offset = held_offset(drive, options.rotor_speed, nacelle) if options.rotor_speed != FULL_ROTOR_SPEED else 0.0
    held = (drive.governed_speed + offset, nacelle if offset == 0.0 else drive.slow_axis * offset)
    programme = setup.programme
    lpv = None if nonlinear else _lpv_tables(database, options.plant)
    rolls = database.lateral is not None if nonlinear else hasattr(lpv, "symmetric")
    if not (rolls or programme.symmetric):
        raise InputError(
            "this aircraft moves in its plane of symmetry alone, and the programme asks for turns or sideward flight",
            key="plant", value=options.plant, mend="fly the plant lpv or nonlinear, or another programme",
        )  # fmt: skip
    for fault in setup.faults:
        check_sides(fault, rolls=rolls)
    wind = wind_tables(
        options.wind,
        None if options.wind_from < 0.0 else options.wind_from,
        heading=options.heading,
        reference_height=options.wind_reference_height,
        felt=rolls,
    )
    lateral = _start_lateral(programme, wind, altitude)
    trim = start_trim(nonlinear, database, airspeed, nacelle, held, lateral)
    x, u = (whole(part, variables) for part, variables in zip(trim, (ALL_STATES, ALL_INPUTS), strict=True))
    ground = load_ground_tables(profile, own) if options.ground else no_ground()
    if options.ground:
        if not nonlinear and not meets_ground(loaded):
            raise needed_inputs_error("ground", "on", "false", GROUND_INPUTS)
        altitude = max(altitude, light_on_wheels(ground, float(x[STATE.pitch])))
    x[STATE.altitude], x[STATE.heading] = altitude, options.heading
    dt, corridor = 1.0 / options.rate_hz, options.corridor_name
    pilot = load_pilot_tables(database, options.outer_loop, dt=dt)
    lateral_aids = rolls and knows_lateral_aids(database)
    for name in LATERAL_AIDS.intersection(options.aids):
        if not lateral_aids:
            raise lateral_aid_error(name)
    tables = SimulationTables(
        dt=dt,
        wind=wind,
        plant=PlantTables(
            aircraft=Address(own if nonlinear else lpv),
            configuration=own.configuration,
            controls=control_tables(profile),
            alpha_speed=scheduling_speed(database),
            lateral=int(rolls),
        ),
        nacelle=load_nacelle_tables(profile),
        automatic=inactive_tables() if setup.automatic_nacelle is None else setup.automatic_nacelle.tables(profile),
        corridor=_corridor_tables(corridor, database),
        pilot=pilot,
        lateral_noise=int(rolls and options.pilot_noise),
        lateral_asked=int(not programme.symmetric),
        lateral_pilot=Address(load_lateral_pilot(database, dt=dt) if rolls else pilot),
        flaps=load_flap_tables(profile),
        drive=drive,
        ground=ground,
        engine=load_engine_tables(profile, density=own.configuration.density),
        aids=design_aids(database),
        lateral_aids=design_lateral_aids(database),
        gusts=gust_tables(setup.air, profile),
        faults=fault_tables(setup.faults, profile),
        # Laws in Python are called from outside the compiled frame; the monitor still predicts in it.
        protection=_law(compiled_law(load_laws(options.protection)) or "monitor", corridor, database, dt),
        programme=np.array(
            [
                programme.time,
                programme.airspeed,
                programme.nacelle_angle,
                programme.altitude,
                *(getattr(programme, name) for name in LATERAL_ROWS),
            ]
        ),
        script=ScriptTables(pulse_table(setup.pulses), -1.0 if setup.reaction is None else setup.reaction),
        units=UNIT_SCALES,
        reference_frequency=REFERENCE_FREQUENCY,
    )
    return Parts(
        tables=tables,
        nonlinear=nonlinear,
        noise_width=interpreted(noise_width)(pilot) if options.pilot_noise else 0,
        database=database,
        database_hash=loaded.aircraft_hash,
        needed_aids=_needed_aids(setup, loaded),
        lateral_aids=lateral_aids,
        start_x=x,
        start_u=u,
        start_held=offset,
    )


def _lpv_tables(database: Database, plant: PlantName) -> LpvTables | SidewaysTables:
    """The LPV aircraft: in six degrees of freedom where the database knows them and the form can."""
    form = PLANT_FORMS[plant]
    if form == "layered" and database.lateral is not None:
        return prepare_sideways(database)
    return prepare_tables(database, form)


def new_scratch(tables: SimulationTables) -> Scratch:
    """Work space for a flight.

    Args:
        tables: What flies.
    """
    states = len(ALL_STATES)
    work = nonlinear_kernels.WORK_COUNT + nonlinear_kernels.STEP_SIZE
    aircraft = tables.plant.aircraft.target
    if hasattr(aircraft, "symmetric"):
        work = max(work, interpreted(sideways_work_size)(aircraft))
    elif hasattr(aircraft, "cells"):
        work = max(work, interpreted(work_size)(aircraft))
    return Scratch(
        work=np.zeros(work),
        y=np.zeros(len(ALL_OUTPUTS)),
        xdot=np.zeros(states),
        path=np.zeros((3, 3)),
        motion=np.zeros(MOTION.size),
        known=np.zeros(KNOWN.size),
        flaps=np.zeros(3),
        margins=np.zeros(MARGIN_COUNT),
        shown=np.zeros(1 + MARGIN_COUNT),
        seen=np.zeros(states),
        target=np.zeros(TARGET.size),
        command=np.zeros((STATION.size, CHANNEL.size)),
        pilot=np.zeros(interpreted(pilot_work_size)(tables.pilot)),
        lateral_pilot=np.zeros(_lateral_sizes(tables)[1]),
        wanted=np.zeros(WANTED.size),
        planned=np.zeros(PLANNED.size),
        sensors=np.zeros(SENSOR.size),
        law=np.zeros(WORK_SIZE),
        si=np.zeros(SIGNAL_COUNT),
        row=np.zeros(SIGNAL_COUNT),
    )


def _lateral_sizes(tables: SimulationTables) -> tuple[int, int]:
    """Lengths of state and work array of the pilot's lateral half."""
    if tables.plant.lateral == 0:
        return 1, 1
    pilot = tables.lateral_pilot.target
    return interpreted(pilot_state_size)(pilot.mocm), interpreted(lateral_work_size)(pilot)


def _needed_aids(setup: FlightSetup, database: Database) -> tuple[SwitchName, ...]:
    options = setup.options
    needed: list[SwitchName] = []
    if options.plant != "nonlinear" and not moves_flaps(database):
        needed.append("automatic_flaps")
    if options.plant != "nonlinear" and not turns_rotors(database):
        needed.append("governor")
    for name, on in (("automatic_flaps", options.automatic_flaps), ("governor", options.governor)):
        if name in needed and not on:
            raise needed_aid_error(name)
    return tuple(needed)


def needed_aid_error(name: str) -> InputError:
    """The refusal to switch an aid off that the database needs.

    Args:
        name: The aid.
    """
    return needed_inputs_error(name, "off", "on", (*FLAP_INPUTS, "rotor_speed"))


def lateral_aid_error(name: str) -> InputError:
    """The refusal of an aid that needs to know the aircraft out of its plane of symmetry.

    Args:
        name: The aid.
    """
    return InputError(
        "cannot be switched on: the database or this form of it does not say how the aircraft rolls and turns",
        key=name,
        value="on",
        allowed="off",
        mend="fly the plant lpv or nonlinear of a database with a lateral half and gains for it (docs/lpv.md)",
    )


def needed_inputs_error(key: str, value: str, allowed: str, inputs: Sequence[str]) -> InputError:
    """The refusal of what a database does not know.

    Args:
        key: What was asked for.
        value: What it was to be.
        allowed: What it can be.
        inputs: Inputs that the database lacks.
    """
    return InputError(
        f"cannot be switched {value}: the database does not say what the aircraft does then",
        key=key,
        value=value,
        allowed=allowed,
        mend=f"give the database the inputs {', '.join(inputs)} (docs/lpv.md), or fly the nonlinear plant",
    )


def start_state(setup: FlightSetup, parts: Parts, air_normals: FloatArray) -> SimulationState:
    """The state at frame 0, trimmed, filters at rest; the pilot is yet to be engaged.

    Args:
        setup: The flight.
        parts: Its parts.
        air_normals: Six standard normals: the turbulence at the start.
    """
    options = setup.options
    airspeed, nacelle, _ = _start(setup)
    clock = np.zeros(CLOCK.size)
    clock[CLOCK.mode] = MODES["mocm" if options.mocm_begins else "external"]
    u = parts.start_u.copy()
    u[[place for place in range(len(ALL_INPUTS)) if place not in of_role(ALL_INPUTS, "pilot")]] = 0.0
    held = np.full(HELD.size, np.nan)
    held[HELD.reason :] = 0.0
    state = SimulationState(
        x=parts.start_x.copy(),
        u=u,
        nacelle=new_actuator_state(nacelle),
        automatic=np.zeros(AUTOMATIC_STATE_SIZE),
        reference=_start_reference(airspeed, options.heading),
        level=new_level_state(),
        pilot=np.zeros(interpreted(pilot_state_size)(parts.tables.pilot)),
        lateral_pilot=np.zeros(_lateral_sizes(parts.tables)[0]),
        aids=np.zeros(MEMORY.size),
        switches=switches_of(options.aids),
        flaps=np.zeros(FLAP_STATE_SIZE),
        drive=np.zeros(DRIVE_STATE_SIZE),
        tank=_tank(options.fuel, parts.tables.engine.capacity),
        gusts=new_gust_state(setup.air, air_normals),
        faults=new_fault_state(),
        protection=np.zeros(LAW.size),
        held=held,
        script=new_script_state(),
        clock=clock,
    )
    state.switches[AUTOMATIC_FLAPS], state.switches[GOVERNOR] = float(options.automatic_flaps), float(options.governor)
    state.flaps[FLAP_FOLLOWS], state.flaps[FLAP_SETTING] = 1.0, NO_SETTING
    state.switches[AUTOMATIC_ROTOR_SPEED] = float(options.automatic_rotor_speed)
    state.drive[GOVERNED] = 1.0
    state.drive[HELD_OFFSET] = state.drive[HELD_SETTING] = parts.start_held
    interpreted(law_start)(parts.tables.protection, state.protection)
    if options.aids:
        state.aids[MEMORY.last_switches] = -1.0  # engaged in the first frame, from the trim
    return state


def _start_reference(airspeed: float, heading: float) -> FloatArray:
    reference = np.zeros(REFERENCE.size)
    reference[REFERENCE.airspeed], reference[REFERENCE.heading] = airspeed, heading
    return reference


def _tank(fuel: float, capacity: float) -> FloatArray:
    """The tanks at the start."""
    if fuel == FULL_TANKS or capacity <= 0.0:
        fuel = capacity
    if fuel > capacity:
        item = declared()["fuel"]
        allowed = f"{item.low:g} to {item.shown(capacity):.9g} lb"
        raise InputError("is more than the tanks hold", key=item.flag, value=item.shown(fuel), allowed=allowed)
    return np.array([fuel, capacity])


def prepare(
    setup: FlightSetup,
    parts: Parts | None = None,
    *,
    measure: tuple[Measure, FloatArray] | None = None,
    unlocked: bool = False,
) -> Flying:
    """Put the aircraft at the start of a flight, ready for frame 0.

    Args:
        setup: The flight.
        parts: Its parts, where the caller changed some; None: as ``build_parts`` makes them.
        measure: A compiled part that measures each frame, and the array that it adds to.
        unlocked: Fly outside Python's lock, for batches in threads.

    Returns:
        The flight.

    Raises:
        InputError: The start has no trim, or something that was asked for does not exist.
    """
    parts = build_parts(setup) if parts is None else parts
    streams = new_streams(setup.options.seed)
    flying = Flying(
        parts.tables,
        start_state(setup, parts, new_normals(streams)),
        new_scratch(parts.tables),
        streams=streams,
        nonlinear=parts.nonlinear,
        noise_width=parts.noise_width,
        measure=measure,
        unlocked=unlocked,
    )
    flying.do(frames_of.DISTURB)
    flying.engage()
    return flying


def restart(flying: Flying, setup: FlightSetup, parts: Parts) -> None:
    """Put a flight back to its start, random streams included.

    Args:
        flying: The flight; its arrays are overwritten.
        setup: What it was set up with.
        parts: Its parts.
    """
    flying.streams = new_streams(setup.options.seed)
    flying.take(start_state(setup, parts, new_normals(flying.streams)))
    flying.do(frames_of.DISTURB)
    flying.engage()


__all__ = [
    "FlightSetup", "Parts", "build_parts", "lateral_aid_error", "needed_aid_error", "prepare", "restart", "start_trim",
]  # fmt: skip
