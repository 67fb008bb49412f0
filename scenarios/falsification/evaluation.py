"""Flies points and asks the properties of them; the same wherever it is done."""

from __future__ import annotations

import functools
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN
from rtsim.properties.formula import Property, parse_property
from scenarios.campaign.chunks import Task, flown_of, fly_law, refuse_another, task_spec, twin_of
from scenarios.campaign.draws import NoStart
from scenarios.campaign.spec import CampaignFile
from scenarios.campaign.trial import Bench
from scenarios.falsification.space import ClassSpace, class_spaces

NACELLE_STEP_DEG, AIRSPEED_STEP_KT = 5.0, 10.0
"""Size of a cell of the corridor in the account of what was flown."""
NEAR_KT = 20.0
"""Margin below which a flight is near a side of the corridor [kn]."""
NACELLES, NEAR_NACELLE_DEG = 37, 2.5
"""Nacelle angles that differ by more are another situation."""
QUARTERS = 4
"""Parts of a flight, each another situation."""
SITUATIONS = 2 * QUARTERS * NACELLES
"""Side, part of the flight, nacelle angle."""
_DEEPEST_KT, _STEPS_PER_KT, _NOWHERE = -10.0, 8.0, 255
"""Least margin that is told from a smaller one [kn], steps of the account, and its word for not near."""
NACELLE_CELLS, AIRSPEED_CELLS = 19, 26
"""Cells from 0 to 90 deg, and from 0 to 260 kn."""


@dataclass(frozen=True, slots=True, eq=False)
class Query:
    """One point to fly."""

    class_number: int
    """Its class."""
    vector: FloatArray
    """Its place in the class's cube."""


@dataclass(frozen=True, slots=True, eq=False)
class Answer:
    """What came of a point."""

    robustness: FloatArray
    """By property; inf where there is no such flight, since its start has no trim or lies outside."""
    guidance: FloatArray
    """What a search goes down by: the robustness where it is broken, else that of the flight after its start."""
    flights: int
    """Flights flown for it: 0, 1, or 2 with the twin."""
    nacelle_deg: float
    """Where the corridor's margin was least."""
    airspeed_kt: float
    """Where the corridor's margin was least."""
    time_s: float
    """When the corridor's margin was least."""
    cells: bytes
    """Cells of the corridor that were flown through, a bit for each."""
    nearest: bytes
    """Least margin in every situation near a side of the corridor that the flight was in; see :func:`margins_of`."""
    problem: str
    """What the law did wrong by itself; empty where it ran."""
    seconds: float
    """CPU time [s]."""


class Flyer(Protocol):
    """Flies points, here or elsewhere, and gives the answers in their order."""

    def __call__(self, queries: Sequence[Query]) -> list[Answer]:
        """Fly.

        Args:
            queries: The points.
        """
        ...


def fly_points(task: Task, queries: Sequence[Query]) -> list[Answer]:
    """Fly points.

    Args:
        task: What flies and what is asked of it; the first law is the one under test.
        queries: The points.

    Raises:
        InputError: This worker has another aircraft.
    """
    refuse_another(task)
    spec = task_spec(task.text, task.file)
    spaces = _spaces(task.text, task.file)
    read = [parse_property(formula) for formula in task.properties]
    bench = Bench()
    return [_fly(task, spaces[query.class_number], spec, read, query, bench) for query in queries]


@functools.lru_cache(maxsize=4)
def _spaces(text: str, file: str) -> list[ClassSpace]:
    return class_spaces(task_spec(text, file))


def _fly(
    task: Task,
    space: ClassSpace,
    spec: CampaignFile,
    properties: Sequence[Property],
    query: Query,
    bench: Bench,
) -> Answer:
    begin = time.process_time()
    try:
        plan = space.plan(spec, query.vector, task.options)
    except NoStart:
        nothing = np.full(len(properties), np.inf)
        return Answer(nothing, nothing, 0, 0.0, 0.0, 0.0, b"", b"", "", time.process_time() - begin)
    twin = twin_of(bench, plan, properties)
    flight = fly_law(bench, plan, task.laws[0], folder=task.folder)
    dt = 1.0 / plan.setup.options.rate_hz
    flown = flown_of(flight)
    found = [one.robustness(flown, dt, twin) for one in properties]
    rows = flight.rows
    least = int(np.argmin(rows[:, COLUMN.margin_kt]))
    row = rows[least]
    return Answer(
        robustness=np.array([one.value for one in found]),
        guidance=np.array([one.value if one.broken else max(one.later, one.value) for one in found]),
        flights=1 if twin is None else 2,
        nacelle_deg=float(row[COLUMN.nacelle_deg]),
        airspeed_kt=float(row[COLUMN.airspeed_kt]),
        time_s=float(row[COLUMN.time_s]),
        cells=cells_of(rows),
        nearest=nearest_of(rows, plan.duration),
        problem="; ".join(flight.law_problems),
        seconds=time.process_time() - begin,
    )


def cells_of(rows: FloatArray) -> bytes:
    """Cells of the corridor that a flight went through, one bit each, nacelle by nacelle.

    Args:
        rows: Its history.
    """
    nacelle = np.clip(np.rint(rows[:, COLUMN.nacelle_deg] / NACELLE_STEP_DEG), 0, NACELLE_CELLS - 1)
    airspeed = np.clip(rows[:, COLUMN.airspeed_kt] // AIRSPEED_STEP_KT, 0, AIRSPEED_CELLS - 1)
    seen = np.zeros((NACELLE_CELLS, AIRSPEED_CELLS), dtype=np.bool_)
    seen[nacelle.astype(np.int64), airspeed.astype(np.int64)] = True
    return np.packbits(seen).tobytes()


def nearest_of(rows: FloatArray, duration: float) -> bytes:
    """How near a flight came to each side of the corridor in every part of the flight and at every nacelle angle.

    Args:
        rows: Its history.
        duration: Length of the whole flight [s].

    Returns:
        A byte for each situation, small where it was near.
    """
    found = np.full((2, QUARTERS, NACELLES), _NOWHERE, dtype=np.uint8)
    quarters = np.minimum(QUARTERS * rows[:, COLUMN.time_s] / duration, QUARTERS - 1).astype(np.int64)
    nacelles = np.clip(rows[:, COLUMN.nacelle_deg] / NEAR_NACELLE_DEG, 0.0, NACELLES - 1).astype(np.int64)
    for side, column in enumerate((COLUMN.margin_low_kt, COLUMN.margin_high_kt)):
        near = rows[:, column] < NEAR_KT
        steps = np.maximum(np.ceil((rows[near, column] - _DEEPEST_KT) * _STEPS_PER_KT), 0.0).astype(np.uint8)
        np.minimum.at(found[side], (quarters[near], nacelles[near]), steps)
    return found.tobytes()


def margins_of(nearest: bytes) -> FloatArray:
    """Least margin in every situation [kn], shape (SITUATIONS,); inf where the flight was not in it.

    Args:
        nearest: What :func:`nearest_of` found.
    """
    steps = np.frombuffer(nearest, dtype=np.uint8)
    return np.where(steps == _NOWHERE, np.inf, _DEEPEST_KT + steps / _STEPS_PER_KT)
