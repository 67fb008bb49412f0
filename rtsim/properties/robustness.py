"""How far a flight is from breaking a formula: rtamt's semantics of signal temporal logic on whole arrays.

rtamt (Nickovic and Yamaguchi 2020) reads the formulas; its own monitors go sample by sample in Python, which takes
longer than the flight itself. The visitor here gives the same numbers (tests compare them) a hundred times faster.
Robustness is that of Donzé and Maler (2010); windows that reach beyond the last frame see only what was flown.

Legend:
    node: A part of the formula, as rtamt reads it.
    trace: The flight.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from rtsim.arrays import FloatArray
from rtsim.properties.reader import Comparison, StlAstVisitor

NANOSECONDS = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1, "": 10**9}
"""Units of a window's bounds; seconds where none is given."""


@dataclass(eq=False)
class Trace:
    """One flight as a formula sees it."""

    signals: dict[str, FloatArray]
    """What its names stand for, shape (frames,) each."""
    dt: float
    """Length of a frame [s]."""
    frames: int
    """How many."""
    predicates: list[tuple[Any, FloatArray]] = field(default_factory=list)
    """Every comparison met, with its robustness over time."""


class Evaluator(StlAstVisitor):  # type: ignore[misc]  # rtamt has no types
    """Robustness of every part of a formula over time, shape (frames,), +-inf where a part speaks of no frame."""

    def visitPredicate(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """A comparison: how far it is from turning over."""
        left, right = self._pair(node, trace)
        value = node.operator.value
        if value in {Comparison.LEQ.value, Comparison.LESS.value}:
            found = right - left
        elif value in {Comparison.GEQ.value, Comparison.GREATER.value}:
            found = left - right
        else:
            found = np.abs(left - right) * (-1.0 if value == Comparison.EQ.value else 1.0)
        trace.predicates.append((node, found))
        return found

    def visitVariable(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """A signal."""
        return trace.signals[node.var]

    def visitConstant(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """A number."""
        return np.full(trace.frames, float(node.val))

    def _pair(self, node: Any, trace: Trace) -> tuple[FloatArray, FloatArray]:
        left, right = (self.visit(child, trace) for child in node.children[:2])  # rtamt enters those of a sum twice
        return left, right

    def visitNot(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """Not."""
        return -self.visit(node.children[0], trace)

    def visitAnd(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """Both."""
        return np.minimum(*self._pair(node, trace))

    def visitOr(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """One or both."""
        return np.maximum(*self._pair(node, trace))

    def visitImplies(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """The first only with the second."""
        left, right = self._pair(node, trace)
        return np.maximum(-left, right)

    def visitIff(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """Both or none."""
        left, right = self._pair(node, trace)
        with np.errstate(invalid="ignore"):  # of two infinities
            return -np.where(left == right, 0.0, np.abs(left - right))

    def visitXor(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """One of them."""
        return -self.visitIff(node, trace)

    def visitAbs(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """Magnitude."""
        return np.abs(self.visit(node.children[0], trace))

    def visitSqrt(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """Square root."""
        return np.sqrt(self.visit(node.children[0], trace))

    def visitExp(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """Exponential."""
        return np.exp(self.visit(node.children[0], trace))

    def visitPow(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """Power."""
        return np.power(*self._pair(node, trace))

    def visitAddition(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """Sum."""
        return np.add(*self._pair(node, trace))

    def visitSubtraction(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """Difference."""
        return np.subtract(*self._pair(node, trace))

    def visitMultiplication(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """Product."""
        return np.multiply(*self._pair(node, trace))

    def visitDivision(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """Quotient."""
        return np.divide(*self._pair(node, trace))

    def visitAlways(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """From now to the end."""
        return np.minimum.accumulate(self.visit(node.children[0], trace)[::-1])[::-1]

    def visitEventually(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """At some time from now to the end."""
        return np.maximum.accumulate(self.visit(node.children[0], trace)[::-1])[::-1]

    def visitHistorically(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """From the beginning to now."""
        return np.minimum.accumulate(self.visit(node.children[0], trace))

    def visitOnce(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """At some time from the beginning to now."""
        return np.maximum.accumulate(self.visit(node.children[0], trace))

    def visitTimedAlways(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """In every frame of a window ahead."""
        return _window(self.visit(node.children[0], trace), _frames(node, trace), least=True)

    def visitTimedEventually(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """In some frame of a window ahead."""
        return _window(self.visit(node.children[0], trace), _frames(node, trace), least=False)

    def visitTimedHistorically(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """In every frame of a window behind."""
        return _window(self.visit(node.children[0], trace)[::-1], _frames(node, trace), least=True)[::-1]

    def visitTimedOnce(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """In some frame of a window behind."""
        return _window(self.visit(node.children[0], trace)[::-1], _frames(node, trace), least=False)[::-1]

    def visitUntil(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """The first until the second, which must come."""
        return _until(*self._pair(node, trace))

    def visitSince(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """The first since the second, which must have been."""
        left, right = self._pair(node, trace)
        return _until(left[::-1], right[::-1])[::-1]

    def visitTimedUntil(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """The first until the second, which must come in a window ahead."""
        return _timed_until(*self._pair(node, trace), _frames(node, trace))

    def visitTimedSince(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """The first since the second, which must have been in a window behind."""
        left, right = self._pair(node, trace)
        return _timed_until(left[::-1], right[::-1], _frames(node, trace))[::-1]

    def visitRise(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """Begins to hold."""
        found = self.visit(node.children[0], trace)
        return np.minimum(-_shifted(found, 1, -np.inf), found)

    def visitFall(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """Ceases to hold."""
        found = self.visit(node.children[0], trace)
        return np.minimum(_shifted(found, 1, np.inf), -found)

    def visitPrevious(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """In the frame before, if there is one."""
        return _shifted(self.visit(node.children[0], trace), 1, np.inf)

    def visitStrongPrevious(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """In the frame before, which there must be."""
        return _shifted(self.visit(node.children[0], trace), 1, -np.inf)

    def visitNext(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """In the next frame, if there is one."""
        return _shifted(self.visit(node.children[0], trace), -1, np.inf)

    def visitStrongNext(self, node: Any, trace: Trace) -> FloatArray:  # noqa: N802
        """In the next frame, which there must be."""
        return _shifted(self.visit(node.children[0], trace), -1, -np.inf)


def _frames(node: Any, trace: Trace) -> tuple[int, int]:
    """First and last frame of a window."""
    units = (node.begin_unit or node.end_unit, node.end_unit or node.begin_unit)
    begin, end = (
        round(Fraction(bound) * NANOSECONDS[unit] / (Fraction(trace.dt).limit_denominator(10**6) * 10**9))
        for bound, unit in zip((node.begin, node.end), units, strict=True)
    )
    return begin, end


def _shifted(values: FloatArray, by: int, filled: float) -> FloatArray:
    found = np.full(len(values), filled)
    if by > 0:
        found[by:] = values[:-by]
    else:
        found[:by] = values[-by:]
    return found


def _window(values: FloatArray, window: tuple[int, int], *, least: bool) -> FloatArray:
    """Extreme of ``values[k + begin .. k + end]`` for each k; what lies beyond the end is not there."""
    begin, end = window
    beyond, extreme = (np.inf, minimum_filter1d) if least else (-np.inf, maximum_filter1d)
    begin, end = min(begin, len(values)), min(end, len(values))
    ahead = np.concatenate([values[begin:], np.full(end, beyond)])
    size = end - begin + 1
    found = extreme(ahead, size, mode="constant", cval=beyond, origin=-((size - 1) - size // 2) - (size % 2 == 0))
    return np.asarray(found[: len(values)], dtype=np.float64)


def _until(left: FloatArray, right: FloatArray) -> FloatArray:
    found, after = np.empty(len(left)), -np.inf
    for k in range(len(left) - 1, -1, -1):
        after = max(min(left[k], after), right[k])
        found[k] = after
    return found


def _timed_until(left: FloatArray, right: FloatArray, window: tuple[int, int]) -> FloatArray:
    """Best over the frames of a window of the worse of: the second there, the first in all frames before."""
    begin, end = window
    frames = len(left)
    found, kept = np.full(frames, -np.inf), np.full(frames, np.inf)
    for ahead in range(min(end, frames - 1) + 1):
        if ahead >= begin:
            there = np.minimum(right[ahead:], kept[: frames - ahead])
            found[: frames - ahead] = np.maximum(found[: frames - ahead], there)
        kept[: frames - ahead] = np.minimum(kept[: frames - ahead], left[ahead:])
    return found
