"""Named tuples that compiled code reads where they lie: one pointer is handed over instead of every array in them.

``packed`` writes numbers, addresses and shapes of a named tuple (and of those in it) into one row of 64-bit words. To
Python the result reads like the tuple; to a kernel it is one pointer, and ``tables.lpv.cells[i, j]`` is a load from it.
The words never change, which the compiler is told: a field that is read in a loop is read once. What changes in flight
are the contents of the arrays, not the words. Types are looked at here, once: arrays of float64 or int64, C-contiguous.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from typing import Any, TypeVar, cast

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    lower_getattr_generic,
    models,
    register_model,
    typeof_impl,
    unbox,
)
from numba.np import arrayobj

Tuple = TypeVar("Tuple")
_SIZE = "size"
"""Stands for the type of a ``Size``."""
_DTYPES = {"<f8": types.float64, "<i8": types.int64}


class PackedType(types.Type):
    """Type of a packed named tuple: its class, and the type and place of each field."""

    def __init__(self, class_name: str, fields: tuple[tuple[str, Any, int], ...]) -> None:
        """Name the type by its layout.

        Args:
            class_name: Name of the named tuple's class.
            fields: Name, numba type and first word of each field.
        """
        self.class_name = class_name
        self.fields = {name: (kind, place) for name, kind, place in fields}
        layout = repr([(name, str(kind), place) for name, kind, place in fields])
        self.sizes = {name: place for name, kind, place in fields if kind is _SIZE}
        """Values of the fields that are constants, which have no word of their own."""
        super().__init__(name=f"{class_name}_{hashlib.sha256(layout.encode()).hexdigest()[:12]}")


class Packed:
    """A named tuple and its words; reads like the tuple."""

    __slots__ = ("_kind", "_tuple", "_words", "address")

    def __init__(self, values: Any, kind: PackedType, words: Any) -> None:
        """Keep a tuple with its words.

        Args:
            values: The named tuple, its inner tuples packed.
            kind: Its type.
            words: Its words, int64, kept unchanged.
        """
        self._tuple, self._kind, self._words = values, kind, words
        self.address = int(words.ctypes.data)
        """Where the words lie."""

    def __getattr__(self, name: str) -> Any:
        return getattr(self._tuple, name)

    def __iter__(self) -> Iterator[Any]:
        return iter(self._tuple)

    def __reduce__(self) -> tuple[Any, tuple[Any]]:
        return packed, (self._tuple,)

    def __len__(self) -> int:
        return len(self._tuple)

    def _replace(self, **changes: Any) -> Any:
        return packed(self._tuple._replace(**changes))


class Size(int):
    """A whole number that is part of the type: a constant to compiled code, which unrolls loops over it."""


class Address:
    """A packed tuple that another one only points at, whatever its type: kernels hand it on to who knows."""

    __slots__ = ("target",)

    def __init__(self, target: Any) -> None:
        """Point at something.

        Args:
            target: What ``packed`` made; kept alive.
        """
        self.target = target


def packed(values: Tuple) -> Tuple:
    """Pack a named tuple for kernels.

    Args:
        values: A named tuple of numbers, arrays (float64 or int64), tuples of numbers, ``Address`` and named tuples.

    Returns:
        A ``Packed``, which reads like the tuple; arrays that were not C-contiguous are copies.

    Raises:
        TypeError: An array has another type.
    """
    if isinstance(values, Packed):
        return cast(Tuple, values)
    kinds: list[tuple[str, Any, int]] = []
    words: list[int] = []
    kept: dict[str, Any] = {}
    inner: list[tuple[str, int, int]] = []
    for name in values._fields:
        value, place = getattr(values, name), len(words)
        if isinstance(value, np.ndarray):
            value = np.require(value, requirements=["C", "A"])
            if value.dtype.str not in _DTYPES:
                raise TypeError(f"{type(values).__name__}.{name} is of type {value.dtype}, not float64 or int64")
            kinds.append((name, types.Array(_DTYPES[value.dtype.str], value.ndim, "C"), place))
            words.extend((value.ctypes.data, *value.shape))
        elif hasattr(value, "_fields") or isinstance(value, Packed):
            value = packed(value)
            kinds.append((name, value._kind, place))
            inner.append((name, place, len(value._words)))
            words.extend(value._words.tolist())
        elif isinstance(value, Size):
            kinds.append((name, _SIZE, int(value)))
        else:
            kind, content = _numbers(value)
            kinds.append((name, kind, place))
            words.extend(content)
        kept[name] = value
    row = np.array(words, dtype=np.int64)
    row.flags.writeable = False
    for name, place, count in inner:
        kept[name] = Packed(kept[name]._tuple, kept[name]._kind, row[place : place + count])
    kind = PackedType(type(values).__name__, tuple(kinds))
    return cast(Tuple, Packed(type(values)(**kept), kind, row))


def _numbers(value: Any) -> tuple[Any, list[int]]:
    """Type and words of what is no array."""
    if isinstance(value, Address):
        return types.int64, [value.target.address]
    if isinstance(value, (bool, int, np.integer)):
        return types.int64, [int(value)]
    if isinstance(value, tuple):
        return types.UniTuple(types.float64, len(value)), [int(np.float64(number).view(np.int64)) for number in value]
    return types.float64, [int(np.float64(value).view(np.int64))]


@typeof_impl.register(Packed)
def _typeof(value: Packed, _context: Any) -> Any:
    return value._kind


@register_model(PackedType)
class _Model(models.OpaqueModel):
    """A pointer."""


@unbox(PackedType)
def _unbox(_kind: Any, value: Any, c: Any) -> Any:
    address = c.pyapi.object_getattr_string(value, "address")
    pointer = c.pyapi.long_as_voidptr(address)
    c.pyapi.decref(address)
    return NativeValue(pointer)


@infer_getattr
class _Attributes(AttributeTemplate):
    key = PackedType

    def generic_resolve(self, kind: Any, name: str) -> Any:
        field = kind.fields.get(name, (None, 0))[0]
        return types.int64 if field is _SIZE else field


@lower_getattr_generic(PackedType)
def _read(context: Any, builder: Any, kind: Any, value: Any, name: str) -> Any:
    field, place = kind.fields[name]
    if field is _SIZE:
        return context.get_constant(types.int64, place)
    if isinstance(field, PackedType):
        return cgutils.pointer_add(builder, value, 8 * place, return_type=value.type)

    def load(index: int, of: Any) -> Any:
        pointer = cgutils.pointer_add(builder, value, 8 * (place + index), return_type=of.as_pointer())
        loaded = builder.load(pointer)
        loaded.set_metadata("invariant.load", builder.module.add_metadata([]))
        return loaded

    if isinstance(field, types.UniTuple):
        of = context.get_data_type(field.dtype)
        return cgutils.pack_array(builder, [load(k, of) for k in range(field.count)])
    if not isinstance(field, types.Array):
        return load(0, context.get_data_type(field))
    data = load(0, context.get_data_type(field.dtype).as_pointer())
    shape = [load(1 + k, ir.IntType(64)) for k in range(field.ndim)]
    size = context.get_constant(types.intp, 8)
    strides = [size]
    for extent in reversed(shape[1:]):
        strides.insert(0, builder.mul(strides[0], extent))
    array = context.make_array(field)(context, builder)
    arrayobj.populate_array(array, data=data, shape=shape, strides=strides, itemsize=size, meminfo=None)
    return array._getvalue()
