"""Ways to look for the flight with the least robustness, behind one small interface: ask for points, tell their worth.

``random`` draws flights as a campaign does. ``situations`` goes round the corridor. ``cma-es`` (pycma) and
``surrogate`` (DYCORS) go down from the flights nearest to breaking. Every method is a function of its seed and of what
it is told, so that a search can be repeated, and resumed from its record.

Legend:
    spaces: The classes.
    random: Source of randomness.
    archive: Everything flown.
    target: Place of the property.
    answers: What came of the points asked for, in their order.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from rtsim.optimization.methods import CmaMethod
from scenarios.falsification.archive import Archive, Tried
from scenarios.falsification.evaluation import Answer, Query
from scenarios.falsification.space import ClassSpace
from scenarios.falsification.surrogate import SurrogateSearch

NO_FLIGHT = 1e6
"""Worth of a point that has no flight: worse than any that has."""
FIRST_STEP = 0.15
"""First standard deviation of a search that goes down from a flight."""
PATIENCE, LONGEST = 6, 40
"""Generations without getting lower, and in all, after which another start is tried."""
LOWER_BY = 0.02
"""What counts as getting lower, in units of robustness."""


class Method(Protocol):
    """Asks for points and learns from what they are worth."""

    def ask(self) -> list[Query]:
        """Points of the next generation."""
        ...

    def tell(self, answers: Sequence[Answer]) -> None:
        """Learn what became of the points asked for."""
        ...


@dataclass(eq=False)
class _Descent:
    """One way down in a class."""

    search: CmaMethod | SurrogateSearch
    """Who goes."""
    lowest: float
    """The least it has seen."""
    pace: float = math.inf
    """How much lower it got of late, for each generation; inf before the first."""
    since: int = 0
    """Generations without getting lower."""
    generations: int = 0
    """Generations in all."""
    last: int = 0
    """When it was last asked."""


class DescentSearch:
    """Goes down from the worst flights found, one descent in each class, by CMA-ES or with a surrogate.

    A generation goes to the class that of late got lower the fastest, or where none does to the one that waits longest.
    """

    def __init__(self, kind: str, archive: Archive, target: int, seed: int, spaces: Sequence[ClassSpace]) -> None:
        """Begin without a start.

        Args:
            kind: ``cma-es`` or ``surrogate``.
            seed: Root of its random streams.
        """
        self._kind, self._archive, self._target, self._seed = kind, archive, target, seed
        self._spaces = {space.number: space for space in spaces}
        self._left: set[int] = set()
        self._descents: dict[int, _Descent] = {}
        self._starts, self._asked = 0, 0
        self._class = 0

    def ask(self) -> list[Query]:
        """See :class:`Method`."""
        self._class = self._next_class()
        descent = self._descents.get(self._class)
        if descent is None or descent.since >= PATIENCE or descent.generations >= LONGEST:
            descent = self._descents[self._class] = self._begun()
        self._asked += 1
        descent.last = self._asked
        return [Query(self._class, vector) for vector in descent.search.ask()]

    def tell(self, answers: Sequence[Answer]) -> None:
        """See :class:`Method`."""
        descent = self._descents[self._class]
        values = np.array([one.guidance[self._target] for one in answers])
        values = np.where(np.isfinite(values), values, NO_FLIGHT)
        descent.search.tell(values[:, None], np.zeros((len(values), 0)))
        descent.generations += 1
        drop = max(descent.lowest - float(values.min()), 0.0)
        descent.since = 0 if drop > LOWER_BY else descent.since + 1
        descent.lowest -= drop
        descent.pace = drop if math.isinf(descent.pace) else 0.5 * (descent.pace + drop)

    def _next_class(self) -> int:
        """The class whose descent got lower the fastest; one without a descent first."""
        known = sorted({one.query.class_number for one in self._starts_known().values()})
        return max(known, key=self._worth)

    def _worth(self, number: int) -> tuple[float, int]:
        descent = self._descents.get(number)
        if descent is None:
            return math.inf, 0
        return descent.pace if descent.pace > LOWER_BY else 0.0, -descent.last

    def _starts_known(self) -> dict[int, Tried]:
        """Flights to go down from, by situation."""
        elites = self._archive.elites[self._target] if self._archive.elites else {}
        return elites or {-1: self._archive.worst(self._target)}

    def _begun(self) -> _Descent:
        """From the class's flight nearest to breaking of the situations not begun from yet; at last from all again."""
        target = self._target
        own = {k: one for k, one in self._starts_known().items() if one.query.class_number == self._class}
        left = [one for one in own if one not in self._left]
        if not left:
            self._left -= set(own)
            left = list(own)
        start = own[min(left, key=lambda one: (own[one].answer.guidance[target], one))]
        self._left |= {one for one, flown in own.items() if flown is start}
        query, lowest = start.query, float(start.answer.guidance[target])
        size = self._spaces[self._class].size
        seed = self._seed + self._starts
        self._starts += 1
        search: CmaMethod | SurrogateSearch
        if self._kind == "cma-es" and size > 1:
            population = 4 + int(3.0 * math.log(size))
            search = CmaMethod(query.vector[None, :], population=population, seed=seed, penalty=False, step=FIRST_STEP)
        else:
            known = [one for one in self._archive.flown if one.query.class_number == self._class]
            search = SurrogateSearch(
                np.array([one.query.vector for one in known]).reshape(len(known), size),
                np.array([one.answer.guidance[target] for one in known]),
                centre=query.vector,
                seed=seed,
            )
        return _Descent(search, lowest)
