"""What ``rtsim fly`` says to people on stderr: status line, progress bar, events, summary."""

from __future__ import annotations

import math
import shutil
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rtsim.aircraft.condition import SHIPPED
from rtsim.cli.output import console, progress

if TYPE_CHECKING:
    from rtsim.arrays import FloatArray
    from rtsim.realtime.control import FlightControl
    from scenarios.files.scenario import Scenario
    from scenarios.flight.result import FlightRecord, Verdict
    from telemetry.log.format import LogEvent

STATUS_PERIOD_S = 0.25
"""Time between two status lines [s]."""
MAX_EVENT_LINES = 40
"""Events told while flying; a flight along a boundary has more than anyone reads."""
_CONTROLS = ("stick", "lever", "nacelles", "lateral stick", "pedals")
_CORRIDOR_LIMITS = {"stall_attitude", "load_torque", "downstop_gate", "consistency", "time_to_limit"}
"""What the line of the corridor says."""
_STYLES = {"caution": "yellow", "warning": "bold yellow", "exceedance": "bold red"}


class FlightScreen:
    """Status and events of a running flight. The loop only leaves values here; another thread prints them."""

    def __init__(self, scenario: Scenario, control: FlightControl, *, paced: bool) -> None:
        """Prepare.

        Args:
            control: Tells whether the flight is paused, and its speed.
            paced: Whether it is flown on the wall clock.
        """
        self.first_frame_s: float | None = None
        """How long after the command the first frame began [s]."""
        self._scenario, self._control, self._paced = scenario, control, paced
        self._row: FloatArray | None = None
        self._events: deque[LogEvent] = deque()
        self._lines = 0
        self._closing = threading.Event()
        self._advance: Callable[[float], None] | None = None
        self._shown_s = 0.0
        self._status_shown = False

    def on_rows(self, row: FloatArray) -> None:
        """Take the last row flown.

        Args:
            row: The frame; it must not change later.
        """
        self._row = row
        if self._advance is not None:
            time = float(row[1])
            self._advance(max(0.0, time - self._shown_s))
            self._shown_s = time

    def on_event(self, event: LogEvent) -> None:
        """Take an event.

        Args:
            event: What happened.
        """
        if event.kind != "view":  # it has said that itself
            self._events.append(event)

    @contextmanager
    def running(self) -> Iterator[None]:
        """Show progress while the block runs, and everything that is left to say after it."""
        thread = None
        if self._paced:
            thread = threading.Thread(target=self._keep_telling, name="status", daemon=True)
            thread.start()
        try:
            if self._paced or not sys.stderr.isatty():
                yield
            else:
                with progress(f"Flying {self._scenario.name}", total=self._scenario.duration) as advance:
                    self._advance = advance
                    yield
        finally:
            self._advance = None
            self._closing.set()
            if thread is not None:
                thread.join(timeout=2.0)
            self._clear_status()
            self._tell_events()

    def _keep_telling(self) -> None:
        on_terminal = sys.stderr.isatty()
        while not self._closing.wait(STATUS_PERIOD_S):
            if self._events:
                self._clear_status()
                self._tell_events()
            if on_terminal and self._row is not None:
                width = shutil.get_terminal_size().columns
                sys.stderr.write(f"\r{status_line(self._row, self._control, width=width)}\x1b[K")
                sys.stderr.flush()
                self._status_shown = True

    def _clear_status(self) -> None:
        if self._status_shown:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()
            self._status_shown = False

    def _tell_events(self) -> None:
        while self._events:
            event = self._events.popleft()
            self._lines += 1
            if self._lines <= MAX_EVENT_LINES and event.kind != "end":
                say(f"{event.time_s:8.2f} s  {event.text}", style=_STYLES.get(event.level))
            elif self._lines == MAX_EVENT_LINES + 1:
                say("            (further events are in the log)")


def status_line(row: FloatArray, control: FlightControl, *, width: int) -> str:
    """One line about a frame, the more important first; angles in degrees, speeds in knots.

    Args:
        control: Tells whether the flight is paused, and its speed.
        width: Columns of the terminal; what has no room is left out.
    """
    from rtsim.frame import COLUMN

    state = "paused" if control.paused else "max" if math.isinf(control.speed) else f"{control.speed:g}x"
    heading = (row[COLUMN.heading_deg] + 0.5) // 1.0 % 360.0
    parts = (
        f"{row[COLUMN.time_s]:6.1f} s {state:>6}",
        f"{row[COLUMN.airspeed_kt]:5.1f} kn",
        f"nac {row[COLUMN.nacelle_deg]:4.1f}",
        f"{row[COLUMN.altitude_m]:6.1f} m",
        f"margin {row[COLUMN.margin_kt]:5.1f}",
        f"hdg {heading:03.0f}",
        f"bank {row[COLUMN.bank_deg]:+3.0f}",
        f"pitch {row[COLUMN.pitch_deg]:+5.1f}",
        f"flapping {row[COLUMN.flapping_deg]:4.1f}",
    )
    line = parts[0]
    for part in parts[1:]:
        if len(line) + 2 + len(part) >= width:  # a line that wraps would not be overwritten
            break
        line += f"  {part}"
    return line


def say(sentence: str, *, style: str | None = None) -> None:
    """Print one sentence on stderr as it is: no markup, no line breaks of our own.

    Args:
        sentence: What to say.
        style: Colour and weight on a terminal.
    """
    console.print(sentence, style=style, markup=False, highlight=False, soft_wrap=True)


def describe(scenario: Scenario, *, speed: float, outputs: list[str]) -> None:
    """Say what is about to be flown.

    Args:
        speed: Multiple of real time; infinity is as fast as possible.
        outputs: Where the flight goes, in words.
    """
    pace = (
        "as fast as possible" if math.isinf(speed) else "in real time" if speed == 1.0 else f"at {speed:g} x real time"
    )
    options = scenario.options
    say(f"{scenario.title}: {scenario.duration:.1f} s {pace}", style="bold")
    say(
        f"plant {options.plant}, pilot {options.pilot}, outer loop {options.outer_loop}, "
        f"corridor {options.corridor_name}, protection {options.protection}, {options.rate_hz} Hz, seed {options.seed}",
    )
    if options.condition != SHIPPED:
        say(f"the XV-15 at {options.condition}")
    for line in outputs:
        say(line)


def summarize(record: FlightRecord, *, first_frame_s: float | None) -> None:
    """Tell how a flight went.

    Args:
        record: The flight.
        first_frame_s: How long after the command it began [s]; None where that is not known.
    """
    timing, metrics = record.timing, record.metrics
    ending = "Completed" if record.completed else "Ended early"
    began = "" if first_frame_s is None else f"; first frame {first_frame_s:.2f} s after the command"
    say(
        f"{ending}: {record.end_reason}; {timing.frames} frames, {timing.duration_s:.1f} s in {timing.wall_s:.2f} s "
        f"({timing.real_time_factor:.1f} x real time){began}",
    )
    if metrics is not None:
        _print_metrics(record.summary())
    if timing.lateness_us is not None and timing.work_us is not None and timing.work_cpu_us is not None:
        late, work, cpu = timing.lateness_us, timing.work_us, timing.work_cpu_us
        say(
            f"Loop: lateness p50 {late.p50:.1f} us, p99 {late.p99:.0f} us, max {late.max:.0f} us; "
            f"work p99 {work.p99:.0f} us wall, {cpu.p99:.0f} us CPU; overruns {timing.overruns}; "
            f"drift {timing.drift_frames:.2f} frames",
        )
    if record.mavlink is not None:
        say(_sticks(record.mavlink))
    for verdict in record.verdicts:
        mark, style = ("held  ", None) if verdict.held else ("FAILED", "bold red")
        say(f"  {mark} {verdict.name}{_measured(verdict)}", style=style)
    say(f"History SHA-256 {record.history_sha256}")


def _sticks(mavlink: Mapping[str, Any]) -> str:
    """How MAVLink went, in one line."""
    age = mavlink["input_age_ms"]
    if age is None:
        return f"MAVLink: no sticks; {mavlink['sent']} messages sent"
    return (
        f"MAVLink: {mavlink['inputs']} stick inputs, age when used p50 {age['p50']:.1f} ms, p99 {age['p99']:.1f} ms, "
        f"max {age['max']:.1f} ms; {mavlink['sent']} messages sent"
    )


def _print_metrics(summary: dict[str, Any]) -> None:
    speed, nacelle, height = summary["airspeed_kt"], summary["nacelle_deg"], summary["altitude_m"]
    flapping, pitch, corridor = summary["flapping_deg"], summary["pitch_deg"], summary["corridor"]
    stick, lever = summary["stick"], summary["lever"]
    late = flapping["peak_after_30_s"]
    tracking = f"error {speed['rms_error']:.3f} kn rms, {speed['max_error']:.2f} kn at most"
    tilting = f"error {nacelle['max_error']:.3f} deg at most, rate {nacelle['max_rate_deg_s']:.2f} deg/s at most"
    flapped = f"rms {flapping['rms']:.2f} deg" + ("" if late is None else f", {late:.2f} deg at most after 30 s")
    on_stop = f"{summary['controls_on_stop_frames']} frames with a control on its stop"
    outside = f"{corridor['exceedances']} exceedances, {corridor['time_outside_s']:.1f} s outside"
    rows = (
        ("Airspeed", f"final {speed['final']:.2f} kn", tracking),
        ("Nacelle", f"final {nacelle['final']:.2f} deg", tilting),
        ("Altitude", f"final {height['final']:.2f} m", f"deviation {height['max_deviation']:.2f} m at most"),
        ("Flapping", f"peak {flapping['peak']:.2f} deg at {flapping['peak_time_s']:.1f} s", flapped),
        ("Pitch", f"{pitch['min']:.1f} to {pitch['max']:.1f} deg", ""),
        ("Stick", f"travel {stick['travel_in']:.2f} in", f"rate {stick['rms_rate_in_s']:.2f} in/s rms"),
        ("Lever", f"travel {lever['travel']:.3f}", f"rate {lever['rms_rate_per_s']:.3f} 1/s rms; {on_stop}"),
        ("Fuel", f"{summary['fuel_lb']['used']:.1f} lb used", ""),
        ("Corridor", f"worst margin {corridor['worst_margin_kt']:.1f} kn", outside),
    )
    for name, result, details in (*rows, *_sideways_rows(summary)):
        say(f"{name:9} {result:25} {details}".rstrip())
    _print_limits(summary.get("limits", {}))
    acted = summary.get("interventions", {})
    if acted.get("episodes"):
        times = "acted" if acted["episodes"] == 1 else f"acted {acted['episodes']} times"
        seconds = {name: acted[f"{name.replace(' ', '_')}_s"] for name in _CONTROLS}
        on = [f"{name} {spent:.1f} s" for name, spent in seconds.items() if spent]
        say(f"Protection {times}: {', '.join(on)}")


def _sideways_rows(summary: dict[str, Any]) -> list[tuple[str, str, str]]:
    """How it turned, slipped and went sideward, where it did."""
    bank, heading, stick, pedal = (summary[name] for name in ("bank_deg", "heading_deg", "lateral_stick", "pedal"))
    place, slip = summary["position_m"], f"sideslip {summary['sideslip_deg']['max']:.1f} deg at most"
    if not (summary["lateral_kt"]["max"] or bank["min"] or bank["max"] or stick["travel_in"] or pedal["travel_in"]):
        return []
    banked = f"error {bank['rms_error']:.2f} deg rms, {bank['max_error']:.2f} deg at most; {slip}"
    where = f"{place['north']:.1f} m north, {place['east']:.1f} m east"
    line = (
        f"; {summary['track_m']['max_error']:.1f} m beside the line at most" if summary["track_m"]["max_error"] else ""
    )
    return [
        ("Bank", f"{bank['min']:.1f} to {bank['max']:.1f} deg", banked),
        ("Heading", f"final {heading['final']:.1f} deg", f"error {heading['max_error']:.2f} deg at most"),
        ("Sideways", f"{summary['lateral_kt']['max']:.1f} kn at most", where + line),
        ("Hands", f"lateral stick {stick['peak_in']:.2f} in", f"pedals {pedal['peak_in']:.2f} in at most"),
    ]


def _print_limits(limits: Mapping[str, Mapping[str, Any]]) -> None:
    """Say which limits besides the corridor were passed, for how long and how far."""
    from rtsim.protection.monitor_kernels import LIMIT_WORDS

    passed = []
    for name, found in limits.items():
        if found["outside_s"] and name not in _CORRIDOR_LIMITS:
            beyond = f"{-found['worst_margin']:.1f} {found['unit']}".rstrip()
            passed.append(f"{LIMIT_WORDS[name]} for {found['outside_s']:.1f} s (by {beyond})")
    if passed:
        say(f"Limits passed: {'; '.join(passed)}", style="yellow")


def _measured(verdict: Verdict) -> str:
    """What was measured and allowed, with its unit; one part in ten thousand of the limit is as good as nothing."""
    from rtsim.measures.metrics import metric_unit

    value, limit = verdict.value, verdict.limit
    if isinstance(value, bool) or isinstance(limit, bool):
        return ""
    unit = f" {metric_unit(verdict.metric)}".rstrip()
    largest = max(map(abs, limit)) if isinstance(limit, list) else abs(limit)
    if value is None:
        shown = "no value"
    elif abs(value) < 1e-4 * largest:
        shown = f"0.000{unit}"
    else:
        shown = f"{value:.4g}{unit}"
    allowed = f"{limit[0]:g} to {limit[1]:g}{unit}" if isinstance(limit, list) else f"limit {limit:g}{unit}"
    return f": {shown} ({allowed})"
