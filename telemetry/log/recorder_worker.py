"""The process that writes a flight log: ``python -m telemetry.log.recorder_worker LOG``, fed through its stdin.

It ends when its stdin does, so it outlives a killed flight just long enough to write what had reached it. After a
write has failed it goes on reading, so that the flight is never held up, and says why on stdout.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import select
import signal
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from rtsim.arrays import FloatArray
from rtsim.processes import lower_priority
from telemetry.exchange.ring import ROW_WIDTH
from telemetry.log.format import EVENTS_FILE, HEADER_PART, log_schema, part_name
from telemetry.log.recorder import CLOSE, EVENT, MESSAGE_HEADER, ROWS, Progress

LONGEST_WAIT_S = 1.0
"""A row that arrived stands in a finished part after this long, also when simulated time is slow [s]."""


NOTHING = Progress()
"""What stands in a new log."""


class PartWriter:
    """Collects rows and writes them as parts, each under a temporary name that is then renamed."""

    def __init__(self, directory: Path, metadata_json: str, progress: Progress = NOTHING) -> None:
        """Write the header part; what an earlier writer had not confirmed comes again and is removed.

        Args:
            directory: The log's directory, which exists.
            metadata_json: ``FlightMetadata.to_json()``.
            progress: What earlier writers have confirmed.
        """
        self._directory = directory
        self._metadata_json = metadata_json
        self._rows_per_part = max(1, round(json.loads(metadata_json)["rate_hz"]))
        self._schema = log_schema(None)
        self._pending: list[FloatArray] = []
        self._pending_rows = 0
        self._oldest = 0.0
        self._parts, self._rows, self._event_count = progress.parts, progress.rows, progress.events
        for part in directory.glob("part-*.parquet"):
            if part.name > part_name(self._parts):
                part.unlink()
        for unfinished in directory.glob(".part-*.tmp"):
            unfinished.unlink()
        self._events = (directory / EVENTS_FILE).open("ab")
        self._events.truncate(progress.event_bytes)
        self._events.seek(0, os.SEEK_END)
        self._write(HEADER_PART, log_schema(metadata_json).empty_table())

    def rows(self, rows: FloatArray) -> None:
        """Take rows; every full second of them becomes a part.

        Args:
            rows: Shape (rows, ROW_WIDTH).
        """
        if not self._pending:
            self._oldest = time.monotonic()
        self._pending.append(rows)
        self._pending_rows += len(rows)
        if self._pending_rows >= self._rows_per_part:
            gathered = np.concatenate(self._pending)
            whole = len(gathered) - len(gathered) % self._rows_per_part
            for start in range(0, whole, self._rows_per_part):
                self._write_rows(gathered[start : start + self._rows_per_part])
            self._pending = [gathered[whole:]] if whole < len(gathered) else []
            self._pending_rows = len(gathered) - whole

    def event(self, line: str) -> None:
        """Append one event.

        Args:
            line: ``LogEvent.to_json()``.
        """
        self._events.write(line.encode() + b"\n")
        self._events.flush()
        self._event_count += 1

    @property
    def progress(self) -> Progress:
        """What stands in the log now."""
        return Progress(self._parts, self._rows, self._event_count, self._events.tell())

    def wait_s(self) -> float | None:
        """Longest time to wait for more before ``flush`` is due [s]; None while nothing is pending."""
        return max(0.0, self._oldest + LONGEST_WAIT_S - time.monotonic()) if self._pending else None

    def flush(self) -> None:
        """Write what is pending, also if it is less than a second."""
        if self._pending:
            rows = np.concatenate(self._pending)
            self._pending, self._pending_rows = [], 0
            self._write_rows(rows)

    def finish(self, summary_json: str) -> None:
        """Write what is pending, and the summary.

        Args:
            summary_json: How the flight ended.
        """
        self.flush()
        self._write(HEADER_PART, log_schema(self._metadata_json, json.loads(summary_json)).empty_table())

    def close(self) -> None:
        """Close the events file; the parts are closed already."""
        self._events.close()

    def _write_rows(self, rows: FloatArray) -> None:
        columns = [pa.array(np.ascontiguousarray(rows[:, column])) for column in range(ROW_WIDTH)]
        self._write(part_name(self._parts + 1), pa.Table.from_arrays(columns, schema=self._schema))
        self._parts += 1
        self._rows += len(rows)

    def _write(self, name: str, table: pa.Table) -> None:
        temporary = self._directory / f".{name}.tmp"
        try:
            # Dictionaries do not pay for measured values: plain columns are written in half the time.
            pq.write_table(table, temporary, use_dictionary=False)
            temporary.replace(self._directory / name)
        except OSError:
            temporary.unlink(missing_ok=True)
            raise


def main() -> int:
    """Write the log named on the command line from the messages on stdin; 0 also after a failure that was told."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    lower_priority()
    pa.set_cpu_count(1)
    pa.set_io_thread_count(1)
    try:
        _serve(Path(sys.argv[1]), Progress(**json.loads(sys.argv[2])))
    except OSError as failure:
        sys.stdout.write(json.dumps({"error": _reason(failure)}) + "\n")
        sys.stdout.flush()
        while os.read(0, 1 << 20):
            pass
    return 0


def _serve(directory: Path, confirmed: Progress) -> None:
    """Read messages until stdin ends, and confirm what is written."""
    writer: PartWriter | None = None
    data = bytearray()
    while True:
        wait = writer.wait_s() if writer else None
        if not select.select([0], [], [], wait)[0]:
            assert writer is not None  # there is no deadline without a writer
            writer.flush()
            confirmed = _confirm(writer, confirmed)
            continue
        received = os.read(0, 1 << 20)
        if not received:
            break
        data += received
        while len(data) >= MESSAGE_HEADER.size:
            kind, length = MESSAGE_HEADER.unpack_from(data)
            end = MESSAGE_HEADER.size + length
            if len(data) < end:
                break
            payload = bytes(data[MESSAGE_HEADER.size : end])
            del data[:end]
            if writer is None:
                writer = PartWriter(directory, payload.decode(), confirmed)
            else:
                _handle(writer, kind, payload)
        if writer is not None:
            if writer.wait_s() == 0.0:
                writer.flush()
            confirmed = _confirm(writer, confirmed)
    if writer is not None:
        writer.flush()
        writer.close()


def _confirm(writer: PartWriter, confirmed: Progress) -> Progress:
    """Tell the flight how far the log is, where that is further than it knows."""
    progress = writer.progress
    if progress != confirmed:
        with contextlib.suppress(OSError):  # it was killed; what came from it is written all the same
            os.write(1, f"{progress.to_json()}\n".encode())
    return progress


def _handle(writer: PartWriter, kind: bytes, payload: bytes) -> None:
    if kind == ROWS:
        writer.rows(np.frombuffer(payload).reshape(-1, ROW_WIDTH))
    elif kind == EVENT:
        writer.event(payload.decode())
    elif kind == CLOSE:
        writer.finish(payload.decode())


def _reason(failure: OSError) -> str:
    """The failure as part of a sentence."""
    reasons = {
        errno.ENOSPC: "no space is left on the device",
        errno.EDQUOT: "the disk quota is used up",
        errno.EFBIG: "a file would become larger than is allowed",
        errno.EACCES: "writing is not permitted",
    }
    return reasons.get(failure.errno or 0, f"writing failed ({failure.strerror or failure})")


if __name__ == "__main__":
    sys.exit(main())
