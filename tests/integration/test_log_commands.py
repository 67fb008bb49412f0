"""``rtsim plot``, ``rtsim log info`` and ``rtsim log export`` as a user calls them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from rtsim.cli.main import run as run_command
from rtsim.errors import EXIT_BAD_INPUT, EXIT_OUTPUT_FAILED
from rtsim.frame import COLUMN, SIGNAL_COUNT, history_sha256
from telemetry.log.format import FlightMetadata, LogEvent
from telemetry.log.recorder import Recorder


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    code = run_command(list(arguments))
    out, err = capsys.readouterr()
    return code, out, err


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "flight.parquet"
    rows = np.zeros((120, SIGNAL_COUNT))
    rows[:, COLUMN.frame] = np.arange(120)
    rows[:, COLUMN.time_s] = np.arange(120) / 50.0
    rows[:, COLUMN.airspeed_kt] = np.linspace(0.0, 100.0, 120)
    metadata = FlightMetadata("hover", "", "feed" * 16, 3, 50.0, versions={"rtsim": "0.1.0"})
    recorder = Recorder(path, metadata, live=False)
    recorder.event(LogEvent(0, 0.0, "start", "the flight begins"))
    recorder.push_block(rows)
    recorder.close({"end_reason": "the programme is flown", "history_sha256": history_sha256([rows])})
    return path


def test_info_as_json_says_everything(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "log", "info", str(log), "--json")
    info = json.loads(out.splitlines()[-1])
    assert code == 0
    assert info["frames"] == 120
    assert info["duration_s"] == pytest.approx(2.4)
    assert info["complete"] is True
    assert info["hash_matches"] is True
    assert info["seed"] == 3
    assert info["signals"][2] == {"name": "airspeed_kt", "unit": "kn"}
    assert info["events"][0]["text"] == "the flight begins"


def test_info_for_people_names_a_damaged_log(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "log", "info", str(log))
    assert code == 0
    assert "(as stated)" in out
    assert "the flight begins" in out
    part = log / "part-000001.parquet"
    table = pq.read_table(part)
    pq.write_table(table.slice(0, 49), part)
    code, out, _ = run(capsys, "log", "info", str(log))
    assert "NOT as stated" in out


def test_export_writes_what_the_ending_says(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "flight.csv"
    code, out, _ = run(capsys, "log", "export", str(log), str(target), "--json")
    assert code == 0
    assert json.loads(out)["frames"] == 120
    assert len(target.read_text().splitlines()) == 121
    code, _, err = run(capsys, "log", "export", str(log), str(tmp_path / "flight.doc"))
    assert code == EXIT_BAD_INPUT
    assert "*.csv or *.mat" in err
    code, _, err = run(capsys, "log", "export", str(log), str(tmp_path / "missing" / "flight.csv"))
    assert code == EXIT_OUTPUT_FAILED
    assert err.startswith("rtsim: error:")


def test_plot_draws_beside_the_log_or_elsewhere(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "plot", str(log), "--json")
    assert code == 0
    assert (tmp_path / "flight-plots" / "corridor.svg").is_file()
    assert str(tmp_path / "flight-plots" / "margins.png") in json.loads(out)["files"]
    code, out, _ = run(capsys, "plot", str(log), "--out", str(tmp_path / "elsewhere"))
    assert code == 0
    assert str(tmp_path / "elsewhere" / "flight.png") in out


@pytest.mark.parametrize("command", [("log", "info"), ("plot",)])
def test_what_is_no_log_is_one_sentence(
    command: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, err = run(capsys, *command, str(tmp_path / "nothing.parquet"))
    assert code == EXIT_BAD_INPUT
    assert out == ""
    assert err.startswith("rtsim: error:")
    assert "does not exist" in err
    assert "Traceback" not in err
