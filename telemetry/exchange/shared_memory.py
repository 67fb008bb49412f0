"""Memory shared with a helper process, and two ways to pass values through it without a lock.

The memory has no name. A helper is handed its descriptor, and it is gone with the last process that holds it, however
that one ended.

A value that is written whole and read often lives in a sequence lock: the writer makes the count odd, writes, makes it
even; a reader that saw the count change keeps what it had and looks again in the next frame. Things that happen once go
through a queue with one writer and one reader. What a helper would need if it were started again is kept in two slots,
one of which is always whole.
"""

from __future__ import annotations

import mmap
import os
import struct
import tempfile
import threading
from typing import cast

WORD = 8
"""Bytes of a word."""


class SharedMemory:
    """Zeros at first; from either side."""

    def __init__(self, size: int | None = None, *, descriptor: int = -1) -> None:
        """Make it, or attach to it.

        Args:
            size: How much to make [bytes]; None attaches.
            descriptor: What was handed to this process.

        Raises:
            OSError: There is none of this descriptor.
            ValueError: What is there has no size.
        """
        self._owns = size is not None
        if size is not None:
            descriptor = _nameless()
            os.ftruncate(descriptor, size)
        self.descriptor = descriptor
        """What a helper is handed."""
        self._map = mmap.mmap(descriptor, 0)
        self.buf = memoryview(self._map)
        """The bytes."""

    def close(self) -> None:
        """Let it go; views of ``buf`` must have been released."""
        self.buf.release()
        self._map.close()
        if self._owns:
            os.close(self.descriptor)


def _nameless() -> int:
    """A descriptor of memory, or of a file without a name where there is no such memory."""
    if hasattr(os, "memfd_create"):
        return os.memfd_create("rtsim")
    with tempfile.TemporaryFile() as file:
        return os.dup(file.fileno())


class SequenceLock:
    """A handful of float64 values, written whole by one side and read whole by the other."""

    def __init__(self, memory: SharedMemory, offset: int, count: int) -> None:
        """Lay it over shared memory.

        Args:
            memory: The shared memory.
            offset: Where it begins [bytes].
            count: How many values.
        """
        buffer = memory.buf
        # Two readings of the count around a copy show a torn read.
        self._count = buffer[offset : offset + WORD].cast("q")
        self._values = buffer[offset + WORD : offset + WORD * (1 + count)].cast("d")
        self._pack = struct.Struct(f"={count}d").pack_into
        self._fence = threading.Lock()

    def write(self, values: tuple[float, ...]) -> None:
        """Publish new values.

        Args:
            values: As many as the lock holds.
        """
        count = self._count[0] + (self._count[0] & 1)  # a writer that died half-way left it odd
        self._count[0] = count + 1
        with self._fence:  # orders the stores, also off x86
            pass
        self._pack(self._values, 0, *values)
        with self._fence:
            pass
        self._count[0] = count + 2

    @property
    def version(self) -> int:
        """Changes with every write."""
        return self._count[0]

    def read(self) -> list[float] | None:
        """The values, or None while they are being written; call again in the next frame then."""
        before = self._count[0]
        if before & 1:
            return None
        values = cast("list[float]", self._values.tolist())
        return values if self._count[0] == before else None

    def release(self) -> None:
        """Let the shared memory go."""
        self._values.release()
        self._count.release()


class Queue:
    """Fixed-size records from one writer to one reader; a full queue refuses."""

    def __init__(self, memory: SharedMemory, offset: int, *, record: struct.Struct, slots: int) -> None:
        """Lay it over shared memory.

        Args:
            memory: The shared memory.
            offset: Where it begins [bytes].
            record: Layout of a record.
            slots: How many records fit.
        """
        buffer = memory.buf
        self._ends = buffer[offset : offset + 2 * WORD].cast("q")
        first = offset + 2 * WORD
        self._buffer = buffer[first : first + slots * record.size]
        self._record, self._slots = record, slots
        self._fence = threading.Lock()

    def put(self, *values: object) -> bool:
        """Append a record.

        Args:
            *values: What the record's layout takes.

        Returns:
            False where the reader is so far behind that there is no room.
        """
        written, taken = self._ends[0], self._ends[1]
        if written - taken >= self._slots:
            return False
        self._record.pack_into(self._buffer, (written % self._slots) * self._record.size, *values)
        with self._fence:
            pass
        self._ends[0] = written + 1
        return True

    def take(self) -> list[tuple[object, ...]]:
        """Everything that was put since; an empty list costs a fraction of a microsecond."""
        written, taken = self._ends[0], self._ends[1]
        if written == taken:
            return []
        records = [
            self._record.unpack_from(self._buffer, (number % self._slots) * self._record.size)
            for number in range(taken, written)
        ]
        self._ends[1] = written
        return records

    def release(self) -> None:
        """Let the shared memory go."""
        self._buffer.release()
        self._ends.release()


class Kept:
    """The newest of what one side puts by for whoever takes its place; always whole."""

    def __init__(self, memory: SharedMemory, offset: int, *, size: int) -> None:
        """Lay it over shared memory.

        Args:
            memory: The shared memory.
            offset: Where it begins [bytes].
            size: Most that can be kept [bytes].
        """
        self._newest = memory.buf[offset : offset + WORD].cast("q")
        self._lengths = memory.buf[offset + WORD : offset + 3 * WORD].cast("q")
        first = offset + 3 * WORD
        self._slots = [memory.buf[first + slot * size : first + (slot + 1) * size] for slot in range(2)]
        self._fence = threading.Lock()

    def put(self, content: bytes) -> bool:
        """Keep this instead of what was kept.

        Args:
            content: What to keep.

        Returns:
            False where it is too long.
        """
        slot = 1 - self._newest[0]
        if len(content) > len(self._slots[slot]):
            return False
        self._slots[slot][: len(content)] = content
        self._lengths[slot] = len(content)
        with self._fence:
            pass
        self._newest[0] = slot
        return True

    def get(self) -> bytes:
        """What was kept last; nothing at first."""
        slot = self._newest[0]
        return bytes(self._slots[slot][: self._lengths[slot]])

    def release(self) -> None:
        """Let the shared memory go."""
        for part in (self._newest, self._lengths, *self._slots):
            part.release()
