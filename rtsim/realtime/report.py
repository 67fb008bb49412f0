"""What the executive measured: lateness, work, overruns and drift of one flight."""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from rtsim.arrays import FloatArray

Ending = Literal["finished", "stopped", "overruns"]
"""Why the loop ended: the source had no more frames, it was asked to, or the overrun policy said so."""


@dataclass(frozen=True, slots=True)
class Spread:
    """Distribution of a time in the loop."""

    p50: float
    """Median [us]."""
    p99: float
    """99th percentile [us]."""
    max: float
    """Largest value [us]."""

    @classmethod
    def of(cls, values_us: FloatArray) -> Spread | None:
        """Summarize, or None where nothing was measured.

        Args:
            values_us: Times [us], shape (frames,).
        """
        if values_us.size == 0:
            return None
        p50, p99 = np.percentile(values_us, (50.0, 99.0))
        return cls(float(p50), float(p99), float(values_us.max()))


@dataclass(slots=True)
class TimingLog:
    """Times of every paced frame, appended by the executive [ns]."""

    lateness_ns: array[int] = field(default_factory=lambda: array("q"))
    """Frame start minus deadline."""
    work_ns: array[int] = field(default_factory=lambda: array("q"))
    """Wall time from frame start to the push into the view's ring."""
    work_cpu_ns: array[int] = field(default_factory=lambda: array("q"))
    """Thread CPU time from frame start to the push into the view's ring."""
    overrun_frames: array[int] = field(default_factory=lambda: array("q"))
    """Numbers of the frames that finished after the next deadline, counted from the start of the loop."""


@dataclass(frozen=True, slots=True)
class TimingReport:
    """Summary of one flight's pacing."""

    frames: int
    """Frames flown."""
    duration_s: float
    """Simulated time, frames times frame length [s]."""
    wall_s: float
    """Wall time from the first frame to the end of the last [s]."""
    paused_s: float
    """Part of it spent in pauses [s]."""
    overruns: int
    """Frames that finished after the next deadline."""
    overrun_frames: tuple[int, ...]
    """Which ones."""
    lateness_us: Spread | None
    """Frame start minus deadline; None where no frame was paced."""
    work_us: Spread | None
    """Wall time from frame start to ring push; None where no frame was paced."""
    work_cpu_us: Spread | None
    """Thread CPU time of the same work; None where no frame was paced."""
    drift_frames: float | None
    """Wall time beyond the schedule at the end, in frames; None where no frame was paced."""
    ending: Ending
    """Why the loop ended."""
    end_reason: str
    """The same as a sentence."""

    @property
    def real_time_factor(self) -> float:
        """Simulated time per wall time, pauses left out."""
        flown = self.wall_s - self.paused_s
        return self.duration_s / flown if flown > 0.0 else 0.0


def microseconds(values_ns: array[int]) -> FloatArray:
    """Nanoseconds as an array of microseconds.

    Args:
        values_ns: Times [ns].
    """
    return np.asarray(values_ns, dtype=np.float64) * 1e-3
