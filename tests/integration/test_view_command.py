"""``rtsim view``: one log or two in a recording, the difference in words, and every wrong input in one sentence."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr

from rtsim.cli import view as view_command
from rtsim.cli.main import run as run_command
from rtsim.errors import EXIT_BAD_INPUT, EXIT_OUTPUT_FAILED
from rtsim.frame import COLUMN, SIGNAL_COUNT
from telemetry.log.format import FlightMetadata, LogEvent
from telemetry.log.recorder import Recorder
from telemetry.view import options, viewer
from telemetry.view.overlay import Flight, differences

Make = Callable[..., Path]


def rows_of(seconds: float, rate: float, *, faster: float = 0.0, north: float = 0.0) -> np.ndarray:
    """A flight that speeds up by 10 kn/s and a little more."""
    rows = np.zeros((round(seconds * rate), SIGNAL_COUNT))
    rows[:, COLUMN.frame] = np.arange(len(rows))
    time_s = rows[:, COLUMN.time_s] = rows[:, COLUMN.frame] / rate
    rows[:, COLUMN.airspeed_kt] = (10.0 + faster) * time_s
    rows[:, COLUMN.nacelle_deg], rows[:, COLUMN.altitude_m] = 90.0, 50.0
    rows[:, COLUMN.north_m] = north
    return rows


@pytest.fixture(scope="module")
def make(tmp_path_factory: pytest.TempPathFactory) -> Make:
    """Logs by name, each written once."""
    folder = tmp_path_factory.mktemp("logs")

    def record(name: str, rows: np.ndarray, rate: float, *, event: str = "") -> Path:
        path = folder / f"{name}.parquet"
        if not path.exists():
            recorder = Recorder(path, FlightMetadata(name, "", "feed", 0, rate), live=False)
            if event:
                recorder.event(LogEvent(10, 10 / rate, "corridor", event, "warning"))
            recorder.push_block(rows)
            recorder.close({})
        return path

    return record


def run(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> tuple[int, str, str]:
    code = run_command(["view", *map(str, arguments)])
    out, err = capsys.readouterr()
    return code, out, err


def values(path: Path, entity: str, component: str) -> list[Any]:
    """All values of a component, in the order in which they were written."""
    found = []
    for chunk in rr.chunk.RrdReader(str(path)).stream().filter(content=entity):
        batch = chunk.to_record_batch()
        if component in batch.schema.names:
            found += batch.column(component).to_pylist()
    return found


def test_the_difference_is_taken_at_the_same_time_whatever_the_rates() -> None:
    first = Flight("a", rows_of(4.0, 50.0), 50.0)
    second = Flight("b", rows_of(3.0, 20.0, faster=2.0, north=30.0), 20.0)
    times, found = differences((first, second))
    assert times[0] == 0.0
    assert times[-1] <= second.times[-1]
    assert found["airspeed"] == pytest.approx(2.0 * times)
    assert found["apart"] == pytest.approx(30.0)
    assert found["nacelle"] == pytest.approx(0.0)
    swapped = differences((second, first))[1]
    assert swapped["airspeed"][-1] < 0.0, "it has a sign: the second less the first"


def test_two_logs_of_different_rates_are_laid_over_each_other(
    make: Make, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one = make("without", rows_of(2.0, 50.0), 50.0, event="corridor warning: near")
    two = make("with", rows_of(3.0, 20.0, faster=2.0, north=30.0), 20.0, event="stick protected")
    record = tmp_path / "both.rrd"
    code, out, _ = run(capsys, one, two, "--headless", "--record", record)
    assert code == 0
    assert "B with less A without at most, in 2.0 s: apart 30.0 m, airspeed +4.0 kn" in out
    curves = {letter: values(record, f"/compare/airspeed/{letter}", "Scalars:scalars") for letter in "ab"}
    assert [row[0] for row in curves["a"]] == pytest.approx((10.0 * np.arange(100) / 50.0).tolist())
    assert [row[0] for row in curves["b"]] == pytest.approx((12.0 * np.arange(60) / 20.0).tolist())
    names = [values(record, f"/compare/airspeed/{letter}", "SeriesLines:names")[0][0] for letter in "ab"]
    assert names == ["A without", "B with"]
    ghost = values(record, "/world/ghost", "Transform3D:translation")
    assert ghost[-1][0][0] == 30.0
    assert len(ghost) > 30, "it flies on after the first has landed"
    told = [entry[0] for entry in values(record, "/events/log", "TextLog:text")]
    assert told == ["A: corridor warning: near", "B: stick protected"]
    assert values(record, "/corridor/other_trail", "LineStrips2D:strips")
    assert not list(tmp_path.glob("*.partial.rrd"))


def test_one_log_is_shown_alone(make: Make, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one, record = make("one", rows_of(1.0, 50.0), 50.0), tmp_path / "one.rrd"
    code, out, _ = run(capsys, one, "--headless", "--record", record, "--json")
    assert code == 0
    answer = json.loads(out.splitlines()[-1])
    assert answer == {"logs": [str(one)], "recording": str(record), "difference": None}
    assert not values(record, "/world/ghost", "Transform3D:translation")
    assert len(values(record, "/world/aircraft", "Transform3D:translation")) >= 20


def test_what_cannot_be_shown_is_one_sentence(
    make: Make, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    one = make("one", rows_of(1.0, 50.0), 50.0)
    empty = make("empty", rows_of(0.0, 50.0), 50.0)
    (tmp_path / "text.rrd").write_text("no recording")
    record = ("--headless", "--record", tmp_path / "out.rrd")
    cases: tuple[tuple[tuple[str | Path, ...], int, str], ...] = (
        ((one, one, *record), EXIT_BAD_INPUT, "same log twice"),
        ((one, one.parent / ".." / one.parent.name / one.name, *record), EXIT_BAD_INPUT, "same log twice"),
        ((one, tmp_path / "none.parquet", *record), EXIT_BAD_INPUT, "does not exist"),
        ((one, tmp_path / "text.rrd", *record), EXIT_BAD_INPUT, "a flight log is a directory"),
        ((one, empty, *record), EXIT_BAD_INPUT, "no flight to show"),
        ((one, "--layout", "compare", *record), EXIT_BAD_INPUT, "two logs"),
        ((one, "--headless"), EXIT_BAD_INPUT, "--record"),
        ((one, "--headless", "--record", tmp_path / "text.rrd"), EXIT_BAD_INPUT, "no recording is here"),
        ((one, "--headless", "--record", tmp_path / "no" / "out.rrd"), EXIT_OUTPUT_FAILED, "rtsim: error:"),
    )
    for arguments, expected, words in cases:
        code, _, err = run(capsys, *arguments)
        assert code == expected, arguments
        assert words in err
        assert "Traceback" not in err
        assert not (tmp_path / "out.rrd").exists()
    monkeypatch.setattr(options, "display_available", lambda: False)
    code, _, err = run(capsys, one)
    assert code == EXIT_BAD_INPUT
    assert "no display" in err


@pytest.mark.parametrize(("ends", "code", "said"), [(0, 0, ""), (1, EXIT_OUTPUT_FAILED, "could not show its window")])
def test_the_viewer_is_waited_for(
    ends: int, code: int, said: str, make: Make, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[str] = []

    class Shown:
        """A viewer that is closed at once."""

        def __init__(self, _options: object, source: str) -> None:
            shown.append(source)
            assert Path(source).read_bytes().startswith(b"RRF"), "it is there while the viewer is open"

        def ended(self) -> int:
            return ends

    monkeypatch.setattr(options, "display_available", lambda: True)
    monkeypatch.setattr(viewer, "Viewer", Shown)
    monkeypatch.setattr(view_command.time, "sleep", lambda _: None)
    got, _, err = run(capsys, make("one", rows_of(1.0, 50.0), 50.0))
    assert got == code
    assert said in err
    assert len(shown) == 1
    assert not Path(shown[0]).exists(), "nothing is left behind"
