"""Reading a flight log: signals by name, units, metadata, events, and the history hash computed anew."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.frame import SIGNAL_NAMES, history_sha256
from telemetry.log.format import (
    EVENTS_FILE,
    HEADER_PART,
    LOG_VERSION,
    FlightMetadata,
    LogEvent,
    read_schema_metadata,
)


@dataclass(frozen=True, slots=True, eq=False)
class FlightLog:
    """One recorded flight, in memory."""

    path: Path
    """Where it was read from."""
    names: tuple[str, ...]
    """Names of the columns."""
    units: tuple[str, ...]
    """Units of the columns, empty where dimensionless."""
    rows: FloatArray
    """All columns, shape (frames, columns), read-only."""
    metadata: FlightMetadata
    """What was said about the flight at its start."""
    events: tuple[LogEvent, ...]
    """The discrete events, in order."""
    summary: Mapping[str, Any] | None
    """How the flight ended; None where the recording was cut off (killed, full disk)."""

    def __getitem__(self, name: str) -> FloatArray:
        """One signal over the flight.

        Args:
            name: Name of the column.

        Returns:
            Its values, shape (frames,), in the unit that its name says.

        Raises:
            InputError: The log has no such column.
        """
        return self.rows[:, self._index(name)]

    def unit(self, name: str) -> str:
        """Unit of one signal.

        Args:
            name: Name of the column.
        """
        return self.units[self._index(name)]

    @property
    def history(self) -> FloatArray:
        """The columns of ``SIGNALS`` in declared order, shape (frames, SIGNAL_COUNT).

        Raises:
            InputError: The log was written by a version with other signals.
        """
        if self.names[: len(SIGNAL_NAMES)] != SIGNAL_NAMES:
            raise InputError(
                "this log holds other signals than this version of rtsim has",
                file=str(self.path),
                mend=f"use the version that wrote it ({self.metadata.versions.get('rtsim', 'unknown')})",
            )
        return self.rows[:, : len(SIGNAL_NAMES)]

    def history_sha256(self) -> str:
        """The history hash, computed from the recorded rows."""
        return history_sha256([self.history])

    def _index(self, name: str) -> int:
        try:
            return self.names.index(name)
        except ValueError:
            raise InputError(
                "the log has no such signal",
                file=str(self.path),
                key="signal",
                value=name,
                allowed=", ".join(self.names),
            ) from None


def read_log(path: str | os.PathLike[str]) -> FlightLog:
    """Read a flight log, finished or not.

    Args:
        path: The log's directory.

    Returns:
        The flight.

    Raises:
        InputError: There is no log, or it is none of rtsim, or one of its files is damaged.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    directory = Path(path)
    _check_is_log(directory)
    try:
        entries = read_schema_metadata(pq.read_schema(directory / HEADER_PART).metadata)
        table = pq.read_table(directory)
    except (OSError, pa.ArrowException) as failure:
        raise InputError(f"the log is damaged: {failure}", file=str(directory)) from failure
    if int(entries.get("log_version", "0")) != LOG_VERSION:
        raise InputError(
            "this version of rtsim reads logs of another layout only",
            file=str(directory),
            key="log_version",
            value=entries.get("log_version"),
            allowed=str(LOG_VERSION),
        )
    rows = np.empty((table.num_rows, table.num_columns))
    for column in range(table.num_columns):
        rows[:, column] = table.column(column).to_numpy()
    rows.setflags(write=False)
    return FlightLog(
        path=directory,
        names=tuple(table.column_names),
        units=tuple(json.loads(entries["units"])),
        rows=rows,
        metadata=FlightMetadata.from_json(entries["metadata"]),
        events=_read_events(directory / EVENTS_FILE),
        summary=json.loads(entries["summary"]) if "summary" in entries else None,
    )


def _check_is_log(directory: Path) -> None:
    where = str(directory)
    if not directory.exists():
        raise InputError("there is no such log", file=where, mend="check the path, or record one with rtsim fly --log")
    if not directory.is_dir():
        raise InputError("this is a file; a flight log is a directory", file=where, mend="name the log's directory")
    if not (directory / EVENTS_FILE).is_file():
        raise InputError("this is no flight log of rtsim", file=where, mend="record one with rtsim fly --log")
    if not (directory / HEADER_PART).is_file():
        raise InputError("the recording was cut off before its first part was written", file=where, mend="fly it again")


def _read_events(path: Path) -> tuple[LogEvent, ...]:
    """The events; a last line that a kill cut off is left out."""
    lines = path.read_text(encoding="utf-8").split("\n")
    whole = lines[:-1]  # what follows the last newline is either nothing or a line that was cut off
    try:
        return tuple(LogEvent.from_json(line) for line in whole if line)
    except (ValueError, TypeError) as failure:
        raise InputError(f"an event cannot be read: {failure}", file=str(path)) from failure
