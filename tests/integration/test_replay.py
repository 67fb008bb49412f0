"""Replays: recorded commands give the recorded history; a changed log is found out, to the frame and signal."""

from __future__ import annotations

import json
from collections import deque
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

import scenarios
from rtsim.arrays import FloatArray
from rtsim.cli.main import run
from rtsim.errors import InputError
from rtsim.frame import COLUMN, SIGNAL_COUNT
from rtsim.realtime.control import FlightControl
from scenarios.files.options import Overrides
from scenarios.flight.replay import first_difference, replay_log
from scenarios.flight.runner import FlightOutputs

OWN_PILOT = """
import math
from rtsim.command import Command

class Weaving:
    def step(self, sensors, reference, dt):
        lever = 0.6 - 0.01 * math.cos(3.0 * sensors.time)
        return Command(0.05 * math.sin(sensors.time), lever, 0.1 * reference.nacelle_rate / 3.0)
"""


def recorded(path: Path, name: str = "typical_conversion", **changes: Any) -> scenarios.FlightRecord:
    """Fly three seconds as fast as possible with a log."""
    overrides = Overrides(**{"duration": 3.0, **changes})
    flight = scenarios.fly(name, speed="max", overrides=overrides, outputs=FlightOutputs(log=path))
    assert flight.failure is None
    return flight


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"plant": "nonlinear"},
        {"plant": "lpv-plain", "outer_loop": "pi"},
        {"pilot_noise": True, "seed": 7},
        {"wind": 5.0, "rate_hz": 100, "corridor": "flight", "protection": "off"},
    ],
)
def test_a_replay_has_the_same_history(tmp_path: Path, changes: dict[str, Any]) -> None:
    flight = recorded(tmp_path / "a.parquet", **changes)
    result = replay_log(tmp_path / "a.parquet")
    assert result.same
    assert result.difference is None
    assert result.replayed_sha256 == result.recorded_sha256 == result.stated_sha256 == flight.history_sha256
    assert result.rows == len(flight.rows)
    assert result.complete
    assert result.changed_versions == ()


def test_a_pilot_of_ones_own_is_not_needed_to_replay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "weaving_pilot.py").write_text(OWN_PILOT, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    flight = recorded(tmp_path / "a.parquet", pilot="weaving_pilot:Weaving")
    (tmp_path / "weaving_pilot.py").unlink()
    assert np.ptp(flight["pilot_nacelle_rate_rad_s"]) > 0.0
    assert replay_log(tmp_path / "a.parquet").same


def test_resets_and_hand_overs_are_replayed(tmp_path: Path) -> None:
    control = FlightControl()
    control.step(150)
    script = deque(
        [
            lambda: (control.set_pilot("hold"), control.step(150)),
            lambda: (control.set_pilot("mocm"), control.step(100)),
            lambda: (control.reset(), control.resume()),
        ]
    )

    def next_act(_row: FloatArray) -> None:
        if script:
            script.popleft()()

    outputs = FlightOutputs(log=tmp_path / "a.parquet", on_rows=next_act)
    flight = scenarios.fly(
        "typical_conversion", speed="max", overrides=Overrides(duration=2.0), control=control, outputs=outputs
    )
    assert [event.kind for event in flight.events][:3] == ["pilot", "pilot", "reset"]
    assert len(flight.rows) == 900
    assert replay_log(tmp_path / "a.parquet").same


def changed_value(log: Path, *, row: int, signal: str, value: float) -> None:
    """Change one value of a log's second second."""
    part = log / "part-000002.parquet"
    table = pq.read_table(part)
    values = table[signal].to_numpy().copy()
    values[row - 250] = value
    index = table.column_names.index(signal)
    pq.write_table(table.set_column(index, table.schema.field(index), [values]), part)


def test_a_changed_history_is_found_to_the_frame_and_signal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recorded(tmp_path / "a.parquet")
    changed_value(tmp_path / "a.parquet", row=300, signal="pitch_deg", value=1.25)
    assert run(["replay", str(tmp_path / "a.parquet"), "--json"]) == 1
    output = capsys.readouterr()
    answer = json.loads(output.out.splitlines()[-1])
    assert answer["same"] is False
    assert (answer["difference"]["frame"], answer["difference"]["signal"]) == (300, "pitch_deg")
    assert answer["difference"]["recorded"] == 1.25
    assert answer["recorded_sha256"] != answer["replayed_sha256"] == answer["stated_sha256"]
    assert "damaged or edited" in output.err
    assert run(["replay", str(tmp_path / "a.parquet")]) == 1
    assert "Different from frame 300" in capsys.readouterr().out


def test_a_changed_command_changes_what_follows(tmp_path: Path) -> None:
    recorded(tmp_path / "a.parquet")
    changed_value(tmp_path / "a.parquet", row=300, signal="pilot_stick", value=0.5)
    difference = replay_log(tmp_path / "a.parquet").difference
    assert difference is not None
    assert (difference.frame, difference.signal) == (300, "stick")  # the applied stick of that frame is as recorded


def test_a_cut_off_log_is_replayed_as_far_as_it_goes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recorded(tmp_path / "a.parquet")
    header = tmp_path / "a.parquet" / "part-000000.parquet"
    metadata = dict(pq.read_schema(header).metadata)
    del metadata[b"rtsim.summary"]
    pq.write_table(pq.read_table(header).replace_schema_metadata(metadata), header)
    (tmp_path / "a.parquet" / "part-000003.parquet").unlink()
    assert run(["replay", str(tmp_path / "a.parquet")]) == 0
    output = capsys.readouterr()
    assert "cut off" in output.err
    assert "500 frames" in output.out


def test_what_is_no_log_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        replay_log(tmp_path / "none.parquet")
    assert run(["replay", str(tmp_path)]) == 2


def test_differences_are_of_bits() -> None:
    one = np.zeros((4, SIGNAL_COUNT))
    one[:, COLUMN.frame] = np.arange(4)
    one[2, COLUMN.stick] = np.nan
    assert first_difference(one, one.copy()) is None
    other = one.copy()
    other[3, COLUMN.lever], other[2, COLUMN.altitude_m] = 1.0, -0.0
    found = first_difference(one, other)
    assert found is not None
    assert (found.row, found.signal) == (2, "altitude_m")
    short = first_difference(one, one[:3])
    assert short is not None
    assert (short.row, short.frame) == (3, 3)
