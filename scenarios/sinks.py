"""Where the rows of a flight go: the history in memory, the log, the view; and the corridor's events."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from rtsim.corridor import LEVEL_NAMES
from rtsim.frame import COLUMN, SIGNAL_COUNT, TIMING_SIGNALS, FloatArray
from telemetry.log_format import LogEvent

_CHUNK = 4096
_DROPPED = [signal.name for signal in TIMING_SIGNALS].index("telemetry_dropped")


class RowLog(Protocol):
    """What the recorder offers to a flight."""

    def push(self, row: FloatArray, timing: FloatArray | None = None) -> None:
        """Keep one row."""
        ...

    def push_block(self, rows: FloatArray) -> None:
        """Keep many rows."""
        ...

    def event(self, event: LogEvent) -> None:
        """Keep an event."""
        ...


class RowView(Protocol):
    """What a view offers to a flight; nothing of it may wait."""

    @property
    def dropped(self) -> int:
        """Rows the view was too slow to take."""
        ...

    def push(self, row: FloatArray, timing: FloatArray) -> None:
        """Show one row."""
        ...

    def push_block(self, rows: FloatArray) -> None:
        """Show many rows of a flight that is not paced; may wait for the view."""
        ...

    def event(self, text: str, level: str) -> None:
        """Show an event."""
        ...


class History:
    """All rows of a flight, kept in chunks."""

    def __init__(self) -> None:
        self.chunks: list[FloatArray] = []
        """Full chunks."""
        self._current = np.empty((_CHUNK, SIGNAL_COUNT))
        self._fill = 0

    def append(self, row: FloatArray) -> None:
        """Keep one row.

        Args:
            row: The frame, shape (SIGNAL_COUNT,); it is copied.
        """
        self._current[self._fill] = row
        self._fill += 1
        if self._fill == _CHUNK:
            self.chunks.append(self._current)
            self._current, self._fill = np.empty((_CHUNK, SIGNAL_COUNT)), 0

    def extend(self, rows: FloatArray) -> None:
        """Keep many rows.

        Args:
            rows: The frames, shape (frames, SIGNAL_COUNT); the array itself is kept.
        """
        if self._fill:
            self.chunks.append(self._current[: self._fill])
            self._current, self._fill = np.empty((_CHUNK, SIGNAL_COUNT)), 0
        if len(rows):
            self.chunks.append(rows)

    def rows(self) -> FloatArray:
        """All rows, shape (frames, SIGNAL_COUNT), read-only."""
        self.extend(np.empty((0, SIGNAL_COUNT)))
        whole = np.concatenate(self.chunks) if self.chunks else np.empty((0, SIGNAL_COUNT))
        whole.flags.writeable = False
        return whole


class FlightSinks:
    """Hands rows on; implements ``rtsim.realtime.FrameSink``."""

    def __init__(
        self,
        *,
        log: RowLog | None = None,
        view: RowView | None = None,
        watch_corridor: bool = True,
        on_rows: Callable[[FloatArray], None] | None = None,
    ) -> None:
        """Connect.

        Args:
            log: Keeps every row and event.
            view: Shows what it can.
            watch_corridor: Make events of changes of the corridor level.
            on_rows: Told the last row flown (progress and status lines); must be quick.
        """
        self.history = History()
        self.events: list[LogEvent] = []
        self._log, self._view, self._on_rows = log, view, on_rows
        self._watch_corridor = watch_corridor
        self._level = 0.0

    def view(self, row: FloatArray, timing: FloatArray) -> None:
        """Show a row.

        Args:
            row: The frame, shape (SIGNAL_COUNT,).
            timing: Timing columns of the frame before.
        """
        if self._view is not None:
            timing[_DROPPED] = self._view.dropped
            self._view.push(row, timing)

    def record(self, row: FloatArray, timing: FloatArray) -> None:
        """Keep a row.

        Args:
            row: The frame, shape (SIGNAL_COUNT,).
            timing: Its timing columns.
        """
        self.history.append(row)
        if self._log is not None:
            self._log.push(row, timing)
        if self._watch_corridor and row[COLUMN.corridor_level] != self._level:
            self._tell_level(row)
        if self._on_rows is not None:
            self._on_rows(row)

    def block(self, rows: FloatArray) -> None:
        """Show and keep many rows.

        Args:
            rows: The frames, shape (frames, SIGNAL_COUNT).
        """
        if not len(rows):
            return
        self.history.extend(rows)
        if self._log is not None:
            self._log.push_block(rows)
        if self._view is not None:
            self._view.push_block(rows)
        if self._watch_corridor:
            levels = rows[:, COLUMN.corridor_level]
            before = np.concatenate(([self._level], levels[:-1]))
            for number in np.flatnonzero(levels != before):
                self._tell_level(rows[number])
        if self._on_rows is not None:
            self._on_rows(rows[-1])

    def event(self, event: LogEvent) -> None:
        """Keep and show an event.

        Args:
            event: What happened.
        """
        self.events.append(event)
        if self._log is not None:
            self._log.event(event)
        if self._view is not None:
            self._view.event(event.text, event.level)

    def _tell_level(self, row: FloatArray) -> None:
        level = int(row[COLUMN.corridor_level])
        self._level = float(level)
        margin, side = (
            row[COLUMN.margin_kt],
            "low" if row[COLUMN.margin_low_kt] < row[COLUMN.margin_high_kt] else "high",
        )
        name = LEVEL_NAMES[level]
        text = (
            "corridor clear again"
            if level == 0
            else f"corridor {name}: {margin:.1f} kn from the {side}-speed side at {row[COLUMN.airspeed_kt]:.0f} kn, "
            f"nacelle {row[COLUMN.nacelle_deg]:.0f} deg"
        )
        self.event(
            LogEvent(
                int(row[COLUMN.frame]),
                float(row[COLUMN.time_s]),
                "corridor",
                text,
                "info" if level == 0 else name,
                {"margin_kt": float(margin), "side": side, "level": level},
            )
        )
