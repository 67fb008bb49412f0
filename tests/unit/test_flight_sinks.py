"""What becomes an event of a flight besides what the flight itself says."""

from __future__ import annotations

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN, SIGNAL_COUNT, TIMING_SIGNALS
from scenarios.flight.sinks import FlightSinks


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
