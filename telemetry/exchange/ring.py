"""Drop-oldest ring of frame rows in shared memory: the loop pushes, a viewer's process reads.

The writer never waits. It fills the slot of row ``n`` and only then publishes ``written = n + 1``; a reader that
is more than the capacity behind finds the rows it missed by comparing the published count before and after its
copy, skips them and counts them as dropped. There is no lock that one side could hold against the other.
"""

from __future__ import annotations

import threading
import time

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.frame import SIGNAL_COUNT, TIMING_SIGNALS
from telemetry.exchange.shared_memory import SharedMemory

TIMING_COUNT = len(TIMING_SIGNALS)
"""Number of wall-clock columns that follow the signals in a full row."""
ROW_WIDTH = SIGNAL_COUNT + TIMING_COUNT
"""Columns of a full row: ``SIGNALS`` then ``TIMING_SIGNALS``."""
RING_CAPACITY = 4096
"""Slots of the ring: 16 s at 250 Hz."""

_MAGIC = 0x5254_5349_4D52_4E47
_HEADER_WORDS = 16
_MAGIC_WORD, _CAPACITY_WORD, _WIDTH_WORD, _WRITTEN, _CONSUMED, _DROPPED, _HEARTBEAT = range(7)


class Ring:
    """The writing end; makes the shared memory."""

    def __init__(self, capacity: int = RING_CAPACITY) -> None:
        """Create the shared memory.

        Args:
            capacity: Number of slots, a power of two; one slot is always the writer's, so a reader that is
                late finds the newest ``capacity - 1`` rows.

        Raises:
            InputError: The capacity is not a power of two above 1.
        """
        if capacity < 2 or capacity & (capacity - 1):
            raise InputError("the ring needs a power of two of slots", key="capacity", value=capacity)
        self.capacity = capacity
        """Number of slots."""
        self._memory = SharedMemory(8 * (_HEADER_WORDS + capacity * ROW_WIDTH))
        self._header = _header_of(self._memory)
        self._slots = np.ndarray(
            (capacity, ROW_WIDTH), dtype=np.float64, buffer=self._memory.buf, offset=8 * _HEADER_WORDS
        )
        self._slots[:] = 0.0  # touches every page now, so that no page fault falls into a frame
        # One view per slot: indexing a list and filling a ready view is twice as fast as two-dimensional indexing.
        self._history = [self._slots[slot, :SIGNAL_COUNT] for slot in range(capacity)]
        self._timing = [self._slots[slot, SIGNAL_COUNT:] for slot in range(capacity)]
        self._mask = capacity - 1
        self._written = 0
        self._fence = threading.Lock()
        self._open = True
        self._header[_CAPACITY_WORD], self._header[_WIDTH_WORD] = capacity, ROW_WIDTH
        self._header[_MAGIC_WORD] = _MAGIC

    @property
    def descriptor(self) -> int:
        """What a reader attaches to; its process must be handed it."""
        return self._memory.descriptor

    @property
    def written(self) -> int:
        """Rows pushed so far."""
        return self._written

    @property
    def consumed(self) -> int:
        """Rows the reader has passed (taken or dropped)."""
        return int(self._header[_CONSUMED]) if self._open else self._written

    @property
    def dropped(self) -> int:
        """Rows no reader will see: those it reported, and those overwritten since it last looked."""
        if not self._open:
            return 0
        overwritten = self._written - self._header[_CONSUMED] - (self.capacity - 1)
        return int(self._header[_DROPPED]) + max(0, overwritten)

    @property
    def heartbeat(self) -> int:
        """Counts up whenever the reader looked, with or without rows; standing still means a stuck reader."""
        return int(self._header[_HEARTBEAT]) if self._open else 0

    def push(self, row: FloatArray, timing: FloatArray) -> None:
        """Publish one row; costs about a microsecond and never waits."""
        written = self._written
        slot = written & self._mask
        self._history[slot][:] = row
        self._timing[slot][:] = timing
        # Taking and giving back a free lock orders the row's stores before the count's, also off x86.
        with self._fence:
            pass
        self._written = self._header[_WRITTEN] = written + 1

    def skip_unread(self) -> None:
        """Let the next reader start at the newest row (after a stuck reader has been replaced)."""
        self._header[_DROPPED] += self._written - self._header[_CONSUMED]
        self._header[_CONSUMED] = self._written

    def close(self) -> None:
        """Let the shared memory go; a reader that is still attached keeps its mapping until it closes."""
        if not self._open:
            return
        self._open = False
        self._header.release()
        self._history, self._timing = [], []
        del self._slots
        self._memory.close()


class RingReader:
    """The reading end, in any process of the same machine. One reader per ring."""

    def __init__(self, descriptor: int) -> None:
        """Attach to a ring.

        Args:
            descriptor: ``Ring.descriptor``, handed to this process.

        Raises:
            InputError: There is no such ring, or it has another layout.
        """
        try:
            self._memory = SharedMemory(descriptor=descriptor)
        except (OSError, ValueError) as failure:
            raise InputError("there is no such ring", key="ring", value=descriptor) from failure
        self._header = _header_of(self._memory)
        capacity, width = int(self._header[_CAPACITY_WORD]), int(self._header[_WIDTH_WORD])
        if self._header[_MAGIC_WORD] != _MAGIC or width != ROW_WIDTH:
            self._header.release()
            self._memory.close()
            raise InputError("this shared memory is no ring of this version", key="ring", value=descriptor)
        self._capacity = capacity
        self._slots = np.ndarray((capacity, width), dtype=np.float64, buffer=self._memory.buf, offset=8 * _HEADER_WORDS)
        self._next = int(self._header[_CONSUMED])
        self._open = True

    @property
    def dropped(self) -> int:
        """Rows that were overwritten before this reader came to them."""
        return int(self._header[_DROPPED])

    def read(self) -> FloatArray:
        """Take every row not yet read, oldest first.

        Returns:
            A copy of shape (rows, ROW_WIDTH), possibly with no row.
        """
        header = self._header
        header[_HEARTBEAT] += 1
        written = int(header[_WRITTEN])
        first = max(self._next, written - self._capacity + 1)
        rows = self._slots[np.arange(first, written) % self._capacity]
        # The writer may have moved on while we copied: the slot of row `written` is being filled at any time,
        # so only rows younger than `written - capacity` are certainly whole.
        whole_from = int(header[_WRITTEN]) - self._capacity + 1
        if whole_from > first:
            rows = rows[min(whole_from - first, len(rows)) :]
        taken_from = written - len(rows)
        if taken_from > self._next:
            header[_DROPPED] += taken_from - self._next
        self._next = header[_CONSUMED] = written
        return rows

    def wait(self, timeout_s: float) -> FloatArray:
        """Read, and where there is nothing, look again every 2 ms until something came.

        Args:
            timeout_s: Longest wait [s].

        Returns:
            As ``read``; no row after the timeout.
        """
        deadline = time.monotonic() + timeout_s
        rows = self.read()
        while not len(rows) and time.monotonic() < deadline:
            time.sleep(0.002)
            rows = self.read()
        return rows

    def close(self) -> None:
        """Detach; the ring itself lives on."""
        if self._open:
            self._open = False
            self._header.release()
            del self._slots
            self._memory.close()


def _header_of(memory: SharedMemory) -> memoryview[int]:
    """The counters at the start of the memory, as 64-bit words."""
    return memory.buf[: 8 * _HEADER_WORDS].cast("q")
