"""Flies the candidates of a search on a Dask cluster; the result is that of a search on one such machine."""

from __future__ import annotations

import re
from functools import lru_cache
from types import TracebackType
from typing import Any, Self

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.optimization.problem import ConversionProblem, Evaluation
from rtsim.optimization.spec import SearchSpec

CONNECT_TIMEOUT_S = 10
ADDRESS = re.compile(r"((tcp|tls|ws|wss|ucx)://)?(\[[0-9a-fA-F:]+\]|[\w.-]+):\d{1,5}")
"""Addresses of schedulers: ``tcp://HOST:PORT``."""
RETRIES = 3
"""How often a piece of a generation is tried anew when its worker dies."""


@lru_cache(maxsize=4)
def _problem(spec_json: str) -> ConversionProblem:
    """The problem as this worker process keeps it between calls."""
    return ConversionProblem(SearchSpec.model_validate_json(spec_json), workers=1)


def evaluate_here(spec_json: str, variables: FloatArray) -> tuple[str, FloatArray, FloatArray]:
    """Fly candidates in a worker of the cluster.

    Args:
        spec_json: The specification as JSON.
        variables: Shape (candidates, variables).

    Returns:
        The database's hash, objectives and constraints.
    """
    problem = _problem(spec_json)
    evaluation = problem.evaluate(variables)
    return problem.database_hash, evaluation.objectives, evaluation.constraints


class ClusterEvaluator:
    """Spreads each generation over the workers of a cluster; order and values do not depend on who flies what."""

    def __init__(self, problem: ConversionProblem, address: str) -> None:
        """Connect.

        Args:
            problem: What is searched.
            address: The scheduler's address, as in ``tcp://127.0.0.1:8786``.

        Raises:
            InputError: The package is missing or nobody answers there.
        """
        try:
            from distributed import Client
        except ModuleNotFoundError as missing:
            raise InputError(
                f"needs the package {missing.name}, which is not installed",
                key="--dask",
                mend="install it with: pip install 'rtsim[cluster]'",
            ) from None
        if not ADDRESS.fullmatch(address):
            # distributed would refuse it too, then hang for 20 s and print a traceback while it is cleaned up.
            raise InputError("is not the address of a Dask scheduler", key="--dask", value=address, allowed="HOST:PORT")
        self._spec_json = problem.spec.model_dump_json()
        self._hash = problem.database_hash
        try:
            connect: Any = Client  # untyped
            self._client = connect(address, timeout=CONNECT_TIMEOUT_S, set_as_default=False)
        except (OSError, ValueError) as error:
            raise InputError(
                f"no Dask scheduler answers there ({str(error) or type(error).__name__})",
                key="--dask",
                value=address,
                mend="start one with: dask scheduler",
            ) from None

    def __enter__(self) -> Self:
        """The evaluator itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Disconnect.

        Args:
            kind: Type of what was raised, if anything.
            error: What was raised.
            trace: Where.
        """
        self._client.close()

    def evaluate(self, variables: FloatArray) -> Evaluation:
        """Fly candidates.

        Args:
            variables: Shape (candidates, variables).

        Raises:
            InputError: A worker has another database.
        """
        threads = sum(self._client.nthreads().values()) or 1
        pieces = np.array_split(variables, min(len(variables), 2 * threads))
        futures = self._client.map(evaluate_here, [self._spec_json] * len(pieces), pieces, pure=False, retries=RETRIES)
        answers = self._client.gather(futures)
        if any(answer[0] != self._hash for answer in answers):
            raise InputError(
                "a worker has another LPV database", key="--dask", mend="install the same rtsim everywhere"
            )
        return Evaluation(
            np.array(variables, dtype=np.float64),
            np.concatenate([answer[1] for answer in answers]),
            np.concatenate([answer[2] for answer in answers]),
        )
