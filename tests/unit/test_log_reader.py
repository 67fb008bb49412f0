"""Reading and exporting logs: clear words for what is no log, exact values in every format."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.io import loadmat

from rtsim.errors import InputError, OutputError
from rtsim.frame import SIGNAL_COUNT
from telemetry.log.export import export_log
from telemetry.log.format import HEADER_PART, FlightMetadata, LogEvent
from telemetry.log.reader import FlightLog, read_log
from telemetry.log.recorder import Recorder

METADATA = FlightMetadata("hover", "", "hash", 0, 50.0, versions={"rtsim": "0.1.0"})


@pytest.fixture
def log(tmp_path: Path) -> FlightLog:
    rows = np.random.default_rng(3).normal(size=(60, SIGNAL_COUNT))
    recorder = Recorder(tmp_path / "flight.parquet", METADATA, live=False)
    recorder.event(LogEvent(0, 0.0, "start", "hover"))
    recorder.push_block(rows)
    recorder.close({"end_reason": "done"})
    return read_log(tmp_path / "flight.parquet")


def test_an_unknown_signal_is_answered_with_the_known_ones(log: FlightLog) -> None:
    with pytest.raises(InputError, match=r"no such signal.*airspeed_kt"):
        log["airspeed"]


def test_what_is_no_log_is_named(tmp_path: Path, log: FlightLog) -> None:
    with pytest.raises(InputError, match=r"does not exist.*record one with rtsim fly --log"):
        read_log(tmp_path / "nothing")
    file = tmp_path / "file.parquet"
    pq.write_table(pa.table({"a": [1]}), file)
    with pytest.raises(InputError, match="this is a file; a flight log is a directory"):
        read_log(file)
    directory = tmp_path / "empty"
    directory.mkdir()
    with pytest.raises(InputError, match="no flight log of rtsim"):
        read_log(directory)
    (directory / "_events.jsonl").write_text("")
    with pytest.raises(InputError, match="cut off before its first part"):
        read_log(directory)
    (log.path / "part-000001.parquet").write_bytes(b"damaged")
    with pytest.raises(InputError, match="damaged"):
        read_log(log.path)


def test_another_layout_is_refused(log: FlightLog) -> None:
    header = log.path / HEADER_PART
    table = pq.read_table(header)
    pq.write_table(table.replace_schema_metadata({**table.schema.metadata, b"rtsim.log_version": b"99"}), header)
    with pytest.raises(InputError, match=r"log_version.*'99'.*allowed: 1"):
        read_log(log.path)


def test_a_last_event_that_was_cut_off_is_left_out(log: FlightLog) -> None:
    events = log.path / "_events.jsonl"
    events.write_text(events.read_text() + '{"frame": 3, "time_')
    assert [event.kind for event in read_log(log.path).events] == ["start"]
    events.write_text('{"frame": 3}\n' + events.read_text())
    with pytest.raises(InputError, match=r"_events\.jsonl: line 1: is damaged, or no event"):
        read_log(log.path)


def test_signals_of_another_version_have_no_hash(log: FlightLog) -> None:
    for part in log.path.glob("part-*.parquet"):
        table = pq.read_table(part)
        names = ["renamed" if name == "stick" else name for name in table.column_names]
        pq.write_table(table.rename_columns(names).replace_schema_metadata(table.schema.metadata), part)
    other = read_log(log.path)
    assert len(other["renamed"]) == 60
    with pytest.raises(InputError, match=r"other signals.*0\.1\.0"):
        other.history_sha256()


def test_csv_holds_every_digit(log: FlightLog, tmp_path: Path) -> None:
    target = tmp_path / "flight.csv"
    export_log(log, target)
    lines = target.read_text().splitlines()
    assert tuple(lines[0].split(",")) == log.names
    values = np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])
    assert np.array_equal(values, log.rows, equal_nan=True)


def test_mat_holds_signals_units_and_metadata(log: FlightLog, tmp_path: Path) -> None:
    target = tmp_path / "flight.mat"
    export_log(log, target)
    content = loadmat(target, simplify_cells=True)
    assert np.array_equal(content["airspeed_kt"], log["airspeed_kt"])
    assert content["units"]["airspeed_kt"] == "kn"
    assert json.loads(content["metadata"])["scenario_name"] == "hover"
    assert json.loads(content["summary"]) == {"end_reason": "done"}


def test_export_refuses_other_endings_and_tells_of_unwritable_places(log: FlightLog, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"allowed: \*\.csv or \*\.mat"):
        export_log(log, tmp_path / "flight.xlsx")
    with pytest.raises(OutputError, match="cannot be written"):
        export_log(log, tmp_path / "missing" / "flight.csv")
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["flight.parquet"]
