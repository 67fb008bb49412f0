"""What properties may speak of: signals of the frame, metrics of the whole flight, and both of the unprotected twin."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.errors import InputError, suggestion
from rtsim.frame import COLUMN, SIGNALS
from rtsim.measures.metrics import TrialMetrics

TWIN = "twin_"
"""Before the name of a signal or metric: that of the same flight without a law."""
SIGNAL_UNITS = {signal.name: signal.unit for signal in SIGNALS}
"""Unit of every signal by name."""
METRIC_UNITS = {name: metric.unit for name, metric in TrialMetrics.shown.items() if name not in SIGNAL_UNITS}
"""Unit of every metric by name; in a property it is a signal that never changes."""
UNITS = SIGNAL_UNITS | METRIC_UNITS
"""Unit of everything a property may speak of."""


def unit_of(name: str) -> str:
    """Unit of a signal or metric, of the flight or its twin.

    Args:
        name: Its name.
    """
    return UNITS[name.removeprefix(TWIN)]


def check_names(names: Iterable[str], formula: str) -> None:
    """Refuse names that mean nothing.

    Args:
        names: What the formula speaks of.
        formula: The formula, for the sentence.

    Raises:
        InputError: One of them is neither a signal nor a metric.
    """
    for name in names:
        if name.removeprefix(TWIN) not in UNITS:
            mend = suggestion(name.removeprefix(TWIN), tuple(UNITS), otherwise="docs/signals.md lists the signals")
            raise InputError("is neither a signal nor a metric", key=f"property '{formula}'", value=name, mend=mend)


def values_of(name: str, rows: FloatArray, metrics: FloatArray) -> FloatArray:
    """What a name stands for in a flight, shape (frames,).

    Args:
        name: A signal or a metric, without ``twin_``.
        rows: Frame history, shape (frames, SIGNAL_COUNT).
        metrics: Metrics of the flight, places ``VALUE``.
    """
    if name in SIGNAL_UNITS:
        return rows[:, getattr(COLUMN, name)].astype(np.float64)
    return np.full(len(rows), TrialMetrics(metrics)[name])
