"""The metrics of a flight by name: as ``rtsim fly`` shows them, as trials and campaigns do, and as searches do.

All are views of one array of numbers (``rtsim.measures.metric_kernels``), which holds the table they are declared in.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Mapping
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np

from rtsim.aircraft.profile import AircraftProfile
from rtsim.arrays import BoolArray, FloatArray
from rtsim.choices import LEAVABLE
from rtsim.errors import InputError
from rtsim.frame import SIGNAL_COUNT
from rtsim.kernels.parts import entry_point
from rtsim.measures import metric_kernels as kernels
from rtsim.measures.metric_kernels import CONTROL, FLIGHT, METRICS, SEARCH, SUM, TRIAL, VALUE, Metric
from rtsim.places import Places
from rtsim.programme import Programme
from rtsim.protection.limits import load_limits
from rtsim.units import to_deg

SECONDARY_LIMITS = LEAVABLE[1:-1]
"""Limits besides the corridor, by name: flapping, 1.02 of the torque limit, load factor, pitch, bank, sideslip, and
keeping control to the end."""
VACUOUS_HEIGHT = 30.0
"""Height loss that counts as a violation of ``height`` [m]."""


def _shown(view: str) -> dict[str, Metric]:
    return {getattr(item, view, "") or item.name: item for item in METRICS if view in item.views}


class Metrics(Mapping[str, Any]):
    """Numbers of one flight by name; ``metrics.flapping_deg.peak`` is ``metrics["flapping_deg.peak"]``."""

    __slots__ = ("numbers",)
    shown: ClassVar[dict[str, Metric]] = {}
    """What is shown, by name."""

    def __init__(self, numbers: FloatArray) -> None:
        """Show the numbers of a flight.

        Args:
            numbers: All its metrics, places ``VALUE``, as ``measured`` gives them.
        """
        self.numbers = numbers

    def __getitem__(self, name: str) -> Any:
        """One metric.

        Args:
            name: One of ``shown``.
        """
        metric = self.shown[name]
        return metric.kind(self.numbers[getattr(VALUE, metric.name)])

    def __iter__(self) -> Iterator[str]:
        return iter(self.shown)

    def __len__(self) -> int:
        return len(self.shown)

    def __repr__(self) -> str:
        """Say all of it."""
        return f"{type(self).__name__}({self.asdict()})"

    def __getattr__(self, name: str) -> Any:  # only for names that are not there
        if name in self.shown:
            return self[name]
        group = {key.removeprefix(f"{name}."): key for key in self.shown if key.startswith(f"{name}.")}
        if not group:
            raise AttributeError(f"there is no metric '{name}'; there are {', '.join(self.shown)}")
        return SimpleNamespace(**{leaf: self[key] for leaf, key in group.items()})

    def asdict(self) -> dict[str, Any]:
        """All of them, as JSON values: what stands before a dot is a group."""
        found: dict[str, Any] = {}
        for name in self.shown:
            group, _, leaf = name.rpartition(".")
            (found.setdefault(group, {}) if group else found)[leaf] = self[name]
        return found


class FlightMetrics(Metrics):
    """What ``rtsim fly --json`` and the ``[[expect]]`` clauses of scenarios show."""

    __slots__ = ()
    shown = _shown(FLIGHT)

    def __getitem__(self, name: str) -> Any:
        """One metric; None where the flight has no such number.

        Args:
            name: One of ``METRIC_NAMES``, such as ``airspeed_kt.rms_error``.
        """
        value = super().__getitem__(name)
        return None if math.isnan(value) else value

    def value(self, name: str) -> float | None:
        """One metric as a float.

        Args:
            name: One of ``METRIC_NAMES``.
        """
        value = self[name]
        return None if value is None else float(value)


class FlightFigures(Metrics):
    """What searches judge a flight by."""

    __slots__ = ()
    shown = _shown(SEARCH)


class TrialMetrics(Metrics):
    """What trials and campaigns show, all of it floats."""

    __slots__ = ()
    shown = _shown(TRIAL)

    def __getitem__(self, name: str) -> float:
        """One metric.

        Args:
            name: One of ``TRIAL_METRICS``.
        """
        return float(super().__getitem__(name))

    @property
    def exceeded(self) -> frozenset[str]:
        """What the flight violated, out of ``LEAVABLE``."""
        return frozenset(name for name, violated in violations(self.numbers[None, :]).items() if violated[0])


METRIC_NAMES = tuple(FlightMetrics.shown)
"""Dotted names of the metrics of a flight, as used by the ``expect`` clauses of scenarios."""
TRIAL_METRICS = {name: item.text for name, item in TrialMetrics.shown.items()}
"""Metrics of a trial by name, in words."""
OBJECTIVES = {item.objective: item.text for item in METRICS if item.objective}
"""What a search can minimize, in words."""
_OBJECTIVE_PLACES = {item.objective: place for place, item in enumerate(METRICS) if item.objective}


def metric_unit(name: str) -> str:
    """The unit of a metric as people write it; empty for a number.

    Args:
        name: One of :data:`METRIC_NAMES`; others have none.
    """
    return FlightMetrics.shown[name].unit if name in FlightMetrics.shown else ""


def objective_value(figures: FlightFigures, objective: str) -> float:
    """One objective of a flight, to be minimized.

    Args:
        figures: The flight.
        objective: One of :data:`OBJECTIVES`.

    Raises:
        InputError: There is no such objective.
    """
    if objective not in OBJECTIVES:
        raise InputError("is not an objective", key="objective", value=objective, allowed=", ".join(OBJECTIVES))
    return float(figures.numbers[_OBJECTIVE_PLACES[objective]])


def new_sums(profile: AircraftProfile | None = None) -> FloatArray:
    """What a flight is measured into: nothing summed up yet, the limits it is judged by in their places."""
    limits, sums = load_limits(profile), np.zeros(SUM.size)
    sums[SUM.flapping_limit], sums[SUM.pitch_limit] = to_deg(limits.flapping), to_deg(limits.pitch)
    sums[SUM.load_limit_max], sums[SUM.load_limit_min] = limits.load_factor_max, limits.load_factor_min
    sums[SUM.torque_cruise : SUM.torque_cruise + len(limits.torque)] = limits.torque
    sums[SUM.sideways : SUM.sideways + len(limits.sideways)] = limits.sideways
    sums[SUM.alpha_speed] = limits.alpha_speed
    return sums


def finished(sums: FloatArray, dt: float) -> FloatArray:
    """All metrics of a flight, places ``VALUE``.

    Args:
        sums: What was summed up, places ``SUM``.

    Raises:
        InputError: Not one frame was flown.
    """
    if sums[SUM.frames] == 0.0:
        raise InputError("has no frames", key="flight")
    named = SimpleNamespace(**_named(sums, SUM), dt=dt)
    for control in ("stick", "lever", "lateral_stick", "pedal"):
        setattr(named, control, SimpleNamespace(**_named(sums[getattr(SUM, control) :], CONTROL)))
    return np.array([metric.value(named) for metric in METRICS], dtype=np.float64)


def _named(values: FloatArray, places: Places) -> dict[str, float]:
    return {name: float(values[place]) for name, place in places.asdict().items()}


@functools.cache
def _measure_rows() -> Callable[..., float]:
    """The compiled measuring of rows, held."""
    return entry_point(kernels.measure_rows, np.zeros((1, SIGNAL_COUNT)), np.zeros((4, 1)), 0.0, np.zeros(1))


def compile_measures() -> None:
    """Compile, or load, what measures rows: a first flight does it beside."""
    _measure_rows()


def measured(
    rows: FloatArray,
    programme: Programme,
    dt: float,
    *,
    profile: AircraftProfile | None = None,
    ended: bool = False,
    yielded: bool = False,
) -> FloatArray:
    """Measure a flight that was recorded.

    Args:
        rows: The frame history, shape (frames, SIGNAL_COUNT), at least one frame.
        programme: What it was asked to do.
        ended: It ended by itself.
        yielded: Its pilot gave up his plan.

    Returns:
        All its metrics, places ``VALUE``.
    """
    sums = new_sums(profile)
    points = np.array([programme.time, programme.airspeed, programme.nacelle_angle, programme.altitude])
    _measure_rows()(np.ascontiguousarray(rows, dtype=np.float64), points, dt, sums)
    sums[SUM.ended], sums[SUM.yielded] = ended, yielded
    return finished(sums, dt)


def flight_metrics(rows: FloatArray, programme: Programme, dt: float) -> FlightMetrics:
    """Measure a flight as ``rtsim fly`` does.

    Args:
        rows: The frame history, shape (frames, SIGNAL_COUNT), at least one frame.
        programme: What the scenario asked for.
    """
    return FlightMetrics(measured(rows, programme, dt))


def violations(numbers: FloatArray) -> dict[str, BoolArray]:
    """What flights violated, by name out of ``LEAVABLE``, shape (flights,) each.

    Args:
        numbers: Metrics, shape (flights, VALUE.size).
    """
    return {
        "corridor": numbers[:, VALUE.exceedances] > 0.0,
        "flapping": numbers[:, VALUE.flapping_over_s] > 0.0,
        "torque": numbers[:, VALUE.torque_over_s] > 0.0,
        "load_factor": numbers[:, VALUE.load_factor_beyond] > 0.0,
        "pitch": numbers[:, VALUE.pitch_beyond_deg] > 0.0,
        "bank": numbers[:, VALUE.bank_over_s] > 0.0,
        "sideslip": numbers[:, VALUE.sideslip_over_s] > 0.0,
        "control": numbers[:, VALUE.completed] == 0.0,
        "height": numbers[:, VALUE.height_lost_m] > VACUOUS_HEIGHT,
    }
