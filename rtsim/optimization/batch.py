"""Many flights at once: one candidate per flight, measured while it is flown, over all cores.

The threads share the aircraft's tables and own everything else. A flight depends on its programme and seed alone, so
the figures do not depend on how many workers there are or on who flies what.
"""

from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

from rtsim.loop.data import CLOCK
from rtsim.loop.setup import FlightSetup, build_parts, prepare
from rtsim.measures.metric_kernels import SUM, add_metrics
from rtsim.measures.metrics import FlightFigures, finished, new_sums
from rtsim.programme import Programme


@dataclass(frozen=True, slots=True)
class BatchFlight:
    """One flight of a batch."""

    programme: Programme
    """What it is asked to do; it begins at the batch's start condition."""
    seed: int | None = None
    """Root of its random streams; None takes the batch's."""
    duration: float | None = None
    """Length [s]; None takes the programme's."""


class BatchFlyer:
    """Flies programmes that share everything but the programme and the seed."""

    def __init__(self, setup: FlightSetup, *, workers: int | None = None) -> None:
        """Load the aircraft once for all flights.

        Args:
            setup: What flies and how; its programme gives the start condition of every flight.
            workers: Threads; None takes one for every core.

        Raises:
            InputError: The start has no trim.
        """
        self.setup = setup
        self.workers = max(1, workers if workers is not None else os.cpu_count() or 1)
        self._parts = build_parts(setup)

    @property
    def database_hash(self) -> str:
        """Content hash of the LPV database in use."""
        return self._parts.database_hash

    def fly(self, flights: Sequence[BatchFlight | Programme]) -> list[FlightFigures]:
        """Fly them all.

        Args:
            flights: The flights; a programme alone is flown with the batch's seed.

        Returns:
            Their figures, in the same order.
        """
        jobs = [flight if isinstance(flight, BatchFlight) else BatchFlight(flight) for flight in flights]
        if self.workers == 1 or len(jobs) < 2:
            return [self.fly_one(job) for job in jobs]
        # Threads, not processes: the kernel runs outside Python's lock, the tables (tens of MB) are shared, and Ctrl-C
        # only waits for the flights in the air.
        with ThreadPoolExecutor(max_workers=min(self.workers, len(jobs))) as pool:
            futures = [pool.submit(self.fly_one, job) for job in jobs]
            try:
                return [future.result() for future in futures]
            except BaseException:
                pool.shutdown(wait=True, cancel_futures=True)
                raise

    def fly_one(self, flight: BatchFlight) -> FlightFigures:
        """Fly one in this thread."""
        seed = self.setup.options.seed if flight.seed is None else flight.seed
        setup = dataclasses.replace(self.setup.with_options(seed=seed), programme=flight.programme)
        sums = new_sums(self._parts.database.profile)
        flying = prepare(setup, measure=(add_metrics, sums), unlocked=True)
        duration = flight.programme.duration if flight.duration is None else flight.duration
        flying.run(max(1, math.ceil(duration * self.setup.options.rate_hz - 1e-6)))
        sums[SUM.ended] = flying.state.clock[CLOCK.end]
        return FlightFigures(finished(sums, flying.tables.dt))
