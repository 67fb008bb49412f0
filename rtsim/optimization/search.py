"""Runs a search: generations of candidates flown and told, best so far, record for resuming, Pareto front.

A search keeps the record of everything it has evaluated. Resuming asks the method for the same candidates again and
answers from the record until it is used up; the end result is that of a search that was never interrupted.
"""

from __future__ import annotations

import dataclasses
import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.optimization.methods import feasibility_order, make_method
from rtsim.optimization.problem import CONSTRAINTS, ConversionProblem, Evaluation
from rtsim.optimization.spec import SearchSpec
from rtsim.outside import read_arrays, understanding
from rtsim.whole_file import whole_file

RECORD_FORMAT = 1
LARGEST_RECORD = 1_000_000_000
"""Size of the largest record that is read [bytes]."""


class Evaluator(Protocol):
    """Flies candidates, here or elsewhere."""

    def evaluate(self, variables: FloatArray) -> Evaluation:
        """Fly candidates.

        Args:
            variables: Shape (candidates, variables).
        """
        ...


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a search has come."""

    generation: int
    """Generations done."""
    generations: int
    """Generations to do."""
    evaluations: int
    """Candidates judged."""
    best: float
    """First objective of the best candidate so far."""
    feasible: bool
    """It keeps all constraints."""


@dataclass(frozen=True, slots=True)
class FrontPoint:
    """One solution of a search with several objectives that no other one beats in all of them."""

    variables: FloatArray
    """Its vector."""
    objectives: tuple[float, ...]
    """Its objectives."""


@dataclass(frozen=True, slots=True)
class SearchResult:
    """What a search found."""

    best: FloatArray
    """Best vector: the feasible one with the least first objective, else the one with the least violation."""
    objectives: tuple[float, ...]
    """Its objectives."""
    constraints: dict[str, float]
    """Its constraints by name; above 0 is a violation."""
    feasible: bool
    """It keeps all constraints."""
    front: tuple[FrontPoint, ...]
    """Feasible solutions that no other one beats, by the first objective."""
    history: tuple[float, ...]
    """First objective of the best feasible candidate after each generation; NaN while there is none."""
    generations: int
    """Generations done."""
    evaluations: int
    """Candidates judged."""
    seconds_per_generation: float
    """Mean wall time of the generations flown in this run [s]; NaN where all came from the record."""
    interrupted: bool
    """It was stopped before its last generation."""
    stopped_by: BaseException | None = None
    """Ctrl-C or SIGTERM, for the caller to raise again once the result is safe."""


class Record:
    """Everything a search has evaluated, on disk in one file that is replaced as a whole."""

    def __init__(self, path: Path | None, fingerprint: str, *, resume: bool = True) -> None:
        """Open or begin a record.

        Args:
            path: The file; None keeps the record in memory only.
            fingerprint: What the search is; a record of another search is refused.
            resume: Go on from the file, if there is one; else it is replaced once a generation is done.

        Raises:
            InputError: The file belongs to another search or is no record.
        """
        self.path = path
        self.fingerprint = fingerprint
        self.generations: list[Evaluation] = []
        if resume and path is not None and path.exists():
            self._read(path)

    def add(self, evaluation: Evaluation) -> None:
        """Add a generation and save.

        Args:
            evaluation: What was evaluated.

        Raises:
            OutputError: The file cannot be written.
        """
        self.generations.append(evaluation)
        if self.path is None:
            return
        sizes = [len(generation.variables) for generation in self.generations]
        with whole_file(self.path) as temporary, temporary.open("wb") as file:
            np.savez(
                file,
                format=RECORD_FORMAT,
                fingerprint=self.fingerprint,
                sizes=np.array(sizes),
                variables=np.concatenate([g.variables for g in self.generations]),
                objectives=np.concatenate([g.objectives for g in self.generations]),
                constraints=np.concatenate([g.constraints for g in self.generations]),
            )

    def _read(self, path: Path) -> None:
        mend = "delete it and search anew without --resume"
        data = read_arrays(path, noun="record of a search", largest=LARGEST_RECORD, mend=mend)
        with understanding("record of a search", file=path, mend=mend):
            if data["format"].item() != RECORD_FORMAT:
                raise ValueError("its format is another one")
            written = str(data["fingerprint"].item())
            sizes = data["sizes"].astype(np.int64, casting="same_kind")
            columns = [data[name].astype(np.float64, casting="same_kind") for name in Evaluation.__slots__]
            if any(values.ndim != 2 or len(values) != sizes.sum() for values in columns) or np.any(sizes < 1):
                raise ValueError("its arrays do not fit together")
            parts = [np.split(values, np.cumsum(sizes)[:-1]) for values in columns]
        if written != self.fingerprint:
            raise InputError(
                "is the record of another search (specification or database differ)",
                file=str(path),
                mend="delete it, or resume with the specification it was made with",
            )
        self.generations = [Evaluation(*generation) for generation in zip(*parts, strict=True)]


def fingerprint(spec: SearchSpec, database_hash: str) -> str:
    """What makes two searches the same, but for their number of generations.

    Args:
        spec: What is searched.
        database_hash: Content hash of the database.
    """
    content = spec.model_dump(mode="json")
    del content["search"]["generations"]
    return json.dumps({"spec": content, "database": database_hash}, sort_keys=True)


def run_search(
    problem: ConversionProblem,
    *,
    evaluator: Evaluator | None = None,
    record_path: Path | None = None,
    resume: bool = True,
    on_progress: Callable[[Progress], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> SearchResult:
    """Search.

    Args:
        problem: What is searched.
        evaluator: Who flies the candidates; None: the problem itself, on this machine.
        record_path: Record to resume from and to keep; None keeps none.
        resume: Go on from the record; else it is replaced once the first generation is done.
        on_progress: Told after each generation.
        should_stop: Asked before each generation whether to end now.

    Returns:
        What was found; after Ctrl-C or SIGTERM what was found until then, with the exception in ``stopped_by``.

    Raises:
        InputError: The record belongs to another search, or a package is missing.
        OutputError: The record cannot be written.
        KeyboardInterrupt: Ctrl-C came before the first generation was done.
    """
    spec = problem.spec
    evaluator = problem if evaluator is None else evaluator
    record = Record(record_path, fingerprint(spec, problem.database_hash), resume=resume)
    starts = start_vectors(problem)
    method = make_method(
        spec.search.method,
        starts,
        population=spec.search.population,
        seed=spec.search.seed,
        penalty=spec.search.handling == "penalty",
        objectives=len(spec.objectives),
        constraints=len(CONSTRAINTS),
    )
    archive = Archive()
    spent: list[float] = []
    interrupted = False
    stopped_by: BaseException | None = None
    try:
        for number in range(spec.search.generations):
            if should_stop is not None and should_stop():
                interrupted = True
                break
            variables = method.ask()
            if number < len(record.generations):
                evaluation = record.generations[number]
                if not np.array_equal(evaluation.variables, variables):
                    raise InputError(
                        "does not follow from this search's seed (made by another version or machine)",
                        file=str(record_path),
                        mend="delete it and search anew",
                    )
            else:
                begin = time.perf_counter()
                evaluation = evaluator.evaluate(variables)
                spent.append(time.perf_counter() - begin)
                record.add(evaluation)
            archive.add(evaluation)
            method.tell(evaluation.objectives, evaluation.constraints)
            if on_progress is not None:
                on_progress(archive.progress(spec.search.generations))
    except (KeyboardInterrupt, SystemExit) as stop:
        if not archive.history:
            raise
        interrupted, stopped_by = True, stop
    mean = sum(spent) / len(spent) if spent else float("nan")
    result = archive.result(seconds_per_generation=mean, interrupted=interrupted)
    return dataclasses.replace(result, stopped_by=stopped_by)


def start_vectors(problem: ConversionProblem) -> FloatArray:
    """The vectors of the paper's paths, best first, and one in the middle if none is wanted.

    Args:
        problem: What is searched.
    """
    wanted = problem.spec.search.start_from
    vectors = [problem.encode(path) for name, path in problem.baselines().items() if name in wanted]
    if not vectors:
        share = np.linspace(0.0, 1.0, problem.spec.points + 2)[1:-1]
        return np.concatenate((share, 1.0 - share))[None, :]
    evaluation = problem.evaluate(np.array(vectors))
    order = np.argsort(feasibility_order(evaluation.objectives[:, 0], evaluation.violation))
    return evaluation.variables[order]


class Archive:
    """Everything seen so far, and what is best of it."""

    def __init__(self) -> None:
        """Begin empty."""
        self._seen: list[Evaluation] = []
        self.history: list[float] = []
        self._best: tuple[float, float] = (np.inf, np.inf)

    def add(self, evaluation: Evaluation) -> None:
        """Take a generation.

        Args:
            evaluation: Its candidates.
        """
        self._seen.append(evaluation)
        found = zip(evaluation.violation.tolist(), evaluation.objectives[:, 0].tolist(), strict=True)
        self._best = min(self._best, *found)
        self.history.append(self._best[1] if self._best[0] <= 0.0 else float("nan"))

    def progress(self, generations: int) -> Progress:
        """How far the search has come.

        Args:
            generations: Generations to do.
        """
        evaluations = sum(len(seen.variables) for seen in self._seen)
        return Progress(len(self.history), generations, evaluations, self._best[1], self._best[0] <= 0.0)

    def result(self, *, seconds_per_generation: float, interrupted: bool) -> SearchResult:
        """What was found.

        Args:
            seconds_per_generation: Mean wall time of a generation [s].
            interrupted: The search was stopped early.

        Raises:
            InputError: Nothing was evaluated.
        """
        if not self._seen:
            raise InputError("ended before its first generation", key="search")
        variables = np.concatenate([seen.variables for seen in self._seen])
        objectives = np.concatenate([seen.objectives for seen in self._seen])
        constraints = np.concatenate([seen.constraints for seen in self._seen])
        violation = np.concatenate([seen.violation for seen in self._seen])
        best = int(np.lexsort((objectives[:, 0], violation))[0])
        feasible = np.flatnonzero(violation <= 0.0)
        front = feasible[nondominated(objectives[feasible])]
        front = front[np.argsort(objectives[front, 0], kind="stable")]
        return SearchResult(
            best=variables[best],
            objectives=tuple(objectives[best].tolist()),
            constraints=dict(zip(CONSTRAINTS, constraints[best].tolist(), strict=True)),
            feasible=bool(violation[best] <= 0.0),
            front=tuple(FrontPoint(variables[k], tuple(objectives[k].tolist())) for k in front),
            history=tuple(self.history),
            generations=len(self._seen),
            evaluations=len(variables),
            seconds_per_generation=seconds_per_generation,
            interrupted=interrupted,
        )


def nondominated(objectives: FloatArray) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Rows that no other row beats: nowhere worse and somewhere better; of equal rows the first.

    Args:
        objectives: Shape (candidates, objectives).

    Returns:
        Their numbers, ascending.
    """
    kept = []
    for k, row in enumerate(objectives):
        no_worse = (objectives <= row).all(axis=1)
        better = (objectives < row).any(axis=1)
        twins = (objectives[:k] == row).all(axis=1)
        if not (no_worse & better).any() and not twins.any():
            kept.append(k)
    return np.array(kept, dtype=np.int64)
