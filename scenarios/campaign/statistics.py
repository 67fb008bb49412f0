"""What a number of flights says about a rate or a quantile, with its uncertainty.

All bounds are exact for the sampled distribution of flights: they speak of a campaign's misuse, not of flight at large.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rtsim.arrays import FloatArray

CONFIDENCE = 0.95
"""Confidence of every interval that is not asked for otherwise."""
RESAMPLES = 2000
"""Bootstrap samples of a quantile's interval."""


@dataclass(frozen=True, slots=True)
class Rate:
    """A share of flights with its Clopper-Pearson bounds."""

    count: int
    """Flights in which it happened."""
    total: int
    """Flights flown."""
    low: float
    """Lower end of the two-sided interval."""
    high: float
    """Upper end of the two-sided interval."""
    upper: float
    """One-sided upper bound."""

    @property
    def value(self) -> float:
        """The share itself; NaN without flights."""
        return self.count / self.total if self.total else math.nan


@dataclass(frozen=True, slots=True)
class Quantile:
    """A quantile with its bootstrap interval."""

    value: float
    """The sample's quantile; NaN without values."""
    low: float
    """Lower end of the interval."""
    high: float
    """Upper end of the interval."""


@dataclass(frozen=True, slots=True)
class PairedComparison:
    """Two laws on the same flights: in how many only one of them failed, and how surprising that is."""

    only_first: int
    """Flights in which only the first failed."""
    only_second: int
    """Flights in which only the second failed."""
    p_value: float
    """Two-sided exact McNemar p-value of no difference."""


def rate(count: int, total: int, *, confidence: float = CONFIDENCE) -> Rate:
    """Estimate a share.

    Args:
        count: Flights in which it happened.
        total: Flights flown.
        confidence: Confidence of the interval and of the one-sided bound.
    """
    low, high = clopper_pearson(count, total, confidence=confidence)
    return Rate(count, total, low, high, upper_bound(count, total, confidence=confidence))


def clopper_pearson(count: int, total: int, *, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """Give the exact two-sided interval of a share (Clopper and Pearson 1934).

    Args:
        count: Successes, 0 to total.
        total: Trials; without any the interval is 0 to 1.
        confidence: Its least coverage.
    """
    _check(count, total)
    tail = 0.5 * (1.0 - confidence)
    return _lower(count, total, tail), _upper(count, total, tail)


def upper_bound(count: int, total: int, *, confidence: float = CONFIDENCE) -> float:
    """Give the exact one-sided upper bound of a share; ``0`` of ``n`` gives ``1 - (1 - confidence)^(1/n)``.

    Args:
        count: Successes, 0 to total.
        total: Trials; without any the bound is 1.
        confidence: Its least coverage.
    """
    _check(count, total)
    return _upper(count, total, 1.0 - confidence)


def flights_to_bound(limit: float, *, confidence: float = CONFIDENCE) -> int:
    """Least number of flights, none of them a success, whose upper bound is within a limit.

    Args:
        limit: Largest allowed upper bound.
        confidence: Confidence of the bound.
    """
    if limit >= 1.0:
        return 0
    if limit <= 0.0:
        raise ValueError("no number of flights bounds a share by 0")
    return math.ceil(math.log1p(-confidence) / math.log1p(-limit) - 1e-9)


def mcnemar(first: FloatArray, second: FloatArray) -> PairedComparison:
    """Compare two laws on the same flights by the exact McNemar test.

    Args:
        first: Whether the first law's flight failed, as 0 or 1, shape (flights,).
        second: The same of the second law, flight by flight.
    """
    from scipy.stats import binomtest

    one, two = np.asarray(first) != 0.0, np.asarray(second) != 0.0
    if one.shape != two.shape:
        raise ValueError("both laws must have flown the same flights")
    only_first, only_second = int(np.count_nonzero(one & ~two)), int(np.count_nonzero(two & ~one))
    different = only_first + only_second
    p_value = float(binomtest(only_first, different, 0.5).pvalue) if different else 1.0
    return PairedComparison(only_first, only_second, p_value)


def quantile(
    values: FloatArray, share: float, *, seed: int, confidence: float = CONFIDENCE, resamples: int = RESAMPLES
) -> Quantile:
    """Estimate a quantile, with a percentile bootstrap interval.

    Args:
        values: The sample, any order.
        share: Which quantile, 0 to 1.
        seed: Seed of the resampling; equal seeds give equal intervals.
        confidence: Nominal coverage of the interval.
        resamples: Bootstrap samples.
    """
    sample = np.sort(np.asarray(values, dtype=np.float64))
    if sample.size == 0:
        return Quantile(math.nan, math.nan, math.nan)
    generator = np.random.Generator(np.random.PCG64(seed))
    picks = generator.integers(0, sample.size, (resamples, sample.size))
    spread = np.quantile(sample[picks], share, axis=1)
    tail = 0.5 * (1.0 - confidence)
    low, high = np.quantile(spread, [tail, 1.0 - tail])
    return Quantile(float(np.quantile(sample, share)), float(low), float(high))


def bound_decided(count: int, done: int, planned: int, limit: float, *, confidence: float = CONFIDENCE) -> bool | None:
    """Say whether the flights so far already decide if the upper bound after all planned ones is within a limit.

    This is curtailed sampling: the verdict is that of the whole campaign, so stopping early costs no confidence.

    Args:
        count: Flights so far in which it happened.
        done: Flights so far.
        planned: Flights of the whole campaign.
        limit: Largest allowed upper bound.
        confidence: Confidence of the bound.

    Returns:
        True or False once the verdict is certain, None before.
    """
    if upper_bound(count, planned, confidence=confidence) > limit:
        return False
    if upper_bound(count + planned - done, planned, confidence=confidence) <= limit:
        return True
    return None


def _check(count: int, total: int) -> None:
    if not 0 <= count <= total:
        raise ValueError(f"{count} of {total} is not a share")


def _lower(count: int, total: int, tail: float) -> float:
    from scipy.special import betaincinv

    return 0.0 if count == 0 else float(betaincinv(count, total - count + 1, tail))


def _upper(count: int, total: int, tail: float) -> float:
    from scipy.special import betaincinv

    return 1.0 if count == total else float(betaincinv(count + 1, total - count, 1.0 - tail))
