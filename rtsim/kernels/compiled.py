"""How kernels are compiled: one decorator for all of them.

numpy's division semantics spare a check at every division (the rotor's blade elements run four times faster), the
machine code is kept on disk (``rtsim.kernels.store``), and ``fastmath`` stays off: results are bit-reproducible on
one machine type.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable
from types import FunctionType
from typing import Any, TypeVar, cast

import numba
from numba.extending import typeof_impl

from rtsim.kernels import place_type as place_type  # noqa: PLC0414 - teaches numba the places
from rtsim.kernels.store import writable_folder

Function = TypeVar("Function", bound=Callable[..., Any])

try:
    from rtsim.kernels.lowering import LoweredDispatcher, WholeDispatcher

    LEAN = not os.environ.get("RTSIM_PLAIN_NUMBA")
except (ImportError, AttributeError):  # a numba that has moved its inside
    LEAN = False
"""Whether kernels compile lean (``rtsim.kernels.lowering``), or by numba as it is."""


class Kernel:
    """A function that is compiled when it is first called, from Python or from another kernel that is compiled.

    Nothing of the compiler is made before that: a flight uses a tenth of the kernels that its modules hold.
    """

    def __init__(self, function: Callable[..., Any], *, lowered: bool = False, **options: Any) -> None:
        """Remember how to compile.

        Args:
            function: The function.
            lowered: Only lower it for its callers, where that can be done.
            options: Options of ``numba.njit``.
        """
        functools.update_wrapper(self, function)
        self.py_func = function
        """The function as plain Python."""
        self._lowered, self._options = lowered, options
        self._dispatcher: Any = None

    @property
    def dispatcher(self) -> Any:
        """What numba compiles and calls it by."""
        if self._dispatcher is None:
            if numba.config.DISABLE_JIT:
                self._dispatcher = self.py_func
            elif LEAN:
                kind = LoweredDispatcher if self._lowered else WholeDispatcher
                self._dispatcher = kind(self.py_func, **self._options)
            else:
                folder = writable_folder()
                configuration: Any = numba.config  # its names are made at run time
                configuration.CACHE_DIR = str(folder or "")
                self._dispatcher = numba.njit(cache=folder is not None, **self._options)(self.py_func)
        return self._dispatcher

    def __call__(self, *arguments: Any) -> Any:
        """Compile for the types of the arguments, if need be, and call.

        Args:
            arguments: Its arguments.
        """
        return self.dispatcher(*arguments)

    def __getattr__(self, name: str) -> Any:  # what numba asks of a dispatcher
        return getattr(self.dispatcher, name)


@typeof_impl.register(Kernel)
def _type_of_kernel(value: Kernel, _context: Any) -> Any:
    return value.dispatcher._numba_type_


def kernel(function: Function) -> Function:
    """Compile a kernel with all that it calls: cached on disk, numpy's division semantics, strict floating point.

    Args:
        function: A function of numbers, arrays, named tuples and packed tuples of them.
    """
    return _kernel(function, error_model="numpy")


def inner_kernel(function: Function) -> Function:
    """Compile a kernel that other kernels call; it neither allocates nor returns arrays.

    References to the arrays that it uses are not counted: every function boundary would otherwise cost two atomic
    operations per array, which is more than the arithmetic of most kernels. Views made inside must not leave the
    function as return values; work space is passed in. numba refuses an allocation here.

    Args:
        function: A function of numbers, arrays, named tuples and packed tuples of them, returning numbers or nothing
            (or, if called from other inner kernels only, views).
    """
    return _kernel(function, lowered=True, error_model="numpy", _nrt=False)


def allocating_kernel(function: Function) -> Function:
    """Compile a kernel that other kernels call and that makes arrays of its own; not for what runs in every frame.

    Args:
        function: As for ``inner_kernel``.
    """
    return _kernel(function, lowered=True, error_model="numpy")


def part(function: Function) -> Function:
    """Compile a kernel that is called at its address, or that calls such: whole, without counting references.

    Args:
        function: As for ``inner_kernel``; called at its address, it returns a float.
    """
    return _kernel(function, error_model="numpy", _nrt=False)


def batch_kernel(function: Function) -> Function:
    """Compile a kernel that flies or measures whole flights outside Python's lock, so that threads fly side by side.

    Args:
        function: A function of numbers, arrays and packed tuples; its work space must be its thread's own.
    """
    return _kernel(function, error_model="numpy", nogil=True)


def interpreted(function: Function) -> Function:
    """Give a kernel as plain Python, with the kernels that it calls: for set-up, where compiling would cost more.

    Args:
        function: The kernel.
    """
    plain: Any = function.py_func
    names = dict(plain.__globals__)
    for name in plain.__code__.co_names:
        if isinstance(names.get(name), Kernel):
            names[name] = interpreted(names[name])
    return cast(Function, FunctionType(plain.__code__, names, plain.__name__, plain.__defaults__))


def _kernel(function: Function, *, lowered: bool = False, **options: Any) -> Function:
    return cast(Function, Kernel(function, lowered=lowered, **options))
