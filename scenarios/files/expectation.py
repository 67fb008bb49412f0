"""What a flight is expected to do: a metric and the range it must lie in.

Legend:
    file: The file it stands in.
    key: Where it stands there.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, Literal, Protocol

from rtsim.errors import InputError, suggestion

ROBUSTNESS = "robustness"
"""What is measured of a property: how far the flight is from breaking it, in the unit of what decides."""


@dataclass(frozen=True, slots=True)
class Expectation:
    """A clause of ``[[expect]]`` or ``[[trial.expect]]``."""

    name: str
    """What is expected, in words."""
    metric: str
    """One of ``rtsim.measures.metrics.METRIC_NAMES``, in a trial of its ``TRIAL_METRICS``; the unit is part of it."""
    minimum: float | None
    """Smallest value that holds."""
    maximum: float | None
    """Largest value that holds."""
    of: Literal["law", "off", "difference"] = "law"
    """Whose value: the flight's, its unprotected twin's, or the first minus the second."""
    formula: str = ""
    """A property in signal temporal logic; its robustness is what is measured, and ``metric`` says so."""

    @property
    def limit(self) -> float | list[float]:
        """The limit as reported: one number, or ``[minimum, maximum]``."""
        if self.minimum is not None and self.maximum is not None:
            return [self.minimum, self.maximum]
        limit = self.maximum if self.minimum is None else self.minimum
        assert limit is not None  # the loader refuses a clause without a limit
        return limit

    @property
    def words(self) -> str:
        """The limit in words, such as ``<= 5`` or ``1 to 2``."""
        if self.minimum is None:
            return f"<= {self.maximum:g}"
        return f">= {self.minimum:g}" if self.maximum is None else f"{self.minimum:g} to {self.maximum:g}"

    def holds(self, value: float | None) -> bool:
        """Whether a measured value meets the expectation; a metric without value does not.

        Args:
            value: The metric as measured, in the unit of its name.
        """
        if value is None:
            return False
        low = self.minimum is None or value >= self.minimum
        return low and (self.maximum is None or value <= self.maximum)


class ClauseTable(Protocol):
    """What a table says of a clause: a metric or a property, and its limits."""

    metric: str | None
    property: str | None
    min: float | None
    max: float | None


def clause_of(name: str, table: ClauseTable, **whose: Any) -> Expectation:
    """Make a clause of what a checked table says; a property without limits must not be broken.

    Args:
        name: What is expected, in words.
        table: The clause.
        whose: ``of``, where it is not the flight's.
    """
    metric, formula, low, high = table.metric, table.property, table.min, table.max
    if formula is None:
        assert metric is not None  # the table was checked
        return Expectation(name, metric, low, high, **whose)
    from rtsim.properties.formula import parse_property  # loads its reader

    low, unit = 0.0 if low is None and high is None else low, parse_property(formula).unit
    return Expectation(name, f"{ROBUSTNESS} [{unit}]" if unit else ROBUSTNESS, low, high, formula=formula, **whose)


def clause_problems(
    table: ClauseTable, *, known: Collection[str], noun: str, twin: bool, file: str, key: str
) -> list[InputError]:
    """Mistakes in what a clause measures and allows.

    Args:
        table: The clause.
        known: Metrics that there are.
        noun: What they are called, with the article.
        twin: Whether the flight has an unprotected twin.
    """
    metric, formula, low, high = table.metric, table.property, table.min, table.max
    if (metric is None) == (formula is None):
        return [InputError("needs either metric or property", file=file, key=key, mend="give one of them")]
    if formula is not None:
        limits = range_problems(low or 0.0, high, file=file, key=key)
        return property_problems(formula, twin=twin, file=file, key=f"{key}.property") + limits
    assert metric is not None  # one of them
    found = name_problems(metric, known, noun, file=file, key=f"{key}.metric")
    return found + range_problems(low, high, file=file, key=key)


def range_problems(minimum: float | None, maximum: float | None, *, file: str, key: str) -> list[InputError]:
    """Mistakes in the range of a clause: none at all, or its ends the wrong way round.

    Args:
        minimum: Smallest value that holds.
        maximum: Largest value that holds.
    """
    if minimum is None and maximum is None:
        return [InputError("has no limit", file=file, key=key, mend="add min, max or both")]
    if minimum is not None and maximum is not None and minimum > maximum:
        problem, allowed = "is larger than max", f"at most {maximum:g}"
        return [InputError(problem, file=file, key=f"{key}.min", value=minimum, allowed=allowed, mend="swap them")]
    return []


def property_problems(formula: str, *, twin: bool = True, file: str, key: str) -> list[InputError]:
    """Why a formula cannot be asked of a flight.

    Args:
        formula: The formula.
        twin: Whether the flight has an unprotected twin.
    """
    from rtsim.properties.formula import parse_property  # loads its reader

    try:
        if parse_property(formula).needs_twin and not twin:
            mend = "ask it in [[trial.expect]], or leave twin_ out"
            problem = "speaks of a twin without a law, which a flight by itself has not"
            return [InputError(problem, file=file, key=key, value=formula, mend=mend)]
    except InputError as error:
        value = error.value if error.value is not None else formula
        return [InputError(error.problem, file=file, key=key, value=value, mend=error.mend or "correct it")]
    return []


def name_problems(name: str, known: Collection[str], noun: str, *, file: str, key: str) -> list[InputError]:
    """Whether a clause names something that is not there.

    Args:
        name: What it names.
        known: What there is.
        noun: What that is called, with its article.
    """
    if name in known:
        return []
    mend = suggestion(str(name), tuple(known), otherwise="choose one")
    return [InputError(f"is not {noun}", file=file, key=key, value=name, allowed=", ".join(known), mend=mend)]
