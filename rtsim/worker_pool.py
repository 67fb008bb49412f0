"""Processes of this machine that share a piece of work.

Each is connected by a pair of sockets: there is nothing with a name that could be left behind. A worker ends the moment
its socket does; the piece of one that died or hangs is given to another.
"""

from __future__ import annotations

import contextlib
import logging
import os
import pickle
import queue
import socket
import subprocess
import sys
import threading
import traceback
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from multiprocessing.connection import Connection, wait
from typing import Any, Self

from rtsim.errors import OutputError
from rtsim.processes import ROOT, Stillness, end_process, ending, is_here, start_process

AHEAD = 4
"""Pieces per worker that may be done before the first of them is taken."""
MOST_DEATHS = 3
"""A piece that ended as many workers is given up."""
HANG_S = 90.0
"""A worker that does nothing with its piece for so long is ended [s]; a law may sleep for a minute."""
_LOOK_S = 1.0


class WorkersDied(OutputError):
    """One piece ended one worker after the other."""


def work(function: Callable[..., Any], pieces: Iterable[tuple[Any, ...]], *, jobs: int) -> Iterator[Any]:
    """Work on pieces, here or in processes, and give the results in the order of the pieces.

    Args:
        function: What is done with each; a module has it.
        pieces: Its arguments, piece by piece.
        jobs: Processes; 1 works in this one.

    Yields:
        The results.

    Raises:
        WorkersDied: A piece ended one worker after the other.
    """
    pieces = list(pieces)
    with Workers(min(jobs, max(len(pieces), 1))) as workers:
        yield from workers.work(function, pieces)


class Workers:
    """Processes that are kept between pieces of work; one works in this process."""

    def __init__(self, jobs: int) -> None:
        """Start none yet.

        Args:
            jobs: Processes; 1 works in this one.
        """
        self._jobs = jobs
        self._workers: list[_Worker] = []

    def __enter__(self) -> Self:
        """The workers."""
        return self

    def __exit__(self, *_: object) -> None:
        """End them."""
        self.close()

    def work(self, function: Callable[..., Any], pieces: Sequence[tuple[Any, ...]]) -> Iterator[Any]:
        """Work on pieces and give the results in the order of the pieces.

        Args:
            function: What is done with each; a module has it.
            pieces: Its arguments, piece by piece.

        Yields:
            The results. Workers are ended where it is closed before its end.

        Raises:
            WorkersDied: A piece ended one worker after the other.
        """
        if self._jobs == 1 or (len(pieces) <= 1 and not self._workers):
            for piece in pieces:
                yield function(*piece)
            return
        if not self._workers:
            self._workers += [_Worker() for _ in range(self._jobs)]
        try:
            yield from _Pool(function, pieces, self._workers).results()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """End the processes."""
        for worker in self._workers:
            worker.connection.close()
        for worker in self._workers:
            end_process(worker.process)
        self._workers.clear()


class _Worker:
    """One process and the socket to it."""

    def __init__(self) -> None:
        ours, theirs = socket.socketpair()
        with theirs:
            self.process = start_process(
                "rtsim.worker_pool",
                str(theirs.fileno()),
                handed=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=2,  # what a law prints must not come between the results of the command
            )
        self.stillness = Stillness(self.process)
        self.connection = Connection(ours.detach())
        self.piece: int | None = None
        # What this process can import, a worker can; but nothing stands before what is installed.
        here = [entry for entry in sys.path if is_here(entry)]
        self.connection.send([str(ROOT), *(entry for entry in sys.path if entry not in here), *here])


class _Pool:
    """Which worker has which piece, and what is finished."""

    def __init__(self, function: Callable[..., Any], pieces: Sequence[tuple[Any, ...]], workers: list[_Worker]) -> None:
        self._function, self._pieces = function, pieces
        self._todo = deque(range(len(pieces)))
        self._deaths = [0] * len(pieces)
        self._done: dict[int, Any] = {}
        self._workers = workers

    def results(self) -> Iterator[Any]:
        for wanted in range(len(self._pieces)):
            while wanted not in self._done:
                self._hand_out(wanted)
                busy = [worker for worker in self._workers if worker.piece is not None]
                answered = wait([worker.connection for worker in busy], timeout=_LOOK_S)
                for worker in busy:
                    if worker.connection in answered:
                        self._collect(worker)
                    elif worker.stillness.end_after(HANG_S):
                        assert worker.piece is not None
                        self._replace(worker, worker.piece)
            result, failure = self._done.pop(wanted)
            if failure is not None:
                kind, arguments, attributes, told = failure
                error = kind.__new__(kind, *arguments)  # its __init__ would compose the sentence a second time
                error.__dict__.update(attributes)
                raise error from RuntimeError(f"in a worker process:\n{told}")
            yield result

    def _hand_out(self, wanted: int) -> None:
        for worker in self._workers:
            if worker.piece is None and self._todo and self._todo[0] < wanted + AHEAD * len(self._workers):
                worker.piece = self._todo.popleft()
                worker.stillness.reset()
                with contextlib.suppress(OSError):  # it died: that shows when its answer is read
                    worker.connection.send((self._function, self._pieces[worker.piece]))

    def _collect(self, worker: _Worker) -> None:
        piece = worker.piece
        assert piece is not None
        try:
            self._done[piece] = worker.connection.recv()
        except (EOFError, OSError):
            self._replace(worker, piece)
        else:
            worker.piece = None

    def _replace(self, worker: _Worker, piece: int) -> None:
        """Start another for one that died, and let it have the piece."""
        end_process(worker.process, patience_s=1.0)
        worker.connection.close()
        self._deaths[piece] += 1
        if self._deaths[piece] >= MOST_DEATHS:
            raise WorkersDied(
                f"a worker process died ({ending(worker.process)}), and so did {MOST_DEATHS - 1} that replaced it: "
                "memory ran out, somebody ended them, or the law under test ended its process"
            )
        logging.getLogger(__name__).warning(
            "A worker process died (%s); another does its piece.", ending(worker.process)
        )
        self._todo.appendleft(piece)
        self._workers[self._workers.index(worker)] = _Worker()


def main() -> None:
    """Be a worker: pieces come and results go through the socket named on the command line."""
    connection = Connection(int(sys.argv[1]))
    sys.path[:] = connection.recv()
    pieces: queue.SimpleQueue[bytes] = queue.SimpleQueue()

    def receive() -> None:
        try:
            while True:
                pieces.put(connection.recv_bytes())
        finally:
            os._exit(1)  # who started us is gone, or done

    threading.Thread(target=receive, name="pieces", daemon=True).start()
    while True:
        try:
            function, arguments = pickle.loads(pieces.get())
            answer: tuple[Any, Any] = (function(*arguments), None)
        except BaseException as error:  # noqa: BLE001 - a law may raise anything
            told = traceback.format_exc()
            answer = (None, (type(error), error.args, dict(error.__dict__), told))
        try:
            message = pickle.dumps(answer)
        except Exception as error:  # noqa: BLE001 - whatever cannot be sent
            told = f"{answer}: {error}"
            message = pickle.dumps((None, (RuntimeError, (told,), {}, told)))
        connection.send_bytes(message)


if __name__ == "__main__":
    main()
