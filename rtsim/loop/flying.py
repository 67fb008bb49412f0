"""A flight that is about to be flown or on its way: its tables, state, work space and random streams, and one ``fly``.

Whoever flies, flies this: ``Simulation`` frame by frame or in blocks, trials, searches and studies whole. A part of the
frame that the flight needs is compiled when it is first needed, before the frame.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from rtsim.aircraft.variables import INPUT, STATE
from rtsim.arrays import FloatArray
from rtsim.atmosphere.dryden_kernels import TURBULENCE
from rtsim.atmosphere.gust_kernels import NORMALS_PER_FRAME
from rtsim.frame import SIGNAL_COUNT
from rtsim.kernels.compiled import interpreted
from rtsim.kernels.packed import packed
from rtsim.loop import beside
from rtsim.loop import frame_kernels as frames_of
from rtsim.loop.data import (
    CLOCK,
    END,
    END_REASONS,
    KNOWN,
    MOTION,
    PART,
    REFERENCE,
    Flight,
    Scratch,
    SimulationState,
    SimulationTables,
)
from rtsim.loop.loading import entry_of, load_part, part_address
from rtsim.pilot.engage_kernels import mocm_engage
from rtsim.pilot.lateral_kernels import lateral_engage
from rtsim.pilot.layout_kernels import noise_width as noise_width_of
from rtsim.random_streams import (
    STREAM_LATERAL_PILOT,
    STREAM_LATERAL_TURBULENCE,
    STREAM_PILOT,
    STREAM_TURBULENCE,
    stream_generator,
)

WHOLE, COMPLETE = frames_of.WHOLE, frames_of.COMPLETE
NO_ROWS = np.zeros(0)
_NO_NORMALS = np.zeros((1, 0))
_STILL = np.zeros((1, 2 * NORMALS_PER_FRAME))
"""Normals of the air where no time passes."""
BLOCK = 2_048
"""Frames for which noise is drawn at a time in a flight that keeps no rows."""
_ENGAGE, _ENGAGE_LATERAL = interpreted(mocm_engage), interpreted(lateral_engage)
Measure = Callable[[Any], float]
"""A compiled part that looks at ``flight.scratch.row`` after each frame and adds to ``flight.measures``."""


class Streams(NamedTuple):
    """Random streams of a flight."""

    pilot: np.random.Generator
    """The pilot's noise."""
    air: np.random.Generator
    """Turbulence in the plane of symmetry."""
    side: np.random.Generator
    """Turbulence out of it."""
    hands: np.random.Generator
    """Noise of the pilot's lateral half."""


def new_streams(seed: int) -> Streams:
    """Random streams of a flight.

    Args:
        seed: Root of every random stream.
    """
    numbers = (STREAM_PILOT, STREAM_TURBULENCE, STREAM_LATERAL_TURBULENCE, STREAM_LATERAL_PILOT)
    return Streams(*(stream_generator(seed, number) for number in numbers))


def new_normals(streams: Streams) -> FloatArray:
    """Standard normals for the first state of the turbulence, drawn as many whether or not they are needed.

    Args:
        streams: The flight's.
    """
    return np.concatenate([streams.air.standard_normal(3), streams.side.standard_normal(3)])


class Flying:
    """One flight."""

    __slots__ = ("_call", "_gusts", "_nonlinear", "flight", "noise_width", "state", "streams")

    def __init__(
        self,
        tables: SimulationTables,
        state: SimulationState,
        scratch: Scratch,
        *,
        streams: Streams,
        nonlinear: bool,
        noise_width: int,
        measure: tuple[Measure, FloatArray] | None = None,
        unlocked: bool = False,
    ) -> None:
        """Put a flight together; nothing is flown yet.

        Args:
            tables: What the frame reads.
            state: The state, changed by flying.
            scratch: Work space of this flight alone.
            streams: Random streams.
            nonlinear: The nonlinear aircraft flies.
            noise_width: Standard normals that the pilot takes per frame; 0: no noise.
            measure: A part that measures each frame, and the array that it adds to.
            unlocked: Fly outside Python's lock: in batches, where threads fly side by side.
        """
        sums = np.zeros(0) if measure is None else measure[1]
        addresses = np.zeros(PART.size, dtype=np.int64)
        self.flight: Any = packed(Flight(tables, state, scratch, sums, addresses))
        """The flight as kernels see it."""
        self.state: SimulationState = self.flight.state
        """Its state."""
        self.streams = streams
        """Random streams."""
        self.noise_width, self._nonlinear, self._gusts = noise_width, nonlinear, state.gusts
        self._load("outputs", "step")
        arguments = (self.flight, NO_ROWS, _NO_NORMALS, _NO_NORMALS, 0, 0)
        if unlocked:
            address = part_address(frames_of.fly_frames, *arguments)
            self._call = functools.partial(entry_of(frames_of.fly_unlocked, address, *arguments), address)
        else:
            self._call = entry_of(frames_of.fly_frames, *arguments)
        beside.finish("nonlinear" if nonlinear else "lpv")
        self._load("ask", "advance")
        if tables.automatic.active:
            self._load("automatic_rate", "automatic_advance")
        if tables.script.pulses.shape[0] or tables.script.reaction >= 0.0:
            self._load("script")
        if tables.script.reaction >= 0.0:
            self._load("notice")
        if measure is not None:
            addresses[PART.measure] = part_address(measure[0], self.flight)

    @property
    def tables(self) -> SimulationTables:
        """What the frame reads."""
        return self.flight.tables  # type: ignore[no-any-return]

    @property
    def scratch(self) -> Scratch:
        """Its work space; the row of the present frame is ``scratch.row``."""
        return self.flight.scratch  # type: ignore[no-any-return]

    @property
    def ended(self) -> bool:
        """The flight ended by itself."""
        return bool(self.state.clock[CLOCK.end] != END.none)

    @property
    def end_reason(self) -> str:
        """Why; empty while it has not."""
        clock = self.state.clock
        return END_REASONS[int(clock[CLOCK.end])].format(sink=float(clock[CLOCK.sink]))

    def fly(self, rows: FloatArray, frames: int, stages: int = WHOLE) -> int:
        """Fly frames.

        Args:
            rows: Written: their rows, C-contiguous, frames * SIGNAL_COUNT numbers; ``NO_ROWS`` keeps none.
            frames: How many at most.
            stages: Stages of the first frame.

        Returns:
            How many were flown: fewer where the flight ended by itself.
        """
        noise = air = _NO_NORMALS
        if stages & COMPLETE or frames > 1:
            if self.noise_width:
                noise = self.streams.pilot.standard_normal((frames, self.noise_width))
                if self.tables.lateral_noise:
                    width = interpreted(noise_width_of)(self.tables.lateral_pilot.target.mocm)
                    noise = np.hstack([noise, self.streams.hands.standard_normal((frames, width))])
            if self._gusts.item(TURBULENCE.active):
                air = self.streams.air.standard_normal((frames, NORMALS_PER_FRAME))
                if self._gusts.item(TURBULENCE.lateral):
                    air = np.hstack([air, self.streams.side.standard_normal((frames, NORMALS_PER_FRAME))])
        flown = self._call(self.flight, rows, noise, air, frames, stages)
        if flown >= 0.0:
            return int(flown)
        return self._complete(rows, noise, air, frames, stages, int(-1 - flown))

    def _complete(
        self, rows: FloatArray, noise: FloatArray, air: FloatArray, frames: int, stages: int, flown: int
    ) -> int:
        """Load what was missing and fly on, until nothing is."""
        while True:
            self._load_missing()
            left = rows[flown * SIGNAL_COUNT :] if rows.size else rows
            normals = noise[flown:] if noise.shape[1] else noise, air[flown:] if air.shape[1] else air
            more = self._call(self.flight, left, *normals, frames - flown, WHOLE if flown else stages)
            if more >= 0.0:
                return flown + int(more)
            flown += int(-1 - more)

    def run(self, frames: int) -> int:
        """Fly frames without keeping their rows, for measures.

        Args:
            frames: How many at most.

        Returns:
            How many were flown.
        """
        flown = 0
        while flown < frames and not self.ended:
            flown += self.fly(NO_ROWS, min(BLOCK, frames - flown))
        return flown

    def do(self, stages: int) -> None:
        """Do stages of the present frame that draw no random numbers.

        Args:
            stages: Which.
        """
        if self._call(self.flight, NO_ROWS, _NO_NORMALS, _STILL, 1, stages) < 0.0:
            self._complete(NO_ROWS, _NO_NORMALS, _STILL, 1, stages, 0)

    def engage(self) -> None:
        """Let the MOCM take the controls as they are: its state is set so that its first output equals them.

        Done in interpreted kernels: it happens once in a flight, and compiling it takes longer than a thousand times.
        """
        tables, state, scratch = self.tables, self.state, self.scratch
        if tables.plant.lateral:  # what it is asked for begins with how the aircraft moves, and leads on from there
            x = state.x
            turning = x[STATE.q] * math.sin(x[STATE.bank]) + x[STATE.r] * math.cos(x[STATE.bank])
            state.reference[[REFERENCE.heading, REFERENCE.turn_rate]] = x[STATE.heading], turning
            state.reference[[REFERENCE.turn_acceleration, REFERENCE.lateral_rate, REFERENCE.on_track]] = 0.0
            state.reference[REFERENCE.lateral] = x[STATE.v]
        self.do(frames_of.OBSERVE)
        present = np.array([state.u[INPUT.stick], state.u[INPUT.lever]])
        place, rate = float(scratch.known[KNOWN.place]), float(scratch.motion[MOTION.rate])
        _ENGAGE(tables.pilot, state.pilot, scratch.seen, place, rate, scratch.target, present)
        if tables.plant.lateral:
            hands = np.array([state.u[INPUT.lateral_stick], state.u[INPUT.pedal]])
            pilot, airspeed = tables.lateral_pilot.target, float(scratch.shown[0])
            _ENGAGE_LATERAL(pilot, state.lateral_pilot, state.x, place, airspeed, scratch.wanted, hands)

    def take(self, state: SimulationState) -> None:
        """Take another state.

        Args:
            state: Arrays as those of the present one.
        """
        for mine, start in zip(self.state, state, strict=True):
            mine[:] = start

    def _load_missing(self) -> None:
        missing = int(self.state.clock[CLOCK.missing]) - 1
        self._load(next(name for name, place in PART.asdict().items() if place == missing))

    def _load(self, *names: str) -> None:
        for name in names:
            load_part(self.flight, name, nonlinear=self._nonlinear)
