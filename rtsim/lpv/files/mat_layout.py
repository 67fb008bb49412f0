"""The layout of MATLAB files (version 5 to 7), unpacked and measured before a reader sees it.

A reader believes what a file says of its sizes, and takes that much memory. Here every array is held against the bytes
that are really there. The layout: "MAT-File Format", The MathWorks.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from typing import Final

HEADER_BYTES: Final = 128
_LITTLE: Final = b"IM"
_MATRIX, _COMPRESSED = 14, 15
_CELL, _STRUCT, _OBJECT, _SPARSE = 1, 2, 3, 5
_LARGEST_CLASS = 15
"""Functions and objects of classes have layouts of their own, and no place in a database."""


def unpacked(data: bytes, *, largest: int) -> bytes:
    """The same file with nothing compressed, every array no larger than its bytes.

    Args:
        data: The file.
        largest: Size of the largest content that is unpacked [bytes].

    Returns:
        The file; one of another version as it is.

    Raises:
        ValueError: It is damaged or too large.
    """
    if data[126:128] not in {_LITTLE, _LITTLE[::-1]}:
        return data
    order = "<" if data[126:128] == _LITTLE else ">"
    parts, place, size = [data[:HEADER_BYTES]], HEADER_BYTES, 0
    while place + 8 <= len(data):
        kind, count = struct.unpack_from(f"{order}II", data, place)
        body = data[place + 8 : place + 8 + count]
        if len(body) < count:
            raise ValueError("it ends within a variable")
        if kind == _COMPRESSED:
            inflate = zlib.decompressobj()
            element = inflate.decompress(body, largest - size + 1)
            if not inflate.eof and len(element) <= largest - size:
                raise ValueError("a compressed variable is cut off")
        else:
            element = data[place : place + 8 + count]
        size += len(element)
        if size > largest:
            raise ValueError(f"it holds more than {largest} bytes")
        _check(memoryview(element), order)
        parts.append(element)
        place += 8 + count
    return b"".join(parts)


def _check(element: memoryview, order: str) -> None:
    """Hold the size of an array against its bytes, and those of what it holds."""
    kind, size = struct.unpack_from(f"{order}II", element)
    if kind != _MATRIX or size + 8 > len(element):
        raise ValueError("a variable has no array, or less than it says")
    if not size:
        return
    items = _items(element[8 : 8 + size], order)
    flags, dimensions = next(items), next(items)
    next(items)  # its name
    what = struct.unpack_from(f"{order}I", flags)[0] & 0xFF
    shape = struct.unpack_from(f"{order}{len(dimensions) // 4}i", dimensions)
    if what > _LARGEST_CLASS or any(length < 0 for length in shape):
        raise ValueError("an array is of no kind or size that a database has")
    if what == _SPARSE:
        return
    count = math.prod(shape)
    if what in {_STRUCT, _OBJECT}:
        if what == _OBJECT:
            next(items)  # the name of its class
        length = struct.unpack_from(f"{order}i", next(items))[0]
        count *= max(1, len(next(items)) // length)
    holds = what in {_CELL, _STRUCT, _OBJECT}
    if count * (8 if holds else 1) > size:
        raise ValueError(f"an array of {count} entries has {size} bytes")
    if holds:
        for part in items:
            _check(part, order)


def _items(body: memoryview, order: str) -> Iterator[memoryview]:
    """The elements within an element: arrays with their tags, the others without."""
    place = 0
    while place + 8 <= len(body):
        kind, size = struct.unpack_from(f"{order}II", body, place)
        if kind >> 16:  # a small element: size, kind and data in eight bytes
            yield body[place + 4 : place + 4 + (kind >> 16)]
            place += 8
            continue
        if place + 8 + size > len(body):
            raise ValueError("an array ends early")
        yield body[place : place + 8 + size] if kind == _MATRIX else body[place + 8 : place + 8 + size]
        place += 8 + size + (-size) % 8
