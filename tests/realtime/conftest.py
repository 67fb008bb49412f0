"""A source and a sink with the interfaces of the executive, for tests of the pacing alone; flights and a station."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN, SIGNAL_COUNT, TIMING_SIGNALS
from tests.ground_station import Flight, Station


class CountingSource:
    """Counts frames; each row carries its frame and time; may work or do something at chosen frames."""

    def __init__(
        self, frames: int, *, dt: float = 0.004, work_s: float = 0.0, at: dict[int, Callable[[], object]] | None = None
    ) -> None:
        self.dt, self._frames, self._work_s, self._at = dt, frames, work_s, dict(at or {})
        self.frame = 0
        self.resets = 0
        self.pilots: list[str] = []
        self.end_reason = "all frames flown"

    @property
    def finished(self) -> bool:
        return self.frame >= self._frames

    def step(self) -> FloatArray:
        if self._work_s:
            end = time.perf_counter() + self._work_s
            while time.perf_counter() < end:
                pass
        action = self._at.pop(self.frame, None)
        if action is not None:
            action()
        row = np.zeros(SIGNAL_COUNT)
        row[COLUMN.frame], row[COLUMN.time_s] = self.frame, self.frame * self.dt
        self.frame += 1
        return row

    def run(self, frames: int) -> FloatArray:
        return np.array([self.step() for _ in range(min(frames, self._frames - self.frame))])

    def reset(self) -> None:
        self.frame = 0
        self.resets += 1

    def switch_pilot(self, pilot: str) -> None:
        self.pilots.append(pilot)


class ListSink:
    """Keeps everything it is given."""

    def __init__(self) -> None:
        self.viewed: list[int] = []
        self.rows: list[FloatArray] = []
        self.timings: list[FloatArray] = []
        self.blocks: list[int] = []

    def view(self, row: FloatArray, timing: FloatArray) -> None:
        assert timing.shape == (len(TIMING_SIGNALS),)
        self.viewed.append(int(row[COLUMN.frame]))

    def record(self, row: FloatArray, timing: FloatArray) -> None:
        self.rows.append(row.copy())
        self.timings.append(timing.copy())

    def block(self, rows: FloatArray) -> None:
        self.blocks.append(len(rows))
        self.rows.extend(rows.copy())

    @property
    def frames(self) -> list[int]:
        return [int(row[COLUMN.frame]) for row in self.rows]


@pytest.fixture(name="make_source")
def _make_source() -> type[CountingSource]:
    return CountingSource


@pytest.fixture(name="sink")
def _sink() -> ListSink:
    return ListSink()


@pytest.fixture(name="start")
def _start(tmp_path: Path) -> Iterator[Callable[..., Flight]]:
    flights: list[Flight] = []

    def start(port: int, *options: str) -> Flight:
        flights.append(Flight(port, tmp_path, *options))
        return flights[-1]

    yield start
    for flight in flights:
        if flight.process.poll() is None:
            flight.process.kill()
            flight.process.communicate()


@pytest.fixture(name="station")
def _station() -> Iterator[Station]:
    station = Station()
    yield station
    station.close()
