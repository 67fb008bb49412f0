"""How kernels are compiled: one decorator for all of them.

numpy's division semantics spare a check at every division (the rotor's blade elements run four times faster), the
machine code is cached on disk (``rtsim.kernels.cache``), and ``fastmath`` stays off: results are bit-reproducible on
one machine type.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from types import FunctionType
from typing import Any, TypeVar

import numba

from rtsim.kernels import place_type as place_type  # noqa: PLC0414 - teaches numba the places
from rtsim.kernels.cache import cache_folder

_folder = cache_folder(Path(__file__).resolve().parents[2])
if _folder is not None:
    _configuration: Any = numba.config  # its names are made at run time
    _configuration.CACHE_DIR = str(_folder)

Function = TypeVar("Function", bound=Callable[..., Any])

try:
    from rtsim.kernels.lowering import LoweredDispatcher, WholeDispatcher

    LEAN = not os.environ.get("RTSIM_PLAIN_NUMBA")
except (ImportError, AttributeError):  # a numba that has moved its inside
    LEAN = False
"""Whether kernels compile lean (``rtsim.kernels.lowering``), or by numba as it is."""


def kernel(function: Function) -> Function:
    """Compile a kernel with all that it calls: cached on disk, numpy's division semantics, strict floating point.

    Args:
        function: A function of numbers, arrays, named tuples and packed tuples of them.
    """
    return _whole(function, error_model="numpy")


def inner_kernel(function: Function) -> Function:
    """Compile a kernel that other kernels call; it neither allocates nor returns arrays.

    References to the arrays that it uses are not counted: every function boundary would otherwise cost two atomic
    operations per array, which is more than the arithmetic of most kernels. Views made inside must not leave the
    function as return values; work space is passed in. numba refuses an allocation here.

    Args:
        function: A function of numbers, arrays, named tuples and packed tuples of them, returning numbers or nothing
            (or, if called from other inner kernels only, views).
    """
    if LEAN and not numba.config.DISABLE_JIT:
        lowered: Function = LoweredDispatcher(function, error_model="numpy", _nrt=False)  # type: ignore[assignment]
        return lowered
    return _whole(function, error_model="numpy", _nrt=False)


def allocating_kernel(function: Function) -> Function:
    """Compile a kernel that other kernels call and that makes arrays of its own; not for what runs in every frame.

    Args:
        function: As for ``inner_kernel``.
    """
    if LEAN and not numba.config.DISABLE_JIT:
        lowered: Function = LoweredDispatcher(function, error_model="numpy")  # type: ignore[assignment]
        return lowered
    return _whole(function, error_model="numpy")


def part(function: Function) -> Function:
    """Compile a kernel that is called at its address, or that calls such: whole, without counting references.

    Args:
        function: As for ``inner_kernel``; called at its address, it returns a float.
    """
    return _whole(function, error_model="numpy", _nrt=False)


def batch_kernel(function: Function) -> Function:
    """Compile a kernel that flies or measures whole flights outside Python's lock, so that threads fly side by side.

    Args:
        function: A function of numbers, arrays and packed tuples; its work space must be its thread's own.
    """
    return _whole(function, error_model="numpy", nogil=True)


def interpreted(function: Function) -> Function:
    """Give a kernel as plain Python, with the kernels that it calls: for set-up, where compiling would cost more.

    Args:
        function: The kernel.
    """
    plain: Any = getattr(function, "py_func", None)
    if plain is None:  # numba is switched off
        return function
    names = dict(plain.__globals__)
    for name in plain.__code__.co_names:
        if hasattr(names.get(name), "py_func"):
            names[name] = interpreted(names[name])
    made: Any = FunctionType(plain.__code__, names, plain.__name__, plain.__defaults__)
    return made  # type: ignore[no-any-return]


def _whole(function: Function, **options: Any) -> Function:
    if LEAN and not numba.config.DISABLE_JIT:
        whole: Function = WholeDispatcher(function, **options)  # type: ignore[assignment]
        return whole
    njit: Any = numba.njit
    compiled: Function = njit(cache=True, **options)(function)
    return compiled
