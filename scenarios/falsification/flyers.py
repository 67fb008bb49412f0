"""Who flies the points of a search: this machine or a Dask cluster; the answers are the same."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from functools import partial

import numpy as np

from rtsim.cluster.work import Cluster
from rtsim.errors import OutputError
from rtsim.worker_pool import Workers, WorkersDied
from scenarios.campaign.chunks import Task, task_identity
from scenarios.falsification.evaluation import Answer, Query, fly_points

PIECES_PER_WORKER = 3
"""A generation is cut into so many pieces for each worker, since flights differ in length."""


class LocalFlyer:
    """This machine: in this process, or in ``jobs`` processes that are kept between generations."""

    def __init__(self, task: Task, workers: Workers, jobs: int) -> None:
        """Remember what flies.

        Args:
            task: What flies.
            workers: The processes.
            jobs: How many.
        """
        self._task, self._workers, self._jobs = task, workers, jobs

    def __call__(self, queries: Sequence[Query]) -> list[Answer]:
        """Fly points.

        Args:
            queries: The points.

        Raises:
            OutputError: Worker processes died again and again.
        """
        try:
            pieces = [(self._task, piece) for piece in _cut(queries, self._jobs)]
            return [answer for found in self._workers.work(fly_points, pieces) for answer in found]
        except WorkersDied as error:
            raise OutputError(f"{error}; with --out FOLDER the same command goes on where it stopped.") from error


class DaskFlyer:
    """A Dask cluster; pieces lost with a worker are flown again by another."""

    def __init__(self, task: Task, cluster: Cluster) -> None:
        """Look who is there.

        Args:
            task: What flies.
            cluster: The cluster.

        Raises:
            InputError: A worker is not like this process.
            OutputError: There are no workers in time.
        """
        self._task, self._cluster, self._own = task, cluster, partial(task_identity, task)
        self._threads = cluster.threads(self._own)

    def __call__(self, queries: Sequence[Query]) -> list[Answer]:
        """Fly points.

        Args:
            queries: The points.

        Raises:
            InputError: A worker is not like this process.
            OutputError: The cluster is lost.
        """
        pieces = [(self._task, piece) for piece in _cut(queries, self._threads)]
        answers = dict(self._cluster.fly(self._own, fly_points, pieces))
        return [answer for number in range(len(pieces)) for answer in answers[number]]


def _cut(queries: Sequence[Query], workers: int) -> list[list[Query]]:
    count = min(len(queries), workers * PIECES_PER_WORKER if workers > 1 else 1)
    ends = np.linspace(0, len(queries), count + 1).round().astype(int).tolist()
    return [list(queries[first:last]) for first, last in itertools.pairwise(ends)]
