"""Rare events whose probability is known: subset simulation against it.

Sources: closed forms of the normal, chi-square and gamma distributions; the algorithm's own publication, Au and Beck,
"Estimation of small failure probabilities in high dimensions by subset simulation" (2001).

Tolerances, set beforehand: the 95 % interval of every case holds the known probability, and over eight seeds the
geometric mean of the estimates is within a factor of 1.5.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import ndtr, ndtri
from scipy.stats import chi2, gamma

from scenarios.falsification.subset_simulation import LEVEL, MOST_LEVELS, estimate


def linear(beta):
    return lambda u: beta - ndtri(u).sum(axis=1) / math.sqrt(u.shape[1])


def some_without_value(u):
    return np.where(u[:, 1] < 0.5, np.inf, 3.0 - ndtri(u[:, 0]))


CASES = {
    "a tenth": (linear(-ndtri(0.1)), 3, 0.1),
    "linear, 2 dimensions": (linear(3.09), 2, ndtr(-3.09)),
    "linear, 10 dimensions": (linear(4.0), 10, ndtr(-4.0)),
    "linear, 40 dimensions": (linear(4.7534), 40, ndtr(-4.7534)),
    "two sides": (lambda u: 4.0 - np.abs(ndtri(u[:, 0])), 3, 2.0 * ndtr(-4.0)),
    "outside a sphere": (lambda u: 36.0 - (ndtri(u) ** 2).sum(axis=1), 6, chi2.sf(36.0, 6)),
    "one of two": (lambda u: 3.5 - ndtri(u[:, :2]).max(axis=1), 2, 1.0 - ndtr(3.5) ** 2),
    "both of two": (lambda u: 2.5 - ndtri(u[:, :2]).min(axis=1), 2, ndtr(-2.5) ** 2),
    "a corner of the cube": (lambda u: u[:, :2].max(axis=1) - 0.01, 4, 1e-4),
    "a sum of exponentials": (lambda u: 20.0 + np.log1p(-u).sum(axis=1), 3, gamma.sf(20.0, 3)),
    "half without value": (some_without_value, 3, ndtr(-3.0)),
}


@pytest.mark.parametrize("name", CASES)
def test_the_interval_holds_the_known_probability(name):
    value, size, known = CASES[name]
    found = [estimate(value, size, points=1000, seed=seed) for seed in range(8)]
    assert all(one.low <= known <= one.high for one in found)
    assert abs(np.log([one.probability for one in found]).mean() - math.log(known)) < math.log(1.5)


def test_it_is_cheaper_than_counting():
    value, size, known = CASES["linear, 40 dimensions"]
    assert estimate(value, size, points=1000, seed=1).evaluations < 0.01 / known


def test_the_same_seed_gives_the_same():
    value, size, _ = CASES["outside a sphere"]
    assert estimate(value, size, points=200, seed=5) == estimate(value, size, points=200, seed=5)
    assert estimate(value, size, points=200, seed=5) != estimate(value, size, points=200, seed=6)


def test_what_cannot_happen_has_a_bound():
    """The value never falls below 1 however far it goes."""
    found = estimate(lambda u: 1.0 + u[:, 0], 2, points=300, seed=2)
    assert not found.reached
    assert (found.probability, found.low) == (0.0, 0.0)
    assert 0.0 < found.high < 1e-3
    assert found.least == pytest.approx(1.0, abs=0.01)
    assert len(found.levels) <= MOST_LEVELS


def test_a_jumping_coordinate_is_drawn_anew_or_kept():
    """Half of the seeds of a flight's noise are bad by one deviation: a mixture of two normal tails."""

    def value(u):
        bad = (u[:, 1] * 1e6).astype(np.int64) % 2
        return 4.0 - bad - ndtri(u[:, 0])

    known = 0.5 * (ndtr(-4.0) + ndtr(-3.0))
    jumps = np.array([False, True])
    found = [estimate(value, 2, points=1000, seed=seed, jumps=jumps) for seed in range(4)]
    assert all(one.low <= known <= one.high for one in found)


def test_nothing_to_fly_is_told():
    found = estimate(lambda u: np.full(len(u), np.inf), 2, points=50, seed=0)
    assert (found.probability, found.low, found.high) == (0.0, 0.0, 1.0)


def test_levels_are_a_tenth_each():
    value, size, known = CASES["linear, 10 dimensions"]
    found = estimate(value, size, points=1000, seed=3)
    assert len(found.levels) - 1 == pytest.approx(math.log(known) / math.log(LEVEL), abs=1.0)
    assert list(found.levels) == sorted(found.levels, reverse=True)
