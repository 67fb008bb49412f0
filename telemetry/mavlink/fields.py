"""Numbers that fit the fields of messages: what does not fit would end the process while packing."""

from __future__ import annotations

import math


def whole(value: float, low: int, high: int) -> int:
    """A number as an integer that fits its field.

    Args:
        value: Any number; NaN becomes 0 (or the nearest allowed).
        low: Smallest value of the field.
        high: Largest value of the field.
    """
    if math.isnan(value):
        value = 0.0
    return round(min(max(value, low), high))


def real(value: float) -> float:
    """A number as a float32 that can be packed.

    Args:
        value: Any number; what is not finite becomes 0, what is huge is cut.
    """
    return min(max(value, -3.0e38), 3.0e38) if math.isfinite(value) else 0.0


def wrapped(angle: float) -> float:
    """An angle between -pi and pi [rad].

    Args:
        angle: Any angle [rad].
    """
    return math.atan2(math.sin(angle), math.cos(angle))
