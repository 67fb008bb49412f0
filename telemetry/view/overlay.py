"""A second flight over the one that is shown: a ghost of its aircraft, its track in the corridor, curves side by side.

Legend:
    flights: Two flights, the one that is shown and the one over it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr

from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN
from telemetry.view.aircraft import Aircraft, place_of
from telemetry.view.colours import GHOST, TRAIL
from telemetry.view.corridor import FASTEST_KT, SLOWEST_KT, height_of
from telemetry.view.scene import TRAIL_POINTS
from telemetry.view.strokes import LineArt

COMPARED = {
    "airspeed": ("Airspeed", "airspeed_kt", "kn"),
    "nacelle": ("Nacelle", "nacelle_deg", "deg"),
    "altitude": ("Altitude", "altitude_m", "m"),
    "bank": ("Bank", "bank_deg", "deg"),
    "flapping": ("Flapping", "flapping_deg", "deg"),
    "margin": ("Corridor margin", "margin_kt", "kn"),
}
"""What is laid side by side: title, signal and unit by name of the plot."""
POINTS_PER_SECOND = 50.0
"""Points of a curve [Hz]."""


@dataclass(frozen=True, slots=True, eq=False)
class Flight:
    """A flight that has been flown."""

    name: str
    """What it is called in legends."""
    rows: FloatArray
    """Its rows, oldest first."""
    rate_hz: float
    """Rows per second."""

    @property
    def times(self) -> FloatArray:
        """Times of its rows [s]."""
        return self.rows[:, COLUMN.time_s]


def differences(flights: Sequence[Flight]) -> tuple[FloatArray, dict[str, FloatArray]]:
    """The second flight less the first while both fly: times [s], and by name of the plot; ``apart`` is in metres."""
    first, second = flights
    start, end = (pick(first.times[at], second.times[at]) for pick, at in ((max, 0), (min, -1)))
    times = first.times[(first.times >= start) & (first.times <= end)]

    def less(signal: str) -> FloatArray:
        column = getattr(COLUMN, signal)
        a, b = (np.interp(times, flight.times, flight.rows[:, column]) for flight in flights)
        difference: FloatArray = b - a
        return difference

    found = {name: less(signal) for name, (_, signal, _) in COMPARED.items()}
    apart = np.sqrt(less("north_m") ** 2 + less("east_m") ** 2 + found["altitude"] ** 2)
    return times, {**found, "apart": apart}


class Overlay:
    """Logs the second flight to the recording of the first."""

    def __init__(self, recording: Any, flights: Sequence[Flight]) -> None:
        """Log its aircraft, names, and all curves.

        Args:
            recording: The ``rerun.RecordingStream``.
        """
        self._recording, self._other = recording, flights[1]
        self._shown = -1
        self._trail: list[list[float]] = []
        self._track: list[list[float]] = []
        self._trail_time = -math.inf
        self._ghost = Aircraft(recording, "world/ghost", ghost=GHOST)
        label = rr.Points3D([[0.0, 0.0, -7.0]], radii=[-1.5], colors=[GHOST], labels=[flights[1].name])
        recording.log("world/ghost/name", label, static=True)
        for name in COMPARED:
            for letter, flight, colour in zip("ab", flights, (TRAIL, GHOST), strict=True):
                line = rr.SeriesLines(names=[flight.name], colors=[colour], widths=[1.8])
                recording.log(f"compare/{name}/{letter}", line, static=True)
        for flight, letter in zip(flights, "ab", strict=True):
            every = max(1, round(flight.rate_hz / POINTS_PER_SECOND))
            for name, (_, signal, _) in COMPARED.items():
                self._curve(
                    f"compare/{name}/{letter}", flight.times[::every], flight.rows[::every, getattr(COLUMN, signal)]
                )
        times, found = differences(flights)
        every = max(1, round(flights[0].rate_hz / POINTS_PER_SECOND))
        for name, values in found.items():
            line = rr.SeriesLines(names=[f"{flights[1].name} less {flights[0].name}"], colors=[GHOST], widths=[1.8])
            recording.log(f"difference/{name}", line, static=True)
            self._curve(f"difference/{name}", times[::every], values[::every])

    def update(self, time_s: float) -> None:
        """Show it at a time, which is that of the recording; before its start nothing, after its end where it ended.

        Args:
            time_s: Time of both flights [s].
        """
        place = int(np.searchsorted(self._other.times, time_s + 1e-9, side="right")) - 1
        if place < 0 or place == self._shown:
            return
        self._shown = place
        row = self._other.rows[place]
        self._ghost.update(row)
        speed = min(max(float(row[COLUMN.airspeed_kt]), SLOWEST_KT), FASTEST_KT)
        point = [speed, height_of(float(row[COLUMN.nacelle_deg]))]
        now = LineArt()
        now.line([[point[0] - 0.1, point[1]], [point[0] + 0.1, point[1]]], GHOST, radius=3.5)
        self._recording.log("corridor/other_now", now.archetype(2.8))
        if time_s - self._trail_time >= 0.5:
            self._trail_time = time_s
            self._trail = [*self._trail[1 - TRAIL_POINTS :], place_of(row)]
            self._track = [*self._track[1 - TRAIL_POINTS :], point]
            ground = [[north, east, -0.2] for north, east, _ in self._trail]
            strips = rr.LineStrips3D([self._trail, ground], colors=[GHOST, (*GHOST, 110)], radii=[-1.5, -1.0])
            self._recording.log("world/other_trail", strips)
            if len(self._track) > 1:
                track = LineArt()
                track.line(self._track, GHOST, radius=-1.4)
                self._recording.log("corridor/other_trail", track.archetype(1.9))

    def _curve(self, path: str, times: FloatArray, values: FloatArray) -> None:
        index = [rr.TimeColumn("sim_time", duration=times)]
        self._recording.send_columns(path, indexes=index, columns=rr.Scalars.columns(scalars=values))
