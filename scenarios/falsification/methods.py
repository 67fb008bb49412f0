"""Ways to look for the flight with the least robustness, behind one small interface: ask for points, tell their worth.

``random`` draws flights as a campaign does. ``situations`` keeps the flight nearest to breaking of every situation near
a side of the corridor and varies those of the rarest (as fuzzers go after rare branches, and MAP-Elites, Mouret and
Clune 2015): it goes round the corridor. ``cma-es`` (pycma) and ``surrogate`` go down from the flights nearest to
breaking. Every method is a function of its seed and of what it is told, so that a search can be repeated, and resumed
from its record.

Legend:
    spaces: The classes.
    random: Source of randomness.
    archive: Everything flown.
    target: Place of the property.
    answers: What came of the points asked for, in their order.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.optimization.methods import CmaMethod
from scenarios.falsification.archive import Archive, Tried
from scenarios.falsification.evaluation import Answer, Query
from scenarios.falsification.space import ClassSpace
from scenarios.falsification.surrogate import SurrogateSearch

BATCH = 16
"""Points of a generation of the methods that have no size of their own."""
NO_FLIGHT = 1e6
"""Worth of a point that has no flight: worse than any that has."""
STEPS = (0.01, 0.05, 0.2)
"""Standard deviations of a variation, one of them for each."""
FIRST_STEP = 0.15
"""First standard deviation of a search that goes down from a flight."""
PATIENCE, LONGEST = 6, 40
"""Generations without getting lower, and in all, after which another start is tried."""
LOWER_BY = 0.02
"""What counts as getting lower, in units of robustness."""
FRESH_SHARE = 0.25
"""Share of the points of ``situations`` that vary nothing but are drawn anew."""
MATING = 0.3
"""Share of its points that take coordinates from a second flight of their class."""


class Method(Protocol):
    """Asks for points and learns from what they are worth."""

    def ask(self) -> list[Query]:
        """Points of the next generation."""
        ...

    def tell(self, answers: Sequence[Answer]) -> None:
        """Learn what became of the points asked for."""
        ...


class RandomSearch:
    """Flights as a campaign draws them, class after class."""

    def __init__(self, spaces: Sequence[ClassSpace], random: np.random.Generator) -> None:
        """Begin with the first class."""
        self._spaces, self._random, self._next = spaces, random, 0

    def ask(self) -> list[Query]:
        """See :class:`Method`."""
        return [self.draw() for _ in range(BATCH)]

    def draw(self) -> Query:
        """One flight of the next class."""
        space = self._spaces[self._next % len(self._spaces)]
        self._next += 1
        return Query(space.number, self._random.random(space.size))

    def tell(self, answers: Sequence[Answer]) -> None:
        """Learn nothing."""


class SituationSearch:
    """Varies flights that were in the situations the law was in least often (coverage-guided, as a fuzzer does)."""

    def __init__(
        self, spaces: Sequence[ClassSpace], archive: Archive, target: int, random: np.random.Generator
    ) -> None:
        """Look at what is flown."""
        self._fresh = RandomSearch(spaces, random)
        self._archive, self._target, self._random = archive, target, random
        self._tried: Counter[int] = Counter()
        self._asked: Counter[int] = Counter()

    def ask(self) -> list[Query]:
        """See :class:`Method`."""
        elites = self._archive.elites[self._target] if self._archive.elites else {}
        self._asked.clear()
        fresh = BATCH if not elites else round(FRESH_SHARE * BATCH)
        return [self._fresh.draw() for _ in range(fresh)] + [self._varied(elites) for _ in range(BATCH - fresh)]

    def _varied(self, elites: dict[int, Tried]) -> Query:
        """A variation of the flight nearest to breaking in the rarest situation of the class that flew least."""
        visits, tried = self._archive.visits, self._tried
        flown = self._archive.flights + self._asked
        classes = {one.query.class_number for one in elites.values()}
        chosen = min(classes, key=lambda number: (flown[number], number))
        own = [one for one, flight in elites.items() if flight.query.class_number == chosen]
        situation = min(own, key=lambda one: (visits[one] + tried[one], elites[one].answer.guidance[self._target], one))
        tried[situation] += 1
        self._asked[chosen] += 1
        query = elites[situation].query
        vector = query.vector.copy()
        mates = [one.query.vector for one in elites.values() if one.query.class_number == query.class_number]
        if self._random.random() < MATING:
            mate = mates[int(self._random.integers(len(mates)))]
            vector = np.where(self._random.random(len(vector)) < 0.5, vector, mate)
        step = STEPS[int(self._random.integers(len(STEPS)))]
        moved = self._random.random(len(vector)) < max(0.3, 1.0 / max(len(vector), 1))
        vector = reflected(vector + step * self._random.standard_normal(len(vector)) * moved)
        return Query(query.class_number, vector)

    def tell(self, answers: Sequence[Answer]) -> None:
        """Learn from the archive alone."""


class DescentSearch:
    """Goes down from the worst flights found, one start after the other, by CMA-ES or with a surrogate."""

    def __init__(self, kind: str, archive: Archive, target: int, seed: int, spaces: Sequence[ClassSpace]) -> None:
        """Begin without a start.

        Args:
            kind: ``cma-es`` or ``surrogate``.
            seed: Root of its random streams.
        """
        self._kind, self._archive, self._target, self._seed = kind, archive, target, seed
        self._spaces = {space.number: space for space in spaces}
        self._left: set[int] = set()
        self._starts = 0
        self._class = 0
        self._inner: CmaMethod | SurrogateSearch | None = None
        self._lowest, self._since, self._generations = math.inf, 0, 0

    def ask(self) -> list[Query]:
        """See :class:`Method`."""
        if self._inner is None or self._since >= PATIENCE or self._generations >= LONGEST:
            self._begin()
        assert self._inner is not None  # begun above
        return [Query(self._class, vector) for vector in self._inner.ask()]

    def tell(self, answers: Sequence[Answer]) -> None:
        """See :class:`Method`."""
        assert self._inner is not None  # asked before
        values = np.array([one.guidance[self._target] for one in answers])
        values = np.where(np.isfinite(values), values, NO_FLIGHT)
        self._inner.tell(values[:, None], np.zeros((len(values), 0)))
        self._generations += 1
        lowest = float(values.min())
        self._since = 0 if lowest < self._lowest - LOWER_BY else self._since + 1
        self._lowest = min(self._lowest, lowest)

    def _begin(self) -> None:
        """From the flight nearest to breaking of the situations not begun from yet; at last from all again."""
        target = self._target
        elites = self._archive.elites[target] or {-1: self._archive.worst(target)}
        left = [one for one in elites if one not in self._left]
        if not left:
            self._left.clear()
            left = list(elites)
        start = elites[min(left, key=lambda one: (elites[one].answer.guidance[target], one))]
        self._left |= {one for one, flown in elites.items() if flown is start}
        query, lowest = start.query, float(start.answer.guidance[target])
        self._class = query.class_number
        size = self._spaces[self._class].size
        seed = self._seed + self._starts
        self._starts += 1
        if self._kind == "cma-es" and size > 1:
            population = 4 + int(3.0 * math.log(size))
            self._inner = CmaMethod(
                query.vector[None, :], population=population, seed=seed, penalty=False, step=FIRST_STEP
            )
        else:
            known = [one for one in self._archive.flown if one.query.class_number == self._class]
            self._inner = SurrogateSearch(
                np.array([one.query.vector for one in known]).reshape(len(known), size),
                np.array([one.answer.guidance[target] for one in known]),
                centre=query.vector,
                seed=seed,
            )
        self._lowest, self._since, self._generations = lowest, 0, 0


def reflected(vector: FloatArray) -> FloatArray:
    """Bring a point back into the unit cube by mirrors at its sides.

    Args:
        vector: The point.
    """
    return np.asarray(1.0 - np.abs(1.0 - np.mod(np.abs(vector), 2.0)), dtype=np.float64)
