"""The probability of a rare event by subset simulation: level after level, each a tenth of the one before.

Au and Beck (2001), with the conditional sampling of Papaioannou, Betz, Zwirglmaier and Straub (2015): in standard
normal space a candidate is ``sqrt(1 - s^2) x + s xi``, which keeps the distribution, and the step ``s`` follows the
share of candidates that are kept. Coordinates without neighbourhood (roots of random streams) are kept or drawn anew.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr
from scipy.stats import norm

from rtsim.arrays import BoolArray, FloatArray
from rtsim.random_streams import STREAM_SEARCH, stream_generator
from scenarios.campaign.statistics import clopper_pearson, upper_bound

LEVEL = 0.1
"""Share of a level that reaches the next one."""
MOST_LEVELS = 9
"""Levels after which it is given up: the event is rarer than about 1e-9."""
WANTED_KEPT = 0.44
"""Share of candidates that a good step keeps."""
FIRST_STEP = 0.6
MOST_DRAWN = 50
"""Points drawn for each flight wanted, where most have none."""
STALLED = 1e-3
"""A level that comes no nearer than this share of the way left is the last: the event cannot be reached."""

IntArray = npt.NDArray[np.int64]
Evaluate = Callable[[FloatArray], FloatArray]
"""Values of points of the unit cube, shape (points,) from (points, size): below 0 is the event, inf is no point."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """A probability with its interval."""

    probability: float
    """The estimate; 0 where the event was not reached."""
    low: float
    """Lower end of the interval."""
    high: float
    """Upper end of the interval."""
    evaluations: int
    """Points that were evaluated."""
    levels: tuple[float, ...]
    """Values at which the levels ended; the last is 0 where the event was reached."""
    least: float
    """The least value met."""
    deviation: float
    """Coefficient of variation of the estimate; 0 where it was counted."""

    @property
    def reached(self) -> bool:
        """Whether the event was met."""
        return self.probability > 0.0


def estimate(
    evaluate: Evaluate,
    size: int,
    *,
    points: int,
    seed: int,
    jumps: BoolArray | None = None,
    confidence: float = 0.95,
    on_level: Callable[[int, float], None] | None = None,
) -> Estimate:
    """Estimate the probability that a value is below 0 where points are spread evenly over the unit cube.

    Args:
        evaluate: Gives the values; points that have none (inf) are not part of the distribution.
        size: Dimensions.
        points: Points of a level, at least 20.
        seed: Root of its random stream.
        jumps: Coordinates without neighbourhood, shape (size,).
        confidence: Confidence of the interval.
        on_level: Told the number of each level and the value at which it ends.

    Returns:
        The estimate. Its interval is wide on purpose: deviations of the levels are added, not their squares, since
        levels share their points.
    """
    random = stream_generator(seed, STREAM_SEARCH, 0)
    jumps = np.zeros(size, dtype=np.bool_) if jumps is None else jumps
    state, values, spent = _first(evaluate, size, points, random)
    ends: list[float] = []
    share, deviations, step = 1.0, [], FIRST_STEP
    chains: IntArray = np.arange(len(values), dtype=np.int64)
    least = float(values.min(initial=math.inf))
    while True:
        failed = values < 0.0
        kept = max(1, round(LEVEL * len(values)))
        end = float(np.sort(values)[kept - 1]) if len(values) else math.inf
        reached = bool(failed.mean() >= LEVEL) if len(values) else False
        ahead = ends[-1] if ends else math.inf
        stalled = not reached and math.isfinite(ahead) and ahead - end < STALLED * max(abs(ahead), 1e-12)
        if reached or stalled or len(ends) >= MOST_LEVELS or not len(values):
            break
        inside = values <= end
        part = float(inside.mean())
        deviations.append(_deviation(inside, chains, part))
        share *= part
        ends.append(end)
        if on_level is not None:
            on_level(len(ends), end)
        state, values, chains, step, used = _climb(
            evaluate, state[inside], values[inside], end, points, step, jumps, random
        )
        spent += used
        least = min(least, float(values.min()))
    return _concluded(values, chains, share, deviations, ends, spent, least, confidence)


def _first(
    evaluate: Evaluate, size: int, points: int, random: np.random.Generator
) -> tuple[FloatArray, FloatArray, int]:
    """Points with values, drawn evenly."""
    state, values, drawn = np.zeros((0, size)), np.zeros(0), 0
    while len(values) < points and drawn < MOST_DRAWN * points:
        more = random.standard_normal((points - len(values), size))
        found = evaluate(ndtr(more))
        drawn += len(more)
        there = np.isfinite(found)
        state, values = np.concatenate([state, more[there]]), np.concatenate([values, found[there]])
    return state, values, drawn


def _climb(
    evaluate: Evaluate,
    seeds: FloatArray,
    seed_values: FloatArray,
    end: float,
    points: int,
    step: float,
    jumps: BoolArray,
    random: np.random.Generator,
) -> tuple[FloatArray, FloatArray, IntArray, float, int]:
    """Markov chains from the points that reached a level, all within it."""
    order = random.permutation(len(seeds))
    state, values = seeds[order], seed_values[order]
    length = max(2, math.ceil(points / len(seeds)))
    states, found, spent = [state], [values], 0
    for number in range(1, length):
        candidate = math.sqrt(1.0 - step * step) * state + step * random.standard_normal(state.shape)
        anew = random.random(state.shape) < 0.5
        candidate[:, jumps] = np.where(anew, random.standard_normal(state.shape), state)[:, jumps]
        worth = evaluate(ndtr(candidate))
        spent += len(candidate)
        better = worth <= end
        state = np.where(better[:, None], candidate, state)
        values = np.where(better, worth, values)
        states.append(state)
        found.append(values)
        step = float(np.clip(step * math.exp((better.mean() - WANTED_KEPT) / math.sqrt(number)), 0.02, 0.999))
    chains = np.tile(np.arange(len(seeds), dtype=np.int64), length)
    return np.concatenate(states), np.concatenate(found), chains, step, spent


def _deviation(inside: BoolArray, chains: IntArray, part: float) -> float:
    """Coefficient of variation of a level's share, with the correlation within its chains (Au and Beck, eq. 28)."""
    count = len(inside)
    if part >= 1.0:
        return 0.0
    groups = int(chains.max()) + 1
    length = count // groups
    correlation = 0.0
    if length > 1:
        walks = inside[: groups * length].reshape(length, groups).astype(np.float64)
        variance = part * (1.0 - part)
        for lag in range(1, length):
            together = float((walks[:-lag] * walks[lag:]).mean()) - part * part
            correlation += 2.0 * (1.0 - lag / length) * max(together / variance, 0.0)
    return math.sqrt((1.0 - part) / (part * count) * (1.0 + correlation))


def _concluded(
    values: FloatArray,
    chains: IntArray,
    share: float,
    deviations: list[float],
    ends: list[float],
    spent: int,
    least: float,
    confidence: float,
) -> Estimate:
    failed = values < 0.0
    count, total = int(failed.sum()), len(values)
    if not ends:  # seen often enough to be counted
        low, high = clopper_pearson(count, total, confidence=confidence) if total else (0.0, 1.0)
        return Estimate(count / total if total else 0.0, low, high, spent, (), least, 0.0)
    quantile = float(norm.ppf(0.5 + 0.5 * confidence))
    if not count:
        before = sum(deviations)
        high = min(1.0, share * math.exp(quantile * _log_deviation(before)))
        return Estimate(0.0, 0.0, high * upper_bound(0, total, confidence=confidence), spent, tuple(ends), least, 0.0)
    part = count / total
    deviation = sum(deviations) + _deviation(failed, chains, part)
    probability, width = share * part, quantile * _log_deviation(deviation)
    low, high = probability * math.exp(-width), min(1.0, probability * math.exp(width))
    return Estimate(probability, low, high, spent, (*ends, 0.0), least, deviation)


def _log_deviation(deviation: float) -> float:
    return math.sqrt(math.log1p(deviation * deviation))
