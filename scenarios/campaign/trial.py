"""Flies trials: one flight plan, one protection law, one set of random numbers; the same for tests and campaigns."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rtsim.aircraft.variables import STATE
from rtsim.atmosphere.air import gust_tables, normals_needed
from rtsim.choices import BUILT_IN_PILOT, CorridorName, PlantName
from rtsim.errors import InputError
from rtsim.faults.schedule import fault_tables
from rtsim.frame import SIGNAL_COUNT, FloatArray, history_sha256
from rtsim.loop.data import (
    CLOCK_END,
    CLOCK_SINK,
    END_NONE,
    Scratch,
    SimulationState,
    SimulationTables,
)
from rtsim.loop.options import FlightOptions
from rtsim.loop.setup import FlightSetup, Parts, build_parts, start_state
from rtsim.loop.simulation import END_REASONS
from rtsim.measures.trial_metrics import TORQUE_EXCESS, TrialMetrics
from rtsim.nacelle.automatic import inactive_tables
from rtsim.programme import Programme
from rtsim.protection import law_data
from rtsim.protection.chain import LawChain, compiled_law
from rtsim.protection.laws import LawSpec
from rtsim.protection.limits import load_limits
from rtsim.protection.tables import law_tables
from rtsim.random_streams import STREAM_PILOT, STREAM_TURBULENCE, stream_generator
from rtsim.units import to_deg, to_kt
from scenarios.campaign import trial_kernels as kernels
from scenarios.files import script_kernels
from scenarios.files.script import Pulse, pulse_table

if TYPE_CHECKING:
    from rtsim.command import Pilot


MOST_PARTS = 8
"""Sets of options whose tables a bench keeps."""
SLOW_CALLS = 10
"""Calls of a law in one flight that last longer than its period and count as a failure; fewer are the machine's."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightPlan:
    """One flight as it is meant to go, and what its script does. SI and radians."""

    setup: FlightSetup
    """What flies, how and from where; model, corridor, rate, pilot and law are those of the bench."""
    duration: float
    """Length of the flight [s]."""
    pulses: tuple[Pulse, ...] = ()
    """What the script does to the controls."""
    reaction: float | None = None
    """A pilot who yields: how long a warning lasts before he gives up his plan [s]; None: he never does."""


@dataclass(frozen=True, slots=True)
class TrialFlight:
    """One flown trial."""

    metrics: TrialMetrics
    """What it is judged by."""
    end_reason: str
    """Why it ended by itself, or empty."""
    rows: FloatArray
    """Frame history; a view that the next flight of the same bench overwrites unless it was asked to be kept."""
    law_problems: tuple[str, ...] = ()
    """What went wrong in laws written in Python, as sentences."""

    @property
    def history_sha256(self) -> str:
        """Hash of the frame history."""
        return history_sha256([self.rows])


class Bench:
    """Flies trials of one plant against one corridor; loads everything once."""

    def __init__(
        self,
        *,
        plant: PlantName = "lpv",
        corridor: CorridorName = "flight",
        rate_hz: int = 250,
    ) -> None:
        """Remember what to fly; parts are loaded with the first flight.

        Args:
            plant: Aircraft model.
            corridor: Boundaries that laws keep to and flights are judged by.
            rate_hz: Frames per second.
        """
        self.plant, self.corridor, self.rate_hz = plant, corridor, rate_hz
        self._parts: dict[FlightOptions, Parts] = {}
        self._laws: dict[tuple[str, float, str], law_data.ProtectionTables] = {}
        self._rows = np.zeros((0, SIGNAL_COUNT))
        limits = load_limits()
        self._limits = kernels.TrialLimits(float(to_deg(limits.flapping)), limits.torque, TORQUE_EXCESS)

    @property
    def dt(self) -> float:
        """Length of a frame [s]."""
        return 1.0 / self.rate_hz

    def law(self, name: str, *, buffer: float = 0.0, database: str = "") -> law_data.ProtectionTables:
        """Give the tables of a built-in law.

        Args:
            name: One of ``rtsim.protection.tables.LAW_NAMES``.
            buffer: Added to the margins at which governor and recovery begin to act [m/s].
            database: LPV database it predicts with, a file; empty: the shipped XV-15.
        """
        key = (name, buffer, database)
        if key not in self._laws:
            from rtsim.lpv.files.storage import load_database
            from rtsim.lpv.flown import flown_database

            flown = flown_database(load_database(database or None), database or None)
            tables = law_tables(name, flown, dt=self.dt, boundary=self.corridor)
            settings = tables.settings
            self._laws[key] = tables._replace(
                settings=settings._replace(
                    reverse_margin=settings.reverse_margin + buffer,
                    pass_margin=settings.pass_margin + buffer,
                    blend_begin=settings.blend_begin + buffer,
                    blend_full=settings.blend_full + buffer,
                )
            )
        return self._laws[key]

    def fly(
        self,
        plan: FlightPlan,
        law: str | Sequence[LawSpec],
        *,
        buffer: float = 0.0,
        keep: bool = False,
        pilot: Pilot | None = None,
        repeat: bool = False,
    ) -> TrialFlight:
        """Fly a plan with a law.

        Args:
            plan: The flight.
            law: A built-in law by name, or a chain of laws as ``rtsim.protection.laws.load_laws`` finds it.
            buffer: Added to the margins at which a built-in law begins to act [m/s].
            keep: Give the history arrays of their own.
            pilot: A pilot written in Python instead of the built-in one.
            repeat: Ask laws written in Python everything twice, to find those that keep state outside themselves.

        Returns:
            The flight.

        Raises:
            InputError: The plan's start has no trim, or there is no such law.
        """
        from scenarios.campaign.python_trial import fly_in_python

        name = law if isinstance(law, str) else compiled_law(law)
        # Laws in Python stand in the compiled law's place.
        tables = self.law("off" if name is None else name, buffer=buffer, database=plan.setup.options.database)
        flying = self._prepare(plan, tables, external=pilot is not None)
        problems: tuple[str, ...] = ()
        if name is not None:
            flown = self._fly_compiled(flying) if pilot is None else fly_in_python(flying, None, pilot)[0]
        else:
            assert not isinstance(law, str)  # a name is a compiled law
            chain = LawChain(law, dt=self.dt, remember=repeat)
            flown, slow = fly_in_python(flying, chain, pilot)
            if repeat:
                chain.unrepeatable()
            problems = tuple(event.text for event in chain.events)
            if slow >= SLOW_CALLS:
                names = ", ".join(spec.name for spec in law)
                period = 1000.0 * chain.period
                late = f"took longer than its period of {period:.0f} ms in {slow} calls; in real time it would be late"
                problems += (f"the law {names} {late}",)
        metrics = np.zeros(kernels.METRIC_COUNT)
        rows = flying.rows[:flown]
        kernels.measure_trial(rows, flying.tables.programme, self._limits, self.dt, metrics)
        ended = int(flying.state.clock[CLOCK_END])
        metrics[kernels.M_COMPLETED] = float(ended == END_NONE)
        metrics[kernels.M_YIELDED] = flying.script_state[script_kernels.S_YIELDED]
        reason = END_REASONS[ended].format(sink=float(flying.state.clock[CLOCK_SINK]))
        return TrialFlight(TrialMetrics(metrics), reason, rows.copy() if keep else rows, problems)

    def _fly_compiled(self, flying: Flying) -> int:
        return int(
            kernels.fly_trial(
                flying.tables,
                flying.state,
                flying.scratch,
                (flying.pulses, flying.script_state),
                flying.reaction,
                flying.noise,
                flying.rows,
            )
        )

    def _prepare(self, plan: FlightPlan, law: law_data.ProtectionTables, *, external: bool) -> Flying:
        """Put the aircraft at the plan's start and draw its random numbers."""
        frames = max(1, int(np.ceil(plan.duration * self.rate_hz - 1e-6)))
        setup = plan.setup.with_options(
            plant=self.plant,
            pilot="external" if external else BUILT_IN_PILOT,
            corridor=self.corridor,
            protection="off",
            rate_hz=self.rate_hz,
        )
        parts = self._parts_of(setup, law)
        pilot_random = stream_generator(setup.options.seed, STREAM_PILOT)
        air_random = stream_generator(setup.options.seed, STREAM_TURBULENCE)
        state = start_state(setup, parts, air_random.standard_normal(3))
        script_state = np.zeros(script_kernels.SCRIPT_STATE_SIZE)
        script_kernels.script_start(script_state)
        if len(self._rows) < frames:
            self._rows = np.zeros((frames, SIGNAL_COUNT))
        return Flying(
            tables=parts.tables,
            state=state,
            scratch=parts.scratch,
            pulses=pulse_table(plan.pulses),
            script_state=script_state,
            reaction=-1.0 if plan.reaction is None else plan.reaction,
            noise=(
                pilot_random.standard_normal((frames, parts.noise_width)),
                air_random.standard_normal((frames, normals_needed(state.gusts))),
            ),
            rows=self._rows[:frames],
            programme=setup.programme,
        )

    def _parts_of(self, setup: FlightSetup, law: law_data.ProtectionTables) -> Parts:
        """Tables of a flight: the costly ones are loaded once and shared, the start is trimmed anew."""
        options = setup.options
        key = dataclasses.replace(options, seed=0, wind=0.0)  # these two are each flight's own
        if key not in self._parts and len(self._parts) >= MOST_PARTS:
            self._parts.clear()
        if key not in self._parts:
            self._parts[key] = build_parts(setup)
        parts = self._parts[key]
        programme = setup.programme
        start = programme.at(0.0) if setup.start is None else setup.start
        x, u = _trim(options.plant, start.airspeed, start.nacelle_angle, options.database)
        x = x.copy()
        x[STATE.altitude] = start.altitude
        points = np.array([programme.time, programme.airspeed, programme.nacelle_angle, programme.altitude])
        tables = parts.tables._replace(
            wind=float(options.wind),
            automatic=inactive_tables() if setup.automatic_nacelle is None else setup.automatic_nacelle.tables(),
            gusts=gust_tables(setup.air),
            faults=fault_tables(setup.faults),
            protection=law,
            programme=points,
        )
        return dataclasses.replace(parts, tables=tables, start_x=x, start_u=u)


@dataclass(frozen=True, slots=True)
class Flying:
    """Everything of one flight that is about to be flown."""

    tables: SimulationTables
    """The simulation."""
    state: SimulationState
    """Its state at the start."""
    scratch: Scratch
    """Its work space."""
    pulses: FloatArray
    """The script."""
    script_state: FloatArray
    """State of the script."""
    reaction: float
    """Reaction time of a pilot who yields [s]; negative for one who does not."""
    noise: tuple[FloatArray, FloatArray]
    """Standard normals of pilot and air."""
    rows: FloatArray
    """To be written: frame rows."""
    programme: Programme
    """What the pilot is asked to do."""


@functools.lru_cache(maxsize=8)
def _trim(plant: PlantName, airspeed: float, nacelle: float, database: str = "") -> tuple[FloatArray, FloatArray]:
    """Trimmed state and inputs at a start, altitude 0; kept, since a twin starts like its flight."""
    from rtsim.aircraft import Condition
    from rtsim.aircraft.xv15.model import Xv15
    from rtsim.lpv.aircraft import load_aircraft

    if plant == "nonlinear":
        trim = Xv15.load().trim(Condition(airspeed=airspeed, nacelle_angle=nacelle))
        converged, x, u = trim.converged, trim.x, trim.u
    else:
        point = load_aircraft(database or None).trim(airspeed=airspeed, nacelle=nacelle)
        converged, x, u = point.converged, point.x, point.u
    if not converged:
        raise InputError(
            "the aircraft has no level-flight trim there",
            key="start",
            value=f"{to_kt(airspeed):.1f} kn at nacelle {to_deg(nacelle):.1f} deg",
            mend="start inside the conversion corridor (rtsim corridor shows it)",
        )
    return x.copy(), u.copy()


def has_trim(plant: PlantName, airspeed: float, nacelle: float) -> bool:
    """Whether a flight can start somewhere.

    Args:
        plant: Aircraft model.
        airspeed: Airspeed [m/s].
        nacelle: Nacelle angle [rad].
    """
    try:
        _trim(plant, airspeed, nacelle)
    except InputError:
        return False
    return True
