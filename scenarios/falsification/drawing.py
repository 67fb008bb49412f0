"""Points drawn as a campaign draws its flights, and what keeps a point that was moved inside the cube.

Legend:
    spaces: The classes.
    random: Source of randomness.
    answers: What came of the points asked for, in their order.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rtsim.arrays import FloatArray
from scenarios.falsification.evaluation import Answer, Query
from scenarios.falsification.space import ClassSpace

BATCH = 16
"""Points of a generation of the methods that have no size of their own."""


class RandomSearch:
    """Flights as a campaign draws them, class after class."""

    def __init__(self, spaces: Sequence[ClassSpace], random: np.random.Generator) -> None:
        """Begin with the first class."""
        self._spaces, self._random, self._next = spaces, random, 0

    def ask(self) -> list[Query]:
        """See :class:`scenarios.falsification.methods.Method`."""
        return [self.draw() for _ in range(BATCH)]

    def draw(self) -> Query:
        """One flight of the next class."""
        space = self._spaces[self._next % len(self._spaces)]
        self._next += 1
        return Query(space.number, self._random.random(space.size))

    def tell(self, answers: Sequence[Answer]) -> None:
        """Learn nothing."""


def reflected(vector: FloatArray) -> FloatArray:
    """Bring points back into the unit cube by mirrors at its sides.

    Args:
        vector: The point, or several.
    """
    return np.asarray(1.0 - np.abs(1.0 - np.mod(np.abs(vector), 2.0)), dtype=np.float64)
