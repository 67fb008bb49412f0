"""Flies the candidates of a search on a Dask cluster; the result is that of a search on one such machine."""

from __future__ import annotations

from functools import lru_cache, partial

import numpy as np

from rtsim.aircraft.condition import AircraftName
from rtsim.arrays import FloatArray
from rtsim.cluster.identity import found_or_told
from rtsim.cluster.work import Cluster
from rtsim.lpv.files.storage import load_database
from rtsim.optimization.problem import ConversionProblem, Evaluation
from rtsim.optimization.spec import SearchSpec


@lru_cache(maxsize=4)
def _problem(spec_json: str, aircraft_hash: str) -> ConversionProblem:
    """The problem as this worker process keeps it between calls, as long as the aircraft is the same."""
    del aircraft_hash
    return ConversionProblem(SearchSpec.model_validate_json(spec_json), workers=1)


def search_identity(aircraft: AircraftName) -> dict[str, str]:
    """What a search needs to be the same wherever it is flown, besides rtsim: its aircraft.

    Args:
        aircraft: File of its database, empty for the shipped one, or a condition, whose database must be kept.
    """
    return {"database": found_or_told(lambda: load_database(aircraft or None).aircraft_hash)}


def evaluate_here(spec_json: str, aircraft_hash: str, variables: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Fly candidates in a worker of the cluster.

    Args:
        spec_json: The specification as JSON.
        aircraft_hash: Hash of the aircraft's database and profile.
        variables: Shape (candidates, variables).

    Returns:
        Objectives and constraints.
    """
    evaluation = _problem(spec_json, aircraft_hash).evaluate(variables)
    return evaluation.objectives, evaluation.constraints


class ClusterEvaluator:
    """Spreads each generation over the workers of a cluster; order and values do not depend on who flies what."""

    def __init__(self, problem: ConversionProblem, cluster: Cluster) -> None:
        """Take a cluster, once it has workers and they are known.

        Args:
            problem: What is searched.
            cluster: Who flies.

        Raises:
            InputError: A worker is not like this process.
            OutputError: There are no workers in time.
        """
        self._cluster = cluster
        self._spec_json, self._hash = problem.spec.model_dump_json(), problem.database_hash
        self._own = partial(search_identity, problem.setup.options.aircraft)
        cluster.threads(self._own)

    def evaluate(self, variables: FloatArray) -> Evaluation:
        """Fly candidates.

        Args:
            variables: Shape (candidates, variables).

        Raises:
            InputError: A worker is not like this process.
            OutputError: The cluster is lost.
        """
        count = min(len(variables), 2 * self._cluster.threads(self._own))
        pieces = [(self._spec_json, self._hash, part) for part in np.array_split(variables, count)]
        answers = dict(self._cluster.fly(self._own, evaluate_here, pieces))
        return Evaluation(
            np.array(variables, dtype=np.float64),
            np.concatenate([answers[number][0] for number in range(count)]),
            np.concatenate([answers[number][1] for number in range(count)]),
        )
