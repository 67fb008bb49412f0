"""``rtsim plot``, ``rtsim log info`` and ``rtsim log export`` as a user calls them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from rtsim.cli.logged_properties import stated_properties
from rtsim.cli.main import run as run_command
from rtsim.errors import EXIT_BAD_INPUT, EXIT_OUTPUT_FAILED
from rtsim.frame import COLUMN, SIGNAL_COUNT, history_sha256
from telemetry.log.format import FlightMetadata, LogEvent
from telemetry.log.reader import read_log
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


ASKED = """
[[expect]]
property = "always (airspeed_kt < 90)"
[[trial.expect]]
property = "always (airspeed_kt < twin_airspeed_kt + 5)"
"""


def test_plot_says_how_a_flight_stands_to_properties(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Airspeed rises evenly to 100 kn in 119 frames: 80 kn are passed by 20 kn, in the last frame."""
    code, out, _ = run(capsys, "plot", str(log), "--property", "always (airspeed_kt < 80)", "--json")
    assert code == 0
    stated = json.loads(out)
    assert str(tmp_path / "flight-plots" / "properties.svg") in stated["files"]
    (one,) = stated["properties"]
    assert (one["robustness"], one["unit"], one["broken"]) == (pytest.approx(-20.0), "kn", True)
    assert one["decided_at_s"] == pytest.approx(119 / 50.0)
    code, out, _ = run(capsys, "plot", str(log), "--property", "always (airspeed_kt < 101)")
    assert "always (airspeed_kt < 101): +1 kn" in out
    # What the scenario asks is drawn, as far as a log can answer: the twin was not recorded.
    kept = read_log(log)
    monkeypatch.setattr(
        "telemetry.log.reader.read_log", lambda _: replace(kept, metadata=replace(kept.metadata, scenario_toml=ASKED))
    )
    code, out, _ = run(capsys, "plot", str(log), "--json")
    assert [one["robustness"] for one in json.loads(out)["properties"]] == [pytest.approx(-10.0)]


@pytest.mark.parametrize("text", ["expect = 3", "trial = 1", "[[expect]]\nproperty = 5", "[[expect]]", "= broken"])
def test_a_scenario_that_asks_nonsense_is_asked_nothing(log: Path, text: str) -> None:
    kept = read_log(log)
    assert stated_properties(replace(kept, metadata=replace(kept.metadata, scenario_toml=text)), None) == []


def test_what_a_log_cannot_answer_is_one_sentence(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for formula, words in (
        ("always (twin_margin_kt > 0)", "twin_margin_kt, which this log does not hold"),
        ("flapping_over_s <= 0", "flapping_over_s, which this log does not hold"),
        ("always (margin > 0)", "margin"),
    ):
        code, _, err = run(capsys, "plot", str(log), "--property", formula)
        assert code == EXIT_BAD_INPUT
        assert words in err
        assert "Traceback" not in err


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
