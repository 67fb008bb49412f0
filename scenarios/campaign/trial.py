"""Flies trials: one flight plan, one protection law, one set of random numbers; the same for tests and campaigns."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rtsim.aircraft.condition import AircraftName
from rtsim.arrays import FloatArray
from rtsim.choices import BUILT_IN_PILOT, CorridorName, PlantName
from rtsim.errors import InputError
from rtsim.frame import SIGNAL_COUNT, history_sha256
from rtsim.loop.aircraft import database_of
from rtsim.loop.data import SimulationTables
from rtsim.loop.script_kernels import S_YIELDED
from rtsim.loop.setup import FlightSetup, build_parts, start_trim
from rtsim.loop.simulation import Simulation
from rtsim.lpv.flown import flown_database
from rtsim.measures.metrics import TrialMetrics, measured
from rtsim.protection.chain import LawChain, compiled_law
from rtsim.protection.laws import LawSpec

if TYPE_CHECKING:
    from rtsim.command import Pilot


TRIAL_CORRIDOR: CorridorName = "flight"
"""Corridor of trials that name none: laws keep to it and flights are judged by it, with a law and without."""
SLOW_CALLS = 10
"""Calls of a law in one flight that last longer than its period and are told; fewer are the machine's."""
BUFFERED = ("reverse_margin", "pass_margin", "blend_begin", "blend_full")
"""Margins of the built-in laws that a buffer is added to."""


@dataclass(frozen=True, slots=True)
class FlightPlan:
    """One flight as it is meant to go, whatever law is flown with it."""

    setup: FlightSetup
    """What flies, how and from where, with what its script does."""
    duration: float
    """Length of the flight [s]."""


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
    late: str = ""
    """Laws in Python that this machine would be too slow for in real time, as a sentence; nothing is judged by it."""

    @property
    def history_sha256(self) -> str:
        """Hash of the frame history."""
        return history_sha256([self.rows])


class Bench:
    """Flies trials; its history is written over by every flight."""

    def __init__(self) -> None:
        """Make room for a history when there is one."""
        self._rows = np.zeros((0, SIGNAL_COUNT))

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
        frames = max(1, int(np.ceil(plan.duration * plan.setup.options.rate_hz - 1e-6)))
        setup = _setup(plan, "monitor" if name is None else name, external=pilot is not None)
        parts = build_parts(setup)
        if buffer:
            parts = dataclasses.replace(parts, tables=_with_buffer(parts.tables, buffer))
        chain = None
        if name is None:
            assert not isinstance(law, str)  # a name is a compiled law
            chain = LawChain(law, dt=parts.tables.dt, remember=repeat, profile=parts.database.profile)
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
        late = "" if chain is None else _late(chain, law)
        yielded = bool(simulation.flying.state.script[S_YIELDED])
        numbers = measured(
            rows,
            setup.programme,
            simulation.dt,
            profile=parts.database.profile,
            ended=simulation.finished,
            yielded=yielded,
        )
        return TrialFlight(TrialMetrics(numbers), simulation.end_reason, rows.copy() if keep else rows, problems, late)


def _setup(plan: FlightPlan, law: str, *, external: bool) -> FlightSetup:
    """The plan with a law, flown by the built-in pilot or another, in the corridor that trials are judged by."""
    return plan.setup.with_options(
        pilot="external" if external else BUILT_IN_PILOT,
        protection=law,
        corridor=plan.setup.options.corridor or TRIAL_CORRIDOR,
    )


def _late(chain: LawChain, law: str | Sequence[LawSpec]) -> str:
    """Laws that would be late in real time, as a sentence; it changes nothing, since the next machine is another."""
    if chain.slow_calls < SLOW_CALLS:
        return ""
    names = law if isinstance(law, str) else ", ".join(spec.name for spec in law)
    late = f"used more CPU time than its period of {1000.0 * chain.period:.0f} ms in {chain.slow_calls} calls"
    return f"the law {names} {late}; in real time on this machine it would be late"


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


def has_trim(plant: PlantName, airspeed: float, nacelle: float, *, aircraft: AircraftName = "") -> bool:
    """Whether a flight can start somewhere.

    Args:
        plant: Aircraft model.
        aircraft: A database file, empty for the shipped XV-15, or a condition.
    """
    database = flown_database(database_of(aircraft), aircraft if isinstance(aircraft, str) else None)
    try:
        start_trim(plant == "nonlinear", database, airspeed, nacelle)
    except InputError:
        return False
    return True
