"""How kernels are compiled: one decorator for all of them.

numpy's division semantics spare a check at every division (the rotor's blade elements run four times faster), the
machine code is cached beside the source, and ``fastmath`` stays off: results are bit-reproducible on one machine type.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba

Function = TypeVar("Function", bound=Callable[..., Any])


def kernel(function: Function) -> Function:
    """Compile a kernel: cached on disk, numpy's division semantics, strict floating point.

    Args:
        function: A function of numbers, arrays and named tuples of them.
    """
    compiled: Function = numba.njit(cache=True, error_model="numpy")(function)
    return compiled
