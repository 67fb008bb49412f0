"""Two ways to pass values through shared memory without a lock: newest value, and queue of records.

A value that is written whole and read often lives in a sequence lock: the writer makes the count odd, writes, makes it
even; a reader that saw the count change keeps what it had and looks again in the next frame. Things that happen once go
through a queue with one writer and one reader.
"""

from __future__ import annotations

import struct
import threading
from multiprocessing.shared_memory import SharedMemory
from typing import cast

WORD = 8
"""Bytes of a word."""


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
        assert buffer is not None
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
        assert buffer is not None
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
