"""A search with a surrogate: radial basis functions through what is known, candidates near the best that they like.

DYCORS (Regis and Shoemaker 2013): fewer and fewer coordinates are moved, candidates are weighed by what the surrogate
promises and by how far they are from what is known; the step is halved after failures and doubled after successes.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.interpolate import RBFInterpolator
from scipy.spatial.distance import cdist

from rtsim.arrays import FloatArray
from rtsim.random_streams import STREAM_SEARCH, stream_generator
from scenarios.falsification.drawing import reflected

POPULATION = 8
"""Points of a generation."""
MOST_KNOWN = 400
"""Points that the surrogate goes through: the nearest to the centre."""
CANDIDATES = 400
"""Candidates weighed in a generation."""
WEIGHTS = (0.3, 0.5, 0.8, 0.95)
"""Weight of what is promised against distance, one candidate after the other."""
FIRST_STEP, SMALLEST_STEP, LARGEST_STEP = 0.2, 0.005, 0.4
"""Standard deviation of a candidate from the centre."""
MOVED = 20
"""Coordinates moved at first."""
LONGEST = 300.0
"""Points after which one coordinate is moved."""


class SurrogateSearch:
    """Searches a unit cube for the least value, from what is known of it."""

    def __init__(self, points: FloatArray, values: FloatArray, *, centre: FloatArray, seed: int) -> None:
        """Begin.

        Args:
            points: Known points, shape (known, size).
            values: Their values, shape (known,).
            centre: Where to begin.
            seed: Root of its random stream.
        """
        self._points, self._values, self._centre = points, values, centre
        self._lowest = float(values.min()) if len(values) else math.inf
        self._random = stream_generator(seed, STREAM_SEARCH)
        self._step = FIRST_STEP
        self._asked = points[:0]
        self._told = 0

    def ask(self) -> FloatArray:
        """Points of the next generation, shape (POPULATION, size)."""
        size = len(self._centre)
        share = min(MOVED / size, 1.0) * max(1.0 - math.log(self._told + 1) / math.log(LONGEST), 1.0 / size)
        moved = self._random.random((CANDIDATES, size)) < share
        moved[np.arange(CANDIDATES), self._random.integers(size, size=CANDIDATES)] = True
        steps = self._step * self._random.standard_normal((CANDIDATES, size)) * moved
        candidates = reflected(self._centre + steps)
        near = np.argsort(cdist(self._points, self._centre[None, :])[:, 0], kind="stable")[:MOST_KNOWN]
        known, values = np.unique(self._points[near], axis=0, return_index=True)
        promised = self._promise(known, np.clip(self._values[near][values], None, np.median(self._values)), candidates)
        taken: list[int] = []
        distance = cdist(candidates, known).min(axis=1)
        for number in range(POPULATION):
            weight = WEIGHTS[number % len(WEIGHTS)]
            worth = weight * _scaled(promised) + (1.0 - weight) * (1.0 - _scaled(distance))
            worth[taken] = np.inf
            best = int(np.argmin(worth))
            taken.append(best)
            distance = np.minimum(distance, cdist(candidates, candidates[best][None, :])[:, 0])
        self._asked = candidates[taken]
        return self._asked

    def tell(self, objectives: FloatArray, constraints: FloatArray) -> None:
        """Learn.

        Args:
            objectives: Values of the points asked for, shape (POPULATION, 1).
            constraints: None.
        """
        del constraints
        values = objectives[:, 0]
        self._points = np.concatenate([self._points, self._asked])
        self._values = np.concatenate([self._values, values])
        self._told += len(values)
        if values.min() < self._lowest:
            self._lowest, self._centre = float(values.min()), self._asked[int(np.argmin(values))]
            self._step = min(2.0 * self._step, LARGEST_STEP)
        else:
            self._step = max(0.5 * self._step, SMALLEST_STEP)

    def _promise(self, known: FloatArray, values: FloatArray, candidates: FloatArray) -> FloatArray:
        size = known.shape[1]
        rich = len(known) > 2 * (size + 1) and np.linalg.matrix_rank(known - known.mean(axis=0)) == size
        kernel, degree = ("cubic", 1) if rich else ("linear", 0)
        surrogate = RBFInterpolator(known, values, kernel=kernel, degree=degree, smoothing=1e-6)
        return np.asarray(surrogate(candidates), dtype=np.float64)


def _scaled(values: FloatArray) -> FloatArray:
    spread = float(np.ptp(values))
    return (values - values.min()) / spread if spread > 0.0 else np.zeros(len(values))
