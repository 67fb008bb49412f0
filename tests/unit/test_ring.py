"""The row ring: order, counts and wholeness of rows, whatever the reader does; nothing left behind."""

from __future__ import annotations

import os
import signal
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
from telemetry.exchange.child_process import child_environment
from telemetry.exchange.ring import ROW_WIDTH, TIMING_COUNT, Ring, RingReader

CAPACITY = 8


def push_numbered(ring: Ring, number: int) -> None:
    ring.push(np.full(SIGNAL_COUNT, float(number)), np.full(TIMING_COUNT, float(number)))


@settings(max_examples=60, deadline=None)
@given(st.lists(st.one_of(st.just("read"), st.integers(0, 3 * CAPACITY)), max_size=30))
def test_rows_keep_order_and_every_row_is_read_or_counted(actions: list[str | int]) -> None:
    ring = Ring(CAPACITY)
    reader = RingReader(ring.name)
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
        "print(ring.name, flush=True)\n"
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
        env=child_environment(),
        text=True,
    ) as writer:
        assert writer.stdin is not None
        assert writer.stdout is not None
        assert writer.stderr is not None
        reader = RingReader(writer.stdout.readline().strip())
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


def test_nothing_is_left_behind_without_close(tmp_path: Path) -> None:
    script = "from telemetry.exchange.ring import Ring\nprint(Ring(8).name)\nring = Ring(8)\nprint(ring.name)\n"
    result = subprocess.run(
        [sys.executable, "-W", "error", "-c", script],
        env=child_environment(),
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    assert result.stderr == ""
    for name in result.stdout.split():
        with pytest.raises(InputError, match="no ring of this name"):
            RingReader(name)


def test_a_killed_writer_leaves_no_memory_behind() -> None:
    lines = (
        "import time",
        "from telemetry.exchange.ring import Ring",
        "ring = Ring(8)",
        "print(ring.name, flush=True)",
    )
    script = "\n".join((*lines, "print(ring.name, flush=True)", "time.sleep(60)"))
    with subprocess.Popen(
        [sys.executable, "-c", script],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=child_environment(),
        text=True,
    ) as writer:
        assert writer.stdout is not None
        name = writer.stdout.readline().strip()
        RingReader(name).close()
        os.kill(writer.pid, signal.SIGKILL)
        writer.wait(10)
    deadline = time.monotonic() + 10.0
    while Path("/dev/shm", name.lstrip("/")).exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not Path("/dev/shm", name.lstrip("/")).exists()


def test_a_reader_that_ends_leaves_the_ring_to_its_owner() -> None:
    ring = Ring(8)
    imported = "from telemetry.exchange.ring import RingReader"
    script = f"{imported}\nreader = RingReader({ring.name!r})\nprint(len(reader.read()))\n"
    push_numbered(ring, 1)
    result = subprocess.run(
        [sys.executable, "-W", "error", "-c", script],
        env=child_environment(),
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    assert result.stdout == "1\n"
    push_numbered(ring, 2)
    reader = RingReader(ring.name)
    assert reader.read()[:, 0].tolist() == [2.0]
    reader.close()
    ring.close()


def test_replacing_a_stuck_reader_counts_what_it_missed() -> None:
    ring = Ring(8)
    for number in range(5):
        push_numbered(ring, number)
    ring.skip_unread()
    push_numbered(ring, 5)
    reader = RingReader(ring.name)
    assert reader.read()[:, 0].tolist() == [5.0]
    assert ring.dropped == 5
    reader.close()
    ring.close()
    assert ring.dropped == 0
    ring.close()


def test_the_heartbeat_counts_looks_also_without_rows() -> None:
    ring = Ring(8)
    reader = RingReader(ring.name)
    before = ring.heartbeat
    assert len(reader.wait(0.02)) == 0
    assert ring.heartbeat > before
    reader.close()
    ring.close()


@pytest.mark.parametrize("capacity", [0, 1, 3, 100])
def test_a_capacity_that_is_no_power_of_two_is_refused(capacity: int) -> None:
    with pytest.raises(InputError, match="power of two"):
        Ring(capacity)
