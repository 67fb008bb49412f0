"""What a flight is set up with, and the tables and start state that follow from it."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rtsim.aids import design_aids, switches_of
from rtsim.aids.aids_kernels import AID_STATE_SIZE, AUTOMATIC_FLAPS, GOVERNOR, LAST_SWITCHES
from rtsim.aircraft import INPUT, OUTPUTS, STATE, STATES, Condition
from rtsim.aircraft.xv15 import dynamics_kernels as nonlinear
from rtsim.aircraft.xv15.model import Xv15
from rtsim.atmosphere import CALM, AirSpecification
from rtsim.atmosphere.air import gust_tables, new_gust_state
from rtsim.choices import PlantName, SwitchName
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
from rtsim.loop.options import FlightOptions
from rtsim.loop.plant_kernels import AircraftFrame
from rtsim.lpv.aircraft import LpvAircraft
from rtsim.lpv.database import Database
from rtsim.lpv.files.storage import load_database
from rtsim.lpv.flown import flown_database, moves_flaps, turns_rotors
from rtsim.lpv.lpv_kernels import work_size
from rtsim.lpv.tables import Form, prepare_tables
from rtsim.lpv.variables import AUXILIARY_INPUTS
from rtsim.nacelle import load_nacelle_tables
from rtsim.nacelle.automatic import AutomaticNacelle, inactive_tables
from rtsim.nacelle.automatic_kernels import AUTOMATIC_STATE_SIZE
from rtsim.nacelle.nacelle_kernels import new_actuator_state
from rtsim.pilot.pilot_kernels import pilot_work_size
from rtsim.pilot.tables import load_pilot_tables, noise_width, pilot_state_size
from rtsim.programme import Programme, ProgrammePoint
from rtsim.protection.boundary import load_boundary
from rtsim.protection.chain import compiled_law
from rtsim.protection.law_data import LAW_STATE_SIZE, SENSOR_COUNT, WORK_SIZE
from rtsim.protection.law_kernels import law_start
from rtsim.protection.laws import load_laws
from rtsim.protection.tables import law_tables
from rtsim.systems import load_drive_tables, load_flap_tables
from rtsim.systems.drive_kernels import DRIVE_STATE_SIZE, GOVERNED
from rtsim.systems.flap_kernels import FLAP_FOLLOWS, FLAP_SETTING, FLAP_STATE_SIZE, NO_SETTING
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
    faults: tuple[Fault, ...] = ()
    """Failures and their times."""
    automatic_nacelle: AutomaticNacelle | None = None
    """Automatic nacelle control, which sets the nacelle rate whoever flies; None: the pilot does."""

    def with_options(self, **changes: Any) -> FlightSetup:
        """The setup with other options.

        Args:
            changes: Values by field of :class:`FlightOptions`, SI.
        """
        return dataclasses.replace(self, options=self.options.changed(changes))


@dataclass(frozen=True, slots=True)
class Parts:
    """Tables and work space of one simulation."""

    tables: SimulationTables
    """Parameters of the frame."""
    scratch: Scratch
    """Work space of the frame."""
    noise_width: int
    """Standard normals the pilot takes per frame; 0 with the noise off."""
    database_hash: str
    """Content hash of the database."""
    needed_aids: tuple[SwitchName, ...]
    """Aids that cannot be switched off: the database does not say what the aircraft does without them."""
    start_x: FloatArray = field(repr=False)
    """Trimmed state at the start."""
    start_u: FloatArray = field(repr=False)
    """Trimmed inputs at the start."""


def _start(setup: FlightSetup) -> tuple[float, float, float]:
    start = setup.programme.at(0.0) if setup.start is None else setup.start
    return start.airspeed, start.nacelle_angle, start.altitude


def build_parts(setup: FlightSetup) -> Parts:
    """Load database, gains and corridor, and trim at the start.

    Args:
        setup: The flight.

    Raises:
        InputError: The start has no trim.
    """
    options = setup.options
    loaded = load_database(options.database or None)
    database = flown_database(loaded, options.database or None)
    lpv_aircraft = LpvAircraft(database)
    nonlinear_aircraft = Xv15.load()
    airspeed, nacelle, altitude = _start(setup)
    if options.plant == "nonlinear":
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
        dt=1.0 / options.rate_hz,
        wind=float(options.wind),
        lpv=prepare_tables(database, PLANT_FORMS[options.plant]),
        aircraft=own if options.plant == "nonlinear" else AircraftFrame(own.configuration, own.controls),
        nacelle=load_nacelle_tables(),
        automatic=inactive_tables() if setup.automatic_nacelle is None else setup.automatic_nacelle.tables(),
        corridor=load_boundary(options.corridor_name, database).tables(),
        pilot=load_pilot_tables(database, options.outer_loop, dt=1.0 / options.rate_hz),
        flaps=load_flap_tables(own),
        drive=load_drive_tables(own),
        aids=design_aids(database),
        gusts=gust_tables(setup.air),
        faults=fault_tables(setup.faults),
        # Laws in Python are called from outside the compiled frame; the monitor still predicts in it.
        protection=law_tables(
            compiled_law(load_laws(options.protection)) or "monitor",
            database,
            dt=1.0 / options.rate_hz,
            boundary=options.corridor_name,
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
        noise_width=noise_width(tables.pilot) if options.pilot_noise else 0,
        database_hash=loaded.content_hash,
        needed_aids=_needed_aids(setup, loaded),
        start_x=x,
        start_u=u,
    )


def _needed_aids(setup: FlightSetup, database: Database) -> tuple[SwitchName, ...]:
    needed: list[SwitchName] = []
    if setup.options.plant != "nonlinear" and not moves_flaps(database):
        needed.append("automatic_flaps")
    if setup.options.plant != "nonlinear" and not turns_rotors(database):
        needed.append("governor")
    for name, on in (("automatic_flaps", setup.options.automatic_flaps), ("governor", setup.options.governor)):
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
    options = setup.options
    airspeed, nacelle, _ = _start(setup)
    clock = np.zeros(CLOCK_SIZE)
    clock[CLOCK_MODE] = MODE_MOCM if options.mocm_begins else MODE_EXTERNAL
    u = parts.start_u.copy()
    u[INPUT.nacelle_rate :] = 0.0
    state = SimulationState(
        x=parts.start_x.copy(),
        u=u,
        nacelle=new_actuator_state(nacelle),
        automatic=np.zeros(AUTOMATIC_STATE_SIZE),
        reference=np.array([airspeed, 0.0]),
        level=new_level_state(),
        pilot=np.zeros(pilot_state_size(parts.tables.pilot)),
        aids=np.zeros(AID_STATE_SIZE),
        switches=switches_of(options.aids),
        flaps=np.zeros(FLAP_STATE_SIZE),
        drive=np.zeros(DRIVE_STATE_SIZE),
        gusts=new_gust_state(setup.air, air_normals),
        faults=new_fault_state(),
        protection=np.zeros(LAW_STATE_SIZE),
        clock=clock,
    )
    state.switches[AUTOMATIC_FLAPS], state.switches[GOVERNOR] = float(options.automatic_flaps), float(options.governor)
    state.flaps[FLAP_FOLLOWS], state.flaps[FLAP_SETTING] = 1.0, NO_SETTING
    state.drive[GOVERNED] = 1.0
    law_start(parts.tables.protection, state.protection)
    if options.aids:
        state.aids[LAST_SWITCHES] = -1.0  # engaged in the first frame, from the trim
    kernels.disturb(parts.tables, state, parts.scratch, 0.0, np.zeros(3))
    row = np.zeros(len(COLUMN))
    observe(parts.tables, state, parts.scratch, row)
    kernels.engage_pilot(parts.tables, state, parts.scratch)
    return state


__all__ = ["FlightSetup", "Parts", "build_parts", "needed_aid_error", "start_state"]
