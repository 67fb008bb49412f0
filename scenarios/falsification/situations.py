"""A search that goes round the corridor: it keeps the nearest flight of every situation, and varies those.

A situation is a side of the corridor, a part of the flight and a nacelle angle. The variations that promise most are
flown, by what the flights around them did: an archive of elites (MAP-Elites, Mouret and Clune 2015) illuminated with
the help of a surrogate (Gaier, Asteroth and Mouret 2018). What breaks a law in one corner, or only late, is found
since every corner is pushed at, early and late, by every class that comes there.

Legend:
    spaces: The classes.
    archive: Everything flown.
    random: Source of randomness.
    answers: What came of the points asked for, in their order.
    pool: Points that may be flown.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.distance import cdist

from rtsim.arrays import FloatArray
from scenarios.falsification.archive import Archive
from scenarios.falsification.drawing import BATCH, RandomSearch, reflected
from scenarios.falsification.evaluation import SITUATIONS, Answer, Query, margins_of
from scenarios.falsification.space import ClassSpace

FRESH_SHARE = 0.125
"""Share of the points that vary nothing but are drawn anew."""
POOL = 40
"""Variations weighed for each that is flown."""
STEPS = (0.01, 0.05, 0.2)
"""Standard deviations of a variation, one of them for each."""
MOVED = 0.3
"""Share of the coordinates that are moved."""
MATING = 0.3
"""Share of the variations that take coordinates from a second flight of their class."""
CONTESTS = (1, 5)
"""Situations of which the one with the least margin is varied, one number for each: a law need not hold the same margin
everywhere."""
COUNTS_KT = 12.0
"""Margin below which coming nearer counts [kn]."""
NEIGHBOURS = 5
"""Flights by which a variation is foretold."""
BENEFIT_KT, BENEFIT_PER_DISTANCE_KT = 0.9, 6.0
"""How much nearer a point may come than is foretold: at most [kn], and for each unit of its distance from what is
known, which is the root mean square of the distances of its coordinates [kn]."""


@dataclass(eq=False)
class _Known:
    """The flights of a class."""

    vectors: list[FloatArray] = field(default_factory=list)
    margins: list[FloatArray] = field(default_factory=list)


class SituationSearch:
    """Varies the nearest flights of all situations; flies the variations that promise to come nearer somewhere."""

    def __init__(self, spaces: Sequence[ClassSpace], archive: Archive, random: np.random.Generator) -> None:
        """Look at what is flown."""
        self._fresh = RandomSearch(spaces, random)
        self._archive, self._random = archive, random
        self._known: dict[int, _Known] = {}
        self._read = 0

    def ask(self) -> list[Query]:
        """See :class:`scenarios.falsification.methods.Method`."""
        fresh = round(FRESH_SHARE * BATCH) if self._archive.nearest else BATCH
        drawn = [self._fresh.draw() for _ in range(fresh)]
        if fresh == BATCH:
            return drawn
        classes: dict[int, list[int]] = {}
        for situation in sorted(self._archive.nearest):
            classes.setdefault(situation % SITUATIONS, []).append(situation)
        pool = [self._varied(list(classes.values())) for _ in range(POOL * (BATCH - fresh))]
        return drawn + [pool[one] for one in self._best(pool, BATCH - fresh)]

    def tell(self, answers: Sequence[Answer]) -> None:
        """Learn from the archive alone."""

    def _varied(self, places: Sequence[Sequence[int]]) -> Query:
        """A variation of a flight that came near.

        Args:
            places: The same situation in all classes that were in it, of each situation.
        """
        random, nearest, margins = self._random, self._archive.nearest, self._archive.margins
        met = []
        for _ in range(CONTESTS[int(random.integers(len(CONTESTS)))]):
            place = places[int(random.integers(len(places)))]
            if random.random() < 0.5:
                met.append(min(place, key=lambda one: (margins[one], one)))
            else:
                met.append(place[int(random.integers(len(place)))])
        query = nearest[min(met, key=lambda one: (margins[one], one))].query
        vector = query.vector.copy()
        if random.random() < MATING:
            mates = [one.query.vector for one in nearest.values() if one.query.class_number == query.class_number]
            vector = np.where(random.random(len(vector)) < 0.5, vector, mates[int(random.integers(len(mates)))])
        moved = random.random(len(vector)) < max(MOVED, 1.0 / max(len(vector), 1))
        step = STEPS[int(random.integers(len(STEPS)))]
        return Query(query.class_number, reflected(vector + step * random.standard_normal(len(vector)) * moved))

    def _best(self, pool: Sequence[Query], number: int) -> list[int]:
        """Places in the pool of those that together promise to come nearest, in all situations summed."""
        foretold = self._foretold(pool)
        least = np.full(SITUATIONS, COUNTS_KT)
        for situation, margin in self._archive.margins.items():
            least[situation % SITUATIONS] = min(least[situation % SITUATIONS], margin)
        taken: list[int] = []
        for _ in range(number):
            gain = np.maximum(least - foretold, 0.0).sum(axis=1)
            gain[taken] = -1.0
            taken.append(int(np.argmax(gain)))
            least = np.minimum(least, foretold[taken[-1]])
        return taken

    def _foretold(self, pool: Sequence[Query]) -> FloatArray:
        """Least margins that the flights nearby had, with the benefit of the doubt [kn], shape (pool, SITUATIONS)."""
        for flown in self._archive.flown[self._read :]:
            if not flown.answer.problem:
                known = self._known.setdefault(flown.query.class_number, _Known())
                known.vectors.append(flown.query.vector)
                known.margins.append(np.minimum(margins_of(flown.answer.nearest), COUNTS_KT))
        self._read = len(self._archive.flown)
        foretold = np.empty((len(pool), SITUATIONS))
        for number in sorted({query.class_number for query in pool}):
            own = [place for place, query in enumerate(pool) if query.class_number == number]
            vectors, margins = np.array(self._known[number].vectors), np.array(self._known[number].margins)
            distance = cdist(np.array([pool[place].vector for place in own]), vectors)
            near = np.argsort(distance, axis=1, kind="stable")[:, :NEIGHBOURS]
            distance = np.take_along_axis(distance, near, axis=1)
            weight = (distance + 1e-3) ** -2
            weight /= weight.sum(axis=1, keepdims=True)
            away = distance[:, 0] / math.sqrt(max(vectors.shape[1], 1))
            benefit = np.minimum(BENEFIT_PER_DISTANCE_KT * away, BENEFIT_KT)
            foretold[own] = np.einsum("pk,pks->ps", weight, margins[near]) - benefit[:, None]
        return foretold
