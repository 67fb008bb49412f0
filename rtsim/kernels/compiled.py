"""How kernels are compiled: one decorator for all of them.

numpy's division semantics spare a check at every division (the rotor's blade elements run four times faster), the
machine code is cached on disk (``rtsim.kernels.cache``), and ``fastmath`` stays off: results are bit-reproducible on
one machine type.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba

from rtsim.kernels.cache import cache_folder

_folder = cache_folder(Path(__file__).resolve().parents[2])
if _folder is not None:
    _configuration: Any = numba.config  # its names are made at run time
    _configuration.CACHE_DIR = str(_folder)

Function = TypeVar("Function", bound=Callable[..., Any])


def kernel(function: Function) -> Function:
    """Compile a kernel: cached on disk, numpy's division semantics, strict floating point.

    Args:
        function: A function of numbers, arrays and named tuples of them.
    """
    njit: Any = numba.njit
    compiled: Function = njit(cache=True, error_model="numpy")(function)
    return compiled


def inner_kernel(function: Function) -> Function:
    """Compile a kernel that neither allocates nor returns arrays, without counting references to the arrays it uses.

    Every function boundary with a named tuple of arrays otherwise costs two atomic operations per array, which is more
    than the arithmetic of most kernels (a whole frame of the simulation takes a sixth of the time without). Views made
    inside must not leave the function as return values; work space is passed in. numba refuses an allocation here.

    Args:
        function: A function of numbers, arrays and named tuples of them, returning numbers or nothing (or, if called
            from other inner kernels only, views).
    """
    njit: Any = numba.njit  # the option is not in its type hints
    compiled: Function = njit(cache=True, error_model="numpy", _nrt=False)(function)
    return compiled


def batch_kernel(function: Function) -> Function:
    """Compile a kernel that flies or measures whole flights outside Python's lock, so that threads fly side by side.

    Args:
        function: A function of numbers, arrays and named tuples of them; its work space must be its thread's own.
    """
    njit: Any = numba.njit
    compiled: Function = njit(cache=True, error_model="numpy", nogil=True)(function)
    return compiled
