"""Who does the work of a campaign: this process, processes of this machine, or a Dask cluster; always in order.

Legend:
    task: The campaign.
    chunks: The pieces.
"""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from typing import Any, Protocol

from rtsim.errors import InputError, OutputError
from scenarios.campaign.chunks import Chunk, ChunkResult, Task, fly_chunk

WAVE = 4
"""Pieces per worker that are under way or waiting at a time."""
CONNECT_TIMEOUT_S = 10.0
"""How long a Dask scheduler may take to answer [s]."""


class Executor(Protocol):
    """Flies pieces and gives them back in the order in which they were asked for."""

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

    def __init__(self, address: str) -> None:
        """Connect.

        Args:
            address: The scheduler, such as ``tcp://host:8786``.

        Raises:
            InputError: Dask is not installed.
            OutputError: Nobody answers there.
        """
        try:
            from distributed import Client
        except ImportError as error:
            raise InputError(
                "Dask is not installed", key="--dask", value=address, mend="pip install 'rtsim[cluster]'"
            ) from error
        connect: Any = Client  # partly typed, and absent where only the checker runs
        try:
            self._client = connect(address, timeout=CONNECT_TIMEOUT_S)
        except (OSError, ValueError) as error:
            raise OutputError(f"--dask {address}: no Dask scheduler answers there.") from error

    def fly(self, task: Task, chunks: Sequence[Chunk]) -> Iterator[ChunkResult]:
        """Fly pieces in order.

        Raises:
            OutputError: The cluster gave up a piece.
        """
        from distributed import KilledWorker

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of the size of what is sent: a campaign file, once
            futures = [self._client.submit(fly_chunk, task, chunk, pure=False, retries=2) for chunk in chunks]
        try:
            for future in futures:
                try:
                    yield future.result()
                except KilledWorker as error:
                    raise OutputError(f"the Dask cluster lost its workers: {error}") from error
        finally:
            self._client.cancel(futures)

    def close(self) -> None:
        """Disconnect; the cluster goes on."""
        with contextlib.suppress(OSError):
            self._client.close()
