"""Watches limits and protection while a flight goes on: says when a limit comes near and what a law does about it.

It reads finished rows and changes nothing, so that a flight has the same history watched or not. The corridor's own
levels are part of the rows and told by ``scenarios.flight.sinks``.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from rtsim.aircraft.condition import AircraftName
from rtsim.arrays import FloatArray
from rtsim.corridor.boundaries import LEVEL_NAMES
from rtsim.frame import COLUMN, SIGNAL_COUNT
from rtsim.loop.aircraft import database_of
from rtsim.lpv.database import Database
from rtsim.protection.limits import LIMIT_KINDS, WATCHED, load_levels
from rtsim.protection.monitor import MarginWatch, driven_of_rows, monitor_tables, sensors_of_rows
from rtsim.protection.monitor_kernels import KIND, LIMIT_WORDS, MonitorTables
from telemetry.log.format import LogEvent

BATCH_ROWS = 10
"""Rows of a paced flight that are looked at together: one call of compiled code costs more than the rows."""
LET_GO_S = 1.0
"""A law that has not acted for as long has let go [s]."""
_TOLD_ELSEWHERE = ("stall_attitude", "load_torque", "nacelle_range")
_CHANNELS = (
    ("stick", COLUMN.protection_stick_reason),
    ("lever", COLUMN.protection_lever_reason),
    ("nacelles", COLUMN.protection_nacelle_reason),
    ("lateral stick", COLUMN.protection_lateral_stick_reason),
    ("pedals", COLUMN.protection_pedal_reason),
)


class LimitWatch:
    """One flight's limits and interventions."""

    def __init__(
        self, corridor_name: str, tell: Callable[[LogEvent], None], *, dt: float, aircraft: AircraftName = ""
    ) -> None:
        """Load the limits.

        Args:
            corridor_name: Corridor that is watched.
            tell: Told every event.
            aircraft: A database file, empty for the shipped XV-15, or a condition.
        """
        database = database_of(aircraft)
        self._levels = MarginWatch(_tables(corridor_name, database), load_levels(database.profile), dt)
        self._dt, self._tell = dt, tell
        self._noted: list[LogEvent] = []
        self._waiting = np.empty((BATCH_ROWS, SIGNAL_COUNT))
        self._fill = 0
        self._frame = -1
        self._told = np.zeros(KIND.size)
        self._reasons: list[set[int]] = [{0} for _ in _CHANNELS]  # of this episode, by channel; told once each
        self._began: int | None = None  # frame in which a law began to act; None: none acts
        self._acted = 0  # last frame in which it did
        self._episodes = 0
        self._active_frames = [0] * len(_CHANNELS)

    def row(self, row: FloatArray) -> None:
        """Take one row of a paced flight.

        Args:
            row: The frame, shape (SIGNAL_COUNT,); it is copied.
        """
        if self._fill and row[COLUMN.frame] <= self._waiting[self._fill - 1, COLUMN.frame]:
            self.flush()
        self._waiting[self._fill] = row
        self._fill += 1
        if self._fill == BATCH_ROWS:
            self.flush()

    def flush(self) -> None:
        """Look at the rows that wait, as after the last one."""
        if self._fill:
            rows, self._fill = self._waiting[: self._fill], 0
            self.rows(rows)

    def rows(self, rows: FloatArray) -> None:
        """Look at consecutive rows."""
        if not len(rows):
            return
        if rows[0, COLUMN.frame] <= self._frame:
            self._start_anew()
        self._frame = int(rows[-1, COLUMN.frame])
        self._watch_limits(rows)
        self._watch_protection(rows)
        for event in sorted(self._noted, key=lambda event: event.frame):
            self._tell(event)
        self._noted.clear()

    def summary(self) -> dict[str, Any]:
        """Least margins and what the law did, as ``rtsim fly --json`` prints them."""
        self.flush()
        seconds = {
            f"{name.replace(' ', '_')}_s": frames * self._dt
            for (name, _), frames in zip(_CHANNELS, self._active_frames, strict=True)
        }
        return {"limits": self._levels.summary(), "interventions": {"episodes": self._episodes, **seconds}}

    def _start_anew(self) -> None:
        """A reset begins a new flight, whose levels are all clear."""
        self._levels.reset()
        self._told[:] = 0.0
        self._reasons = [{0} for _ in _CHANNELS]
        self._began = None

    def _watch_limits(self, rows: FloatArray) -> None:
        ahead = np.ascontiguousarray(rows[:, COLUMN.time_to_limit_s])
        margins, levels = self._levels.look(sensors_of_rows(rows), ahead, driven_of_rows(rows))
        told = np.where(levels >= self._levels.limits.told_from, levels, 0.0)
        if not told.any() and not self._told.any():
            return
        before = np.vstack([self._told, told[:-1]])
        for number, kind in np.argwhere(told != before):
            change = (int(before[number, kind]), int(told[number, kind]))
            self._tell_level(rows[number], int(kind), change, float(margins[number, kind]))
        self._told = told[-1].copy()

    def _tell_level(self, row: FloatArray, kind: int, change: tuple[int, int], margin: float) -> None:
        name, (before, level) = WATCHED[kind], change
        if name in _TOLD_ELSEWHERE or 0 < level < before:
            return
        words = LIMIT_WORDS[name]
        margin /= float(self._levels.limits.scale[kind])
        unit = self._levels.limits.units[kind]
        shown = f" {unit}".rstrip()
        if level == 0:
            text = f"{words} clear again"
        elif name == "time_to_limit":
            side = "low" if row[COLUMN.margin_low_kt] < row[COLUMN.margin_high_kt] else "high"
            text = f"the corridor's {side}-speed side is {margin:.1f} s ahead as the controls are"
        elif margin >= 0.0:
            text = f"{words} {LEVEL_NAMES[level]}: {margin:.1f}{shown} left"
        else:
            text = f"{words} {LEVEL_NAMES[level]}: {-margin:.1f}{shown} beyond the limit"
        data = {"limit": name, "level": level, "margin": margin, "unit": unit}
        self._say(row, "limit", text, "info" if level == 0 else LEVEL_NAMES[level], data)

    def _watch_protection(self, rows: FloatArray) -> None:
        reasons = rows[:, [column for _, column in _CHANNELS]]
        acting = reasons != 0.0
        if self._began is None and not acting.any():
            return
        for place in range(len(_CHANNELS)):
            self._active_frames[place] += int(np.count_nonzero(acting[:, place]))
        # Only frames at which something changes, and the last, are looked at one by one.
        change = np.any(reasons[1:] != reasons[:-1], axis=1)
        for number in sorted({0, len(rows) - 1, *(np.flatnonzero(change)), *(np.flatnonzero(change) + 1)}):
            self._notice(rows[number], [int(value) for value in reasons[number]])

    def _notice(self, row: FloatArray, reasons: list[int]) -> None:
        frame = int(row[COLUMN.frame])
        if self._began is not None and (frame - self._acted) * self._dt > LET_GO_S:
            self._let_go(self._began)
        if any(reasons):
            if self._began is None:
                self._began = frame
                self._episodes += 1
            self._acted = frame
            # Limits at their edge come and go: each is told once.
            news = [place for place in range(len(_CHANNELS)) if reasons[place] not in self._reasons[place]]
            for place in news:
                self._reasons[place].add(reasons[place])
                name = _CHANNELS[place][0]
                data = {"channel": name, "limit": reasons[place]}
                self._say(row, "protection", f"{name} protected: {_limit(reasons[place])}", "caution", data)

    def _let_go(self, began: int) -> None:
        """End an episode, with the frame in which it was over, whenever that is noticed."""
        seconds = (self._acted - began + 1) * self._dt
        frame = self._acted + round(LET_GO_S / self._dt)
        text = f"protection has let go after {seconds:.1f} s"
        self._noted.append(LogEvent(frame, frame * self._dt, "protection", text, "info", {"seconds": seconds}))
        self._reasons = [{0} for _ in _CHANNELS]
        self._began = None

    def _say(self, row: FloatArray, kind: str, text: str, level: str, data: dict[str, Any]) -> None:
        self._noted.append(LogEvent(int(row[COLUMN.frame]), float(row[COLUMN.time_s]), kind, text, level, data))


def _limit(number: int) -> str:
    return LIMIT_WORDS[LIMIT_KINDS[number - 1]] if number <= len(LIMIT_KINDS) else "a limit of its own"


@functools.lru_cache(maxsize=4)
def _tables(corridor_name: str, database: Database) -> MonitorTables:
    return monitor_tables(corridor_name, database)
