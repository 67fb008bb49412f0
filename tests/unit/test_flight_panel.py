"""What the terminal shows while a flight goes on."""

from __future__ import annotations

import io
import re
import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rtsim.arrays import FloatArray
from rtsim.cli import flight_screen
from rtsim.cli.flight_panel import Alarms, Line, Pace, how_fast, panel, who_flies
from rtsim.cli.flight_screen import FlightScreen
from rtsim.cli.flight_text import loop_line
from rtsim.frame import COLUMN, SIGNAL_COUNT
from rtsim.realtime.control import FlightControl
from rtsim.realtime.report import Spread, TimingReport
from telemetry.log.format import LogEvent


def some_row() -> FloatArray:
    row = np.zeros(SIGNAL_COUNT)
    row[COLUMN.time_s], row[COLUMN.airspeed_kt], row[COLUMN.altitude_m] = 1234.5, -188.8, 1234.5
    row[COLUMN.margin_low_kt], row[COLUMN.heading_deg], row[COLUMN.bank_deg] = -12.3, 359.6, -30.0
    return row


@pytest.mark.parametrize("width", [20, 40, 80, 200])
def test_the_panel_says_what_has_room_and_never_wraps(width: int) -> None:
    row = some_row()
    who = who_flies(row, external="you", protection="monitor")
    lines = [line.text(width) for line in panel(row, FlightControl(), pace=None, duration_s=1300.0, who=who)]
    assert all(len(line) < width for line in lines), "the last column would begin another line"
    assert lines[0].startswith("1234.5 of 1300 s")
    assert ("1x   MOCM flies, protection monitor" in lines[0]) == (width >= 80)
    assert ("bank -30 deg   1234 m    +0.0 m/s   heading 000" in lines[1]) == (width >= 80)
    assert lines[2].startswith("margins: -12 kn low"[: width - 1])


def test_who_flies_is_told_with_what_the_protection_holds() -> None:
    row = some_row()
    row[COLUMN.pilot_mode], row[COLUMN.protection_nacelle_reason] = 1.0, 3.0
    assert who_flies(row, external="you", protection="full") == "you fly, full holds nacelles"
    assert who_flies(row, external="Mine", protection="full") == "Mine flies, full holds nacelles"


def test_the_speed_that_is_shown_is_the_one_that_is_flown() -> None:
    control, pace = FlightControl(), Pace()
    assert how_fast(control, pace.of(0.0, 0.0)) == "1x"
    seen = [pace.of(0.25 * step, 0.75 * 0.25 * step) for step in range(1, 9)]
    control.behind_s = 173.97
    assert how_fast(control, seen[-1]) == "0.75x of 1x, 174.0 s behind"
    assert pace.of(2.5, 0.0) is None, "a reset begins anew"
    control.paused = True
    assert how_fast(control, 0.0) == "paused"


def test_alarms_stand_worst_first_and_then_in_the_order_in_which_they_came() -> None:
    alarms = Alarms()
    assert alarms.line() == Line(("no warnings",))
    for text, level, kind in (
        ("rotor endurance caution: 0.4 % beyond the limit", "caution", "limit"),
        ("mast torque warning: 2.5 % left", "warning", "limit"),
        ("corridor warning: 3.7 kn from the high-speed side at 149 kn, nacelle 62 deg", "warning", "corridor"),
        ("mast torque exceedance: 0.5 % beyond the limit", "exceedance", "limit"),
        ("engine power exceedance: 0.5 % beyond the limit", "exceedance", "limit"),
    ):
        alarms.take(LogEvent(0, 0.0, kind, text, level, {"limit": text}))
    assert alarms.line().parts == (
        "exceedance: mast torque, engine power",
        "warning: corridor",
        "caution: rotor endurance",
    )
    assert alarms.line().style == "bold red"
    alarms.take(LogEvent(0, 0.0, "limit", "mast torque clear again", "info", {}))
    assert alarms.line().parts[0] == "exceedance: engine power"
    alarms.take(LogEvent(0, 0.0, "reset", "the flight starts again"))
    assert alarms.line().parts == ("no warnings",)


class Terminal(io.StringIO):
    """A terminal that keeps what it is sent."""

    def isatty(self) -> bool:
        return True

    def fileno(self) -> int:
        return 2


def seen_on(text: str) -> list[str]:
    """What a screen shows of it, for the few controls that are used."""
    screen, line = [""], 0
    for piece in re.findall(r"\x1b\[\d*[A-Zm]|\x1b\[[\d;]*m|\r|\n|[^\x1b\r\n]+", text):
        if piece == "\n":
            line += 1
            screen += [""] * (line + 1 - len(screen))
        elif piece.endswith("A") and piece.startswith("\x1b"):
            line -= int(piece[2:-1])
        elif piece == "\x1b[J":
            screen[line:] = [""]
        elif not piece.startswith("\x1b") and piece != "\r":
            screen[line] = piece
    return screen


@pytest.fixture
def scenario() -> Any:
    options = SimpleNamespace(pilot="mocm", protection="monitor")
    return SimpleNamespace(name="turn", duration=60.0, options=options)


def test_events_stand_above_the_panel_which_stays_where_it_is(scenario: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("COLUMNS", "80")
    screen = FlightScreen(scenario, FlightControl(), paced=True, by_hand=False)
    screen.on_rows(some_row())
    screen._draw_panel(some_row())
    screen._draw_panel(some_row())
    assert len(seen_on(terminal.getvalue())) == 4
    screen.on_event(LogEvent(250, 1.0, "limit", "mast torque warning: 2.5 % left", "warning", {}))
    screen.say("The view died.")
    screen._clear_panel()
    screen._tell_news()
    screen._draw_panel(some_row())
    shown = seen_on(terminal.getvalue())
    assert shown[0].strip() == "1.00 s  mast torque warning: 2.5 % left"
    assert shown[1] == "The view died."
    assert [line.split("   ")[0] for line in shown[2:]] == [
        "1234.5 of 60 s",
        "-188.8 kn",
        "margins: -12 kn low side, 0 kn high side",
        "warning: mast torque",
    ]


def test_a_terminal_that_cannot_move_its_cursor_gets_no_panel(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setattr(flight_screen, "in_foreground", lambda *_, **__: True)
    monkeypatch.setenv("TERM", "xterm")
    assert flight_screen._takes_panel()
    monkeypatch.setenv("TERM", "dumb")
    monkeypatch.setattr(sys, "stderr", Terminal())
    assert not flight_screen._takes_panel()


def test_a_pipe_gets_lines_without_controls(
    scenario: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(flight_screen, "PERIOD_S", 0.001)
    screen = FlightScreen(scenario, FlightControl(), paced=True, by_hand=False)
    with screen.running():
        screen.on_rows(some_row())
        for number in range(50):
            screen.on_event(LogEvent(number, number / 250.0, "limit", f"limit {number} warning", "warning", {}))
    told = capsys.readouterr().err
    assert "\x1b" not in told
    assert "\r" not in told
    assert len(told.splitlines()) == flight_screen.MAX_EVENT_LINES + 1
    assert told.splitlines()[0].strip() == "0.00 s  limit 0 warning"


def test_times_of_the_loop_have_a_unit_that_suits_them() -> None:
    late, work = Spread(40.6, 12006.0, 173966944.9), Spread(300.0, 4718.0, 5000.0)
    report = TimingReport(
        frames=1000,
        duration_s=4.0,
        wall_s=7.0,
        paused_s=0.0,
        overruns=131,
        overrun_frames=(),
        lateness_us=late,
        work_us=work,
        work_cpu_us=work,
        drift_frames=750.0,
        ending="finished",
        end_reason="flown",
    )
    line = loop_line(report)
    assert line is not None
    assert "41 us (median), 12 ms (99 %), 174.0 s (most)" in line
    assert "131 overruns; 3.0 s lost" in line
