"""The flight log: lossless, readable at any moment, never half-written, whatever happens to disk or process."""

from __future__ import annotations

import errno
import json
import os
import re
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import psutil
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtsim.errors import EXIT_OUTPUT_FAILED, InputError, OutputError
from rtsim.frame import SIGNAL_COUNT, SIGNALS, history_sha256
from rtsim.processes import safe_environment
from telemetry.exchange.ring import ROW_WIDTH, TIMING_COUNT
from telemetry.log import recorder_worker
from telemetry.log.corridor_outline import CorridorOutline
from telemetry.log.format import HEADER_PART, LOG_NAMES, FlightMetadata, LogEvent
from telemetry.log.place import check_log
from telemetry.log.reader import read_log
from telemetry.log.recorder import Recorder

OUTLINE = CorridorOutline.from_lines("design", low=([90.0, 0.0], [0.0, 101.0]), high=([90.0, 0.0], [125.0, 170.0]))
METADATA = FlightMetadata(
    scenario_name="typical_conversion",
    scenario_toml='name = "typical_conversion"\n',
    database_hash="ab" * 32,
    seed=7,
    rate_hz=50.0,
    versions={"rtsim": "0.1.0", "machine": "x86_64"},
    setup={"plant": "lpv", "start": {"airspeed_kt": 0.1}},
    corridor=OUTLINE,
)


def flight(frames: int, seed: int = 1) -> np.ndarray:
    rows = np.random.default_rng(seed).normal(size=(frames, SIGNAL_COUNT))
    rows[:, 0] = np.arange(frames)
    rows[:, 1] = rows[:, 0] / 50.0
    return rows


def test_everything_comes_back_bit_for_bit(tmp_path: Path) -> None:
    path = tmp_path / "flight.parquet"
    rows = flight(173)
    timing = np.arange(173 * TIMING_COUNT, dtype=float).reshape(173, TIMING_COUNT)
    recorder = Recorder(path, METADATA, live=True)
    for frame, row in enumerate(rows):
        if frame == 60:
            event = LogEvent(60, 1.2, "pilot", "the pilot is now external", data={"mode": "external", "stick": 0.1})
            recorder.event(event)
        recorder.push(row, timing[frame])
    recorder.close({"end_reason": "the programme is flown", "history_sha256": history_sha256([rows])})
    log = read_log(path)
    assert log.names == LOG_NAMES
    assert np.array_equal(log.history, rows)
    assert np.array_equal(log.rows[:, SIGNAL_COUNT:], timing)
    assert log.metadata == METADATA
    assert log.events == (event,)
    assert log.summary is not None
    assert log.summary["history_sha256"] == log.history_sha256()
    assert log["airspeed_kt"] == pytest.approx(rows[:, 2])
    assert log.unit("airspeed_kt") == "kn"
    assert not log.rows.flags.writeable


def test_anybody_can_read_it_with_pyarrow_alone(tmp_path: Path) -> None:
    path = tmp_path / "flight.parquet"
    recorder = Recorder(path, METADATA, live=False)
    recorder.push_block(flight(120))
    recorder.event(LogEvent(120, 2.4, "end", "end"))
    recorder.close({"end_reason": "done"})
    table = pq.read_table(path)
    assert table.column_names[:3] == ["frame", "time_s", "airspeed_kt"]
    assert table.num_rows == 120
    assert table.column("frame").to_pylist() == list(range(120))
    assert np.isnan(table.column("lateness_us").to_numpy()).all(), "an unpaced flight has no timing"
    metadata = table.schema.metadata
    assert metadata[b"rtsim.seed"] == b"7"
    assert metadata[b"rtsim.scenario_toml"] == METADATA.scenario_toml.encode()
    assert json.loads(metadata[b"rtsim.summary"])["end_reason"] == "done"
    assert json.loads(metadata[b"rtsim.units"])[2] == "kn"
    assert table.schema.field("pitch_deg").metadata[b"unit"] == b"deg"
    assert sorted(entry.name for entry in path.iterdir()) == [
        "_events.jsonl",
        *(f"part-{number:06d}.parquet" for number in range(4)),
    ]
    assert pq.read_metadata(path / "part-000001.parquet").num_rows == 50


@settings(max_examples=8, deadline=None)
@given(st.lists(st.integers(0, 130), min_size=1, max_size=4), st.booleans())
def test_no_row_is_lost_or_doubled_however_they_are_given(
    tmp_path_factory: pytest.TempPathFactory, blocks: list[int], live: bool
) -> None:
    path = tmp_path_factory.mktemp("log") / "flight.parquet"
    rows = flight(sum(blocks))
    recorder = Recorder(path, METADATA, live=live)
    start = 0
    for index, count in enumerate(blocks):
        piece = rows[start : start + count]
        if index % 2:
            recorder.push_block(piece)
        else:
            for row in piece:
                recorder.push(row)
        start += count
    recorder.close({"end_reason": "done"})
    assert recorder.rows == len(rows)
    assert np.array_equal(read_log(path).history, rows)


def test_rows_are_readable_within_a_second_or_two_while_time_stands_still(tmp_path: Path) -> None:
    path = tmp_path / "flight.parquet"
    recorder = Recorder(path, METADATA, live=True)
    for row in flight(7):
        recorder.push(row)
    recorder.flush()
    deadline = time.monotonic() + 10.0
    while time.monotonic() < deadline and not (path / "part-000001.parquet").exists():
        time.sleep(0.05)
    log = read_log(path)
    assert len(log.rows) == 7
    assert log.summary is None, "an unfinished flight must not look finished"
    recorder.close()
    assert read_log(path).summary is None


def test_kill_9_in_flight_loses_at_most_a_second(tmp_path: Path) -> None:
    path = tmp_path / "flight.parquet"
    script = (
        "import os, sys, time, numpy as np\n"
        "from telemetry.log.format import FlightMetadata\n"
        "from telemetry.log.recorder import Recorder\n"
        "from rtsim.frame import SIGNAL_COUNT\n"
        "recorder = Recorder(sys.argv[1], FlightMetadata('x', '', 'h', 0, 250.0), live=True)\n"
        "row = np.zeros(SIGNAL_COUNT)\n"
        "start = time.monotonic()\n"
        "for frame in range(100000):\n"
        "    row[0] = frame; row[1] = frame / 250.0\n"
        "    recorder.push(row)\n"
        "    if frame % 25 == 24: print(frame, flush=True)\n"
        "    time.sleep(max(0.0, start + frame / 250.0 - time.monotonic()))\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script, str(path)], stdout=subprocess.PIPE, env=safe_environment(), text=True
    ) as process:
        assert process.stdout is not None
        last = 0
        deadline = time.monotonic() + 30.0
        while last < 700 and time.monotonic() < deadline:
            last = int(process.stdout.readline())
        os.kill(process.pid, signal.SIGKILL)
        process.wait(10)
    at_once = read_log(path)
    assert len(at_once.rows) >= last - 250 - 25
    deadline = time.monotonic() + 10.0
    while time.monotonic() < deadline and len(read_log(path).rows) < last - 5:
        time.sleep(0.05)  # the writer, which outlived the flight, ends with what had reached it
    log = read_log(path)
    assert len(log.rows) >= last - 5
    assert log["frame"].tolist() == list(range(len(log.rows)))
    assert log.summary is None
    assert not [entry for entry in path.iterdir() if entry.name.endswith(".tmp")]


def test_a_write_that_fails_midway_ends_the_log_and_not_the_flight(tmp_path: Path) -> None:
    # The kernel refuses to let a file grow beyond the limit, in the middle of a part, like a full disk would.
    path = tmp_path / "flight.parquet"
    metadata = FlightMetadata("x", "", "h", 0, 250.0)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, hard))
    try:
        recorder = Recorder(path, metadata, live=True)  # the writer inherits the limit
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    rows = np.tile(flight(1), (50, 1))  # repeats compress: a part of these is small
    for row in rows:
        recorder.push(row)
    recorder.flush()
    deadline = time.monotonic() + 10.0
    while not (path / "part-000001.parquet").exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    for row in flight(2000):  # incompressible: a part is 120 kB
        recorder.push(row)
    with pytest.raises(
        OutputError, match=r"flight\.parquet: the log stopped because a file would become larger"
    ) as caught:
        recorder.close({"end_reason": "done"})
    assert caught.value.exit_code == EXIT_OUTPUT_FAILED
    assert recorder.failure is caught.value
    log = read_log(path)
    assert np.array_equal(log.history, rows)
    assert log.summary is None
    assert not [entry for entry in path.iterdir() if entry.name.endswith(".tmp")]


def test_a_full_disk_leaves_finished_parts_and_no_half_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    writer = recorder_worker.PartWriter(tmp_path, METADATA.to_json())
    block = np.zeros((50, ROW_WIDTH))
    writer.rows(block)

    def write_half(table: pa.Table, where: Path, **_: object) -> None:
        Path(where).write_bytes(b"PAR1 and half a part")
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(recorder_worker.pq, "write_table", write_half)
    with pytest.raises(OSError, match="No space left"):
        writer.rows(block)
    writer.close()
    names = sorted(entry.name for entry in tmp_path.iterdir())
    assert names == ["_events.jsonl", HEADER_PART, "part-000001.parquet"]
    assert pq.read_table(tmp_path).num_rows == 50


def test_writers_that_are_killed_are_replaced_and_the_log_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "flight.parquet"
    rows = flight(600)
    events = [LogEvent(100 * number, 2.0 * number, "pilot", f"event {number}") for number in range(6)]
    recorder = Recorder(path, METADATA, live=False)
    for number, event in enumerate(events):
        recorder.event(event)
        recorder.push_block(rows[100 * number : 100 * number + 100])
        if number == 1:
            # Something is confirmed, something is not; part 1 may be all that was written before the first death.
            wait_until(lambda: recorder._read_answers() or recorder._confirmed.parts >= 2)
        if number in {0, 1, 4}:
            recorder._process.kill()
            recorder._process.wait()
    recorder.close({"end_reason": "done"})
    log = read_log(path)
    assert np.array_equal(log.history, rows)
    assert log.events == tuple(events)
    assert log.summary == {"end_reason": "done"}
    assert len(recorder.notes) == 3
    assert "ended unexpectedly (ended by SIGKILL); another goes on" in recorder.notes[0]


@pytest.mark.parametrize("live", [True, False])
def test_a_writer_that_is_killed_while_the_log_is_closed_is_replaced_and_that_is_an_event(
    tmp_path: Path, live: bool
) -> None:
    path = tmp_path / "flight.parquet"
    rows = flight(130)
    recorder = Recorder(path, METADATA, live=live)
    for row in rows:
        recorder.push(row)
    recorder._process.kill()
    recorder.close({"end_reason": "done"})
    log = read_log(path)
    assert np.array_equal(log.history, rows)
    assert [event.kind for event in log.events] == ["log_writer"]
    assert log.summary == {"end_reason": "done"}


def test_writers_that_die_one_after_the_other_are_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recorder = Recorder(tmp_path / "flight.parquet", METADATA, live=False)
    recorder._process.kill()
    started = recorder._start_writer

    def start_and_kill() -> None:
        started()
        recorder._process.kill()

    monkeypatch.setattr(recorder, "_start_writer", start_and_kill)
    recorder.push_block(flight(100))
    with pytest.raises(OutputError, match="so did those that replaced it"):
        recorder.close({})


FLIGHT = """
import sys, time, numpy as np
from telemetry.log.format import FlightMetadata
from telemetry.log.recorder import Recorder
from rtsim.frame import SIGNAL_COUNT
recorder = Recorder(sys.argv[1], FlightMetadata('x', '', 'h', 0, 250.0), live=True)
recorder.push(np.zeros(SIGNAL_COUNT))
recorder.flush()
print(recorder._process.pid, flush=True)
time.sleep(600)
"""


def test_a_writer_that_outlives_its_flight_keeps_others_out_until_it_has_ended(tmp_path: Path) -> None:
    path = tmp_path / "flight.parquet"
    with subprocess.Popen(
        [sys.executable, "-c", FLIGHT, str(path)], stdout=subprocess.PIPE, env=safe_environment(), text=True
    ) as killed:
        assert killed.stdout is not None
        writer = psutil.Process(int(killed.stdout.readline()))
        wait_until((path / HEADER_PART).exists)
        writer.suspend()
        killed.kill()
    refused(path, "another flight is writing this log")
    writer.resume()
    writer.wait(60.0)
    recorder = Recorder(path, METADATA, live=False, overwrite=True)
    recorder.push_block(flight(5))
    recorder.close({})
    assert len(read_log(path).rows) == 5


def refused(path: Path, words: str) -> None:
    """Both who looks before the flight and who would write refuse."""
    with pytest.raises(InputError, match=words):
        check_log(path, overwrite=True)
    with pytest.raises(InputError, match=words):
        Recorder(path, METADATA, live=True, overwrite=True)


def wait_until(holds: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 60.0
    while not holds() and time.monotonic() < deadline:
        time.sleep(0.02)
    assert holds()


def test_a_stopped_writer_never_delays_a_live_flight(tmp_path: Path) -> None:
    path = tmp_path / "flight.parquet"
    rows = flight(12_000)  # 5 MB: far more than the pipe takes
    recorder = Recorder(path, METADATA, live=True)
    recorder.push(rows[0])
    os.kill(recorder._process.pid, signal.SIGSTOP)
    slowest = 0.0
    for row in rows[1:]:
        start = time.perf_counter()
        recorder.push(row)
        slowest = max(slowest, time.perf_counter() - start)
    assert recorder.backlog_bytes > 1_000_000
    assert slowest < 5.0  # a push that waited for the stopped writer would never have come back
    os.kill(recorder._process.pid, signal.SIGCONT)
    recorder.close({"end_reason": "done"})
    assert np.array_equal(read_log(path).history, rows), "the backlog is lossless"


def test_a_writer_that_stays_stuck_is_given_up(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "flight.parquet", METADATA, live=True)
    recorder.push(flight(1)[0])
    os.kill(recorder._process.pid, signal.SIGSTOP)
    start = time.monotonic()
    with pytest.raises(OutputError, match="did not finish"):
        recorder.close({}, timeout_s=0.5)
    assert time.monotonic() - start < 5.0


@pytest.mark.parametrize("live", [True, False])
@pytest.mark.parametrize("frames", [100, 6000])  # the pipe takes them all, or not
def test_a_writer_that_hangs_is_replaced_and_nothing_is_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, live: bool, frames: int
) -> None:
    monkeypatch.setattr("telemetry.log.recorder.HANG_S", 0.5)
    path = tmp_path / "flight.parquet"
    rows = flight(frames)
    recorder = Recorder(path, METADATA, live=live)
    recorder.push(rows[0])
    recorder._process.send_signal(signal.SIGSTOP)
    for row in rows[1:]:
        recorder.push(row)
    recorder.close({"end_reason": "done"})
    log = read_log(path)
    assert np.array_equal(log.history, rows)
    assert log.summary == {"end_reason": "done"}
    assert len(recorder.notes) == 1
    assert re.search(r"ended unexpectedly \(it did nothing for \d+ s and was ended\); another", recorder.notes[0])


@pytest.mark.parametrize("place", ["missing/flight.parquet", "file/flight.parquet"])
def test_a_place_that_cannot_be_written_is_told_in_a_sentence(tmp_path: Path, place: str) -> None:
    (tmp_path / "file").write_text("a file, no directory")
    with pytest.raises(OutputError, match="the log cannot be written here"):
        Recorder(tmp_path / place, METADATA, live=True)


def test_an_existing_log_is_only_replaced_on_demand(tmp_path: Path) -> None:
    path = tmp_path / "flight.parquet"
    for overwrite, frames in ((False, 120), (True, 10)):
        recorder = Recorder(path, METADATA, live=False, overwrite=overwrite)
        recorder.push_block(flight(frames))
        recorder.close({})
        with pytest.raises(InputError, match="choose another path or add --overwrite"):
            Recorder(path, METADATA, live=False)
        assert len(read_log(path).rows) == frames


def test_what_is_no_log_is_never_replaced(tmp_path: Path) -> None:
    file = tmp_path / "notes.parquet"
    file.write_text("mine")
    directory = tmp_path / "thesis"
    directory.mkdir()
    (directory / "chapter.tex").write_text("mine")
    (directory / "_events.jsonl").write_text("")
    for path in (file, directory):
        with pytest.raises(InputError, match="no rtsim log"):
            Recorder(path, METADATA, live=False, overwrite=True)
    assert file.read_text() == "mine"
    assert (directory / "chapter.tex").read_text() == "mine"


@pytest.mark.parametrize(
    "name",
    ["part-2.docx", "part-000001.parquet.bak", "my-part-000001.parquet", "part-1.parquet", ".part-000001.parquet", "x"],
)
def test_a_log_with_something_foreign_in_it_is_not_replaced(tmp_path: Path, name: str) -> None:
    path = tmp_path / "flight.parquet"
    recorder = Recorder(path, METADATA, live=False)
    recorder.push_block(flight(5))
    recorder.close({})
    (path / name).write_text("mine")
    before = sorted(path.iterdir())
    refused(path, f"no rtsim log is here: {re.escape(name)}")
    assert sorted(path.iterdir()) == before


def test_a_folder_named_like_a_part_is_foreign_and_what_a_killed_writer_left_is_not(tmp_path: Path) -> None:
    path = tmp_path / "flight.parquet"
    path.mkdir()
    (path / "_events.jsonl").write_text("")
    (path / ".part-000001.parquet.tmp").write_text("half a part")
    check_log(path, overwrite=True)
    (path / "part-000002.parquet").mkdir()
    with pytest.raises(InputError, match="part-000002"):
        check_log(path, overwrite=True)


def test_a_log_that_could_not_be_written_is_refused_before_and_nothing_is_changed(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("a file, no directory")
    for place, error in (("missing/a.parquet", OutputError), ("file/a.parquet", OutputError), ("file", InputError)):
        with pytest.raises(error):
            check_log(tmp_path / place, overwrite=True)
    check_log(tmp_path / "new.parquet", overwrite=False)
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]


def test_two_flights_cannot_write_the_same_log(tmp_path: Path) -> None:
    path = tmp_path / "flight.parquet"
    first = Recorder(path, METADATA, live=False)
    with pytest.raises(InputError, match="another flight is writing this log"):
        Recorder(path, METADATA, live=False, overwrite=True)
    first.push_block(flight(5))
    first.close({})
    assert len(read_log(path).rows) == 5


def test_a_flight_without_a_frame_is_a_log_too(tmp_path: Path) -> None:
    path = tmp_path / "flight.parquet"
    recorder = Recorder(path, METADATA, live=True)
    recorder.close({"end_reason": "stopped before the first frame"})
    recorder.close({"end_reason": "a second close does nothing"})
    log = read_log(path)
    assert log.history.shape == (0, len(SIGNALS))
    assert log.summary == {"end_reason": "stopped before the first frame"}
