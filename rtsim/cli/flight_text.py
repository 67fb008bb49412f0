"""What ``rtsim fly`` says to people on stderr before and after a flight."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rtsim.aircraft.condition import SHIPPED
from rtsim.cli.output import console

if TYPE_CHECKING:
    from rtsim.realtime.report import TimingReport
    from scenarios.files.scenario import Scenario
    from scenarios.flight.result import FlightRecord, Verdict

FEW = 6
"""As many expectations that held are worth a line each; of more, the number is told."""
_CONTROLS = ("stick", "lever", "nacelles", "lateral stick", "pedals")
_CORRIDOR_LIMITS = {"stall_attitude", "load_torque", "downstop_gate", "consistency", "time_to_limit"}
"""What the line of the corridor says."""


def say(sentence: str, *, style: str | None = None) -> None:
    """Print one sentence on stderr, without markup; on a terminal lines break between words, in a pipe not at all.

    Args:
        sentence: What to say.
        style: Colour and weight on a terminal.
    """
    console.print(sentence, style=style, markup=False, highlight=False, soft_wrap=not console.is_terminal)


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
    say(scenario.title, style="bold")
    say(
        f"{scenario.duration:.1f} s {pace}; plant {options.plant}, pilot {options.pilot}, "
        f"outer loop {options.outer_loop}, corridor {options.corridor_name}, protection {options.protection}, "
        f"{options.rate_hz} Hz, seed {options.seed}",
    )
    if options.condition != SHIPPED:
        say(f"the XV-15 at {options.condition}")
    for line in outputs:
        say(line)


def summarize(record: FlightRecord, *, first_frame_s: float | None) -> None:
    """Tell how a flight went: how it ended, what was expected of it, which limits it passed, then the numbers.

    Args:
        record: The flight.
        first_frame_s: How long after the command it began [s]; None where that is not known.
    """
    timing, metrics = record.timing, record.metrics
    ending = "Completed" if record.completed else "Ended early"
    began = "" if first_frame_s is None else f", first frame {first_frame_s:.1f} s after the command"
    say(
        f"{ending}: {record.end_reason} ({timing.frames} frames in {timing.wall_s:.2f} s, "
        f"{timing.real_time_factor:.1f} x real time{began})",
        style=None if record.completed else "bold yellow",
    )
    _print_verdicts(record.verdicts)
    if metrics is not None:
        summary = record.summary()
        _print_limits(summary.get("limits", {}))
        _print_protection(summary.get("interventions", {}))
        for name, result, details in (
            *flight_rows(record, summary),
            *_sideways_rows(summary, judged=not by_hand(record)),
        ):
            say(f"{name:9} {result:27} {details}".rstrip())
    if (loop := loop_line(timing)) is not None:
        say(loop)
    if record.mavlink is not None:
        say(_sticks(record.mavlink))
    say(f"History SHA-256 {record.history_sha256}")


def _print_verdicts(verdicts: Sequence[Verdict]) -> None:
    """What did not hold, one by one; how many did."""
    failed = [verdict for verdict in verdicts if not verdict.held]
    for verdict in failed:
        say(f"FAILED {verdict.name}{_measured(verdict)}", style="bold red")
    if not verdicts:
        return
    held = len(verdicts) - len(failed)
    say(f"{held} of {len(verdicts)} expectations held" + (" (--json lists them)" if held > FEW else ""))
    if held <= FEW:
        for verdict in verdicts:
            if verdict.held:
                say(f"  held {verdict.name}{_measured(verdict)}")


def by_hand(record: FlightRecord) -> bool:
    """Whether a person flew, who is not judged by how the scenario's programme would have been held.

    Args:
        record: The flight.
    """
    from rtsim.choices import HAND_PILOT

    hands = record.mavlink is not None and bool(record["pilot_mode"].any())
    return hands or record.scenario.options.pilot == HAND_PILOT


def loop_line(timing: TimingReport) -> str | None:
    """How the pacing went, in one line; None where the flight was not paced.

    Args:
        timing: What was measured.
    """
    late, work, cpu = timing.lateness_us, timing.work_us, timing.work_cpu_us
    if late is None or work is None or cpu is None:
        return None
    behind_s = (timing.drift_frames or 0.0) * timing.duration_s / max(timing.frames, 1)
    slipped = f"; {behind_s:.1f} s lost to its schedule" if behind_s >= 0.05 else ""
    return (
        f"Loop: late by {_time(late.p50)} (median), {_time(late.p99)} (99 %), {_time(late.max)} (most); "
        f"work {_time(work.p99)}, {_time(cpu.p99)} of it CPU (99 %); {timing.overruns} overruns{slipped}"
    )


def _time(microseconds: float) -> str:
    """A time with two or three digits and the unit that suits it."""
    for unit, size in (("us", 1.0), ("ms", 1e3)):
        if microseconds < 999.5 * size:
            return f"{microseconds / size:.{0 if microseconds >= 10.0 * size else 1}f} {unit}"
    return f"{microseconds * 1e-6:.1f} s"


def _sticks(mavlink: Mapping[str, Any]) -> str:
    """How MAVLink went, in one line."""
    age = mavlink["input_age_ms"]
    if age is None:
        return f"MAVLink: no sticks; {mavlink['sent']} messages sent"
    return (
        f"MAVLink: {mavlink['inputs']} stick inputs, age when used p50 {age['p50']:.1f} ms, p99 {age['p99']:.1f} ms, "
        f"max {age['max']:.1f} ms; {mavlink['sent']} messages sent"
    )


def flight_rows(record: FlightRecord, summary: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """What was flown: name, result, details; a flight by hand without its errors, since it followed nothing.

    Args:
        record: The flight.
        summary: Its numbers.
    """
    speed, nacelle, height = summary["airspeed_kt"], summary["nacelle_deg"], summary["altitude_m"]
    flapping, pitch, corridor = summary["flapping_deg"], summary["pitch_deg"], summary["corridor"]
    stick, lever, late = summary["stick"], summary["lever"], flapping["peak_after_30_s"]
    judged = not by_hand(record)

    def between(signal: str) -> str:
        return f"{record[signal].min():.1f} to {record[signal].max():.1f}"

    tracking = f"error {speed['rms_error']:.2f} kn rms, {speed['max_error']:.2f} kn at most"
    tilting = f"error {nacelle['max_error']:.2f} deg, rate {nacelle['max_rate_deg_s']:.1f} deg/s at most"
    held = f"deviation {height['max_deviation']:.2f} m at most"
    flapped = f"rms {flapping['rms']:.2f} deg" + ("" if late is None else f", {late:.2f} at most after 30 s")
    outside = corridor["exceedances"]
    left = (
        "" if not outside else f"left {outside} time{'s' * (outside > 1)}, {corridor['time_outside_s']:.1f} s outside"
    )
    rows = [
        ("Airspeed", f"final {speed['final']:.2f} kn", tracking if judged else f"{between('airspeed_kt')} kn"),
        ("Nacelle", f"final {nacelle['final']:.2f} deg", tilting if judged else f"{between('nacelle_deg')} deg"),
        ("Altitude", f"final {height['final']:.2f} m", held if judged else f"{between('altitude_m')} m"),
        ("Corridor", f"worst margin {corridor['worst_margin_kt']:.1f} kn", left),
        ("Flapping", f"peak {flapping['peak']:.2f} deg at {flapping['peak_time_s']:.1f} s", flapped),
        ("Pitch", f"{pitch['min']:.1f} to {pitch['max']:.1f} deg", ""),
        ("Stick", f"travel {stick['travel_in']:.2f} in", f"rate {stick['rms_rate_in_s']:.2f} in/s rms"),
        ("Lever", f"travel {lever['travel']:.3f}", f"rate {lever['rms_rate_per_s']:.3f} 1/s rms"),
        ("Fuel", f"{summary['fuel_lb']['used']:.1f} lb used", ""),
    ]
    if on_stop := summary["controls_on_stop_frames"]:
        rows.append(("On stop", f"{on_stop} frames", "with a control at the end of its travel"))
    return rows


def _sideways_rows(summary: dict[str, Any], *, judged: bool) -> list[tuple[str, str, str]]:
    """How it turned, slipped and went sideward, where it did."""
    bank, heading, stick, pedal = (summary[name] for name in ("bank_deg", "heading_deg", "lateral_stick", "pedal"))
    place, slip = summary["position_m"], f"sideslip {summary['sideslip_deg']['max']:.1f} deg at most"
    if not (summary["lateral_kt"]["max"] or bank["min"] or bank["max"] or stick["travel_in"] or pedal["travel_in"]):
        return []
    banked = f"error {bank['rms_error']:.2f} deg rms, {bank['max_error']:.2f} deg at most"
    where = f"{place['north']:.0f} m north, {place['east']:.0f} m east"
    rows = [
        ("Bank", f"{bank['min']:.1f} to {bank['max']:.1f} deg", banked if judged else slip),
        ("Heading", f"final {heading['final']:.1f} deg", f"error {heading['max_error']:.2f} deg at most" * judged),
        ("Sideways", f"{summary['lateral_kt']['max']:.1f} kn at most", slip if judged else where),
        ("Hands", f"lateral stick {stick['peak_in']:.2f} in", f"pedals {pedal['peak_in']:.2f} in at most"),
    ]
    if judged:
        line = summary["track_m"]["max_error"]
        rows.append(("Place", where, f"{line:.1f} m beside the line at most" if line else ""))
    return rows


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


def _print_protection(acted: Mapping[str, Any]) -> None:
    if acted.get("episodes"):
        times = "acted" if acted["episodes"] == 1 else f"acted {acted['episodes']} times"
        seconds = {name: acted[f"{name.replace(' ', '_')}_s"] for name in _CONTROLS}
        on = [f"{name} {spent:.1f} s" for name, spent in seconds.items() if spent]
        say(f"Protection {times}: {', '.join(on)}")


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
