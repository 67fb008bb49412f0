"""Flights from their logs in the view: one, or one over another."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from rtsim.errors import InputError, OutputError
from telemetry.log.format import LogEvent
from telemetry.log.reader import FlightLog
from telemetry.view.options import Layout, ViewOptions
from telemetry.view.overlay import Flight, Overlay, differences
from telemetry.view.recording import claim, discard_empty
from telemetry.view.streamer import Streamer

PICTURES_PER_SECOND, MOST_PICTURES = 20.0, 3000
"""How often poses and instruments are drawn [Hz], and how often at most: fewer in long flights."""


def flights_of(logs: Sequence[FlightLog]) -> list[Flight]:
    """What is shown of logs, each with a letter before its name where there are several.

    Args:
        logs: One or two.

    Raises:
        InputError: The same log is named twice, holds no flight, or other signals than this version has.
    """
    places = [log.path.resolve() for log in logs]
    if len(set(places)) < len(places):
        raise InputError("this is the same log twice", file=str(logs[0].path), mend="name two flights")
    found = []
    for letter, log in zip("AB", logs, strict=False):
        if len(log.history) < 2:
            raise InputError("the log holds no flight to show", file=str(log.path), mend="record a longer flight")
        name = log.path.name.removesuffix(".parquet")
        found.append(Flight(f"{letter} {name}" if len(logs) > 1 else name, log.rows, log.metadata.rate_hz))
    return found


def record_logs(
    logs: Sequence[FlightLog], record: Path, *, layout: Layout, on_progress: Callable[[float], None] | None = None
) -> None:
    """Write what the view shows of one flight, or of one and another over it, on one time axis.

    Args:
        logs: One or two; instruments and corridor are those of the first.
        record: The recording to write.
        layout: Layout of the viewer.
        on_progress: Called with the share of the work that was done.

    Raises:
        InputError: A log cannot be shown, or something else is where the recording is to be.
        OutputError: The recording cannot be written.
    """
    flights = flights_of(logs)
    first = flights[0]
    held = claim(record)
    try:
        options = ViewOptions(viewer=False, record=record, layout=layout, replay=True)
        title = " and ".join(flight.name for flight in flights)
        streamer = Streamer(options, outline=logs[0].metadata.corridor, title=title, rate_hz=first.rate_hz, port=None)
        overlay = Overlay(streamer.recording, flights) if len(flights) > 1 else None
        end = max(float(flight.times[-1]) for flight in flights)
        count = max(2, min(MOST_PICTURES, round((end - float(first.times[0])) * PICTURES_PER_SECOND)))
        events = _events(logs, flights)
        done = 0
        for time_s in np.linspace(float(first.times[0]), end, count):
            upto = int(np.searchsorted(first.times, time_s + 1e-9, side="right"))
            if upto > done:
                streamer.take(first.rows[done:upto])
                done = upto
            if overlay is not None:
                streamer.recording.set_time("sim_time", duration=float(time_s))
                overlay.update(float(time_s))
            while events and events[0][0] <= time_s:
                at, words, level = events.pop(0)
                streamer.recording.set_time("sim_time", duration=at)
                streamer.event(words, level)
            if on_progress is not None:
                on_progress(1.0 / count)
        if streamer.close():
            raise OutputError(f"{record}: the recording could not be written to its end (is the disk full?).")
    finally:
        held.close()
        discard_empty(record)


def greatest_differences(logs: Sequence[FlightLog]) -> dict[str, float]:
    """How far two flights are apart at most while both fly, by name of the plot, and for how long they do [s].

    Args:
        logs: Two.
    """
    times, found = differences(flights_of(logs))
    if not len(times):
        return {"both_fly_s": 0.0}
    span = {"both_fly_s": float(times[-1] - times[0])}
    return span | {name: float(values[np.argmax(np.abs(values))]) for name, values in found.items()}


def _events(logs: Sequence[FlightLog], flights: Sequence[Flight]) -> list[tuple[float, str, str]]:
    """Time, words and level of all that was told, in order, with the letter of its flight where there are two."""

    def told(event: LogEvent, flight: Flight) -> tuple[float, str, str]:
        letter = f"{flight.name[0]}: " if len(flights) > 1 else ""
        return event.time_s, f"{letter}{event.text}", event.level

    pairs = zip(logs, flights, strict=True)
    return sorted((told(event, flight) for log, flight in pairs for event in log.events), key=lambda item: item[0])
