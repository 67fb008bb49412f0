"""What callers in Python give: a plausible wrong thing is told in a sentence, before it reaches compiled code."""

from __future__ import annotations

import math
import operator
from typing import Any, TypeVar

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.errors import InputError

Kind = TypeVar("Kind")


def number(value: Any, key: str, unit: str = "") -> float:
    """A finite number.

    Args:
        value: What was given.
        key: The argument.
        unit: Its unit, for the message.

    Raises:
        InputError: It is none.
    """
    try:
        found = math.nan if isinstance(value, str | bytes) else float(value)
    except (TypeError, ValueError, OverflowError):
        found = math.nan
    if not math.isfinite(found):
        raise InputError("is not a finite number", key=key, value=value, mend=f"give one{unit and ' in '}{unit}")
    return found


def whole_number(value: Any, key: str) -> int:
    """A whole number from 0 on.

    Args:
        value: What was given.
        key: The argument.

    Raises:
        InputError: It is none.
    """
    if not hasattr(value, "__index__") or value < 0:
        raise InputError("is no whole number from 0 on", key=key, value=value, mend="give one")
    return operator.index(value)


def vector(value: Any, key: str, size: int) -> FloatArray:
    """A new array of so many numbers.

    Args:
        value: What was given.
        key: The argument.
        size: How many there must be.

    Raises:
        InputError: It is not.
    """
    try:
        found = np.array(value, dtype=np.float64, order="C")
    except (TypeError, ValueError):
        raise InputError("is not an array of numbers", key=key, value=value, allowed=f"{size} numbers") from None
    if found.shape != (size,):
        raise InputError("has the wrong shape", key=key, value=found.shape, allowed=f"({size},)")
    return found


def instance(value: Any, kind: type[Kind], key: str, mend: str) -> Kind:
    """A value of a type.

    Args:
        value: What was given.
        kind: The type.
        key: The argument.
        mend: Where such a value comes from, as an imperative.

    Raises:
        InputError: It is of another type.
    """
    if not isinstance(value, kind):
        raise InputError(f"is a {type(value).__name__}", key=key, allowed=kind.__name__, mend=mend)
    return value
