"""The search methods behind one small interface: ask for candidates, tell what they are worth.

Every method is a deterministic function of its seed and of what it is told; that is what lets a search resume from its
record of evaluations. ``ga`` and ``nsga2`` are pymoo's, ``cma-es`` is pycma's.

Legend:
    objectives: Shape (candidates, objectives).
    constraints: Shape (candidates, constraints).
    starts: Start vectors, the best first, shape (starts, variables).
    population: Candidates per generation.
    seed: Root of its random stream.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.random_streams import STREAM_SEARCH, stream_generator

PENALTY_WEIGHT = 10.0
"""Penalty per unit of violation, in shares of the first generation's median objective."""
FIRST_STEP = 0.08
"""First standard deviation of the CMA-ES, in shares of the variables' ranges."""
START_SPREAD = 0.08
"""Standard deviation with which the first generation is strewn about the start vectors."""


class SearchMethod(Protocol):
    """Asks for candidates and learns from what they are worth."""

    def ask(self) -> FloatArray:
        """Candidates of the next generation, shape (candidates, variables), in the unit box."""
        ...

    def tell(self, objectives: FloatArray, constraints: FloatArray) -> None:
        """Take the worth of the candidates asked for.

        Args:
            constraints: Shape (candidates, constraints); above 0 is a violation.
        """
        ...


def total_violation(constraints: FloatArray) -> FloatArray:
    """Sum of the violations of each candidate, shape (candidates,).

    Args:
        constraints: Shape (candidates, constraints); above 0 is a violation.
    """
    return np.asarray(np.maximum(constraints, 0.0).sum(axis=1), dtype=np.float64)


def feasibility_order(objectives: FloatArray, violation: FloatArray) -> FloatArray:
    """Deb's rules as one number per candidate, its rank: feasible ones by objective, then the others by violation.

    Args:
        objectives: Shape (candidates,).
        violation: Shape (candidates,).
    """
    infeasible = violation > 0.0
    key = np.where(infeasible, violation, objectives)
    order = np.lexsort((key, infeasible))
    ranks = np.empty(len(order))
    ranks[order] = np.arange(len(order), dtype=np.float64)
    return ranks


class Penalty:
    """The paper's way: violations added to the objective, with a weight that is set once, by the first generation."""

    def __init__(self) -> None:
        """Begin without a weight."""
        self.weight: float | None = None

    def __call__(self, objectives: FloatArray, constraints: FloatArray) -> FloatArray:
        """The penalized objectives, shape of ``objectives``."""
        if self.weight is None:
            self.weight = PENALTY_WEIGHT * float(np.median(np.abs(objectives[:, 0])))
        return objectives + self.weight * total_violation(constraints)[:, None]


class CmaMethod:
    """CMA-ES; constraints by rank (Deb's rules, to which it is invariant like to any monotone change) or by penalty."""

    def __init__(
        self, starts: FloatArray, *, population: int, seed: int, penalty: bool, step: float = FIRST_STEP
    ) -> None:
        """Set up.

        Args:
            penalty: Constraints by penalty instead of by rank.
            step: First standard deviation, in shares of the variables' ranges.
        """
        self._step = step
        self._cma = _needed("cma", extra="optimize")
        self._random = stream_generator(seed, STREAM_SEARCH)
        self._starts = starts
        self._population = population
        self._penalty = Penalty() if penalty else None
        self._asked: list[FloatArray] = []
        self._best: tuple[float, float, FloatArray] | None = None
        self._first = True
        self._strategy = self._new_strategy(np.clip(starts[0], 0.01, 0.99), step)

    def _new_strategy(self, mean: FloatArray, step: float) -> Any:
        options = {
            "popsize": self._population,
            "bounds": [0.0, 1.0],
            "seed": np.nan,  # its own stream instead of numpy's global one
            "randn": lambda *shape: self._random.standard_normal(shape),
            "verbose": -9,
            "verb_log": 0,
            "maxiter": np.inf,
        }
        return self._cma.CMAEvolutionStrategy(mean, step, options)

    def ask(self) -> FloatArray:
        """See :class:`SearchMethod`."""
        if self._strategy.stop() and self._best is not None:  # converged with budget left: once more from the best
            self._strategy = self._new_strategy(np.clip(self._best[2], 0.01, 0.99), 0.5 * self._step)
        self._asked = [np.asarray(x, dtype=np.float64) for x in self._strategy.ask()]
        if self._first:
            # The start vectors compete in the first generation; the strategy takes them as its own draws.
            for k in range(min(len(self._starts), len(self._asked) // 2)):
                self._asked[k] = np.clip(self._starts[k], 0.0, 1.0)
            self._first = False
        return np.array(self._asked)

    def tell(self, objectives: FloatArray, constraints: FloatArray) -> None:
        """See :class:`SearchMethod`.

        Args:
            objectives: Shape (candidates, 1).
        """
        violation = total_violation(constraints)
        if self._penalty is not None:
            values = self._penalty(objectives, constraints)[:, 0]
        else:
            values = feasibility_order(objectives[:, 0], violation)
        best = int(np.argmin(feasibility_order(objectives[:, 0], violation)))
        found = (float(violation[best]), float(objectives[best, 0]), self._asked[best])
        if self._best is None or found[:2] < self._best[:2]:
            self._best = found
        self._strategy.tell(self._asked, values.tolist())


class PymooMethod:
    """pymoo's genetic algorithms: GA for one objective, NSGA-II for one or several."""

    def __init__(
        self,
        name: str,
        starts: FloatArray,
        *,
        population: int,
        seed: int,
        penalty: bool,
        objectives: int,
        constraints: int,
    ) -> None:
        """Set up.

        Args:
            name: ``ga`` or ``nsga2``.
            penalty: Constraints by penalty instead of by pymoo's feasibility rules.
            objectives: How many objectives.
            constraints: How many constraints.
        """
        _needed("pymoo", extra="optimize")
        from pymoo.algorithms.moo.nsga2 import NSGA2
        from pymoo.algorithms.soo.nonconvex.ga import GA
        from pymoo.core.problem import Problem

        random = stream_generator(seed, STREAM_SEARCH)
        count = starts.shape[1]
        self._penalty = Penalty() if penalty else None
        self._problem = Problem(
            n_var=count,
            n_obj=objectives,
            n_ieq_constr=0 if penalty else constraints,
            xl=np.zeros(count),
            xu=np.ones(count),
        )
        first = strewn_about(starts, population, random)
        kind = NSGA2 if name == "nsga2" else GA
        self._algorithm = kind(pop_size=population, sampling=first, eliminate_duplicates=True)
        own_seed = int(random.integers(2**31 - 1))
        self._algorithm.setup(self._problem, termination=("n_gen", 10**9), seed=own_seed, verbose=False)
        self._asked: Any = None

    def ask(self) -> FloatArray:
        """See :class:`SearchMethod`."""
        self._asked = self._algorithm.ask()
        return np.array(self._asked.get("X"), dtype=np.float64)

    def tell(self, objectives: FloatArray, constraints: FloatArray) -> None:
        """See :class:`SearchMethod`."""
        from pymoo.core.evaluator import Evaluator
        from pymoo.problems.static import StaticProblem

        if self._penalty is not None:
            static = StaticProblem(self._problem, F=self._penalty(objectives, constraints))
        else:
            static = StaticProblem(self._problem, F=objectives, G=constraints)
        Evaluator().eval(static, self._asked)
        self._algorithm.tell(infills=self._asked)


def strewn_about(starts: FloatArray, count: int, random: np.random.Generator) -> FloatArray:
    """A first generation: the start vectors, then vectors strewn about them in turn, a quarter of them anywhere.

    Args:
        starts: Shape (starts, variables).
        count: How many vectors.
        random: Source of randomness.
    """
    first = [*starts[:count]]
    while len(first) < count:
        number = len(first)
        if number % 4 == 3:
            first.append(random.random(starts.shape[1]))
        else:
            centre = starts[number % len(starts)]
            first.append(np.clip(centre + START_SPREAD * random.standard_normal(starts.shape[1]), 0.0, 1.0))
    return np.array(first)


def make_method(
    name: str,
    starts: FloatArray,
    *,
    population: int,
    seed: int,
    penalty: bool,
    objectives: int,
    constraints: int,
) -> SearchMethod:
    """A method by its name.

    Args:
        name: ``ga``, ``cma-es`` or ``nsga2``.
        penalty: Constraints by penalty.
        objectives: How many objectives.
        constraints: How many constraints.

    Raises:
        InputError: Its package is not installed.
    """
    if name == "cma-es":
        return CmaMethod(starts, population=population, seed=seed, penalty=penalty)
    return PymooMethod(
        name, starts, population=population, seed=seed, penalty=penalty, objectives=objectives, constraints=constraints
    )


def _needed(package: str, *, extra: str) -> Any:
    import importlib

    try:
        return importlib.import_module(package)
    except ModuleNotFoundError as missing:
        raise InputError(
            f"needs the package {missing.name}, which is not installed",
            key="search.method",
            mend=f"install it with: pip install 'rtsim[{extra}]'",
        ) from None
