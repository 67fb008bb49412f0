"""The row ring: order, counts and wholeness of rows, whatever the reader does; nothing left behind."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtsim.errors import InputError
from rtsim.frame import SIGNAL_COUNT
from rtsim.processes import safe_environment
from telemetry.exchange.ring import ROW_WIDTH, TIMING_COUNT, Ring, RingReader

CAPACITY = 8


def push_numbered(ring: Ring, number: int) -> None:
    ring.push(np.full(SIGNAL_COUNT, float(number)), np.full(TIMING_COUNT, float(number)))


@settings(max_examples=60, deadline=None)
@given(st.lists(st.one_of(st.just("read"), st.integers(0, 3 * CAPACITY)), max_size=30))
def test_rows_keep_order_and_every_row_is_read_or_counted(actions: list[str | int]) -> None:
    ring = Ring(CAPACITY)
    reader = RingReader(ring.descriptor)
    pushed, unread, lost = 0, [], 0
    try:
        for action in actions:
            if action == "read":
                rows = reader.read()
                expected = unread[-(CAPACITY - 1) :]
                lost += len(unread) - len(expected)
                unread = []
                assert rows.shape == (len(expected), ROW_WIDTH)
                assert rows[:, 0].tolist() == expected
                assert (rows == rows[:, :1]).all()
                assert reader.dropped == lost
            else:
                for _ in range(int(action)):
                    push_numbered(ring, pushed)
                    unread.append(float(pushed))
                    pushed += 1
            assert ring.written == pushed
            assert ring.consumed == pushed - len(unread)
            assert ring.dropped == lost + max(0, len(unread) - (CAPACITY - 1))
    finally:
        reader.close()
        ring.close()


def test_rows_from_a_fast_writer_in_another_process_are_whole_and_in_order() -> None:
    script = (
        "import sys, numpy as np\n"
        "from telemetry.exchange.ring import Ring, SIGNAL_COUNT, TIMING_COUNT\n"
        "ring = Ring(16)\n"
        "print(ring.descriptor, flush=True)\n"
        "row, timing = np.empty(SIGNAL_COUNT), np.empty(TIMING_COUNT)\n"
        "sys.stdin.readline()\n"
        "for number in range(60000):\n"
        "    row[:] = number; timing[:] = number; ring.push(row, timing)\n"
        "print('done', flush=True)\n"
        "sys.stdin.readline()\n"
        "ring.close()\n"
    )
    with subprocess.Popen(
        [sys.executable, "-W", "error", "-c", script],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=safe_environment(),
        text=True,
    ) as writer:
        assert writer.stdin is not None
        assert writer.stdout is not None
        assert writer.stderr is not None
        descriptor = os.open(f"/proc/{writer.pid}/fd/{writer.stdout.readline().strip()}", os.O_RDWR)
        reader = RingReader(descriptor)
        os.close(descriptor)
        writer.stdin.write("go\n")
        writer.stdin.flush()
        taken: list[float] = []
        deadline = time.monotonic() + 30.0
        while time.monotonic() < deadline and (not taken or taken[-1] < 59999):
            rows = reader.read()
            assert (rows == rows[:, :1]).all(), "a torn row was handed out"
            taken += rows[:, 0].tolist()
        assert taken[-1] == 59999
        assert (np.diff(taken) > 0).all()
        assert len(taken) + reader.dropped == 60000
        reader.close()
        writer.stdin.write("end\n")
        writer.stdin.flush()
        assert writer.wait(10) == 0
        assert writer.stderr.read() == ""


READER = """
import sys
from telemetry.exchange.ring import RingReader
reader = RingReader(int(sys.argv[1]))
print(len(reader.read()))
"""


def test_a_reader_that_ends_leaves_the_ring_to_its_owner() -> None:
    ring = Ring(8)
    push_numbered(ring, 1)
    result = subprocess.run(
        [sys.executable, "-W", "error", "-c", READER, str(ring.descriptor)],
        env=safe_environment(),
        pass_fds=[ring.descriptor],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    assert result.stdout == "1\n"
    push_numbered(ring, 2)
    reader = RingReader(ring.descriptor)
    assert reader.read()[:, 0].tolist() == [2.0]
    reader.close()
    ring.close()


def test_a_ring_has_no_name_that_could_be_left_behind() -> None:
    ring = Ring(8)
    descriptor = ring.descriptor
    assert "/dev/shm" not in Path("/proc/self/maps").read_text()
    assert os.fstat(descriptor).st_nlink == 0
    ring.close()
    with pytest.raises(InputError, match="no such ring"):
        RingReader(descriptor)


def test_replacing_a_stuck_reader_counts_what_it_missed() -> None:
    ring = Ring(8)
    for number in range(5):
        push_numbered(ring, number)
    ring.skip_unread()
    push_numbered(ring, 5)
    reader = RingReader(ring.descriptor)
    assert reader.read()[:, 0].tolist() == [5.0]
    assert ring.dropped == 5
    reader.close()
    ring.close()
    assert ring.dropped == 0
    ring.close()


def test_the_heartbeat_counts_looks_also_without_rows() -> None:
    ring = Ring(8)
    reader = RingReader(ring.descriptor)
    before = ring.heartbeat
    assert len(reader.wait(0.02)) == 0
    assert ring.heartbeat > before
    reader.close()
    ring.close()


@pytest.mark.parametrize("capacity", [0, 1, 3, 100])
def test_a_capacity_that_is_no_power_of_two_is_refused(capacity: int) -> None:
    with pytest.raises(InputError, match="power of two"):
        Ring(capacity)
