"""What becomes an event of a flight besides what the flight itself says."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
import pytest

from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN, SIGNAL_COUNT, TIMING_SIGNALS
from scenarios.flight.sinks import FlightSinks
from telemetry.log.format import LogEvent


class TalkingView:
    """A view that says something now and then."""

    dropped, backlog, alive = 0, 0, True

    def __init__(self) -> None:
        self.messages: list[str] = []

    def push(self, row: FloatArray, timing: FloatArray) -> None:
        """Show nothing."""

    def watch(self) -> None:
        """See nothing."""

    def event(self, text: str, level: str = "info") -> None:
        """Hear nothing."""


def row(frame: int) -> FloatArray:
    values = np.zeros(SIGNAL_COUNT)
    values[COLUMN.frame], values[COLUMN.time_s] = frame, frame / 250.0
    return values


def test_what_the_view_says_is_an_event_once() -> None:
    view = TalkingView()
    sinks = FlightSinks(view=view)
    timing = np.zeros(len(TIMING_SIGNALS))
    sinks.record(row(0), timing)
    view.messages.append("The view died.")
    sinks.record(row(1), timing)
    sinks.record(row(2), timing)
    view.messages += ["It died again.", "It was given up."]
    sinks.block(np.stack([row(3), row(4)]))
    told = [(event.frame, event.kind, event.level, event.text) for event in sinks.events]
    assert told == [
        (1, "view", "warning", "The view died."),
        (4, "view", "warning", "It died again."),
        (4, "view", "warning", "It was given up."),
    ]


def test_a_flight_that_stood_still_leaves_an_event_and_one_that_catches_up_no_more() -> None:
    sinks = FlightSinks()
    timing = np.zeros(len(TIMING_SIGNALS))
    for frame, late_s in enumerate((0.0, 0.2, 3.2, 3.1, 1.5, 0.0, 0.9)):
        timing[0] = late_s * 1e6
        sinks.record(row(frame), timing)
    assert [(event.frame, event.kind, event.text) for event in sinks.events] == [
        (2, "standstill", "the flight stood still for 3.0 s")
    ]


class LateWatch:
    """Limits that are looked at when ten rows are there, or when somebody asks."""

    def __init__(self, tell: Callable[[LogEvent], None]) -> None:
        self.tell, self.waiting = tell, list[FloatArray]()

    def row(self, row: FloatArray) -> None:
        self.waiting.append(row.copy())
        if len(self.waiting) == 10:
            self.flush()

    def flush(self) -> None:
        rows, self.waiting = self.waiting, []
        self.rows(rows)

    def rows(self, rows: Iterable[FloatArray]) -> None:
        for flown in rows:
            if flown[COLUMN.frame] % 3 == 0:
                self.tell(LogEvent(int(flown[COLUMN.frame]), 0.0, "limit", "near"))

    def summary(self) -> dict[str, object]:
        self.flush()
        return {}


@pytest.mark.parametrize("paced", [True, False])
def test_events_are_told_in_the_order_of_their_frames(paced: bool) -> None:
    heard: list[LogEvent] = []
    sinks = FlightSinks(paced=paced, limits=LateWatch, on_event=heard.append)  # type: ignore[arg-type]
    rows = np.stack([row(frame) for frame in range(25)])
    rows[7:12, COLUMN.corridor_level] = 1.0
    timing = np.zeros(len(TIMING_SIGNALS))
    for start in (0, 10, 20):
        sinks.event(LogEvent(start, 0.0, "pilot", "switched"))  # a session tells before the rows of its block
        block = rows[start : start + 10]
        if paced:
            for flown in block:
                sinks.record(flown, timing)
        else:
            sinks.event(LogEvent(start + len(block) - 1, 0.0, "law", "failed"))
            sinks.block(block)
    sinks.watched()
    sinks.event(LogEvent(25, 0.1, "end", "over"))
    frames = [event.frame for event in heard]
    assert frames == sorted(frames)
    assert frames == [event.frame for event in sinks.events]
    kinds = {"pilot", "limit", "corridor", "end"} | (set() if paced else {"law"})
    assert {event.kind for event in heard} == kinds
    assert [event.frame for event in heard if event.kind == "corridor"] == [7, 12]
