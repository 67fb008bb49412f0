"""What a flight is set up with, and the tables and start state that follow from it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from rtsim.aids import AidName, SwitchName, design_aids, switches_of
from rtsim.aids.aids_kernels import AID_STATE_SIZE, AUTOMATIC_FLAPS, GOVERNOR, LAST_SWITCHES
from rtsim.aircraft import INPUTS, OUTPUTS, STATE, STATES, Condition
from rtsim.aircraft.controls import control_tables
from rtsim.aircraft.variables import AUXILIARY_INPUTS
from rtsim.aircraft.xv15 import dynamics_kernels as nonlinear
from rtsim.aircraft.xv15.model import Xv15
from rtsim.atmosphere import CALM, AirSpecification
from rtsim.atmosphere.air import gust_tables, new_gust_state
from rtsim.corridor.corridor_kernels import MARGIN_COUNT, new_level_state
from rtsim.errors import InputError
from rtsim.faults import Fault
from rtsim.faults.schedule import fault_tables, new_fault_state
from rtsim.frame import COLUMN, FloatArray
from rtsim.loop import advance_kernels as kernels
from rtsim.loop.data import (
    CLOCK_MODE,
    CLOCK_SIZE,
    MODE_EXTERNAL,
    MODE_MOCM,
    TARGET_SIZE,
    Scratch,
    SimulationState,
    SimulationTables,
)
from rtsim.loop.observe_kernels import observe
from rtsim.loop.plant_kernels import AircraftFrame
from rtsim.lpv.aircraft import LpvAircraft
from rtsim.lpv.database import Database
from rtsim.lpv.files.storage import load_database
from rtsim.lpv.flown import flown_database, moves_flaps, turns_rotors
from rtsim.lpv.lpv_kernels import work_size
from rtsim.lpv.tables import Form, prepare_tables
from rtsim.nacelle import load_nacelle_tables
from rtsim.nacelle.automatic import AutomaticNacelle, inactive_tables
from rtsim.nacelle.automatic_kernels import AUTOMATIC_STATE_SIZE
from rtsim.nacelle.nacelle_kernels import new_actuator_state
from rtsim.pilot.pilot_kernels import pilot_work_size
from rtsim.pilot.tables import load_pilot_tables, noise_width, pilot_state_size
from rtsim.programme import Programme
from rtsim.protection.boundary import BoundaryName, load_boundary
from rtsim.protection.chain import compiled_law
from rtsim.protection.law_data import LAW_STATE_SIZE, SENSOR_COUNT, WORK_SIZE
from rtsim.protection.law_kernels import law_start
from rtsim.protection.laws import load_laws
from rtsim.protection.tables import law_tables
from rtsim.systems import load_drive_tables, load_flap_tables
from rtsim.systems.drive_kernels import DRIVE_STATE_SIZE, GOVERNED
from rtsim.systems.flap_kernels import FLAP_FOLLOWS, FLAP_SETTING, FLAP_STATE_SIZE, NO_SETTING
from rtsim.units import to_deg, to_kt

Plant = Literal["lpv", "lpv-plain", "nonlinear"]
PLANT_FORMS: dict[Plant, Form] = {"lpv": "layered", "lpv-plain": "plain", "nonlinear": "layered"}
REFERENCE_FREQUENCY = 1.5
"""Natural frequency of the airspeed reference filter [rad/s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightSetup:
    """What flies, how and from where. SI and radians."""

    programme: Programme
    """Airspeed, nacelle angle and altitude over time."""
    plant: Plant = "lpv"
    """``lpv`` (three scheduling variables), ``lpv-plain`` (the paper's form) or ``nonlinear``."""
    outer_loop: Literal["integrators", "pi"] = "integrators"
    """How the MOCM holds airspeed and altitude."""
    pilot: Literal["mocm", "external"] = "mocm"
    """Who flies at frame 0."""
    corridor: BoundaryName = "design"
    """Boundaries to watch."""
    rate_hz: int = 250
    """Frames per second."""
    start_airspeed: float | None = None
    """Airspeed at frame 0 [m/s]; None: the programme's first."""
    start_nacelle: float | None = None
    """Nacelle angle at frame 0 [rad]; None: the programme's first."""
    start_altitude: float | None = None
    """Altitude at frame 0 [m]; None: the programme's first."""
    wind: float = 0.0
    """Steady tailwind [m/s]."""
    seed: int = 0
    """Root of every random stream."""
    pilot_noise: bool = False
    """Let the MOCM's observation and motor noise act."""
    aids: tuple[AidName, ...] = ()
    """Pilot aids on at frame 0; they act on hands and plug-ins, not on the MOCM and not on held controls."""
    automatic_flaps: bool = True
    """Whether the flaps follow their schedule at frame 0, whoever flies; else they stay where they are."""
    governor: bool = True
    """Whether the governor holds the rotor speed at frame 0, whoever flies."""
    air: AirSpecification = CALM
    """Gusts and turbulence."""
    faults: tuple[Fault, ...] = ()
    """Failures and their times."""
    automatic_nacelle: AutomaticNacelle | None = None
    """Automatic nacelle control, which sets the nacelle rate whoever flies; None: the pilot does."""
    protection: str = "off"
    """Protection laws in the order in which they act, separated by commas: ``off``, ``monitor``, ``governor``,
    ``full``, ``MODULE:CLASS`` or an entry point."""
    protection_boundary: BoundaryName = "flight"
    """Corridor that the built-in laws keep to."""
    database: str = ""
    """LPV database that is flown, a file (``.nc``, ``.mat``); empty: the shipped XV-15."""


@dataclass(frozen=True, slots=True)
class Parts:
    """Tables and work space of one simulation."""

    tables: SimulationTables
    """Parameters of the frame."""
    scratch: Scratch
    """Work space of the frame."""
    noise_width: int
    """Standard normals the pilot takes per frame; 0 with the noise off."""
    database: Database = field(repr=False)
    """The LPV database in use, with the aircraft's profile."""
    database_hash: str
    """Hash of the aircraft."""
    needed_aids: tuple[SwitchName, ...]
    """Aids that cannot be switched off: the database does not say what the aircraft does without them."""
    start_x: FloatArray = field(repr=False)
    """Trimmed state at the start."""
    start_u: FloatArray = field(repr=False)
    """Trimmed inputs at the start."""


def _start(setup: FlightSetup) -> tuple[float, float, float]:
    first = setup.programme.at(0.0)
    airspeed = first.airspeed if setup.start_airspeed is None else setup.start_airspeed
    nacelle = first.nacelle_angle if setup.start_nacelle is None else setup.start_nacelle
    altitude = first.altitude if setup.start_altitude is None else setup.start_altitude
    return airspeed, nacelle, altitude


def build_parts(setup: FlightSetup) -> Parts:
    """Load database, gains and corridor, and trim at the start.

    Args:
        setup: The flight.

    Raises:
        InputError: The start has no trim.
    """
    loaded = load_database(setup.database or None)
    database = flown_database(loaded, setup.database or None)
    profile = database.profile
    if setup.plant == "nonlinear" and not profile.is_xv15:
        raise InputError(
            f"there is no nonlinear model of the {profile.name}", key="plant", value=setup.plant,
            allowed="lpv, lpv-plain", mend="fly the LPV aircraft",
        )  # fmt: skip
    lpv_aircraft = LpvAircraft(database)
    nonlinear_aircraft = Xv15.load()
    airspeed, nacelle, altitude = _start(setup)
    if setup.plant == "nonlinear":
        trim = nonlinear_aircraft.trim(Condition(airspeed=airspeed, nacelle_angle=nacelle))
        converged, x, u = trim.converged, trim.x.copy(), trim.u.copy()
    else:
        point = lpv_aircraft.trim(airspeed=airspeed, nacelle=nacelle)
        converged, x, u = point.converged, point.x.copy(), point.u.copy()
    if not converged:
        raise InputError(
            "the aircraft has no level-flight trim there",
            key="start",
            value=f"{to_kt(airspeed):.1f} kn at nacelle {to_deg(nacelle):.1f} deg",
            mend="start inside the conversion corridor (rtsim corridor shows it)",
        )
    x[STATE.altitude] = altitude
    programme = setup.programme
    own = nonlinear_aircraft.tables
    tables = SimulationTables(
        dt=1.0 / setup.rate_hz,
        wind=float(setup.wind),
        lpv=prepare_tables(database, PLANT_FORMS[setup.plant]),
        aircraft=own if setup.plant == "nonlinear" else AircraftFrame(own.configuration, control_tables(profile)),
        nacelle=load_nacelle_tables(profile),
        automatic=inactive_tables() if setup.automatic_nacelle is None else setup.automatic_nacelle.tables(profile),
        corridor=load_boundary(setup.corridor, database).tables(),
        pilot=load_pilot_tables(database, setup.outer_loop, dt=1.0 / setup.rate_hz),
        flaps=load_flap_tables(profile),
        drive=load_drive_tables(profile, governed_speed=database.rotor_speed),
        aids=design_aids(database),
        gusts=gust_tables(setup.air, profile),
        faults=fault_tables(setup.faults, profile),
        # Laws in Python are called from outside the compiled frame; the monitor still predicts in it.
        protection=law_tables(
            compiled_law(load_laws(setup.protection)) or "monitor",
            database,
            dt=1.0 / setup.rate_hz,
            boundary=setup.protection_boundary,
        ),
        programme=np.array([programme.time, programme.airspeed, programme.nacelle_angle, programme.altitude]),
        reference_frequency=REFERENCE_FREQUENCY,
    )
    states = len(STATES)
    work = max(work_size(tables.lpv), nonlinear.WORK_COUNT + 6 * states)
    scratch = Scratch(
        work=np.zeros(work),
        y=np.zeros(len(OUTPUTS)),
        xdot=np.zeros(states),
        path=np.zeros((3, 3)),
        motion=np.zeros(3),
        scheduled=np.zeros(1),
        flaps=np.zeros(3),
        margins=np.zeros(MARGIN_COUNT),
        shown=np.zeros(1 + MARGIN_COUNT),
        seen=np.zeros(states),
        target=np.zeros(TARGET_SIZE),
        command=np.zeros(3),
        hands=np.zeros(2),
        pilot=np.zeros(pilot_work_size(tables.pilot)),
        asked=np.zeros(3),
        planned=np.zeros(3),
        gust=np.zeros(3),
        sensors=np.zeros(SENSOR_COUNT),
        limited=np.zeros(3),
        law=np.zeros(WORK_SIZE),
    )
    return Parts(
        tables=tables,
        scratch=scratch,
        noise_width=noise_width(tables.pilot) if setup.pilot_noise else 0,
        database=database,
        database_hash=loaded.aircraft_hash,
        needed_aids=_needed_aids(setup, loaded),
        start_x=x,
        start_u=u,
    )


def _needed_aids(setup: FlightSetup, database: Database) -> tuple[SwitchName, ...]:
    needed: list[SwitchName] = []
    if setup.plant != "nonlinear" and not moves_flaps(database):
        needed.append("automatic_flaps")
    if setup.plant != "nonlinear" and not turns_rotors(database):
        needed.append("governor")
    for name, on in (("automatic_flaps", setup.automatic_flaps), ("governor", setup.governor)):
        if name in needed and not on:
            raise needed_aid_error(name)
    return tuple(needed)


def needed_aid_error(name: str) -> InputError:
    """The refusal to switch an aid off that the database needs.

    Args:
        name: The aid.
    """
    return InputError(
        "cannot be switched off: the database does not say what the aircraft does without it",
        key=name,
        value="off",
        allowed="on",
        mend=f"give the database the inputs {', '.join(AUXILIARY_INPUTS)} (docs/lpv.md), or fly the nonlinear plant",
    )


def start_state(setup: FlightSetup, parts: Parts, air_normals: FloatArray) -> SimulationState:
    """The state at frame 0: trimmed, filters at rest, the pilot engaged without a step.

    Args:
        setup: The flight.
        parts: Its parts.
        air_normals: Three standard normals: the turbulence at the start.
    """
    airspeed, nacelle, _ = _start(setup)
    clock = np.zeros(CLOCK_SIZE)
    clock[CLOCK_MODE] = MODE_MOCM if setup.pilot == "mocm" else MODE_EXTERNAL
    u = parts.start_u.copy()
    u[[place for place, variable in enumerate(INPUTS) if variable.role != "pilot"]] = 0.0
    state = SimulationState(
        x=parts.start_x.copy(),
        u=u,
        nacelle=new_actuator_state(nacelle),
        automatic=np.zeros(AUTOMATIC_STATE_SIZE),
        reference=np.array([airspeed, 0.0]),
        level=new_level_state(),
        pilot=np.zeros(pilot_state_size(parts.tables.pilot)),
        aids=np.zeros(AID_STATE_SIZE),
        switches=switches_of(setup.aids),
        flaps=np.zeros(FLAP_STATE_SIZE),
        drive=np.zeros(DRIVE_STATE_SIZE),
        gusts=new_gust_state(setup.air, air_normals),
        faults=new_fault_state(),
        protection=np.zeros(LAW_STATE_SIZE),
        clock=clock,
    )
    state.switches[AUTOMATIC_FLAPS], state.switches[GOVERNOR] = float(setup.automatic_flaps), float(setup.governor)
    state.flaps[FLAP_FOLLOWS], state.flaps[FLAP_SETTING] = 1.0, NO_SETTING
    state.drive[GOVERNED] = 1.0
    law_start(parts.tables.protection, state.protection)
    if setup.aids:
        state.aids[LAST_SWITCHES] = -1.0  # engaged in the first frame, from the trim
    kernels.disturb(parts.tables, state, parts.scratch, 0.0, np.zeros(3))
    row = np.zeros(len(COLUMN))
    observe(parts.tables, state, parts.scratch, row)
    kernels.engage_pilot(parts.tables, state, parts.scratch)
    return state


__all__ = ["FlightSetup", "Parts", "Plant", "build_parts", "needed_aid_error", "start_state"]
