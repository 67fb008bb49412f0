"""How good the time to limit is: predictions against what then happened."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.protection.monitor import MarginHistory


@dataclass(frozen=True, slots=True)
class LeadError:
    """Error of the time to limit at one true lead."""

    lead: float
    """Time before the crossing [s]."""
    crossings: int
    """Crossings that were preceded by as much time inside."""
    detected: float
    """Share of them that were predicted at all."""
    bias: float
    """Mean of predicted minus true time [s]."""
    deviation: float
    """Standard deviation of that [s]."""


@dataclass(frozen=True, slots=True)
class WarningQuality:
    """How the warnings of a set of flights turned out."""

    leads: tuple[LeadError, ...]
    """Error by lead."""
    alarms: int
    """Warnings raised (time to limit below the threshold, from above it)."""
    false_alarms: int
    """Those that no crossing followed within the prediction's horizon."""


def assess_warnings(
    flights: Iterable[MarginHistory],
    *,
    leads: Sequence[float] = (0.5, 1.0, 2.0, 3.0, 4.0),
    horizon: float = 6.0,
    threshold: float = 2.5,
) -> WarningQuality:
    """Compare predictions with what then happened.

    Args:
        flights: Monitored flights.
        leads: True leads at which to read the prediction [s].
        horizon: The prediction's horizon [s].
        threshold: Time to limit at which a warning begins [s].
    """
    errors: dict[float, list[float]] = {lead: [] for lead in leads}
    crossings = dict.fromkeys(leads, 0)
    alarms = missed = 0
    for flight in flights:
        margin = np.minimum(flight.of("stall_attitude"), flight.of("load_torque"))
        outside = margin < 0.0
        starts = np.flatnonzero(outside[1:] & ~outside[:-1]) + 1
        for start in starts:
            for lead in leads:
                _read(flight, outside, int(start), lead, horizon, errors[lead], crossings)
        warned = flight.time_to_limit < threshold
        for begin in np.flatnonzero(warned[1:] & ~warned[:-1]) + 1:
            if outside[begin] or flight.time[-1] - flight.time[begin] < horizon:
                continue
            alarms += 1
            until = np.searchsorted(flight.time, flight.time[begin] + horizon)
            missed += int(not outside[begin:until].any())
    return WarningQuality(
        leads=tuple(_lead_error(lead, crossings[lead], np.array(errors[lead])) for lead in leads),
        alarms=alarms,
        false_alarms=missed,
    )


def _read(
    flight: MarginHistory,
    outside: np.ndarray[tuple[int], np.dtype[np.bool_]],
    start: int,
    lead: float,
    horizon: float,
    errors: list[float],
    crossings: dict[float, int],
) -> None:
    """Take the prediction a lead before one crossing, if the flight was inside since."""
    begin = int(np.searchsorted(flight.time, flight.time[start] - lead - 1e-9))
    if flight.time[start] < lead or outside[begin:start].any():
        return
    crossings[lead] += 1
    predicted = float(flight.time_to_limit[begin])
    if predicted < horizon - 1e-9:
        errors.append(predicted - lead)


def _lead_error(lead: float, crossings: int, errors: FloatArray) -> LeadError:
    if not len(errors):
        return LeadError(lead, crossings, 0.0, float("nan"), float("nan"))
    return LeadError(lead, crossings, len(errors) / crossings, float(errors.mean()), float(errors.std()))
