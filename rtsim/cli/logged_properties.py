"""What was asked of a recorded flight, and how it stands to that."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rtsim.errors import InputError
from rtsim.frame import SIGNAL_NAMES
from rtsim.properties.formula import Flown, Robustness, parse_property
from rtsim.properties.words import SIGNAL_UNITS
from telemetry.log.flight_plots import PropertyCurve

if TYPE_CHECKING:
    from telemetry.log.reader import FlightLog


@dataclass(frozen=True, slots=True, eq=False)
class StatedProperty:
    """One property and a flight."""

    curve: PropertyCurve
    """Its robustness over time."""
    robustness: Robustness
    """Its robustness over the whole flight."""

    @property
    def report(self) -> dict[str, Any]:
        """The same for programs."""
        value = self.robustness
        return {
            "property": self.curve.formula,
            "robustness": value.value,
            "unit": value.unit,
            "decided_at_s": value.time,
            "decided_by": value.decides,
            "broken": value.broken,
        }


def stated_properties(log: FlightLog, formulas: Sequence[str] | None) -> list[StatedProperty]:
    """Ask a recorded flight.

    Args:
        log: The flight.
        formulas: What is asked; None: what its scenario asks, as far as a log can answer.

    Raises:
        InputError: A formula cannot be read, or asks for what no log holds.
    """
    if formulas is None:
        asked = [one for one in _of_scenario(log.metadata.scenario_toml) if not _beyond_a_log(one, log)]
    else:
        asked = list(formulas)
        for formula in asked:
            if beyond := _beyond_a_log(formula, log):
                problem = f"asks for {', '.join(beyond)}, which this log does not hold"
                mend = "ask for signals that rtsim log info names"
                raise InputError(problem, key="--property", value=formula, mend=mend)
    if not asked or len(log.rows) < 2:
        return []
    rows = np.column_stack(
        [log[name] if name in log.names else np.full(len(log.rows), np.nan) for name in SIGNAL_NAMES]
    )
    flown = Flown(rows, np.zeros(0))  # no metric is asked for
    return [_stated(formula, flown, 1.0 / log.metadata.rate_hz) for formula in asked]


def _stated(formula: str, flown: Flown, dt: float) -> StatedProperty:
    read = parse_property(formula)
    whole = read.robustness(flown, dt)
    verdict = f"{whole.words} at {whole.time:.4g} s" + (": BROKEN" if whole.broken else "")
    return StatedProperty(PropertyCurve(formula, read.unit, read.over_time(flown, dt), verdict), whole)


def _beyond_a_log(formula: str, log: FlightLog) -> list[str]:
    """What a formula asks for that only a trial knows (the twin, metrics of the whole flight), or no older log."""
    return [name for name in parse_property(formula).names if name not in log.names or name not in SIGNAL_UNITS]


def _of_scenario(text: str) -> Iterable[str]:
    """Properties in the expectations of a scenario's file."""
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return []
    listed = []
    for table in (tables, tables.get("trial")):
        expected = table.get("expect") if isinstance(table, dict) else None
        listed += expected if isinstance(expected, list) else []
    formulas = [one.get("property") for one in listed if isinstance(one, dict)]
    return dict.fromkeys(formula for formula in formulas if isinstance(formula, str))
