"""Where the rows of a flight go: the history in memory, the log, the view; and the corridor's events."""

from __future__ import annotations

import tempfile
import time
import weakref
from collections.abc import Callable, Sequence
from typing import IO, TYPE_CHECKING, Any, Protocol

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.corridor.boundaries import LEVEL_NAMES
from rtsim.errors import OutputError
from rtsim.frame import COLUMN, SIGNAL_COUNT, TIMING_SIGNALS
from telemetry.log.format import LogEvent

if TYPE_CHECKING:
    from scenarios.flight.limit_watch import LimitWatch

_CHUNK = 4096
MEMORY_ROWS = 65_536
"""Rows of a history that are kept in memory besides those that came last, 35 MB: 4 minutes at 250 Hz."""
_VIEW_PIECE = 64
_VIEW_BACKLOG = 1024
_CLEAR_OF_GROUND_M = 0.5
"""Wheels this high have left the ground [m]."""
_LATENESS, _DROPPED = (
    [signal.name for signal in TIMING_SIGNALS].index(name) for name in ("lateness_us", "telemetry_dropped")
)
STANDSTILL_S = 1.0
"""A paced flight that falls behind by so much from one frame to the next stood still [s]."""


class RowLog(Protocol):
    """What the recorder offers to a flight."""

    @property
    def failure(self) -> OutputError | None:
        """Why the log stopped growing, once it has."""
        ...

    @property
    def notes(self) -> list[str]:
        """What became of its writer and is worth an event; to be taken out."""
        ...

    def push(self, row: FloatArray, timing: FloatArray | None = None) -> None:
        """Keep one row."""
        ...

    def push_block(self, rows: FloatArray) -> None:
        """Keep many rows."""
        ...

    def event(self, event: LogEvent) -> None:
        """Keep an event.

        Args:
            event: What happened.
        """
        ...


class RowView(Protocol):
    """What a view offers to a flight; nothing of it may wait."""

    @property
    def dropped(self) -> int:
        """Rows the view was too slow to take."""
        ...

    @property
    def messages(self) -> Sequence[str]:
        """What it had to say so far: that it was started again, was given up, was closed."""
        ...

    def push(self, row: FloatArray, timing: FloatArray) -> None:
        """Show one row."""
        ...

    @property
    def backlog(self) -> int:
        """Rows pushed that the view has not taken yet."""
        ...

    @property
    def alive(self) -> bool:
        """Whether anything takes the rows."""
        ...

    def watch(self) -> None:
        """Look after the view."""
        ...

    def event(self, text: str, level: str = "info") -> None:
        """Show an event.

        Args:
            text: What happened.
            level: ``info``, ``caution``, ``warning`` or ``exceedance``.
        """
        ...


class RowMirror(Protocol):
    """Whatever else is shown every row of a paced flight; nothing of it may wait."""

    def push(self, row: FloatArray, timing: FloatArray) -> None:
        """Show one row."""
        ...


class History:
    """All rows of a flight: the newest ``MEMORY_ROWS`` in memory, older ones in a file without a name."""

    def __init__(self) -> None:
        self.chunks: list[FloatArray] = []
        """What is in memory, but for the rows that came last."""
        self._current = np.empty((_CHUNK, SIGNAL_COUNT))
        self._fill = 0
        self._file: IO[bytes] | None = None
        self._filed = 0

    def append(self, row: FloatArray) -> None:
        """Keep one row.

        Args:
            row: The frame, shape (SIGNAL_COUNT,); it is copied.
        """
        self._current[self._fill] = row
        self._fill += 1
        if self._fill == _CHUNK:
            self._keep(self._current)
            self._current, self._fill = np.empty((_CHUNK, SIGNAL_COUNT)), 0

    def extend(self, rows: FloatArray) -> None:
        """Keep many rows.

        Args:
            rows: The frames, shape (frames, SIGNAL_COUNT); the array itself is kept.
        """
        if self._fill:
            self._keep(self._current[: self._fill])
            self._current, self._fill = np.empty((_CHUNK, SIGNAL_COUNT)), 0
        if not len(rows):
            return
        last = self.chunks[-1] if self.chunks else rows
        if rows.base is not None and last.base is rows.base and last.ctypes.data + last.nbytes == rows.ctypes.data:
            # What follows in memory too is joined, so that no copy of a long flight is made in the end.
            whole = rows.base.reshape(-1, SIGNAL_COUNT)
            first = (last.ctypes.data - whole.ctypes.data) // whole.strides[0]
            self.chunks[-1] = whole[first : first + len(last) + len(rows)]
        else:
            self._keep(rows)

    def rows(self) -> FloatArray:
        """All rows, shape (frames, SIGNAL_COUNT), read-only."""
        self.extend(np.empty((0, SIGNAL_COUNT)))
        if self._file is not None:
            while self.chunks and self._file_oldest():
                pass
            self._file.flush()
            filed = np.memmap(self._file, dtype=np.float64, mode="r", shape=(self._filed, SIGNAL_COUNT))
            self.chunks.insert(0, filed)
        if len(self.chunks) == 1:
            whole = np.asarray(self.chunks[0]).view()
        else:
            whole = np.concatenate(self.chunks) if self.chunks else np.empty((0, SIGNAL_COUNT))
        if self._file is not None:
            del self.chunks[0]
        whole.flags.writeable = False
        return whole

    def _keep(self, chunk: FloatArray) -> None:
        """Keep a chunk; where there are too many, file the oldest, only one: a live flight has little time."""
        self.chunks.append(chunk)
        if sum(map(len, self.chunks[:-1])) > MEMORY_ROWS:
            self._file_oldest()

    def _file_oldest(self) -> bool:
        """Move the oldest chunk to the file; False where that cannot be: it stays in memory."""
        chunk = np.ascontiguousarray(self.chunks[0])
        try:
            if self._file is None:
                self._file = tempfile.TemporaryFile(prefix="rtsim-")  # noqa: SIM115
                weakref.finalize(self, self._file.close)
            self._file.seek(self._filed * chunk.strides[0])
            self._file.write(chunk.data)
            self._file.flush()
        except OSError:  # the disk is full
            return False
        self._filed += len(chunk)
        del self.chunks[0]
        return True


class FlightSinks:
    """Hands rows on; implements ``rtsim.realtime.executive.FrameSink``."""

    def __init__(
        self,
        *,
        log: RowLog | None = None,
        view: RowView | None = None,
        mirrors: Sequence[RowMirror] = (),
        paced: bool = True,
        watch_corridor: bool = True,
        limits: Callable[[Callable[[LogEvent], None]], LimitWatch] | None = None,
        on_rows: Callable[[FloatArray], None] | None = None,
        on_event: Callable[[LogEvent], None] | None = None,
    ) -> None:
        """Connect.

        Args:
            log: Keeps every row and event.
            view: Shows what it can.
            mirrors: Shown every row of a paced flight beside the view (MAVLink, FlightGear).
            paced: Whether the flight begins on the wall clock, not in blocks.
            watch_corridor: Make events of changes of the corridor level.
            limits: Makes what watches limits and protection from whom it tells; None: nobody watches.
            on_rows: Told the last row flown (progress and status lines); must be quick.
            on_event: Told every event; must be quick.
        """
        self.history = History()
        self.events: list[LogEvent] = []
        self._noted: list[LogEvent] = []
        self._in_blocks = (
            not paced
        )  # events of a flight flown in blocks wait for the end of theirs, to be told in order
        self._log, self._view, self._on_rows, self._on_event = log, view, on_rows, on_event
        self._view_told = 0
        self._lateness_us = 0.0
        self._mirrors = mirrors
        self._watch_corridor = watch_corridor
        self._limits = limits(self.event) if limits is not None else None
        self._level = 0.0
        self._fuel = 0.0
        self._grounded: bool | None = None
        self._waiting = False
        self._no_timing = np.full(len(TIMING_SIGNALS), np.nan)

    def view(self, row: FloatArray, timing: FloatArray) -> None:
        """Show a row."""
        if self._view is not None:
            timing[_DROPPED] = self._view.dropped
            self._view.push(row, timing)
        for mirror in self._mirrors:
            mirror.push(row, timing)

    def record(self, row: FloatArray, timing: FloatArray) -> None:
        """Keep a row."""
        self._tell_in_order(in_blocks=False)
        self.history.append(row)
        if self._log is not None:
            self._log.push(row, timing)
            self._watch_log(self._log, row)
        self._watch_view(row)
        lateness_us = float(timing[_LATENESS])
        if lateness_us - self._lateness_us > STANDSTILL_S * 1e6:
            text = f"the flight stood still for {(lateness_us - self._lateness_us) * 1e-6:.1f} s"
            self.event(LogEvent(int(row[COLUMN.frame]), float(row[COLUMN.time_s]), "standstill", text, "warning"))
        self._lateness_us = lateness_us
        if self._watch_corridor and row[COLUMN.corridor_level] != self._level:
            self._tell_level(row)
        self._watch_fuel(row[None, :])
        self._watch_wheels(row[None, :])
        self._watch_interlock(row[None, :])
        if self._limits is not None:
            self._limits.row(row)
        if self._on_rows is not None:
            self._on_rows(row)

    def block(self, rows: FloatArray) -> None:
        """Show and keep many rows."""
        if not len(rows):
            return
        self._in_blocks = True
        self.history.extend(rows)
        if self._log is not None:
            self._log.push_block(rows)
            self._watch_log(self._log, rows[-1])
        if self._view is not None:
            self._show_block(self._view, rows)
            self._watch_view(rows[-1])
        if self._watch_corridor:
            levels = rows[:, COLUMN.corridor_level]
            before = np.concatenate(([self._level], levels[:-1]))
            for number in np.flatnonzero(levels != before):
                self._tell_level(rows[number])
        self._watch_fuel(rows)
        self._watch_wheels(rows)
        self._watch_interlock(rows)
        if self._limits is not None:
            self._limits.flush()
            self._limits.rows(rows)
        self._tell_in_order(in_blocks=True)
        if self._on_rows is not None:
            self._on_rows(rows[-1])

    def watched(self) -> dict[str, Any]:
        """What was seen of limits and protection, for the summary; empty where nobody watched. No row may follow."""
        seen = self._limits.summary() if self._limits is not None else {}
        self._tell_in_order(in_blocks=False)
        return seen

    def event(self, event: LogEvent) -> None:
        """Keep and show an event, after those of earlier frames.

        Args:
            event: What happened.
        """
        if self._in_blocks:
            self._noted.append(event)
            return
        if self._limits is not None:
            self._limits.flush()  # the rows before it may have events of their own
        self._tell(event)

    def _tell_in_order(self, *, in_blocks: bool) -> None:
        """Tell what was noted; whether further events wait, too."""
        self._in_blocks = in_blocks
        noted, self._noted = self._noted, []
        for event in sorted(noted, key=lambda event: event.frame):
            self._tell(event)

    def _tell(self, event: LogEvent) -> None:
        self.events.append(event)
        if self._log is not None:
            self._log.event(event)
        if self._view is not None:
            self._view.event(event.text, event.level)
        if self._on_event is not None:
            self._on_event(event)

    def _watch_log(self, log: RowLog, row: FloatArray) -> None:
        """Say at once what became of the log's writer; go on without a log that broke."""
        if log.notes or log.failure is not None:
            frame, time_s = int(row[COLUMN.frame]), float(row[COLUMN.time_s])
            if log.failure is not None:
                self._log = None
                self.event(LogEvent(frame, time_s, "log_failed", str(log.failure), "warning"))
            while log.notes:
                self.event(LogEvent(frame, time_s, "log_writer", log.notes.pop(0), "warning"))

    def _watch_view(self, row: FloatArray) -> None:
        """Make events of what the view said."""
        if self._view is not None:
            for text in self._view.messages[self._view_told :]:
                self._view_told += 1
                self.event(LogEvent(int(row[COLUMN.frame]), float(row[COLUMN.time_s]), "view", text, "warning"))

    def _show_block(self, view: RowView, rows: FloatArray) -> None:
        """Push rows no faster than the view takes them, so that a recording at full speed has no holes."""
        for number, row in enumerate(rows):
            if number % _VIEW_PIECE == 0:
                while view.backlog > _VIEW_BACKLOG and view.alive:
                    time.sleep(0.001)
                    view.watch()
            view.push(row, self._no_timing)

    def _watch_fuel(self, rows: FloatArray) -> None:
        """Say when the tanks have run dry; a frame in which they have is looked at once."""
        fuel, before = rows[:, COLUMN.fuel_lb], self._fuel
        self._fuel = float(fuel[-1])
        if self._fuel > 0.0 or not max(before, float(fuel[0])) > 0.0:
            return
        row = rows[int(np.argmin(fuel > 0.0))]
        text = "the fuel is used up: the engines stop"
        self.event(LogEvent(int(row[COLUMN.frame]), float(row[COLUMN.time_s]), "fuel", text, "warning", {}))

    def _watch_wheels(self, rows: FloatArray) -> None:
        """Say when the wheels touch the ground and when they have left it; bounces in between are not told."""
        loads = rows[:, COLUMN.weight_on_wheels]
        if self._grounded is None:
            near = rows[0, COLUMN.ground_effect] > 0.0 and rows[0, COLUMN.altitude_m] < _CLEAR_OF_GROUND_M
            self._grounded = bool(loads[0] > 0.0 or near)
        if not self._grounded and not loads.any():
            return
        for row in rows:
            touching = row[COLUMN.weight_on_wheels] > 0.0
            if touching == self._grounded or (self._grounded and row[COLUMN.altitude_m] < _CLEAR_OF_GROUND_M):
                continue
            self._grounded = bool(touching)
            text = f"touched down, sinking at {-row[COLUMN.climb_rate_m_s]:.2f} m/s" if touching else "lifted off"
            self.event(LogEvent(int(row[COLUMN.frame]), float(row[COLUMN.time_s]), "wheels", text, "info", {}))

    def _watch_interlock(self, rows: FloatArray) -> None:
        """Say once that nacelles which are asked off the downstop wait for the rotors."""
        asked = (rows[:, COLUMN.pilot_nacelle_rate_rad_s] > 0.0) & (rows[:, COLUMN.on_downstop] != 0.0)
        alone = (rows[:, COLUMN.protection_nacelle_rate_deg_s] == 0.0) & (rows[:, COLUMN.failures] == 0.0)
        waits = asked & alone & (rows[:, COLUMN.nacelle_command_rate_deg_s] == 0.0)
        if not waits.any():
            self._waiting = self._waiting and bool(asked[-1])
        elif not self._waiting:
            self._waiting = True
            row = rows[int(np.argmax(waits))]
            text = f"the nacelles wait on the downstop for the rotors, {row[COLUMN.rotor_speed_rpm]:.0f} rpm"
            self.event(LogEvent(int(row[COLUMN.frame]), float(row[COLUMN.time_s]), "interlock", text, "warning", {}))

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
            else f"corridor {name}: {abs(margin):.1f} kn {'beyond' if margin < 0.0 else 'from'} the {side}-speed side "
            f"at {row[COLUMN.airspeed_kt]:.0f} kn, nacelle {row[COLUMN.nacelle_deg]:.0f} deg"
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
