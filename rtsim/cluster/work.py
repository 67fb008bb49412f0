"""A Dask cluster at work: workers waited for and known, pieces handed out and taken back, losses told in a sentence.

Legend:
    address: The scheduler's address, as the user wrote it.
    own: Gives what this work needs besides rtsim (database, laws), by name; called here and in every worker.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import queue
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

from rtsim.cluster.access import CONNECT_TIMEOUT_S, require_scheduler, scheduler_address, security
from rtsim.cluster.identity import Own, answer, differences, identity
from rtsim.errors import InputError, OutputError

WORKERS_WAIT_S = 30.0
"""How long a cluster may be without workers, and how long a worker or the scheduler may take to answer [s]."""
POLL_S = 1.0
"""How often the cluster is looked at while a piece is awaited [s]."""
WORKERS_SHOWN = 10
"""Of more workers that differ the rest is counted."""
VERSION = "__import__('rtsim').__version__"
"""Asked of a worker that does not know :func:`answer`."""
CHATTY = ("distributed", "tornado.application", "asyncio")
"""Loggers that print tracebacks of what is told in a sentence here."""
Result = TypeVar("Result")


class Foreign(Exception):
    """A worker that is not like the process that asked, and so has flown nothing."""

    def __init__(self, worker: str, found: dict[str, str]) -> None:
        """Tell who it is.

        Args:
            worker: Its address.
            found: Its identity.
        """
        super().__init__(worker, found)
        self.worker, self.found = worker, found


def fly_piece(
    expected: dict[str, str], own: Own, function: Callable[..., Result], arguments: tuple[Any, ...]
) -> Result:
    """Do one piece in a worker that is what the work expects.

    Args:
        expected: Identity of the process that asked.
        function: Does the piece.
        arguments: Its arguments.

    Raises:
        Foreign: This worker is another.
    """
    found = identity(own)
    if found != expected:
        from distributed import get_worker

        raise Foreign(str(get_worker().address), found)
    return function(*arguments)


class Cluster:
    """A connection to a scheduler; closing it leaves the cluster as it was."""

    def __init__(self, address: str, *, tls: Path | None = None, goes_on: str) -> None:
        """Connect.

        Args:
            tls: File that names the certificates of an encrypted cluster.
            goes_on: What to say of going on when the cluster is lost.

        Raises:
            InputError: The package is missing, the address is malformed, or a certificate cannot be used.
            OutputError: No scheduler answers there.
        """
        self._address = scheduler_address(address, encrypted=tls is not None)
        self._goes_on = goes_on
        try:
            from distributed import Client
        except ModuleNotFoundError as missing:
            raise InputError(
                f"needs the package {missing.name}, which is not installed",
                key="--dask",
                mend="install it with: pip install 'rtsim[cluster]'",
            ) from None
        certificates = None if tls is None else security(tls)
        self._known: set[str] = set()
        self._seen = time.monotonic()
        self._loud = _silenced()
        connect: Any = Client  # partly typed, and absent where only the checker runs
        try:
            require_scheduler(self._address, certificates)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of other versions: what matters is told below
                self._client = connect(
                    self._address, timeout=CONNECT_TIMEOUT_S, set_as_default=False, security=certificates
                )
        except BaseException as error:
            _let_speak(self._loud)
            if isinstance(error, (OSError, ValueError, ImportError)):
                raise OutputError(f"--dask: {self._address} answers, but does not take part: {error}.") from error
            raise

    def __enter__(self) -> Self:
        """The cluster itself."""
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
        with contextlib.suppress(OSError):
            self._client.close()
        _let_speak(self._loud)

    def threads(self, own: Own) -> int:
        """Wait for workers and look at who they are.

        Returns:
            Threads of all workers.

        Raises:
            InputError: Workers differ from this process.
            OutputError: There are none in time, or the scheduler is lost.
        """
        self._seen = time.monotonic()
        while not (count := self._look(own, identity(own))):
            time.sleep(min(POLL_S, WORKERS_WAIT_S / 10))
        return count

    def fly(
        self, own: Own, function: Callable[..., Result], pieces: Sequence[tuple[Any, ...]]
    ) -> Iterator[tuple[int, Result]]:
        """Do pieces; those of a worker that is lost are done by another. The iterator may be closed before its end.

        Args:
            function: Does a piece.
            pieces: Its arguments, for each.

        Yields:
            The number of a piece and what came of it, as they are finished.

        Raises:
            InputError: A worker differs from this process.
            OutputError: The scheduler or all workers are lost, or a piece ended several workers.
        """
        if not pieces:
            return
        self.threads(own)
        here = identity(own)
        done: queue.SimpleQueue[Any] = queue.SimpleQueue()
        numbers = {}
        futures = []
        try:
            with warnings.catch_warnings(), self._lost_is_told():
                warnings.simplefilter("ignore")  # of the size of what is sent: a campaign file, once
                for number, piece in enumerate(pieces):
                    futures.append(self._client.submit(fly_piece, here, own, function, piece, pure=False))
                    numbers[futures[-1].key] = number
            for future in futures:
                future.add_done_callback(done.put)
            for _ in futures:
                future = self._next(done, own, here)
                yield numbers[future.key], self._result(future, own, here)
        finally:
            with contextlib.suppress(OSError, RuntimeError):  # where the scheduler is lost there is nothing to cancel
                self._client.cancel(futures)

    def _next(self, done: queue.SimpleQueue[Any], own: Own, here: dict[str, str]) -> Any:
        while True:
            try:
                return done.get(timeout=POLL_S)
            except queue.Empty:
                self._look(own, here)

    def _result(self, future: Any, own: Own, here: dict[str, str]) -> Any:
        while True:
            try:
                return future.result(timeout=POLL_S)
            except Exception as error:
                if future.status == "error":
                    raise self._failure(future.exception(timeout=WORKERS_WAIT_S), own, here) from None
                if not isinstance(error, TimeoutError):
                    with self._lost_is_told(CancelledError):
                        raise
                self._look(own, here)  # the way is long, or the worker that had the result is lost: another flies it

    def _failure(self, error: Exception, own: Own, here: dict[str, str]) -> Exception:
        """What to tell of a piece that failed in its worker."""
        from distributed import KilledWorker

        if isinstance(error, Foreign):
            return self._refusal({error.worker: error.found}, here)
        if isinstance(error, KilledWorker):
            return OutputError(
                "--dask: a piece ended every worker that tried it: memory ran out, or the law under test ends its "
                f"process; {self._goes_on}."
            )
        if isinstance(error, (OSError, MemoryError, ImportError, AttributeError, RuntimeError)):
            self._known.clear()
            self._look(own, here)  # who has another rtsim cannot even read the piece
            return OutputError(
                f"--dask: a piece failed on the cluster ({type(error).__name__}: {error}); see that scheduler and "
                f"workers run where this rtsim is installed, with memory and disk to spare; {self._goes_on}."
            )
        return error

    def _look(self, own: Own, here: dict[str, str]) -> int:
        """Threads of all workers, each of them known; 0 where there are none, but not for too long."""
        with self._lost_is_told():
            found = self._client.sync(self._client.nthreads, callback_timeout=WORKERS_WAIT_S)
        if found:
            self._meet(set(found) - self._known, own, here)
            self._seen = time.monotonic()
        elif time.monotonic() - self._seen > WORKERS_WAIT_S:
            raise OutputError(
                f"--dask: the scheduler at {self._address} has had no workers for {WORKERS_WAIT_S:g} s; "
                f"start some where this rtsim is installed: dask worker {self._address}; {self._goes_on}."
            )
        return sum(found.values())

    def _meet(self, strangers: set[str], own: Own, here: dict[str, str]) -> None:
        """Ask workers who they are."""
        if not strangers:
            return

        async def ask(worker: str) -> Any:
            async def call(function: Any, argument: Any) -> Any:
                asked = self._client.run(function, argument, workers=[worker], on_error="return")
                return (await asyncio.wait_for(asked, WORKERS_WAIT_S))[worker]

            found = await call(answer, own)
            if isinstance(found, dict):
                return found
            version = await call(eval, VERSION)  # a builtin, which any worker knows
            if isinstance(version, str):
                return f"rtsim {version}, which cannot say what it is ({found})"
            return f"no rtsim ({version})"

        async def ask_all() -> list[Any]:
            return await asyncio.gather(*(ask(worker) for worker in sorted(strangers)), return_exceptions=True)

        with self._lost_is_told():
            answers = dict(zip(sorted(strangers), self._client.sync(ask_all), strict=True))
            still = self._client.sync(self._client.nthreads, callback_timeout=WORKERS_WAIT_S)
        others = {worker: found for worker, found in answers.items() if found != here and worker in still}
        if others:
            raise self._refusal(others, here)
        self._known |= strangers

    def _refusal(self, others: dict[str, Any], here: dict[str, str]) -> InputError:
        words = []
        for worker, found in list(others.items())[:WORKERS_SHOWN]:
            if isinstance(found, BaseException):
                words.append(f"{worker} does not answer ({type(found).__name__} after {WORKERS_WAIT_S:g} s)")
            else:
                words.append(f"{worker} has {differences(here, found) if isinstance(found, dict) else found}")
        if len(others) > WORKERS_SHOWN:
            words.append(f"{len(others) - WORKERS_SHOWN} more")
        return InputError(
            f"workers must be like this process, but {'; '.join(words)}",
            key="--dask",
            mend="give every worker the same rtsim, Python, packages and files, and start it anew",
        )

    @contextlib.contextmanager
    def _lost_is_told(self, *kinds: type[Exception]) -> Iterator[None]:
        """Turn the loss of the scheduler into its sentence."""
        try:
            yield
        except (OSError, *kinds) as error:  # type: ignore[misc]
            raise OutputError(
                f"--dask: the connection to the scheduler at {self._address} is lost; {self._goes_on}."
            ) from error


def _silenced() -> list[logging.Logger]:
    """Take the word from Dask's loggers."""
    names = [name for name in logging.root.manager.loggerDict if name.startswith(CHATTY)]
    loud = [logger for name in {*names, *CHATTY} if not (logger := logging.getLogger(name)).disabled]
    for logger in loud:
        logger.disabled = True
    return loud


def _let_speak(loud: list[logging.Logger]) -> None:
    for logger in loud:
        logger.disabled = False
