"""Everything a search has flown, and the worst flight of every place where a margin can run out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from rtsim.arrays import FloatArray
from scenarios.falsification.evaluation import Answer, Query

NACELLE_BIN_DEG, TIME_BINS = 7.5, 4
"""Places where margins run out are told apart by nacelle angle and by part of the flight."""

Place = tuple[int, bool, int, int]
"""Class, side of the corridor, bin of the nacelle angle, part of the flight."""


@dataclass(frozen=True, slots=True, eq=False)
class Flown:
    """One point and what came of it."""

    query: Query
    """The point."""
    answer: Answer
    """What came of it."""
    number: int
    """Flights under test before it."""


@dataclass(slots=True, eq=False)
class Elite:
    """The worst flight of a place."""

    flown: Flown
    """The flight."""
    value: float
    """Its robustness."""
    tries: int = 0
    """How often something was tried from it since it was found."""


@dataclass(eq=False)
class Archive:
    """What was flown, in order."""

    durations: Sequence[float]
    """Length of the flights of every class [s]."""
    flown: list[Flown] = field(default_factory=list)
    """Every point that had a flight."""
    without_start: int = 0
    """Points that had none."""
    elites: list[dict[Place, Elite]] = field(default_factory=list)
    """Worst flight of every place, by property."""

    def add(self, queries: Sequence[Query], answers: Sequence[Answer]) -> None:
        """Take what came of points.

        Args:
            queries: The points.
            answers: What came of them.
        """
        for query, answer in zip(queries, answers, strict=True):
            if not answer.flights:
                self.without_start += 1
                continue
            flown = Flown(query, answer, len(self.flown))
            self.flown.append(flown)
            if not self.elites:
                self.elites = [{} for _ in answer.robustness]
            place = self.place_of(flown)
            for elites, value in zip(self.elites, answer.robustness.tolist(), strict=True):
                if place not in elites or value < elites[place].value:
                    elites[place] = Elite(flown, value)

    def place_of(self, flown: Flown) -> Place:
        """Where the corridor's margin was least.

        Args:
            flown: A flight.
        """
        answer, number = flown.answer, flown.query.class_number
        part = min(int(TIME_BINS * answer.time_s / self.durations[number]), TIME_BINS - 1)
        return number, answer.high, int(answer.nacelle_deg // NACELLE_BIN_DEG), part

    def robustness(self, place: int) -> FloatArray:
        """Robustness of every flight in a property, in order, shape (flights,).

        Args:
            place: Place of the property.
        """
        return np.array([one.answer.robustness[place] for one in self.flown], dtype=np.float64)

    def worst(self, place: int) -> Flown:
        """The flight with the least robustness; of equal ones the first.

        Args:
            place: Place of the property.
        """
        return self.flown[int(np.argmin(self.robustness(place)))]

    def least(self, place: int) -> float:
        """The least robustness so far; inf before the first flight.

        Args:
            place: Place of the property.
        """
        return float(self.robustness(place).min()) if self.flown else math.inf

    def first_broken(self, place: int) -> int | None:
        """Number, from 1, of the first flight that broke a property.

        Args:
            place: Place of the property.
        """
        broken = np.flatnonzero(self.robustness(place) < 0.0)
        return int(broken[0]) + 1 if broken.size else None
