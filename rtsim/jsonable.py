"""Values as JSON can hold them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import PurePath
from typing import Any


def to_jsonable(value: object) -> Any:
    """Turn a value into what JSON can hold.

    NaN and infinities become null (JSON has neither), numpy scalars and arrays become numbers and lists,
    dataclasses become objects, enumerations their value, paths their text.

    Args:
        value: Anything made of mappings, sequences, dataclasses, numpy values and plain Python values.

    Returns:
        Nested dict, list, str, int, float, bool and None.

    Raises:
        TypeError: Where a value has no JSON form, naming its type.
    """
    if value is None or (isinstance(value, (str, bool, int)) and not isinstance(value, Enum)):
        return value
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, Enum):
        return to_jsonable(value.value)
    if isinstance(value, PurePath):
        return str(value)
    if isinstance(value, Mapping):
        return {str(key): to_jsonable(item) for key, item in value.items()}
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: to_jsonable(getattr(value, field.name)) for field in fields(value)}
    tolist = getattr(value, "tolist", None)  # numpy scalars and arrays, without importing numpy
    if callable(tolist):
        return to_jsonable(tolist())
    if isinstance(value, (list, tuple, set, frozenset)):
        return [to_jsonable(item) for item in value]
    if isinstance(value, complex):
        return {"re": to_jsonable(value.real), "im": to_jsonable(value.imag)}
    raise TypeError(f"{type(value).__name__} has no JSON form")
