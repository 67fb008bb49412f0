"""Who does the work of a campaign: this process, processes of this machine, or a Dask cluster.

Legend:
    task: The campaign.
    chunks: The pieces.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Protocol

from rtsim.cluster.work import Cluster
from rtsim.errors import OutputError
from rtsim.worker_pool import WorkersDied, work
from scenarios.campaign.chunks import Chunk, ChunkResult, Task, fly_chunk, task_identity


class Executor(Protocol):
    """Flies pieces and gives each back as it is finished."""

    def fly(self, task: Task, chunks: Sequence[Chunk]) -> Iterator[ChunkResult]:
        """Fly pieces; the iterator may be closed before its end."""
        ...


class LocalExecutor:
    """This machine: in this process, or in ``jobs`` processes."""

    def __init__(self, jobs: int) -> None:
        """Remember how many.

        Args:
            jobs: Processes; 1 works in this one.
        """
        self._jobs = jobs

    def fly(self, task: Task, chunks: Sequence[Chunk]) -> Iterator[ChunkResult]:
        """Fly pieces in order.

        Raises:
            OutputError: Worker processes died again and again.
        """
        try:
            yield from work(fly_chunk, [(task, chunk) for chunk in chunks], jobs=self._jobs)
        except WorkersDied as error:
            raise OutputError(f"{error}; with --out FOLDER the same command goes on where it stopped.") from error


class DaskExecutor:
    """A Dask cluster; pieces lost with a worker are flown again by another."""

    def __init__(self, cluster: Cluster) -> None:
        """Take a cluster.

        Args:
            cluster: The cluster.
        """
        self._cluster = cluster

    def fly(self, task: Task, chunks: Sequence[Chunk]) -> Iterator[ChunkResult]:
        """Fly pieces; each is given back as it is finished.

        Raises:
            InputError: A worker is not like this process.
            OutputError: The cluster is lost.
        """
        pieces = [(task, chunk) for chunk in chunks]
        for _, result in self._cluster.fly(partial(task_identity, task), fly_chunk, pieces):
            yield result
