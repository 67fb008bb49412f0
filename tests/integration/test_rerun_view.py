"""The Rerun view as a flight sees it: what is recorded, and that no failure of the view reaches the flight."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pyarrow as pa
import pytest
import rerun as rr

from rtsim.errors import EXIT_OUTPUT_FAILED, InputError, OutputError
from rtsim.frame import COLUMN, SIGNAL_COUNT
from rtsim.processes import safe_environment
from telemetry.exchange.ring import ROW_WIDTH, TIMING_COUNT
from telemetry.log.corridor_outline import CorridorOutline
from telemetry.view import streamer
from telemetry.view.options import ViewOptions, display_available
from telemetry.view.recording import check_recording, partial_name
from telemetry.view.view import RerunView

OUTLINE = CorridorOutline.from_lines(
    "design",
    low=([95.0, 80.0, 59.3, 0.0], [-35.0, -25.0, 58.0, 101.0]),
    high=([95.0, 45.0, 0.0], [120.0, 170.0, 170.0]),
    centre=([90.0, 0.0], [60.0, 135.0]),
)
TIMING = np.zeros(TIMING_COUNT)
SLEEPER = (sys.executable, "-c", "import time; time.sleep(600)")


def rows_of_a_conversion(seconds: float) -> np.ndarray:
    frames = round(seconds * 250)
    rows = np.zeros((frames, SIGNAL_COUNT))
    time_s = np.arange(frames) / 250.0
    share = time_s / seconds
    rows[:, COLUMN.frame], rows[:, COLUMN.time_s] = np.arange(frames), time_s
    rows[:, COLUMN.airspeed_kt] = 170.0 * share
    rows[:, COLUMN.nacelle_deg] = 90.0 * (1.0 - share)
    rows[:, COLUMN.on_downstop] = rows[:, COLUMN.nacelle_deg] <= 0.5
    rows[:, COLUMN.altitude_m] = 100.0
    rows[:, COLUMN.pitch_deg] = 5.0 * np.sin(time_s)
    rows[:, COLUMN.longitudinal_flapping_deg] = 4.0
    rows[:, COLUMN.north_m] = 40.0 * time_s
    rows[:, COLUMN.margin_low_kt] = rows[:, COLUMN.margin_kt] = np.where(share > 0.5, 3.0, 30.0)
    rows[:, COLUMN.margin_high_kt] = 60.0
    rows[:, COLUMN.corridor_level] = np.where(share > 0.5, 2.0, 0.0)
    return rows


def fly(view: RerunView, rows: np.ndarray, *, warp: float = 1.0) -> float:
    """Push rows at their pace; give the longest time that one push took."""
    start, slowest = time.perf_counter(), 0.0
    for row in rows:
        before = time.perf_counter()
        view.push(row, TIMING)
        slowest = max(slowest, time.perf_counter() - before)
        time.sleep(max(0.0, start + (row[COLUMN.time_s] - rows[0, COLUMN.time_s]) / warp - time.perf_counter()))
    return slowest


def chunks(path: Path, entity: str) -> list[pa.RecordBatch]:
    found = rr.chunk.RrdReader(str(path)).stream().filter(content=entity)
    return [chunk.to_record_batch() for chunk in found]


def values(path: Path, entity: str, component: str) -> list[Any]:
    """All values of a component, in the order of time."""
    pairs: list[tuple[int, Any]] = []
    for batch in chunks(path, entity):
        if component in batch.schema.names and "sim_time" in batch.schema.names:
            times = batch.column("sim_time").cast(pa.int64()).to_pylist()
            pairs += zip(times, batch.column(component).to_pylist(), strict=True)
    return [value for _, value in sorted(pairs, key=lambda pair: pair[0])]


@pytest.fixture
def told() -> list[str]:
    return []


@contextlib.contextmanager
def viewing(options: ViewOptions, told: list[str]) -> Iterator[RerunView]:
    view = RerunView(options, corridor=OUTLINE, title="test", on_message=told.append)
    try:
        yield view
    finally:
        with contextlib.suppress(OutputError):
            view.close()


def test_a_recording_holds_the_flight(tmp_path: Path, told: list[str]) -> None:
    record = tmp_path / "flight.rrd"
    rows = rows_of_a_conversion(3.0)
    with viewing(ViewOptions(viewer=False, record=record), told) as view:
        assert view.wait_ready(30.0)
        view.event("flight begins", "info")
        fly(view, rows)
        time.sleep(0.2)
        view.event("too close", "warning")
        start = time.monotonic()
        view.close()
        assert time.monotonic() - start < 3.0
    assert told == []
    assert view.failure is None
    assert view.dropped == 0
    assert not partial_name(record).exists()
    speeds = [row[0] for row in values(record, "/plots/speed/kn", "Scalars:scalars")]
    assert speeds == rows[::5, COLUMN.airspeed_kt].tolist(), "50 points of a curve per second, exact"
    text = [entry[0] for entry in values(record, "/events/log", "TextLog:text")]
    assert text == ["flight begins", "Mode: conversion", "Mode: airplane", "too close"]
    levels = [entry[0] for entry in values(record, "/events/log", "TextLog:level")]
    assert levels == ["INFO", "INFO", "INFO", "ERROR"]
    corridor = [entry[0] for entry in values(record, "/events/corridor", "StateChange:state")]
    assert corridor == ["CLEAR", "WARNING"]
    modes = [entry[0] for entry in values(record, "/events/mode", "StateChange:state")]
    assert modes == ["HELICOPTER", "CONVERSION", "AIRPLANE"]
    nacelle = values(record, "/world/aircraft/nacelle_left", "Transform3D:quaternion")
    assert nacelle[1][0] == pytest.approx([0.0, np.sin(np.pi / 4), 0.0, np.cos(np.pi / 4)], abs=1e-6)
    assert nacelle[-1][0][3] == pytest.approx(1.0, abs=1e-3), "airplane mode at the end"
    assert len(nacelle) > 40
    assert list(rr.chunk.RrdReader(str(record)).blueprints()), "the layout is in the file"


def test_flapping_tilts_the_discs_forward(tmp_path: Path, told: list[str]) -> None:
    record = tmp_path / "flight.rrd"
    with viewing(ViewOptions(viewer=False, record=record), told) as view:
        assert view.wait_ready(30.0)
        fly(view, rows_of_a_conversion(0.3))
    for side in ("left", "right"):
        x, y, z, w = values(record, f"/world/aircraft/nacelle_{side}/hub", "Transform3D:quaternion")[-1][0]
        assert 2.0 * np.arctan2(np.hypot(x, np.hypot(y, z)), w) == pytest.approx(np.radians(4.0), abs=1e-6)
        mast_z = 2.0 * (x * z - w * y)  # where the disc's axis (+x of the hub) points in the nacelle's z
        assert mast_z == pytest.approx(np.sin(np.radians(4.0)), abs=1e-6)


def test_a_reset_begins_a_new_recording(tmp_path: Path, told: list[str]) -> None:
    record = tmp_path / "flight.rrd"
    rows = rows_of_a_conversion(1.0)
    with viewing(ViewOptions(viewer=False, record=record), told) as view:
        assert view.wait_ready(30.0)
        fly(view, rows)
        fly(view, rows[:125])
    ids = []
    for path, last in ((record, 0.98), (tmp_path / "flight-2.rrd", 0.48)):
        ids.append({recording.recording_id for recording in rr.chunk.RrdReader(str(path)).recordings()})
        speeds = [row[0] for row in values(path, "/plots/speed/kn", "Scalars:scalars")]
        assert len(speeds) == round(last * 50) + 1
        assert (np.diff(speeds) > 0.0).all(), "runs are not mixed"
    assert not ids[0] & ids[1]
    assert told == []


def test_a_frozen_view_is_replaced_once_and_then_given_up(tmp_path: Path, told: list[str]) -> None:
    record = tmp_path / "flight.rrd"
    options = ViewOptions(viewer=False, record=record, stall_timeout_s=2.0)
    rows = rows_of_a_conversion(6.0)
    with viewing(options, told) as view:
        for attempt in range(2):
            assert view.wait_ready(30.0)
            assert view._process is not None
            os.kill(view._process.pid, signal.SIGSTOP)
            slowest = fly(view, rows[attempt * 750 : attempt * 750 + 750])
            assert slowest < 1.5, "the flight never stalls"  # a stuck view is given up after 2 s
        assert "did not move for 2 s; it was started again" in told[0]
        assert "given up" in told[1]
        assert not view.alive
        fly(view, rows[:50], warp=10.0)  # and goes on without the view
        assert view.dropped > 0
        start = time.monotonic()
        view.close()
        assert time.monotonic() - start < 1.0
    assert isinstance(view.failure, OutputError)
    assert view.failure.exit_code == EXIT_OUTPUT_FAILED
    assert "recording is incomplete" in str(view.failure)


def test_a_view_that_is_killed_is_started_again(told: list[str], tmp_path: Path) -> None:
    record = tmp_path / "flight.rrd"
    with viewing(ViewOptions(viewer=False, record=record), told) as view:
        assert view.wait_ready(30.0)
        assert view._process is not None
        view._process.kill()
        fly(view, rows_of_a_conversion(0.6))
        assert "ended unexpectedly" in told[0]
        assert view.wait_ready(30.0)
        fly(view, rows_of_a_conversion(0.5))
    assert (tmp_path / "flight-again2.rrd").exists()
    there = ", ".join(sorted(path.name for path in tmp_path.glob("*.rrd")))
    assert "flight-again2.rrd" in there
    assert str(view.failure).endswith(f"; what was recorded is in {there}.")


def test_a_view_that_is_killed_just_before_the_end_is_no_success(told: list[str], tmp_path: Path) -> None:
    with viewing(ViewOptions(viewer=False, record=tmp_path / "flight.rrd"), told) as view:
        assert view.wait_ready(30.0)
        assert view._process is not None
        view._process.kill()
        view._process.wait()
    assert told == ["The view ended unexpectedly (ended by SIGKILL)."]
    assert view.failure is not None
    assert not (tmp_path / "flight.rrd").exists()


def test_a_view_that_is_frozen_at_the_end_is_ended_in_time(tmp_path: Path, told: list[str]) -> None:
    with viewing(ViewOptions(viewer=False, record=tmp_path / "flight.rrd"), told) as view:
        assert view.wait_ready(30.0)
        assert view._process is not None
        os.kill(view._process.pid, signal.SIGSTOP)
        start = time.monotonic()
        view.close(timeout_s=1.0)
        assert time.monotonic() - start < 2.0
    assert "did not get on with closing for 1 s" in told[0]
    assert view.failure is not None


def test_a_view_that_is_slow_to_close_is_waited_for_while_it_gets_on(tmp_path: Path, told: list[str]) -> None:
    record = tmp_path / "flight.rrd"
    with viewing(ViewOptions(viewer=False, record=record), told) as view:
        assert view.wait_ready(30.0)
        assert view._process is not None
        worker = psutil.Process(view._process.pid)
        fly(view, rows_of_a_conversion(0.5))
        worker.suspend()
        stutter = threading.Thread(target=stutters, args=(worker,))
        stutter.start()
        view.close(timeout_s=1.0)  # it takes longer than that, with pauses that are shorter
        stutter.join()
    assert told == []
    assert view.failure is None
    assert len(values(record, "/plots/speed/kn", "Scalars:scalars")) == 25


def stutters(worker: psutil.Process) -> None:
    """Let a process run for a hundredth of a second in each third, as on a machine that has other things to do."""
    with contextlib.suppress(psutil.NoSuchProcess):
        for _ in range(6):
            time.sleep(0.3)
            worker.resume()
            time.sleep(0.01)
            worker.suspend()
        worker.resume()


def test_two_flights_do_not_record_to_one_file(tmp_path: Path, told: list[str]) -> None:
    record = tmp_path / "flight.rrd"
    with viewing(ViewOptions(viewer=False, record=record), told) as view:
        for refuse in (check_recording, lambda place: RerunView(ViewOptions(viewer=False, record=place))):
            with pytest.raises(InputError, match="another flight is recording here"):
                refuse(record)
        assert view.wait_ready(30.0)
        fly(view, rows_of_a_conversion(0.2))
    assert view.failure is None
    check_recording(record)  # one recording may replace another
    assert sorted(path.name for path in tmp_path.iterdir()) == ["flight.rrd"]


@pytest.mark.parametrize("name", ["flight.rrd", "flight.partial.rrd"])
def test_what_is_no_recording_is_not_replaced(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("mine")
    with pytest.raises(InputError, match=f"{name}: something that is no recording is here"):
        RerunView(ViewOptions(viewer=False, record=tmp_path / "flight.rrd"))
    assert (tmp_path / name).read_text() == "mine"
    assert len(list(tmp_path.iterdir())) == 1


def test_a_further_run_leaves_alone_what_is_no_recording(tmp_path: Path, told: list[str]) -> None:
    (tmp_path / "flight-2.rrd").write_text("mine")
    rows = rows_of_a_conversion(0.2)
    with viewing(ViewOptions(viewer=False, record=tmp_path / "flight.rrd"), told) as view:
        assert view.wait_ready(30.0)
        fly(view, rows)
        fly(view, rows)
    assert (tmp_path / "flight-2.rrd").read_text() == "mine"
    assert (tmp_path / "flight-3.rrd").exists()


def test_a_long_recording_goes_on_in_another_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(streamer, "SPLIT_S", 0.0)
    options = ViewOptions(viewer=False, record=tmp_path / "flight.rrd")
    stream = streamer.Streamer(options, outline=OUTLINE, title="test", rate_hz=250.0, port=None)
    rows = rows_of_a_conversion(3.0)
    rows = np.hstack([rows, np.zeros((len(rows), ROW_WIDTH - rows.shape[1]))])
    stream.take(rows[:250])  # what is empty is not split
    stream.take(rows[250:500])
    assert (tmp_path / "flight.rrd").exists(), "the first part has its name already"
    stream.take(rows[500:])
    assert stream.close() == []
    speeds = []
    for name in ("flight", "flight-2", "flight-3"):
        speeds += [row[0] for row in values(tmp_path / f"{name}.rrd", "/plots/speed/kn", "Scalars:scalars")]
    assert speeds == rows[::5, COLUMN.airspeed_kt].tolist()


def test_a_missing_viewer_is_told_and_the_recording_goes_on(tmp_path: Path, told: list[str]) -> None:
    record = tmp_path / "flight.rrd"
    options = ViewOptions(viewer=True, record=record, viewer_command=("/nonexistent/viewer",))
    with viewing(options, told) as view:
        assert view.wait_ready(30.0)
        fly(view, rows_of_a_conversion(1.0))
    assert len(told) == 1
    assert "The viewer cannot be started" in told[0]
    assert len(values(record, "/plots/speed/kn", "Scalars:scalars")) == 50


@pytest.mark.parametrize(("code", "words"), [(0, "was closed"), (7, "could not show its window (exit code 7)")])
def test_a_viewer_that_ends_is_told(tmp_path: Path, told: list[str], code: int, words: str) -> None:
    command = (sys.executable, "-c", f"import sys, time; time.sleep(0.3); sys.exit({code})")
    with viewing(ViewOptions(viewer=True, viewer_command=command), told) as view:
        assert view.wait_ready(30.0)
        assert fly(view, rows_of_a_conversion(2.0)) < 1.5
    assert len(told) == 1
    assert words in told[0]


@pytest.mark.parametrize("close_viewer", [False, True])
def test_the_viewer_stays_open_unless_it_is_to_close(told: list[str], close_viewer: bool) -> None:
    options = ViewOptions(viewer=True, viewer_command=SLEEPER, close_viewer=close_viewer)
    with viewing(options, told) as view:
        assert view.wait_ready(30.0)
        viewer = psutil.Process(view._viewer_pid)
        assert viewer.cmdline()[-1].startswith("rerun+http://127.0.0.1:")
        fly(view, rows_of_a_conversion(0.2))
        start = time.monotonic()
        view.close()
        assert time.monotonic() - start < 3.0
    if close_viewer:
        assert not viewer.is_running()
    else:
        assert viewer.is_running()
        viewer.kill()
        viewer.wait(5.0)
    assert told == []


def test_only_the_loopback_interface_listens(told: list[str]) -> None:
    with viewing(ViewOptions(viewer=True, viewer_command=SLEEPER, close_viewer=True), told) as view:
        assert view.wait_ready(30.0)
        assert view._process is not None
        listening = [
            connection.laddr.ip
            for connection in psutil.Process(view._process.pid).net_connections()
            if connection.status == psutil.CONN_LISTEN
        ]
        assert listening == ["127.0.0.1"]


def test_a_viewer_that_never_reads_does_not_hold_up_the_flight(told: list[str], tmp_path: Path) -> None:
    # It connects like a viewer, then reads not a byte: what a frozen window does to the server.
    script = (
        "import socket, sys, time\n"
        "port = int(sys.argv[-1].split(':')[2].split('/')[0])\n"
        "link = socket.create_connection(('127.0.0.1', port))\n"
        "link.sendall(b'PRI * HTTP/2.0\\r\\n\\r\\nSM\\r\\n\\r\\n')\n"
        "time.sleep(600)\n"
    )
    record = tmp_path / "flight.rrd"
    options = ViewOptions(viewer=True, record=record, viewer_command=(sys.executable, "-c", script), close_viewer=True)
    with viewing(options, told) as view:
        assert view.wait_ready(30.0)
        assert fly(view, rows_of_a_conversion(2.0)) < 1.5
        start = time.monotonic()
        view.close()
        assert time.monotonic() - start < 3.5
    assert told == []
    assert len(values(record, "/plots/speed/kn", "Scalars:scalars")) == 100


def test_the_view_finishes_its_file_and_ends_when_the_flight_is_killed(tmp_path: Path) -> None:
    record = tmp_path / "flight.rrd"
    script = (
        "import sys, time\n"
        "from pathlib import Path\n"
        "from telemetry.view.view import RerunView\n"
        "from telemetry.view.options import ViewOptions\n"
        "view = RerunView(ViewOptions(viewer=False, record=Path(sys.argv[1])))\n"
        "assert view.wait_ready(30.0)\n"
        "print(view._process.pid, flush=True)\n"
        "time.sleep(600)\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script, str(record)],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=safe_environment(),
        text=True,
    ) as flight:
        assert flight.stdout is not None
        worker = psutil.Process(int(flight.stdout.readline()))
        flight.kill()
        flight.wait(10.0)
    worker.wait(10.0)
    assert record.exists()
    assert not partial_name(record).exists()


def test_a_recording_that_cannot_be_written_to_its_end_keeps_its_partial_name(tmp_path: Path, told: list[str]) -> None:
    # The kernel lets no file of the view grow beyond the limit: what a full disk does, without one.
    record = tmp_path / "flight.rrd"
    view = RerunView(ViewOptions(viewer=False, record=record), corridor=OUTLINE, on_message=told.append)
    assert view.wait_ready(30.0)
    assert view._process is not None
    psutil.Process(view._process.pid).rlimit(psutil.RLIMIT_FSIZE, (900_000, 900_000))
    fly(view, rows_of_a_conversion(4.0))
    view.close()
    assert view.failure is not None
    assert "the recording is incomplete" in str(view.failure)
    assert partial_name(record).exists()
    assert not record.exists()


def test_an_unwritable_recording_is_refused_before_the_flight(tmp_path: Path) -> None:
    for record in (tmp_path / "missing" / "flight.rrd", tmp_path):
        with pytest.raises(OutputError, match="cannot be written"):
            RerunView(ViewOptions(viewer=False, record=record))


def test_a_display_is_found_by_its_variables(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert not display_available()
    monkeypatch.setenv("WAYLAND_DISPLAY", "wayland-0")
    assert display_available()
