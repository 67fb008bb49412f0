"""Everything a search has flown, and the worst flight of every situation that the law was in."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from rtsim.arrays import FloatArray
from scenarios.falsification.evaluation import SITUATIONS, Answer, Query, margins_of

CLOSE_KT = 10.0
"""A flight that came nearer in a situation is one to go down from [kn]."""


@dataclass(frozen=True, slots=True, eq=False)
class Tried:
    """One point and what came of it."""

    query: Query
    """The point."""
    answer: Answer
    """What came of it."""
    number: int
    """Flights under test before it."""


@dataclass(eq=False)
class Archive:
    """What was flown, in order."""

    flown: list[Tried] = field(default_factory=list)
    """Every point that had a flight."""
    without_start: int = 0
    """Points that had none."""
    nearest: dict[int, Tried] = field(default_factory=dict)
    """By class and situation (``class_number * SITUATIONS + situation``; another class comes there by another way): the
    flight that came nearest to the corridor's side in it."""
    margins: dict[int, float] = field(default_factory=dict)
    """How near that was [kn]."""
    elites: list[dict[int, Tried]] = field(default_factory=list)
    """By property, class and situation: the flight that came close there and is nearest to breaking the property."""
    _worst: dict[int, Tried] = field(default_factory=dict)
    _first_broken: dict[int, int] = field(default_factory=dict)

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
            flown = Tried(query, answer, len(self.flown))
            self.flown.append(flown)
            if not self.elites:
                self.elites = [{} for _ in answer.robustness]
            if answer.problem:  # what a law that was given up let happen says nothing of the law
                continue
            for place, value in enumerate(answer.robustness.tolist()):
                if value < self.least(place):
                    self._worst[place] = flown
                if value < 0.0:
                    self._first_broken.setdefault(place, len(self.flown))
            self._place(flown)

    def _place(self, flown: Tried) -> None:
        """Compare a flight with the best of the situations it was in."""
        margins = margins_of(flown.answer.nearest)
        base = flown.query.class_number * SITUATIONS
        for one in np.flatnonzero(margins < np.inf).tolist():
            situation, margin = base + one, float(margins[one])
            if margin < self.margins.get(situation, math.inf):
                self.margins[situation], self.nearest[situation] = margin, flown
            if margin > CLOSE_KT:
                continue
            for place, elites in enumerate(self.elites):
                known = elites.get(situation)
                if known is None or flown.answer.guidance[place] < known.answer.guidance[place]:
                    elites[situation] = flown

    def robustness(self, place: int) -> FloatArray:
        """Robustness of every flight in a property, in order, shape (flights,).

        Args:
            place: Place of the property.
        """
        return np.array([one.answer.robustness[place] for one in self.flown], dtype=np.float64)

    def worst(self, place: int) -> Tried:
        """The flight with the least robustness; of equal ones the first.

        Args:
            place: Place of the property.
        """
        return self._worst[place]

    def least(self, place: int) -> float:
        """The least robustness so far; inf before the first flight.

        Args:
            place: Place of the property.
        """
        return float(self._worst[place].answer.robustness[place]) if place in self._worst else math.inf

    def first_broken(self, place: int) -> int | None:
        """Number, from 1, of the first flight that broke a property.

        Args:
            place: Place of the property.
        """
        return self._first_broken.get(place)
