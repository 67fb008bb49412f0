"""What a flight is expected to do: a metric and the range it must lie in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


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
