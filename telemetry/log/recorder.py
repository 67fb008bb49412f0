"""The recording end of the flight log: rows and events go, without loss, to a process that writes them.

Parquet is written by another process (``telemetry.log.recorder_worker``), since a busy thread in the loop's own process
costs it half its frames. The rows travel through a pipe in batches of a fiftieth of a second. A live flight never
waits: what the pipe does not take stays in a backlog here. A headless flight waits for the pipe.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import select
import struct
import subprocess
import sys
import time
from collections import deque
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.errors import InputError, OutputError
from rtsim.frame import SIGNAL_COUNT
from telemetry.exchange.child_process import child_environment
from telemetry.exchange.ring import ROW_WIDTH
from telemetry.log.format import EVENTS_FILE, FlightMetadata, LogEvent

MESSAGE_HEADER = struct.Struct("<cxxxI")
"""Kind and payload length of every message in the pipe."""
ROWS, EVENT, CLOSE = b"R", b"E", b"C"

_BATCHES_PER_SECOND = 50.0
"""Measured beside a 250 Hz loop: fewer batches make single frames long, more cost more in all."""
_DRAINS_PER_LOOK = 10
"""How many drains pass between looks at the writer's answers."""
_PIPE_BYTES = 1 << 20
_SET_PIPE_SIZE = 1031  # F_SETPIPE_SZ of Linux, not named in Python 3.11's fcntl everywhere


class Recorder:
    """Writes one flight log; see ``telemetry.log.format`` for what it looks like on disk."""

    def __init__(
        self, path: str | os.PathLike[str], metadata: FlightMetadata, *, live: bool, overwrite: bool = False
    ) -> None:
        """Create the log and start its writer.

        Args:
            path: The log, a directory to be made; its parent must exist.
            metadata: What the log says about the flight.
            live: True in a paced flight (never wait), False headless (wait for the writer).
            overwrite: Replace an earlier log of rtsim at this path.

        Raises:
            InputError: Something that is not to be replaced is at the path.
            OutputError: The path cannot be written.
        """
        self.path = Path(path)
        """The log."""
        self.failure: OutputError | None = None
        """Why the log stopped growing, once it has; the flight itself is not affected."""
        self.rows = 0
        """Rows taken so far."""
        self._live = live
        self._lock = _create_log_directory(self.path, overwrite=overwrite)
        self._batch = np.full((max(1, round(metadata.rate_hz / _BATCHES_PER_SECOND)), ROW_WIDTH), np.nan)
        self._history = [row[:SIGNAL_COUNT] for row in self._batch]
        self._timing = [row[SIGNAL_COUNT:] for row in self._batch]
        self._fill = 0
        self._drains = 0
        self._backlog: deque[memoryview] = deque()
        self._status = b""
        self._closed = False
        self._process = _start_worker(self.path, metadata)
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._pipe, self._answers = self._process.stdin.fileno(), self._process.stdout.fileno()
        os.set_blocking(self._pipe, False)
        os.set_blocking(self._answers, False)

    @property
    def backlog_bytes(self) -> int:
        """Bytes waiting here because the writer is behind [B]."""
        return sum(len(chunk) for chunk in self._backlog)

    def push(self, row: FloatArray, timing: FloatArray | None = None) -> None:
        """Take one row."""
        fill = self._fill
        self._history[fill][:] = row
        self._timing[fill][:] = np.nan if timing is None else timing
        self._fill = fill + 1
        if fill + 1 == len(self._batch):
            self.flush()

    def push_block(self, rows: FloatArray) -> None:
        """Take many rows at once, without timing."""
        self._gather()
        for start in range(0, len(rows), 256):
            piece = rows[start : start + 256]
            block = np.full((len(piece), ROW_WIDTH), np.nan)
            block[:, :SIGNAL_COUNT] = piece
            self.rows += len(piece)
            self._send(ROWS, block.tobytes())
        self._drain()

    def event(self, event: LogEvent) -> None:
        """Record a discrete event; it keeps its place between the rows.

        Args:
            event: What happened.
        """
        self._gather()
        self._send(EVENT, event.to_json().encode())
        self._drain()

    def flush(self) -> None:
        """Hand the rows gathered so far to the writer; done by itself fifty times a second of flight."""
        self._gather()
        self._drain()

    def close(self, summary: Mapping[str, Any] | None = None, *, timeout_s: float = 20.0) -> None:
        """Finish the log.

        Args:
            summary: How the flight ended, as JSON values: end reason, history hash, metrics. None marks the log as
                not properly ended.
            timeout_s: How long to wait for a writer that does not move any more [s].

        Raises:
            OutputError: The log is incomplete; what was finished before can be read.
        """
        if self._closed:
            return
        self._closed = True
        self._gather()
        if summary is not None:
            self._send(CLOSE, json.dumps(dict(summary)).encode())
        try:
            self._drain(wait_s=timeout_s)
            self._end_worker(timeout_s)
        finally:
            if self._process.poll() is None:
                self._process.kill()
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(1.0)  # one that waits for a dead disk cannot even be killed
            for stream in (self._process.stdin, self._process.stdout):
                with contextlib.suppress(OSError):
                    stream.close()  # type: ignore[union-attr]  # both are pipes
            self._lock.close()
        if self.failure is not None:
            raise self.failure

    def _gather(self) -> None:
        if self._fill:
            self.rows += self._fill
            self._send(ROWS, self._batch[: self._fill].tobytes())
            self._fill = 0

    def _send(self, kind: bytes, payload: bytes) -> None:
        if self.failure is None:
            self._backlog.append(memoryview(MESSAGE_HEADER.pack(kind, len(payload)) + payload))

    def _drain(self, wait_s: float | None = None) -> None:
        """Write the backlog; wait where the flight is headless, or up to ``wait_s`` without any progress."""
        self._drains += 1
        if wait_s is not None or self._drains % _DRAINS_PER_LOOK == 0:
            self._read_answers()
        progress = time.monotonic()
        while self._backlog and self.failure is None:
            try:
                written = os.write(self._pipe, self._backlog[0])
            except BlockingIOError:
                if self._live and wait_s is None:
                    return
                select.select([], [self._pipe], [], 0.2)
                if wait_s is not None and time.monotonic() - progress > wait_s:
                    self._fail(f"its writer did not move for {wait_s:.0f} s")
                self._read_answers()
            except OSError:
                self._read_answers()
                self._fail("its writer ended unexpectedly")
            else:
                progress = time.monotonic()
                rest = self._backlog[0][written:]
                if len(rest):
                    self._backlog[0] = rest
                else:
                    self._backlog.popleft()

    def _read_answers(self) -> None:
        """Take what the worker says: nothing while all is well, one JSON line when it cannot write."""
        try:
            data = os.read(self._answers, 4096)
        except (BlockingIOError, OSError):
            return
        self._status += data
        while b"\n" in self._status:
            line, self._status = self._status.split(b"\n", 1)
            self._fail(json.loads(line)["error"])

    def _fail(self, reason: str) -> None:
        if self.failure is None:
            self.failure = OutputError(
                f"{self.path}: the log stopped because {reason}; its finished parts are intact, "
                "free space or choose another path and fly again."
            )
            self._backlog.clear()

    def _end_worker(self, timeout_s: float) -> None:
        with contextlib.suppress(OSError):
            self._process.stdin.close()  # type: ignore[union-attr]  # a pipe
        deadline = time.monotonic() + timeout_s
        while self._process.poll() is None and time.monotonic() < deadline:
            select.select([self._answers], [], [], 0.05)
            self._read_answers()
        self._read_answers()
        if self._process.poll() is None:
            self._fail(f"its writer did not finish within {timeout_s:.0f} s")
        elif self._process.returncode:
            self._fail("its writer ended unexpectedly")


def _create_log_directory(path: Path, *, overwrite: bool) -> BinaryIO:
    """Make the directory, empty but for the events file, whose lock is held until the log is closed."""
    try:
        try:
            path.mkdir()
        except FileExistsError:
            _clear_old_log(path, overwrite=overwrite)
        events = (path / EVENTS_FILE).open("ab")
    except OSError as failure:
        raise OutputError(
            f"{path}: the log cannot be written here ({failure.strerror}); choose a directory that exists and is yours."
        ) from failure
    _lock_or_refuse(events, path)
    return events


def _clear_old_log(path: Path, *, overwrite: bool) -> None:
    """Remove an earlier log where that was asked for, and nothing else ever."""
    entries = list(path.iterdir()) if path.is_dir() else []
    if path.is_dir() and not entries:
        return
    if not is_flight_log(path):
        raise InputError("something that is no rtsim log is here", file=str(path), mend="choose another path")
    if not overwrite:
        raise InputError("there is a log here already", file=str(path), mend="choose another path or add --overwrite")
    with (path / EVENTS_FILE).open("ab") as events:
        _lock_or_refuse(events, path)
        for entry in entries:
            entry.unlink()


def is_flight_log(path: Path) -> bool:
    """Whether a path is a flight log of rtsim and holds nothing else.

    Args:
        path: The path in question.
    """
    if not path.is_dir() or not (path / EVENTS_FILE).is_file():
        return False
    return all(entry.name == EVENTS_FILE or "part-" in entry.name for entry in path.iterdir())


def _lock_or_refuse(events: BinaryIO, path: Path) -> None:
    try:
        fcntl.flock(events, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        events.close()
        raise InputError(
            "another flight is writing this log", file=str(path), mend="wait for its end or choose another path"
        ) from None


def _start_worker(path: Path, metadata: FlightMetadata) -> subprocess.Popen[bytes]:
    """Start the writing process and give it the metadata as its first message."""
    process = subprocess.Popen(
        [sys.executable, "-m", "telemetry.log.recorder_worker", str(path.resolve())],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=child_environment(),
        start_new_session=True,  # Ctrl-C is for the flight; the writer ends when the pipe does
    )
    pipe = process.stdin
    assert pipe is not None
    with contextlib.suppress(OSError):
        fcntl.fcntl(pipe.fileno(), _SET_PIPE_SIZE, _PIPE_BYTES)
    text = metadata.to_json().encode()
    with contextlib.suppress(OSError):  # a worker that died at once shows at the first drain
        pipe.write(MESSAGE_HEADER.pack(b"M", len(text)) + text)
        pipe.flush()
    return process
