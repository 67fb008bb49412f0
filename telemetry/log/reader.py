"""Reading a flight log: signals by name, units, metadata, events, and the history hash computed anew."""

from __future__ import annotations

import json
import math
import os
import re
import stat
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.frame import SIGNAL_NAMES, history_sha256
from rtsim.outside import named, opening, read_text, regular_file, understanding
from telemetry.log.format import (
    EVENTS_FILE,
    LOG_VERSION,
    FlightMetadata,
    LogEvent,
    part_name,
    read_schema_metadata,
)

PART_NAME = re.compile(r"part-[0-9]{6,}\.parquet")
"""Names of a log's parts; whatever else lies in its folder is not the log's."""
_LARGEST_PART = 100_000_000
"""Size of the largest part that is read, and of its largest column [bytes]; a second of flight has about 0.2 MB."""
_MOST_ROWS, _MOST_COLUMNS = 100_000, 1000
_LARGEST_EVENTS = 500_000_000
_MEND = "fly it again, or restore the file"


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
    """Read a flight log, finished or not; files in its folder that are none of its parts are passed over.

    Args:
        path: The log's directory.

    Returns:
        The flight.

    Raises:
        InputError: There is no log, or it is none of rtsim, or one of its files is damaged.
    """
    directory = named(path)
    parts = _parts(directory)
    header, *others = parts
    entries, names, _ = _read_part(header)
    if entries.get("log_version", "0") != str(LOG_VERSION):
        raise InputError(
            "this version of rtsim reads logs of another layout only",
            file=str(directory),
            key="log_version",
            value=entries.get("log_version"),
            allowed=str(LOG_VERSION),
        )
    with understanding("header of a flight log", file=header, mend=_MEND):
        units = TypeAdapter(tuple[str, ...]).validate_json(entries["units"])
        metadata = FlightMetadata.from_json(entries["metadata"])
        summary = TypeAdapter(dict[str, Any]).validate_python(json.loads(entries.get("summary", "{}")))
        if len(units) != len(names) or not 0.0 < metadata.rate_hz < math.inf:
            raise ValueError("units, columns or rate are nonsense")
    blocks = []
    for part in others:
        _, columns, rows = _read_part(part)
        if columns != names:
            raise InputError("holds other columns than the log's first part", file=str(part), mend=_MEND)
        blocks.append(rows)
    rows = np.concatenate([*blocks, np.empty((0, len(names)))])
    rows.setflags(write=False)
    return FlightLog(
        path=directory,
        names=names,
        units=units,
        rows=rows,
        metadata=metadata,
        events=_read_events(directory / EVENTS_FILE),
        summary=summary if "summary" in entries else None,
    )


def _parts(directory: Path) -> list[Path]:
    """The parts of a log in order, the header first."""
    where = str(directory)
    with opening(directory, "check the path, or record one with rtsim fly --log"):
        status = directory.stat()
        if not stat.S_ISDIR(status.st_mode):
            raise InputError("this is a file; a flight log is a directory", file=where, mend="name the log's directory")
        found = sorted(entry for entry in directory.iterdir() if PART_NAME.fullmatch(entry.name))
    if not (directory / EVENTS_FILE).is_file():
        raise InputError("this is no flight log of rtsim", file=where, mend="record one with rtsim fly --log")
    for number, part in enumerate(found):
        if part.name != part_name(number):
            mend = "restore it, or fly it again"
            raise InputError(
                "is missing between the parts of the log", file=str(directory / part_name(number)), mend=mend
            )
    if not found:
        raise InputError("the recording was cut off before its first part was written", file=where, mend="fly it again")
    return found


def _read_part(path: Path) -> tuple[dict[str, str], tuple[str, ...], FloatArray]:
    """The log's own entries, names of the columns, and rows of one part."""
    import pyarrow.parquet as pq

    regular_file(path, noun="part of a flight log", largest=_LARGEST_PART, missing=_MEND)
    with understanding("part of a flight log", file=path, mend=_MEND), pq.ParquetFile(path) as part:
        table = part.metadata
        if table.num_rows > _MOST_ROWS or table.num_columns > _MOST_COLUMNS:
            raise ValueError(f"{table.num_rows} rows and {table.num_columns} columns are too many")
        for group in range(table.num_row_groups):
            sizes = table.row_group(group)
            if any(sizes.column(k).total_uncompressed_size > _LARGEST_PART for k in range(sizes.num_columns)):
                raise ValueError("a column is too large")
        content = part.read(use_threads=False)
        rows = np.empty((content.num_rows, content.num_columns))
        for column in range(content.num_columns):
            rows[:, column] = content.column(column).to_numpy()
        return read_schema_metadata(content.schema.metadata), tuple(content.column_names), rows


def _read_events(path: Path) -> tuple[LogEvent, ...]:
    """The events; a last line that a kill cut off is left out."""
    lines = read_text(path, noun="list of events", largest=_LARGEST_EVENTS, may_be_empty=True).split("\n")
    events = []
    for number, line in enumerate(lines[:-1]):  # what follows the last newline is nothing, or a line that was cut off
        if line:
            with understanding("event", file=f"{path}: line {number + 1}", mend="correct or delete this line"):
                events.append(LogEvent.from_json(line))
    return tuple(events)
