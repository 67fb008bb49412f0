"""Bounds of campaigns against their definitions: binomial tails, a published value, coverage by enumeration."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binom

from scenarios.campaign.statistics import (
    bound_decided,
    clopper_pearson,
    flights_to_bound,
    mcnemar,
    quantile,
    rate,
    upper_bound,
)


@pytest.mark.parametrize(("flights", "bound"), [(59, 0.05), (299, 0.01), (2995, 0.001)])
def test_the_zero_of_n_bound_has_its_closed_form(flights: int, bound: float) -> None:
    # Reference values of the rule 1 - 0.05^(1/n): that many flights without a failure show at most that rate.
    assert upper_bound(0, flights) == pytest.approx(1.0 - 0.05 ** (1.0 / flights), rel=1e-12)
    assert upper_bound(0, flights) <= bound < upper_bound(0, flights - 1)


@given(st.integers(1, 400).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_the_bounds_solve_the_binomial_tails(case: tuple[int, int]) -> None:
    count, total = case
    low, high = clopper_pearson(count, total)
    if count < total:
        assert binom.cdf(count, total, high) == pytest.approx(0.025, rel=1e-6)
        assert binom.cdf(count, total, upper_bound(count, total)) == pytest.approx(0.05, rel=1e-6)
    if count > 0:
        assert binom.sf(count - 1, total, low) == pytest.approx(0.025, rel=1e-6)
    assert low <= count / total <= high


@pytest.mark.parametrize("share", [0.01, 0.1, 0.37, 0.8])
def test_the_interval_covers_at_least_as_often_as_it_says(share: float) -> None:
    total = 40
    covered = sum(
        float(binom.pmf(count, total, share))
        for count in range(total + 1)
        if clopper_pearson(count, total)[0] <= share <= clopper_pearson(count, total)[1]
    )
    assert covered >= 0.95


def test_no_flights_say_nothing() -> None:
    assert clopper_pearson(0, 0) == (0.0, 1.0)
    assert math.isnan(rate(0, 0).value)


def test_impossible_counts_are_refused() -> None:
    with pytest.raises(ValueError, match="5 of 4"):
        upper_bound(5, 4)


def test_mcnemar_counts_the_pairs_that_differ() -> None:
    first = np.array([1.0, 1, 1, 1, 1, 1, 0, 0])
    second = np.array([1.0, 0, 0, 0, 0, 0, 0, 0])
    found = mcnemar(first, second)
    assert (found.only_first, found.only_second) == (5, 0)
    assert found.p_value == pytest.approx(2 * 0.5**5)
    assert mcnemar(first, first).p_value == 1.0


def test_a_quantile_has_an_interval_that_depends_on_the_seed_only() -> None:
    values = np.random.default_rng(3).exponential(size=400)
    found = quantile(values, 0.95, seed=7)
    assert found == quantile(values[::-1], 0.95, seed=7), "the order of the flights does not matter"
    assert found.low < found.value < found.high
    assert found.low < -math.log(0.05) < found.high


@settings(deadline=None)
@given(st.integers(1, 60), st.floats(0.02, 0.9), st.floats(0.0, 1.0), st.integers(0, 2**32 - 1))
def test_stopping_early_never_changes_the_verdict(planned: int, limit: float, share: float, seed: int) -> None:
    happened = np.random.default_rng(seed).random(planned) < share
    verdict = upper_bound(int(happened.sum()), planned) <= limit
    decisions = [bound_decided(int(happened[:n].sum()), n, planned, limit) for n in range(planned + 1)]
    assert decisions[-1] == verdict
    assert all(decision is None or decision == verdict for decision in decisions)


@given(limit=st.floats(0.001, 0.9), confidence=st.floats(0.5, 0.99))
def test_as_many_flights_as_said_bound_a_share(limit: float, confidence: float) -> None:
    least = flights_to_bound(limit, confidence=confidence)
    assert upper_bound(0, least, confidence=confidence) <= limit * (1.0 + 1e-6)
    assert least == 1 or upper_bound(0, least - 1, confidence=confidence) > limit * (1.0 - 1e-6)
    assert flights_to_bound(0.01) == 299
