"""The work of a campaign in pieces: each a few runs of one class under every law, the same wherever it is done."""

from __future__ import annotations

import functools
import hashlib
import importlib
import inspect
import logging
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import numpy as np

from rtsim.aircraft.condition import AircraftName
from rtsim.arrays import FloatArray
from rtsim.choices import CorridorName
from rtsim.cluster.identity import found_or_told
from rtsim.errors import InputError
from rtsim.loop.options import FlightOptions
from rtsim.lpv.files.storage import load_database
from rtsim.measures.metric_kernels import VALUE
from rtsim.properties.formula import Flown, Property, parse_property
from rtsim.protection.laws import LawSpec, load_laws
from rtsim.protection.tables import LAW_NAMES
from rtsim.units import kt
from scenarios.campaign.draws import draw_plan
from scenarios.campaign.spec import CampaignFile, parse_campaign
from scenarios.campaign.trial import TRIAL_CORRIDOR, Bench, FlightPlan, TrialFlight

CHUNK_RUNS = 10
"""Runs of one class in a piece of work; not to be changed within a campaign, since pieces are what is kept."""


@dataclass(frozen=True, slots=True)
class LawVariant:
    """A law as a campaign flies it."""

    name: str
    """Built-in law, ``MODULE:CLASS``, entry point, or several separated by commas."""
    buffer_kt: float = 0.0
    """Added to the margins at which a built-in law begins to act [kn]."""

    @property
    def label(self) -> str:
        """How it is called in tables: the name, with the buffer where there is one."""
        return self.name if self.buffer_kt == 0.0 else f"{self.name}@{self.buffer_kt:+g}kt"

    @property
    def compiled(self) -> bool:
        """Whether it is one of rtsim's own laws."""
        return self.name in LAW_NAMES


@dataclass(frozen=True, slots=True)
class Task:
    """What a worker needs to know to do its share; small and picklable."""

    text: str
    """The campaign file."""
    file: str
    """Where it came from."""
    laws: tuple[LawVariant, ...]
    """Laws, each flown on every run."""
    seed: int
    """The campaign's seed."""
    options: FlightOptions
    """What all flights have in common."""
    folder: str = ""
    """Where modules of laws are looked for besides the installed ones."""
    aircraft_hash: str = ""
    """Hash of the aircraft, which a worker must have too."""
    properties: tuple[str, ...] = ()
    """Formulas that every flight is asked."""


@dataclass(frozen=True, slots=True)
class Chunk:
    """One piece of work."""

    class_number: int
    """Place of the class in the campaign."""
    first: int
    """First run."""
    count: int
    """Runs."""


@dataclass(frozen=True, slots=True, eq=False)
class ChunkResult:
    """What came of a piece of work."""

    chunk: Chunk
    """The piece."""
    metrics: FloatArray
    """Metrics of every flight, shape (runs, laws, VALUE.size)."""
    robustness: FloatArray
    """Of every flight in every property, shape (runs, laws, properties)."""
    problems: tuple[tuple[int, int, str], ...]
    """What went wrong in laws: run, law, sentence."""
    seconds: FloatArray
    """CPU time of the flights by law, shape (laws,) [s]."""


def plan_chunks(spec: CampaignFile, runs: int | None) -> list[Chunk]:
    """Cut a campaign into pieces, class after class in turn, so that a beginning holds flights of every class.

    Args:
        spec: The campaign.
        runs: Runs of every class; None: what the file says.
    """
    counts = [runs or item.runs or spec.runs for item in spec.classes]
    found = []
    for first in range(0, max(counts), CHUNK_RUNS):
        found += [
            Chunk(number, first, min(CHUNK_RUNS, count - first)) for number, count in enumerate(counts) if first < count
        ]
    return found


def fly_chunk(task: Task, chunk: Chunk) -> ChunkResult:
    """Fly one piece of a campaign.

    Args:
        task: The campaign.
        chunk: The piece.

    Raises:
        InputError: This worker has another aircraft.
    """
    spec = task_spec(task.text, task.file)
    refuse_another(task)
    bench = Bench()
    properties = [parse_property(formula) for formula in task.properties]
    metrics = np.zeros((chunk.count, len(task.laws), VALUE.size))
    robustness = np.zeros((chunk.count, len(task.laws), len(properties)))
    seconds = np.zeros(len(task.laws))
    problems: list[tuple[int, int, str]] = []
    for k in range(chunk.count):
        run = chunk.first + k
        plan = draw_plan(spec, seed=task.seed, class_number=chunk.class_number, run=run, options=task.options)
        twin = twin_of(bench, plan, properties)
        for number, law in enumerate(task.laws):
            begin = time.process_time()
            # The first run of every class asks laws in Python everything twice.
            flight = fly_law(bench, plan, law, folder=task.folder, repeat=run == 0)
            seconds[number] += time.process_time() - begin
            metrics[k, number] = flight.metrics.numbers
            flown, dt = flown_of(flight), 1.0 / plan.setup.options.rate_hz
            robustness[k, number] = [one.robustness(flown, dt, twin).value for one in properties]
            problems += [(run, number, text) for text in flight.law_problems]
    return ChunkResult(chunk, metrics, robustness, tuple(problems), seconds)


def flown_of(flight: TrialFlight) -> Flown:
    """A flight as properties see it."""
    return Flown(flight.rows, flight.metrics.numbers)


def twin_of(bench: Bench, plan: FlightPlan, properties: Sequence[Property]) -> Flown | None:
    """The flight without a law, where a property speaks of it.

    Args:
        bench: What flies.
        plan: The flight.
        properties: What is asked of it.
    """
    asked = any(one.needs_twin for one in properties)
    return flown_of(bench.fly(plan, "off", keep=True)) if asked else None


def fly_law(
    bench: Bench, plan: FlightPlan, law: LawVariant, *, folder: str = "", repeat: bool = False, keep: bool = False
) -> TrialFlight:
    """Fly one plan with one law; a law that cannot even be made is reported, and nothing acts in its place.

    Args:
        bench: What flies.
        plan: The flight.
        law: The law.
        folder: Where modules of laws are looked for besides the installed ones.
        repeat: Ask laws in Python everything twice.
        keep: Give the history arrays of their own.
    """
    if law.compiled:
        return bench.fly(plan, law.name, buffer=kt(law.buffer_kt), keep=keep)
    try:
        options = plan.setup.options
        laws = _python_laws(law.name, folder, options.corridor or TRIAL_CORRIDOR, options.aircraft)
        return bench.fly(plan, laws, repeat=repeat, keep=keep)
    except InputError as error:
        flight = bench.fly(plan, "off", keep=keep)
        return TrialFlight(flight.metrics, flight.end_reason, flight.rows, (str(error).rstrip("."),))


def law_chain(
    name: str, folder: str, boundary: CorridorName = "flight", aircraft: AircraftName = ""
) -> Sequence[LawSpec]:
    """Find a law, or several separated by commas.

    Args:
        name: What the user wrote.
        folder: Where modules are looked for besides the installed ones.
        boundary: Corridor that built-in laws of a chain keep to.
        aircraft: What they know: a database file, empty for the shipped XV-15, or a condition.

    Raises:
        InputError: There is no such law.
    """
    import sys

    if folder and folder not in sys.path:
        sys.path.append(folder)
    return load_laws(name, boundary=boundary, aircraft=aircraft)


@functools.lru_cache(maxsize=8)
def _python_laws(name: str, folder: str, boundary: CorridorName, aircraft: AircraftName) -> Sequence[LawSpec]:
    return law_chain(name, folder, boundary, aircraft)


def law_code(task: Task) -> dict[str, str]:
    """Hash of the modules of laws written in Python, as they were loaded: a changed law is another law.

    Args:
        task: The campaign.

    Raises:
        InputError: There is no such law.
    """
    found = {}
    for law in task.laws:
        if law.compiled:
            continue
        law_chain(law.name, task.folder)
        for part in law.name.split(","):
            if ":" in part:
                found[part.strip()] = _code_hash(importlib.import_module(part.strip().partition(":")[0]))
    return found


@functools.cache
def _code_hash(module: ModuleType) -> str:
    """Of a module as it was when it was first asked for: what its file says later is not what flies."""
    return hashlib.sha256(inspect.getsource(module).encode()).hexdigest()


def task_identity(task: Task) -> dict[str, str]:
    """What a campaign needs to be the same wherever it is flown, besides rtsim: its aircraft and its laws.

    Args:
        task: The campaign.
    """
    # Looked up, never built: a cluster's worker that builds for minutes would be given up meanwhile.
    found = {"database": found_or_told(lambda: load_database(task.options.aircraft or None).aircraft_hash)}
    try:
        return found | {f"law {name}": code for name, code in law_code(task).items()}
    except InputError as error:
        return found | {"laws": str(error).rstrip(".")}


@functools.lru_cache(maxsize=4)
def task_spec(text: str, file: str) -> CampaignFile:
    """Read the campaign of a task, once in every process.

    Args:
        text: The campaign file.
        file: Where it came from.
    """
    spec, problems = parse_campaign(text, file=file)
    if spec is None:
        raise problems[0]
    return spec


def refuse_another(task: Task) -> None:
    """Refuse to fly where the aircraft is another than the campaign's.

    Args:
        task: The campaign.

    Raises:
        InputError: It is another.
    """
    log = logging.getLogger("rtsim.lpv.files.storage")
    level = log.level
    log.setLevel(logging.ERROR)  # what the aircraft borrows was said where the campaign was started
    try:
        present = load_database(task.options.aircraft or None).aircraft_hash
    finally:
        log.setLevel(level)
    if task.aircraft_hash != present:
        raise InputError(
            "a worker has another aircraft than the campaign",
            file=task.options.database or None,
            key="database",
            value=present[:12],
            allowed=task.aircraft_hash[:12],
            mend="give every worker the same database, profile and version of rtsim",
        )


def present_folder() -> str:
    """The folder a user works in, whose modules workers on this machine may need too."""
    return str(Path.cwd())
