"""The recording end of the flight log: rows and events go, without loss, to a process that writes them.

A writer that dies or hangs is replaced: what it had not confirmed is kept here and given to the next one.

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
import time
from collections import deque
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.errors import OutputError
from rtsim.frame import SIGNAL_COUNT
from rtsim.processes import Stillness, end_process, ending, start_process
from telemetry.exchange.ring import ROW_WIDTH
from telemetry.log.format import FlightMetadata, LogEvent
from telemetry.log.place import claim_log

MESSAGE_HEADER = struct.Struct("<cxxxI")
"""Kind and payload length of every message in the pipe."""
ROWS, EVENT, CLOSE = b"R", b"E", b"C"


@dataclass(frozen=True, slots=True)
class Progress:
    """How much of a flight stands in its log."""

    parts: int = 0
    """Parts with rows."""
    rows: int = 0
    """Rows in them."""
    events: int = 0
    """Events in the events file."""
    event_bytes: int = 0
    """Its length [bytes]."""

    def to_json(self) -> str:
        """As one line."""
        return json.dumps(asdict(self))


_BATCHES_PER_SECOND = 50.0
"""Measured beside a 250 Hz loop: fewer batches make single frames long, more cost more in all."""
_DRAINS_PER_LOOK = 10
"""How many drains pass between looks at the writer's answers."""
_MOST_DEATHS = 3
"""A log whose writers die one after the other, having confirmed nothing, is given up."""
HANG_S = 5.0
"""A writer that takes nothing of what waits for it, and does nothing, for so long is ended and replaced [s]."""
_ROW_BYTES = 8 * ROW_WIDTH
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
        self.notes: list[str] = []
        """What became of the writer and is worth an event of the flight; whoever makes one takes it from here."""
        self._lock = claim_log(self.path, overwrite=overwrite)
        self._metadata = metadata
        self._batch = np.full((max(1, round(metadata.rate_hz / _BATCHES_PER_SECOND)), ROW_WIDTH), np.nan)
        self._history = [row[:SIGNAL_COUNT] for row in self._batch]
        self._timing = [row[SIGNAL_COUNT:] for row in self._batch]
        self._fill = 0
        self._drains = 0
        self._backlog: deque[memoryview] = deque()
        self._confirmed = Progress()
        self._unconfirmed: dict[bytes, deque[bytes]] = {ROWS: deque(), EVENT: deque()}
        self._summary: bytes | None = None
        self._deaths = 0
        self._status = b""
        self._closed = False
        self._start_writer()

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
            self._summary = json.dumps(dict(summary)).encode()
            self._send(CLOSE, self._summary)
        try:
            while not self._finish_writer(timeout_s):
                self._replace_writer()
        finally:
            end_process(self._process)
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
            if kind in self._unconfirmed:
                self._unconfirmed[kind].append(payload)

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
                if self._stillness.end_after(HANG_S):
                    self._replace_writer()
                    continue
                if self._live and wait_s is None:
                    return
                select.select([self._answers], [self._pipe], [], 0.2)
                if wait_s is not None and time.monotonic() - progress > wait_s:
                    self._fail(f"its writer did not move for {wait_s:.0f} s")
                self._read_answers()
            except OSError:
                self._replace_writer()
            else:
                progress = time.monotonic()
                self._stillness.reset()
                rest = self._backlog[0][written:]
                if len(rest):
                    self._backlog[0] = rest
                else:
                    self._backlog.popleft()

    def _read_answers(self) -> None:
        """Take what the worker says: how far it is, or why it cannot write."""
        try:
            data = os.read(self._answers, 1 << 16)
        except (BlockingIOError, OSError):
            return
        self._status += data
        *lines, self._status = self._status.split(b"\n")
        for line in lines:
            answer = json.loads(line)
            if "error" in answer:
                self._fail(answer["error"])
            else:
                self._confirm(Progress(**answer))

    def _confirm(self, progress: Progress) -> None:
        """Forget what now stands in the log."""
        before, self._confirmed = self._confirmed, progress
        self._deaths = 0
        events, rows = self._unconfirmed[EVENT], self._unconfirmed[ROWS]
        for _ in range(progress.events - before.events):
            events.popleft()
        left = (progress.rows - before.rows) * _ROW_BYTES
        while left:
            block = rows.popleft()
            if len(block) > left:
                rows.appendleft(block[left:])
            left = max(0, left - len(block))

    def _start_writer(self) -> None:
        """Start a writing process, the first or another, and let it go on where the log stands."""
        self._process = start_process(
            "telemetry.log.recorder_worker",
            str(self.path.resolve()),
            self._confirmed.to_json(),
            handed=[self._lock.fileno()],  # nobody else writes here before it has ended, should this process be killed
        )
        self._stillness = Stillness(self._process)
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._pipe, self._answers = self._process.stdin.fileno(), self._process.stdout.fileno()
        with contextlib.suppress(OSError):
            fcntl.fcntl(self._pipe, _SET_PIPE_SIZE, _PIPE_BYTES)
        os.set_blocking(self._pipe, False)
        os.set_blocking(self._answers, False)
        again, self._status = list(self._unconfirmed.items()), b""
        self._backlog.clear()
        self._unconfirmed = {ROWS: deque(), EVENT: deque()}
        self._send(b"M", self._metadata.to_json().encode())
        for kind, payloads in again:
            for payload in payloads:
                self._send(kind, payload)
        if self._summary is not None:
            self._send(CLOSE, self._summary)

    def _replace_writer(self) -> None:
        """Start another writer for one that died or was ended, and say so."""
        self._read_answers()
        end_process(self._process, patience_s=1.0)
        self._deaths += 1
        if self.failure is not None:
            return
        if self._deaths >= _MOST_DEATHS:
            self._fail(f"its writer ended unexpectedly ({ending(self._process)}), and so did those that replaced it")
            return
        text = f"the log's writer ended unexpectedly ({ending(self._process)}); another goes on, nothing is lost"
        self.notes.append(text)
        if self._closed:  # nobody makes events any more
            event = LogEvent(self.rows, self.rows / self._metadata.rate_hz, "log_writer", text, "warning")
            self._unconfirmed[EVENT].append(event.to_json().encode())
        self._start_writer()

    def _fail(self, reason: str) -> None:
        if self.failure is None:
            self.failure = OutputError(
                f"{self.path}: the log stopped because {reason}; its finished parts are intact, "
                "free space or choose another path and fly again."
            )
            self._backlog.clear()

    def _finish_writer(self, timeout_s: float) -> bool:
        """Give the writer the rest and wait for its end; False where it died and another is to go on."""
        self._drain(wait_s=timeout_s)
        process = self._process
        assert process.stdin is not None
        with contextlib.suppress(OSError):
            process.stdin.close()
        moved = time.monotonic()
        while process.poll() is None and time.monotonic() < moved + timeout_s:
            before = self._confirmed
            select.select([self._answers], [], [], 0.05)
            self._read_answers()
            if self._confirmed != before:
                moved = time.monotonic()
            self._stillness.end_after(HANG_S)
        self._read_answers()
        if process.poll() is None:
            self._fail(f"its writer did not finish within {timeout_s:.0f} s")
        return self.failure is not None or not process.returncode
