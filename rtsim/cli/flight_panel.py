"""The panel at the foot of the terminal while a flight goes on: four lines of numbers that stay where they are."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING, NamedTuple

from rtsim.frame import COLUMN

if TYPE_CHECKING:
    from rtsim.arrays import FloatArray
    from rtsim.realtime.control import FlightControl
    from telemetry.log.format import LogEvent

STYLES = {"caution": "yellow", "warning": "bold yellow", "exceedance": "bold red"}
"""Colour and weight of the levels, in rising order."""
BEHIND_WORTH_TELLING_S = 0.5
"""A flight that is less behind its schedule is on time [s]."""
PACE_WINDOW_S = 2.0
"""Wall time over which the pace is taken [s]."""
_PROTECTED = {
    "stick": COLUMN.protection_stick_reason,
    "lever": COLUMN.protection_lever_reason,
    "nacelles": COLUMN.protection_nacelle_reason,
    "lateral stick": COLUMN.protection_lateral_stick_reason,
    "pedals": COLUMN.protection_pedal_reason,
}


class Line(NamedTuple):
    """One line of the panel."""

    parts: tuple[str, ...]
    """The more important first; what has no room is left out."""
    style: str | None = None
    """Colour and weight."""

    def text(self, width: int) -> str:
        """The parts that a terminal has room for.

        Args:
            width: Columns; one is left free, since a line that wraps would not be overwritten.
        """
        line = self.parts[0][: width - 1]
        for part in self.parts[1:]:
            if len(line) + 3 + len(part) >= width:
                break
            line += f"   {part}"
        return line


class Pace:
    """How fast a flight really goes, over the last seconds."""

    def __init__(self) -> None:
        self._seen: deque[tuple[float, float]] = deque()

    def of(self, wall_s: float, flown_s: float) -> float | None:
        """Simulated per wall time; None where too little was seen.

        Args:
            wall_s: The clock now [s].
            flown_s: Simulated time now [s].
        """
        if self._seen and flown_s < self._seen[-1][1]:  # a reset
            self._seen.clear()
        self._seen.append((wall_s, flown_s))
        while wall_s - self._seen[0][0] > PACE_WINDOW_S and len(self._seen) > 2:
            self._seen.popleft()
        spent = wall_s - self._seen[0][0]
        return (flown_s - self._seen[0][1]) / spent if spent > PACE_WINDOW_S / 2.0 else None


class Alarms:
    """What is near or beyond its limit now, in the order in which it came there."""

    def __init__(self) -> None:
        self._levels: dict[str, str] = {}

    def take(self, event: LogEvent) -> None:
        """Note what an event says of a limit.

        Args:
            event: What happened.
        """
        if event.kind == "reset":
            self._levels.clear()
        elif event.kind in {"limit", "corridor"} and event.data.get("limit") != "time_to_limit":
            name = "corridor" if event.kind == "corridor" else event.text.partition(f" {event.level}")[0]
            if event.level in STYLES:
                self._levels[name] = event.level
            else:
                self._levels.pop(event.text.removesuffix(" clear again"), None)

    def line(self) -> Line:
        """The line of the panel."""
        groups = {
            level: ", ".join(name for name, present in self._levels.items() if present == level)
            for level in reversed(STYLES)
            if level in self._levels.values()
        }
        if not groups:
            return Line(("no warnings",))
        return Line(tuple(f"{level}: {names}" for level, names in groups.items()), STYLES[next(iter(groups))])


def who_flies(row: FloatArray, *, external: str, protection: str) -> str:
    """Who flies and what the protection does about it.

    Args:
        row: The frame.
        external: Who is behind a command from outside.
        protection: The law.
    """
    pilot = ("MOCM flies", f"{external} fly" if external == "you" else f"{external} flies", "controls held")
    held = [name for name, column in _PROTECTED.items() if row[column]]
    law = f"{protection} holds {', '.join(held)}" if held else f"protection {protection}"
    return f"{pilot[int(row[COLUMN.pilot_mode])]}, {law}"


def how_fast(control: FlightControl, pace: float | None) -> str:
    """The speed of the flight as it is, not only as it was asked for.

    Args:
        control: Tells what was asked for, and how far the flight is behind.
        pace: Simulated per wall time; None where that is not known yet.
    """
    if control.paused:
        return "paused"
    if math.isinf(control.speed):
        return "as fast as it goes"
    words = f"{control.speed:g}x"
    if pace is not None and pace < 0.95 * control.speed:
        words = f"{pace:.2g}x of {words}"
    return f"{words}, {control.behind_s:.1f} s behind" if control.behind_s > BEHIND_WORTH_TELLING_S else words


def panel(row: FloatArray, control: FlightControl, *, pace: float | None, duration_s: float, who: str) -> list[Line]:
    """What is flown, by whom, where, and how far the corridor's sides are.

    Args:
        row: The frame.
        control: Tells whether the flight is paused, its speed and its backlog.
        pace: Simulated per wall time; None where that is not known yet.
        duration_s: Length of the flight [s].
        who: Who flies.
    """
    heading = (row[COLUMN.heading_deg] + 0.5) // 1.0 % 360.0
    nacelles = f"nacelles {row[COLUMN.nacelle_forward_deg]:.0f} forward, {row[COLUMN.nacelle_aft_deg]:.0f} deg aft"
    return [
        Line((f"{row[COLUMN.time_s]:6.1f} of {duration_s:.0f} s", how_fast(control, pace), who)),
        Line(
            (
                f"{round(row[COLUMN.airspeed_kt], 1) + 0.0:6.1f} kn",
                f"nacelle {row[COLUMN.nacelle_deg]:4.1f} deg",
                f"bank {round(row[COLUMN.bank_deg]) + 0:+3.0f} deg",
                f"{row[COLUMN.altitude_m]:4.0f} m",
                f"{round(row[COLUMN.climb_rate_m_s], 1) + 0.0:+5.1f} m/s",
                f"heading {heading:03.0f}",
            )
        ),
        Line(
            (
                f"margins: {row[COLUMN.margin_low_kt]:.0f} kn low side, {row[COLUMN.margin_high_kt]:.0f} kn high side",
                nacelles,
            )
        ),
    ]
