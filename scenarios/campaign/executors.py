"""Who does the work of a campaign: this process, processes of this machine, or a Dask cluster; always in order.

Legend:
    task: The campaign.
    chunks: The pieces.
"""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Iterator, Sequence
from typing import Any, Protocol

from rtsim.errors import InputError, OutputError
from rtsim.worker_pool import WorkersDied, work
from scenarios.campaign.chunks import Chunk, ChunkResult, Task, fly_chunk

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
            OutputError: Worker processes died again and again.
        """
        try:
            yield from work(fly_chunk, [(task, chunk) for chunk in chunks], jobs=self._jobs)
        except WorkersDied as error:
            raise OutputError(f"{error}; with --out FOLDER the same command goes on where it stopped.") from error


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
