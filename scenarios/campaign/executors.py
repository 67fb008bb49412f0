"""Who does the work of a campaign: this process, processes of this machine, or a Dask cluster.

Legend:
    task: The campaign.
    chunks: The pieces.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from typing import Protocol

from rtsim.cluster.work import Cluster
from rtsim.errors import OutputError
from scenarios.campaign.chunks import Chunk, ChunkResult, Task, fly_chunk, task_identity

WAVE = 4
"""Pieces per worker that are under way or waiting at a time."""


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
            OutputError: A worker process died.
        """
        if self._jobs == 1 or len(chunks) <= 1:
            for chunk in chunks:
                yield fly_chunk(task, chunk)
            return
        from joblib import Parallel, delayed

        # Waves instead of one long list: what is finished can be kept, and the end can come early.
        # Each piece is given on as it comes: what is finished is kept even if the rest of its wave is not.
        try:
            with Parallel(n_jobs=self._jobs, batch_size=1, return_as="generator") as workers:
                size = WAVE * self._jobs
                for begin in range(0, len(chunks), size):
                    yield from workers(delayed(fly_chunk)(task, chunk) for chunk in chunks[begin : begin + size])
        except BrokenProcessPool as error:
            raise OutputError(
                "a worker process died: memory ran out, somebody ended it, or the law under test ended its process; "
                "with --out FOLDER the same command goes on where it stopped."
            ) from error


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
