"""Pictures of a recorded flight: every file whole, and showing what the log holds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread

from rtsim.arrays import FloatArray
from rtsim.errors import InputError, OutputError
from rtsim.frame import COLUMN, SIGNAL_COUNT
from telemetry.exchange.ring import TIMING_COUNT
from telemetry.log import flight_plots, track_plot
from telemetry.log.corridor_outline import CorridorOutline
from telemetry.log.flight_plots import plot_flight
from telemetry.log.format import FlightMetadata
from telemetry.log.reader import FlightLog, read_log
from telemetry.log.recorder import Recorder
from telemetry.log.signal_groups import label

OUTLINE = CorridorOutline.from_lines("design", low=([90.0, 0.0], [0.0, 101.0]), high=([90.0, 0.0], [125.0, 170.0]))


def record(path: Path, frames: int, *, timed: bool, change: Callable[[FloatArray], None] | None = None) -> FlightLog:
    rows = np.zeros((frames, SIGNAL_COUNT))
    rows[:, COLUMN.time_s] = np.arange(frames) / 50.0
    rows[:, COLUMN.airspeed_kt] = np.linspace(0.0, 170.0, frames)
    rows[:, COLUMN.nacelle_deg] = np.linspace(90.0, 0.0, frames)
    if change is not None:
        change(rows)
    recorder = Recorder(path, FlightMetadata("hover <& more>", "", "h", 0, 50.0, corridor=OUTLINE), live=False)
    for row in rows:
        recorder.push(row, np.full(TIMING_COUNT, 7.0) if timed else None)
    recorder.close({})
    return read_log(path)


def test_every_picture_is_there_whole_and_in_both_formats(tmp_path: Path) -> None:
    log = record(tmp_path / "flight.parquet", 300, timed=True)
    out = tmp_path / "pictures" / "here"
    files = plot_flight(log, out)
    names = ("corridor", "flight", "controls", "flapping", "margins", "signals", "timing")
    assert [file.name for file in files] == [f"{name}.{ending}" for name in names for ending in ("svg", "png")]
    assert sorted(out.iterdir()) == sorted(files), "no temporary file is left"
    for file in files:
        if file.suffix == ".svg":
            assert ET.parse(file).getroot().tag.endswith("svg")
        else:
            picture = imread(file)
            assert picture.shape[0] > 500
            assert picture.std() > 0.02, "an empty picture"


def test_the_corridor_picture_shows_boundaries_and_path(tmp_path: Path) -> None:
    log = record(tmp_path / "flight.parquet", 100, timed=False)
    figure = Figure()
    flight_plots._draw_corridor(log, figure)
    lines = {str(line.get_label()): line.get_xydata() for line in figure.axes[0].get_lines()}
    assert np.array_equal(lines["flown"][:, 0], log["airspeed_kt"])
    assert np.array_equal(lines["flown"][:, 1], log["nacelle_deg"])
    assert lines["low-speed boundary"].tolist() == [[0.0, 90.0], [101.0, 0.0]]
    assert lines["high-speed boundary"].tolist() == [[125.0, 90.0], [170.0, 0.0]]


def test_every_signal_is_in_one_of_the_plots_with_its_unit(tmp_path: Path) -> None:
    log = record(tmp_path / "flight.parquet", 100, timed=False)
    figure = Figure()
    flight_plots._draw_all_signals(log, figure)
    name_of = {label(name, unit=False): name for name in log.names}
    shown = {name_of[str(line.get_label())] for axes in figure.axes for line in axes.get_lines()}
    states = {"frame", "time_s", "corridor_level", "on_downstop", "control_on_stop", "pilot_mode"}
    assert shown | states == set(log.names[:SIGNAL_COUNT])
    for axes in figure.axes:
        assert "[" in axes.get_title(loc="left") + axes.get_ylabel() or not axes.get_visible()


def test_the_controls_are_shaded_while_protection_acts(tmp_path: Path) -> None:
    def act(rows: FloatArray) -> None:
        rows[20:30, COLUMN.protection_lever_reason] = rows[90:, COLUMN.protection_lever_reason] = 7.0

    log = record(tmp_path / "flight.parquet", 100, timed=False, change=act)
    axes = Figure().subplots()
    flight_plots._shade_protection(axes, log, "protection_stick_reason")
    assert not axes.patches
    flight_plots._shade_protection(axes, log, "protection_lever_reason")
    spans = [(patch.get_x(), patch.get_x() + patch.get_width()) for patch in axes.patches]
    assert np.allclose(spans, [(0.4, 0.6), (1.8, 1.98)])
    assert axes.get_legend_handles_labels()[1] == ["protection acts"]


@pytest.mark.parametrize("moved", ["", "lateral_stick", "pilot_pedal"])
def test_lateral_stick_and_pedals_are_drawn_where_they_were_used(tmp_path: Path, moved: str) -> None:
    def move(rows: FloatArray) -> None:
        if moved:
            rows[50:, getattr(COLUMN, moved)] = 0.4

    figure = Figure()
    flight_plots._draw_controls(record(tmp_path / "flight.parquet", 100, timed=False, change=move), figure)
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert len(titles) == (6 if moved else 4)
    if moved:
        assert titles[-2:] == ["Lateral stick, 1 is full right", "Pedals, 1 is full right"]
        assert figure.axes[-1].get_ylabel() == "share of travel"


def turn(rows: FloatArray) -> None:
    """A right turn at 10 deg/s and 20 m/s from north, on through north again, in an east wind."""
    time = rows[:, COLUMN.time_s]
    heading = np.radians(350.0 + 10.0 * time)
    rows[:, COLUMN.heading_deg] = rows[:, COLUMN.track_deg] = np.degrees(heading) % 360.0
    rows[:, COLUMN.turn_rate_deg_s], rows[:, COLUMN.bank_deg] = 10.0, 19.0
    rows[:, COLUMN.north_m] = 20.0 / np.radians(10.0) * (np.sin(heading) - np.sin(heading[0]))
    rows[:, COLUMN.east_m] = -20.0 / np.radians(10.0) * (np.cos(heading) - np.cos(heading[0]))
    rows[:, COLUMN.wind_east_m_s] = -5.0
    rows[:, COLUMN.flapping_right_deg], rows[:, COLUMN.mast_torque_left_inlb] = 3.0, 7e4


def test_a_turn_is_drawn_from_above_with_headings_and_wind(tmp_path: Path) -> None:
    log = record(tmp_path / "flight.parquet", 500, timed=False, change=turn)
    assert [name for name, _, _ in flight_plots._pictures(log)][-2:] == ["track", "course"]
    figure = Figure()
    track_plot.draw_track(log, figure)
    axes = figure.axes[0]
    track, *planes = (line.get_xydata() for line in axes.get_lines())
    assert np.array_equal(track, np.stack([log["east_m"], log["north_m"]], 1))
    assert axes.get_xlim()[0] < track[:, 0].min()
    assert axes.get_ylim()[1] > track[:, 1].max()
    bodies = planes[::3]
    marks = [text.get_text() for text in axes.texts if text.get_text().endswith(" s")]
    assert len(bodies) == len(marks) == 5
    for body, second in zip(bodies, (0.0, 2.0, 4.0, 6.0, 8.0), strict=True):
        east, north = body[1] - body[0]
        assert np.degrees(np.arctan2(east, north)) % 360.0 == pytest.approx((350.0 + 10.0 * second) % 360.0, abs=0.5)
    assert axes.texts[-1].get_text() == "wind 090/10 kn"


def test_the_heading_has_no_line_across_the_plot_at_north(tmp_path: Path) -> None:
    log = record(tmp_path / "flight.parquet", 500, timed=False, change=turn)
    figure = Figure()
    flight_plots._draw_panels(log, figure, flight_plots._COURSE)
    heading = figure.axes[1].get_lines()[0].get_ydata()
    assert np.isnan(heading).sum() == 1
    assert np.nanmax(np.abs(np.diff(heading))) < 1.0


def test_both_rotors_are_drawn_where_they_differ(tmp_path: Path) -> None:
    for name, change, panels in (("turn", turn, 5), ("straight", None, 4)):
        figure = Figure()
        flight_plots._draw_rotors(record(tmp_path / f"{name}.parquet", 60, timed=False, change=change), figure)
        assert len(figure.axes) == panels
        shown = {str(line.get_label()): line.get_ydata()[0] for axes in figure.axes for line in axes.get_lines()}
        if change is not None:
            assert shown["flapping right"] == 3.0
            assert shown["mast torque left"] == 7e4


def test_marks_that_would_cover_one_another_become_one(tmp_path: Path) -> None:
    def stop(rows: FloatArray) -> None:
        for column in (COLUMN.airspeed_kt, COLUMN.nacelle_deg):
            rows[200:, column] = rows[200, column]

    log = record(tmp_path / "flight.parquet", 400, timed=False, change=stop)
    figure = Figure()
    flight_plots._draw_corridor(log, figure)
    told = [text.get_text() for text in figure.axes[0].texts]
    assert told == ["0 s", "1 s", "2 s", "3 s", "4 to 7 s"]


def test_a_path_out_and_back_keeps_both_times_apart() -> None:
    time = np.arange(0.0, 40.01, 0.1)
    way = np.concatenate([np.linspace(0.0, 200.0, 201), np.linspace(199.0, 0.0, 200)])
    marks = [words for _, words in track_plot.marked(time, (way, way), (5.0, 5.0))]
    assert marks == ["0, 40 s", "5, 35 s", "10, 30 s", "15, 25 s", "20 s"]
    assert track_plot._in_words([0.0, 5.0, 10.0, 30.0, 35.0], 5.0) == "0 to 10, 30 to 35 s"


def test_the_title_says_what_was_flown_by_whom_with_what(tmp_path: Path) -> None:
    log = record(tmp_path / "flight.parquet", 60, timed=False)
    assert flight_plots.flight_title(log) == ("hover <& more>", "hover <& more>   seed 0   flight.parquet")
    setup = {"flight": {"options": {"pilot": "mocm", "protection": "full", "corridor": None}}}
    told = replace(log, metadata=replace(log.metadata, scenario_toml='title = "A hover"', setup=setup, seed=7))
    title, below = flight_plots.flight_title(told)
    assert title == "A hover"
    assert below == "hover <& more>   pilot mocm   protection full   seed 7   flight.parquet"
    damaged = replace(log, metadata=replace(log.metadata, scenario_toml="title =", setup={"flight": 3}))
    assert flight_plots.flight_title(damaged)[0] == "hover <& more>"


def test_the_margin_hides_neither_side(tmp_path: Path) -> None:
    figure = Figure()
    flight_plots._draw_margins(record(tmp_path / "flight.parquet", 60, timed=False), figure)
    wide, *sides = figure.axes[0].get_lines()
    assert [line.get_label() for line in sides] == ["margin low", "margin high"], "drawn after it, so above it"
    assert wide.get_alpha() < 0.5
    assert wide.get_linewidth() > 2.0 * sides[0].get_linewidth()


def test_drawing_tells_how_far_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = record(tmp_path / "flight.parquet", 60, timed=False)
    monkeypatch.setattr(flight_plots, "_write", lambda *_, **__: [])
    told: list[tuple[float, str]] = []
    plot_flight(log, tmp_path / "out", on_progress=lambda share, words: told.append((share, words)))
    assert sum(share for share, _ in told) == pytest.approx(1.0)
    assert [words for _, words in told][:2] == ["Drawing corridor", "Drawing flight"]


def test_an_unpaced_flight_has_no_timing_picture(tmp_path: Path) -> None:
    names = [name for name, _, _ in flight_plots._pictures(record(tmp_path / "flight.parquet", 60, timed=False))]
    assert names == ["corridor", "flight", "controls", "flapping", "margins", "signals"]


def test_a_flight_without_frames_and_a_place_without_rights_are_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no flight to draw"):
        plot_flight(record(tmp_path / "empty.parquet", 0, timed=False), tmp_path / "out")
    (tmp_path / "file").write_text("no directory")
    with pytest.raises(OutputError, match="cannot be made"):
        plot_flight(record(tmp_path / "flight.parquet", 60, timed=False), tmp_path / "file" / "out")
