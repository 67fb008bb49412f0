"""The numbers a flight is judged by, computed from its frame history alone.

Field names are the keys of ``rtsim fly --json``; definitions are those of ``docs/scenarios.md``. Nothing here knows
how the flight was made: the nacelle reference, for one, is solved afresh from the programme.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import get_type_hints

import numpy as np
import numpy.typing as npt

from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN
from rtsim.programme import Programme
from rtsim.units import STICK_HALF_TRAVEL_IN, to_deg

NACELLE_FILTER_FREQUENCY = 3.0
"""Natural frequency of the critically damped nacelle filter [rad/s] (design decision: it is the actuator)."""
EXCEEDANCE_MARGIN_KT = -0.5
"""A corridor margin below this counts as outside [kn]."""
EXCEEDANCE_PERSISTENCE_S = 0.1
"""An excursion shorter than this is not an event [s]."""
EXCEEDANCE_MERGE_S = 0.5
"""Events closer than this are one event [s]."""
LATE_PHASE_S = 30.0
"""Start of the phase in which flapping must have come down [s]."""
_EPSILON = 1e-9


@dataclass(frozen=True, slots=True)
class CorridorMetrics:
    """How the flight kept to the conversion corridor."""

    exceedances: int
    """Excursions beyond -0.5 kn of at least 0.1 s, those within 0.5 s merged."""
    worst_margin_kt: float
    """Smallest margin [kn]."""
    time_outside_s: float
    """Time with a margin below -0.5 kn [s]."""


@dataclass(frozen=True, slots=True)
class FlappingMetrics:
    """Gimbal flapping relative to the mast."""

    peak: float
    """Largest flapping [deg]."""
    peak_time_s: float
    """When it was reached first [s]."""
    peak_after_30_s: float | None
    """Largest flapping from 30 s on [deg]; None for shorter flights."""
    rms: float
    """Root mean square [deg]."""
    integral_deg_s: float
    """Time integral [deg s]."""


@dataclass(frozen=True, slots=True)
class AirspeedMetrics:
    """True airspeed against the filtered reference."""

    final: float
    """Airspeed of the last frame [kn]."""
    rms_error: float
    """Root mean square of airspeed minus filtered reference over all frames [kn]."""
    max_error: float
    """Largest magnitude of that difference [kn]."""


@dataclass(frozen=True, slots=True)
class NacelleMetrics:
    """Nacelle angle against the critically damped reference."""

    final: float
    """Nacelle angle of the last frame [deg]."""
    max_error: float
    """Largest magnitude of nacelle angle minus reference [deg]."""
    max_rate_deg_s: float
    """Largest magnitude of the nacelle rate [deg/s]."""


@dataclass(frozen=True, slots=True)
class AltitudeMetrics:
    """Altitude against the altitude to hold."""

    max_deviation: float
    """Largest magnitude of altitude minus its reference [m]."""
    final: float
    """Altitude of the last frame [m]."""


@dataclass(frozen=True, slots=True)
class PitchMetrics:
    """Range of pitch attitude."""

    min: float
    """Smallest pitch attitude [deg]."""
    max: float
    """Largest pitch attitude [deg]."""


@dataclass(frozen=True, slots=True)
class StickMetrics:
    """Longitudinal stick activity, about the mean."""

    rms_in: float
    """Standard deviation of the stick [in]."""
    rms_rate_in_s: float
    """Standard deviation of its rate [in/s]."""
    travel_in: float
    """Largest minus smallest position [in]."""


@dataclass(frozen=True, slots=True)
class LeverMetrics:
    """Power lever activity, about the mean; 1 is full travel."""

    rms: float
    """Standard deviation of the lever [-]."""
    rms_rate_per_s: float
    """Standard deviation of its rate [1/s]."""
    travel: float
    """Largest minus smallest position [-]."""


@dataclass(frozen=True, slots=True)
class FlightMetrics:
    """Everything ``rtsim fly`` measures from the frame history; field names are its JSON keys."""

    corridor: CorridorMetrics
    flapping_deg: FlappingMetrics
    airspeed_kt: AirspeedMetrics
    nacelle_deg: NacelleMetrics
    altitude_m: AltitudeMetrics
    pitch_deg: PitchMetrics
    stick: StickMetrics
    lever: LeverMetrics
    controls_on_stop_frames: int
    """Frames with stick, lever, cyclic or elevator on a stop."""

    def value(self, name: str) -> float | None:
        """One metric by its dotted name, such as ``airspeed_kt.rms_error``.

        Args:
            name: One of :data:`METRIC_NAMES`.
        """
        found: object = self
        for part in name.split("."):
            found = getattr(found, part)
        if found is None:
            return None
        assert isinstance(found, (int, float))  # METRIC_NAMES lists numbers only
        return float(found)


def _names() -> tuple[str, ...]:
    names: list[str] = []
    types = get_type_hints(FlightMetrics)
    for field in fields(FlightMetrics):
        group = types[field.name]
        if hasattr(group, "__dataclass_fields__"):
            names.extend(f"{field.name}.{item.name}" for item in fields(group))
        else:
            names.append(field.name)
    return tuple(names)


METRIC_NAMES: tuple[str, ...] = _names()
"""Dotted names of all metrics, as used by the ``expect`` clauses of scenarios."""


_LEAF_UNITS = {
    "max_rate_deg_s": "deg/s", "peak_time_s": "s", "integral_deg_s": "deg s", "worst_margin_kt": "kn",
    "time_outside_s": "s", "rms_in": "in", "rms_rate_in_s": "in/s", "travel_in": "in", "rms_rate_per_s": "1/s",
}  # fmt: skip
_GROUP_UNITS = {
    "airspeed_kt": "kn", "nacelle_deg": "deg", "altitude_m": "m", "pitch_deg": "deg", "flapping_deg": "deg",
}  # fmt: skip


def metric_unit(name: str) -> str:
    """The unit of a metric as people write it; empty for a number.

    Args:
        name: One of :data:`METRIC_NAMES`.
    """
    group, _, leaf = name.rpartition(".")
    return _LEAF_UNITS.get(leaf, _GROUP_UNITS.get(group, ""))


def nacelle_reference_deg(programme: Programme, time: FloatArray) -> FloatArray:
    """The programme's nacelle angle behind a critically damped 3 rad/s filter, in closed form.

    The programme is a sum of ramps that start at its corners; the answer of w^2 / (s + w)^2 to a unit ramp is
    ``t - 2/w + (t + 2/w) exp(-w t)``. The filter starts at rest on the first nacelle angle.

    Args:
        programme: What the flight was asked to do.
        time: Times since the start [s], any shape.

    Returns:
        Nacelle angles [deg], shape of ``time``.
    """
    w = NACELLE_FILTER_FREQUENCY
    angle = np.full(np.shape(time), programme.nacelle_angle[0])
    if len(programme.time) > 1:
        slopes = np.diff(programme.nacelle_angle) / np.diff(programme.time)
        steps = np.diff(np.concatenate(([0.0], slopes, [0.0])))
        for corner, step in zip(programme.time, steps, strict=True):
            since = np.maximum(time - corner, 0.0)
            angle = angle + step * (since - 2.0 / w + (since + 2.0 / w) * np.exp(-w * since))
    return np.asarray(angle * to_deg(1.0), dtype=np.float64)


def exceedance_events(margin_kt: FloatArray, dt: float) -> list[tuple[int, int]]:
    """Corridor exceedances as ranges of frames.

    Args:
        margin_kt: Margin to the nearer boundary [kn], shape (frames,).
        dt: Length of a frame [s].

    Returns:
        ``(first frame, one past the last frame)`` of each event, merged where the gap is at most 0.5 s.
    """
    outside = np.concatenate(([False], margin_kt < EXCEEDANCE_MARGIN_KT, [False]))
    edges = np.flatnonzero(outside[1:] != outside[:-1])
    events: list[tuple[int, int]] = []
    for begin, end in zip(edges[0::2].tolist(), edges[1::2].tolist(), strict=True):
        if (end - begin) * dt < EXCEEDANCE_PERSISTENCE_S - _EPSILON:
            continue
        if events and (begin - events[-1][1]) * dt <= EXCEEDANCE_MERGE_S + _EPSILON:
            events[-1] = (events[-1][0], end)
        else:
            events.append((begin, end))
    return events


def flight_metrics(rows: FloatArray, programme: Programme, dt: float) -> FlightMetrics:
    """Measure a flight.

    Args:
        rows: The frame history, shape (frames, SIGNAL_COUNT), at least one frame.
        programme: What the scenario asked for.
        dt: Length of a frame [s].
    """

    def column(number: int) -> FloatArray:
        return np.ascontiguousarray(rows[:, number])

    time, margin = column(COLUMN.time_s), column(COLUMN.margin_kt)
    nacelle, altitude = column(COLUMN.nacelle_deg), column(COLUMN.altitude_m)
    airspeed_error = column(COLUMN.airspeed_kt) - column(COLUMN.airspeed_reference_kt)
    altitude_error = altitude - column(COLUMN.altitude_reference_m)
    nacelle_error = nacelle - nacelle_reference_deg(programme, time)
    pitch = column(COLUMN.pitch_deg)
    stick_in, lever = column(COLUMN.stick) * STICK_HALF_TRAVEL_IN, column(COLUMN.lever)
    # A reset puts the clock back: the jump there is not a motion of the controls.
    running = np.diff(time) > 0.0
    return FlightMetrics(
        corridor=CorridorMetrics(
            exceedances=len(exceedance_events(margin, dt)),
            worst_margin_kt=float(margin.min()),
            time_outside_s=float(np.count_nonzero(margin < EXCEEDANCE_MARGIN_KT) * dt),
        ),
        flapping_deg=_flapping(column(COLUMN.flapping_deg), time, dt),
        airspeed_kt=AirspeedMetrics(
            final=float(rows[-1, COLUMN.airspeed_kt]),
            rms_error=_rms(airspeed_error),
            max_error=float(np.abs(airspeed_error).max()),
        ),
        nacelle_deg=NacelleMetrics(
            final=float(nacelle[-1]),
            max_error=float(np.abs(nacelle_error).max()),
            max_rate_deg_s=float(np.abs(column(COLUMN.nacelle_rate_deg_s)).max()),
        ),
        altitude_m=AltitudeMetrics(max_deviation=float(np.abs(altitude_error).max()), final=float(altitude[-1])),
        pitch_deg=PitchMetrics(min=float(pitch.min()), max=float(pitch.max())),
        stick=StickMetrics(_deviation(stick_in), _rate_deviation(stick_in, running, dt), float(np.ptp(stick_in))),
        lever=LeverMetrics(_deviation(lever), _rate_deviation(lever, running, dt), float(np.ptp(lever))),
        controls_on_stop_frames=int(np.count_nonzero(column(COLUMN.control_on_stop) > 0.5)),
    )


def _flapping(flapping: FloatArray, time: FloatArray, dt: float) -> FlappingMetrics:
    peak = int(np.argmax(flapping))
    late = flapping[time >= LATE_PHASE_S - _EPSILON]
    return FlappingMetrics(
        peak=float(flapping[peak]),
        peak_time_s=float(time[peak]),
        peak_after_30_s=float(late.max()) if late.size else None,
        rms=_rms(flapping),
        integral_deg_s=_sum(flapping) * dt,
    )


def _sum(values: FloatArray) -> float:
    """Sum in the order of the frames, so that a flight measured while it is flown gives the same to the last bit."""
    return float(np.cumsum(values)[-1]) if values.size else 0.0


def _rms(values: FloatArray) -> float:
    return math.sqrt(_sum(values * values) / values.size)


def _deviation(values: FloatArray) -> float:
    """Standard deviation about the mean, summed about the first value."""
    return _deviation_about_zero(values - values[0])


def _rate_deviation(values: FloatArray, running: npt.NDArray[np.bool_], dt: float) -> float:
    """Standard deviation of the rate over the frames that follow one another."""
    return _deviation_about_zero(np.diff(values)[running] / dt)


def _deviation_about_zero(values: FloatArray) -> float:
    if not values.size:
        return 0.0
    mean = _sum(values) / values.size
    return math.sqrt(max(_sum(values * values) / values.size - mean * mean, 0.0))
