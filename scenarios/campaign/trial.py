"""Flies trials: one flight plan, one protection law, one set of random numbers; the same for tests and campaigns."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from rtsim.atmosphere import AirSpecification
from rtsim.errors import InputError
from rtsim.faults import Fault
from rtsim.frame import SIGNAL_COUNT, FloatArray, history_sha256
from rtsim.loop.data import SimulationTables
from rtsim.loop.script import Pulse
from rtsim.loop.script_kernels import S_YIELDED
from rtsim.loop.setup import FlightSetup, Plant, build_parts, start_trim
from rtsim.loop.simulation import Simulation
from rtsim.lpv.files.storage import load_database
from rtsim.lpv.flown import flown_database
from rtsim.measures.trial_metrics import TORQUE_EXCESS, TrialMetrics
from rtsim.programme import Programme, ProgrammePoint
from rtsim.protection.boundary import BoundaryName
from rtsim.protection.chain import LawChain, compiled_law
from rtsim.protection.laws import LawSpec
from rtsim.protection.limits import load_limits
from rtsim.units import to_deg
from scenarios.campaign import trial_kernels as kernels

if TYPE_CHECKING:
    from rtsim.command import Pilot


BUFFERED = ("reverse_margin", "pass_margin", "blend_begin", "blend_full")
"""Margins of the built-in laws that a buffer is added to."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightPlan:
    """One flight as it is meant to go, without a law. SI and radians."""

    programme: Programme
    """What the pilot is asked to do."""
    start: ProgrammePoint
    """Trimmed condition at frame 0."""
    duration: float
    """Length of the flight [s]."""
    pulses: tuple[Pulse, ...] = ()
    """What the script does to the controls."""
    reaction: float | None = None
    """A pilot who yields: how long a warning lasts before he gives up his plan [s]; None: he never does."""
    air: AirSpecification = field(default_factory=AirSpecification)
    """Gusts and turbulence."""
    faults: tuple[Fault, ...] = ()
    """Failures."""
    wind: float = 0.0
    """Steady tailwind [m/s]."""
    pilot_noise: bool = False
    """Noise of the built-in pilot."""
    outer_loop: Literal["integrators", "pi"] = "integrators"
    """How the built-in pilot holds airspeed and altitude."""
    automatic_flaps: bool = True
    """Whether the flaps follow their schedule."""
    governor: bool = True
    """Whether the governor holds the rotor speed."""
    seed: int = 0
    """Root of the flight's random streams."""


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
    """Flies trials of one aircraft against one corridor; loads everything once."""

    def __init__(
        self,
        *,
        plant: Plant = "lpv",
        corridor: BoundaryName = "flight",
        rate_hz: int = 250,
        database: str = "",
    ) -> None:
        """Remember what to fly; parts are loaded with the first flight.

        Args:
            plant: Aircraft model.
            corridor: Boundaries that laws keep to and flights are judged by.
            rate_hz: Frames per second.
            database: LPV database of the aircraft, a file; empty: the shipped XV-15.

        Raises:
            InputError: The database is missing or cannot be used.
        """
        self.plant, self.corridor, self.rate_hz, self.database = plant, corridor, rate_hz, database
        self._aircraft = load_database(database or None)
        self._rows = np.zeros((0, SIGNAL_COUNT))
        limits = load_limits(self._aircraft.profile)
        self._limits = kernels.TrialLimits(float(to_deg(limits.flapping)), limits.torque, TORQUE_EXCESS)

    @property
    def aircraft_hash(self) -> str:
        """Hash of the aircraft's database and profile."""
        return self._aircraft.aircraft_hash

    @property
    def dt(self) -> float:
        """Length of a frame [s]."""
        return 1.0 / self.rate_hz

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
        name = law if isinstance(law, str) else compiled_law(law)
        frames = max(1, int(np.ceil(plan.duration * self.rate_hz - 1e-6)))
        setup = self._setup(plan, "monitor" if name is None else name, external=pilot is not None)
        parts = build_parts(setup)
        if buffer:
            parts = dataclasses.replace(parts, tables=_with_buffer(parts.tables, buffer))
        chain = None
        if name is None:
            assert not isinstance(law, str)  # a name is a compiled law
            chain = LawChain(law, dt=self.dt, remember=repeat, profile=self._aircraft.profile)
        simulation = Simulation(setup, parts=parts, laws=chain)
        if len(self._rows) < frames:
            self._rows = np.empty((frames, SIGNAL_COUNT))
        if pilot is None:
            rows = simulation.run(frames, self._rows)
        else:
            rows = _fly_by_hand(simulation, pilot, self._rows[:frames])
        if chain is not None and repeat:
            chain.unrepeatable()
        problems = () if chain is None else tuple(event.text for event in chain.events)
        metrics = np.zeros(kernels.METRIC_COUNT)
        kernels.measure_trial(rows, simulation.tables.programme, self._limits, self.dt, metrics)
        metrics[kernels.M_COMPLETED] = float(not simulation.finished)
        metrics[kernels.M_YIELDED] = simulation.flying.state.script[S_YIELDED]
        return TrialFlight(TrialMetrics(metrics), simulation.end_reason, rows.copy() if keep else rows, problems)

    def _setup(self, plan: FlightPlan, law: str, *, external: bool) -> FlightSetup:
        """What the simulation needs to know of a plan."""
        return FlightSetup(
            programme=plan.programme,
            plant=self.plant,
            outer_loop=plan.outer_loop,
            pilot="external" if external else "mocm",
            corridor=self.corridor,
            protection=law,
            protection_boundary=self.corridor,
            rate_hz=self.rate_hz,
            start_airspeed=plan.start.airspeed,
            start_nacelle=plan.start.nacelle_angle,
            start_altitude=plan.start.altitude,
            wind=plan.wind,
            seed=plan.seed,
            pilot_noise=plan.pilot_noise,
            automatic_flaps=plan.automatic_flaps,
            governor=plan.governor,
            air=plan.air,
            faults=plan.faults,
            pulses=plan.pulses,
            reaction=plan.reaction,
            database=self.database,
        )


def _with_buffer(tables: SimulationTables, buffer: float) -> SimulationTables:
    """The same flight with a law that begins to act earlier."""
    law = tables.protection
    earlier = {name: getattr(law.settings, name) + buffer for name in BUFFERED}
    return tables._replace(protection=law._replace(settings=law.settings._replace(**earlier)))


def _fly_by_hand(simulation: Simulation, pilot: Pilot, rows: FloatArray) -> FloatArray:
    """Fly with a pilot written in Python."""
    flown = 0
    while flown < len(rows) and not simulation.finished:
        command = pilot.step(simulation.sensors(), simulation.reference(), simulation.dt)
        rows[flown] = simulation.step(command, scripted=True)
        flown += 1
    return rows[:flown]


def has_trim(plant: Plant, airspeed: float, nacelle: float, *, database: str = "") -> bool:
    """Whether a flight can start somewhere.

    Args:
        plant: Aircraft model.
        airspeed: Airspeed [m/s].
        nacelle: Nacelle angle [rad].
        database: LPV database of the aircraft, a file; empty: the shipped XV-15.
    """
    aircraft = flown_database(load_database(database or None), database or None)
    try:
        start_trim(plant == "nonlinear", aircraft, airspeed, nacelle)
    except InputError:
        return False
    return True
