"""Kernels that are called at their address: each part of a frame is compiled on its own, and only where it flies.

A part is a whole kernel (``rtsim.kernels.compiled.part``) that returns a float. ``address_of`` compiles it, or loads it
from the cache, and gives its address; ``call_at`` calls that from inside another kernel. The caller says by the types
of its arguments what it calls, so both must agree: who loads a part hands its address over.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from rtsim.kernels.packed import Address

_INTERPRETED: list[Callable[..., float]] = []
"""Parts where numba is switched off (``NUMBA_DISABLE_JIT``); an address is a place in this list, from 1."""


def address_of(part: Callable[..., Any], *arguments: Any) -> int:
    """Compile a part for arguments of these types, or load it, and give its address.

    Args:
        part: The kernel.
        arguments: Arguments as it will be called with.
    """
    if numba.config.DISABLE_JIT:
        if part not in _INTERPRETED:
            _INTERPRETED.append(part)
        return 1 + _INTERPRETED.index(part)
    kernel: Any = part.dispatcher
    result = kernel.overloads[compiled_for(kernel, *arguments)]
    assert result.signature.return_type == types.float64, f"{kernel.__name__} returns no float"
    return int(result.library.get_pointer_to_function(result.fndesc.llvm_func_name))


def compiled_for(kernel: Any, *arguments: Any) -> tuple[Any, ...]:
    """Compile a kernel for arguments of these types, or load it, and give its signature.

    Args:
        kernel: The kernel.
        arguments: Arguments as it will be called with.
    """
    signature = tuple(numba.typeof(one) for one in arguments)
    kernel.compile(signature)
    return signature


def entry_point(kernel: Any, *arguments: Any) -> Callable[..., Any]:
    """Compile a kernel and give what calls it from Python without looking at the types of the arguments again.

    Args:
        kernel: The kernel.
        arguments: Arguments of the types that it will be called with, always.
    """
    dispatcher = kernel.dispatcher
    if numba.config.DISABLE_JIT:
        return dispatcher  # type: ignore[no-any-return]
    entry: Callable[..., Any] = dispatcher.overloads[compiled_for(dispatcher, *arguments)].entry_point
    return entry


if numba.config.DISABLE_JIT:

    def call_at(address: int, *arguments: Any) -> float:
        """Call the part at an address; for kernels only.

        Args:
            address: From ``address_of``; must not be 0.
            arguments: Its arguments.
        """
        given = (one.target if isinstance(one, Address) else one for one in arguments)
        return _INTERPRETED[address - 1](*given)

else:

    @intrinsic
    def call_at(typingctx: Any, address: Any, *arguments: Any) -> Any:  # noqa: ARG001
        """Call the part at an address; for kernels only.

        Args:
            typingctx: numba's.
            address: From ``address_of``; must not be 0.
            arguments: Its arguments.
        """
        given = tuple(types.unliteral(one) for one in arguments)
        signature = types.float64(types.int64, types.StarArgTuple(given))

        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            number, packed_arguments = values
            kinds = list(signature.args[1].types)
            passed = [builder.extract_value(packed_arguments, k) for k in range(len(kinds))]
            kind = context.call_conv.get_function_type(types.float64, kinds)
            place = builder.inttoptr(number, ir.PointerType(kind))
            status, result = context.call_conv.call_function(builder, place, types.float64, kinds, passed)
            with cgutils.if_unlikely(builder, status.is_error):
                context.call_conv.return_status_propagate(builder, status)
            return result

        return signature, generate
