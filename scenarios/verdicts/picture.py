"""The picture of a judged flight: its path in the corridor, margins over time, and when a law acted and why."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from typing import Any

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.drawing import drawing
from rtsim.frame import COLUMN
from rtsim.loop.aircraft import database_of
from rtsim.properties.formula import Flown, Property, parse_property
from rtsim.properties.words import SIGNAL_UNITS, TWIN
from rtsim.protection.boundary import load_boundary
from rtsim.protection.limiter_kernels import torque_limit
from rtsim.protection.limits import LIMIT_KINDS, load_limits
from rtsim.protection.monitor_kernels import LIMIT_WORDS
from rtsim.units import DEGREE, INCH_POUND, kt, to_deg, to_kt
from scenarios.verdicts.tester import Case

DRAWN_POINTS = 1500
"""Points of a line in a picture."""
MOST_PROPERTIES = 3
"""Properties that are drawn."""
OUTSIDE_KT = -0.5
"""Margin below which a path is drawn as outside [kn]."""
_LAW, _OFF, _OUTSIDE, _INSIDE, _WARNING = "#1f5fa8", "#8b96a3", "#c62828", "#eaf3ec", "#c77700"
_CHANNELS = (
    ("stick", COLUMN.protection_stick_reason),
    ("lever", COLUMN.protection_lever_reason),
    ("nacelle", COLUMN.protection_nacelle_reason),
    ("lateral stick", COLUMN.protection_lateral_stick_reason),
    ("pedals", COLUMN.protection_pedal_reason),
)
_REASON_COLOURS = (
    "#c62828", "#1f5fa8", "#5c3a92", "#555555", "#777777", "#00796b",
    "#c77700", "#6d4c41", "#ad1457", "#37474f", "#2e7d32", "#000000",
)  # fmt: skip


def reason_name(reason: float) -> str:
    """Name of the limit behind a recorded reason.

    Args:
        reason: Number as recorded; 0 is none.
    """
    number = int(reason) - 1
    return LIMIT_KINDS[number] if 0 <= number < len(LIMIT_KINDS) else "law's own" if number >= 0 else ""


def interventions(rows: FloatArray) -> list[dict[str, Any]]:
    """When a law acted, on which channel and why; pauses shorter than 0.5 s do not part what belongs together.

    Returns:
        By channel and reason: ``channel, limit, from_s, to_s``.
    """
    found: list[dict[str, Any]] = []
    time = rows[:, COLUMN.time_s]
    dt = float(time[1] - time[0]) if len(time) > 1 else 0.0
    for channel, column in _CHANNELS:
        for reason in np.unique(rows[:, column]):
            if reason == 0.0:
                continue
            hits = np.flatnonzero(rows[:, column] == reason)
            parts = np.split(hits, np.flatnonzero(np.diff(hits) * dt > 0.5) + 1)
            found += [
                {
                    "channel": channel,
                    "limit": reason_name(float(reason)),
                    "from_s": float(time[part[0]]),
                    "to_s": float(time[part[-1]]) + dt,
                }
                for part in parts
            ]
    return sorted(found, key=lambda item: (item["from_s"], item["channel"]))


def picture(case: Case) -> str:
    """Draw a case.

    Args:
        case: What was flown and judged, with a history.

    Returns:
        The picture as a data address (SVG).
    """
    # A fixed salt: equal flights give equal files.
    style = {"svg.hashsalt": "rtsim", "font.size": 9.0, "axes.spines.top": False, "axes.spines.right": False}
    with drawing(**style):
        from matplotlib.figure import Figure

        figure = Figure(figsize=(11.5, 8.2), layout="constrained")
        asked = _properties(case)
        heights = (1.5, 1.2, 0.9, 0.9, *(0.9 for _ in asked), 0.7)
        grid = figure.add_gridspec(len(heights), 2, width_ratios=(1.0, 1.1), height_ratios=heights)
        flights = _flights(case)
        _draw_path(figure.add_subplot(grid[:, 0]), case, flights)
        margin = figure.add_subplot(grid[0, 1])
        _draw_margin(margin, flights)
        _draw_shares(figure.add_subplot(grid[1, 1], sharex=margin), case, flights)
        height = figure.add_subplot(grid[2, 1], sharex=margin)
        for _, rows, colour in flights:
            height.plot(rows[:, COLUMN.time_s], rows[:, COLUMN.altitude_m], color=colour, linewidth=1.2)
        height.set(ylabel="altitude [m]")
        height.set_ylim(*_at_least(height.get_ylim(), 10.0))
        _draw_changes(figure.add_subplot(grid[3, 1], sharex=margin), _thinned(case.flight.rows))
        for place, one in enumerate(asked):
            _draw_robustness(figure.add_subplot(grid[4 + place, 1], sharex=margin), case, one)
        _draw_lanes(figure.add_subplot(grid[-1, 1], sharex=margin), interventions(case.flight.rows))
        for axes in figure.axes[1:-1]:
            axes.tick_params(labelbottom=False)
        stream = io.BytesIO()
        figure.savefig(stream, format="svg", metadata={"Date": None})
    return "data:image/svg+xml;base64," + base64.b64encode(stream.getvalue()).decode()


def _flights(case: Case) -> list[tuple[str, FloatArray, str]]:
    found = [] if case.off is None or case.law == "off" else [("off", _thinned(case.off.rows), _OFF)]
    return [*found, (case.law, _thinned(case.flight.rows), _LAW)]


def _draw_path(axes: Any, case: Case, flights: Sequence[tuple[str, FloatArray, str]]) -> None:
    name = case.scenario.options.corridor_name
    corridor = load_boundary(name, database_of(case.scenario.options.aircraft))
    stop = float(to_deg(corridor.downstop_nacelle))
    angles = np.linspace(corridor.downstop_nacelle, np.pi / 2.0, 181)
    low = np.concatenate([[float(corridor.low.at(0.0))], np.asarray(corridor.low.at(angles))])
    high = np.asarray(corridor.high.at(angles))
    axes.fill_betweenx(to_deg(angles), to_kt(low[1:]), to_kt(high), color=_INSIDE, zorder=0)
    axes.plot(to_kt(low), np.concatenate([[0.0], to_deg(angles)]), color="#2e7d32", linewidth=1.1)
    axes.plot(to_kt(high), to_deg(angles), color="#2e7d32", linewidth=1.1, label=f"corridor ({name})")
    down = [float(to_kt(high[0])), float(to_kt(corridor.downstop_speed))]
    axes.plot([down[0], down[1], down[1]], [stop, stop, 0.0], color="#2e7d32", linewidth=1.1)
    for label, rows, colour in flights:
        speed, angle = rows[:, COLUMN.airspeed_kt], rows[:, COLUMN.nacelle_deg]
        axes.plot(speed, angle, color=colour, linewidth=1.5, label=label)
        outside = rows[:, COLUMN.margin_kt] < OUTSIDE_KT
        axes.plot(
            np.where(outside, speed, np.nan), np.where(outside, angle, np.nan),
            color=_OUTSIDE, linewidth=2.6, alpha=0.75, solid_capstyle="butt",
        )  # fmt: skip
        axes.plot(speed[-1], angle[-1], "s", color=colour, markersize=4.5)
    rows = flights[-1][1]
    axes.plot([], [], color=_OUTSIDE, linewidth=2.6, alpha=0.75, label="outside")
    axes.plot(
        rows[0, COLUMN.airspeed_kt], rows[0, COLUMN.nacelle_deg], "o", color="#1c2430", markersize=5.5, label="start"
    )
    axes.set(xlabel="airspeed [kn]", ylabel="nacelle angle [deg]: 90 helicopter, 0 airplane", ylim=(-3.0, 95.0))
    left, right = axes.get_xlim()
    flown = max(float(rows[:, COLUMN.airspeed_kt].max()) for _, rows, _ in flights)
    axes.set_xlim(left, min(right, max(190.0, flown + 10.0)))
    axes.legend(loc="lower left", fontsize="small", framealpha=0.9)


def _draw_margin(axes: Any, flights: Sequence[tuple[str, FloatArray, str]]) -> None:
    for label, rows, colour in flights:
        axes.plot(rows[:, COLUMN.time_s], rows[:, COLUMN.margin_kt], color=colour, label=label, linewidth=1.2)
    axes.axhline(0.0, color=_OUTSIDE, linewidth=1.0)
    for level in (4.0, 10.0):
        axes.axhline(level, color=_WARNING, linewidth=0.7, linestyle=":")
    axes.set_ylim(*_at_least(axes.get_ylim(), 20.0))
    bottom = axes.get_ylim()[0]
    if bottom < 0.0:
        axes.axhspan(bottom, 0.0, color=_OUTSIDE, alpha=0.07, linewidth=0.0)
        axes.set_ylim(bottom=bottom)
    axes.set(ylabel="corridor margin [kn]")
    axes.legend(loc="best", fontsize="small")


def _draw_shares(axes: Any, case: Case, flights: Sequence[tuple[str, FloatArray, str]]) -> None:
    """Torque, flapping and pitch as shares of their limits."""
    limits = load_limits(database_of(case.scenario.options.aircraft).profile)
    for label, rows, _ in flights:
        allowed = [
            torque_limit(limits.torque, kt(row[COLUMN.airspeed_kt]), row[COLUMN.nacelle_deg] * DEGREE) / INCH_POUND
            for row in rows
        ]
        lines = (
            ("mast torque", rows[:, COLUMN.mast_torque_inlb] / np.array(allowed), "#c77700"),
            ("flapping", rows[:, COLUMN.flapping_deg] / float(to_deg(limits.flapping)), "#00796b"),
            ("pitch", np.abs(rows[:, COLUMN.pitch_deg]) / float(to_deg(limits.pitch)), "#ad1457"),
        )
        last = label == flights[-1][0]
        for name, values, colour in lines:
            axes.plot(
                rows[:, COLUMN.time_s], values, color=colour, label=name if last else None,
                linewidth=1.2 if last else 0.8, linestyle="-" if last else ":",
            )  # fmt: skip
    axes.axhline(1.0, color=_OUTSIDE, linewidth=1.0)
    top = axes.get_ylim()[1]
    axes.set(
        ylabel="share of limit\n(dotted: off)" if len(flights) > 1 else "share of limit", ylim=(0.0, min(top, 2.5))
    )
    axes.legend(loc="best", fontsize="small", ncols=3)


def _properties(case: Case) -> list[Property]:
    """Properties that a case is judged by, those whose robustness changes over time."""
    trial = case.scenario.trial
    clauses = [*(trial.clauses if trial is not None else ()), *case.scenario.expectations]
    read = [parse_property(formula) for formula in dict.fromkeys(clause.formula for clause in clauses) if formula]
    drawn = [one for one in read if all(name.removeprefix(TWIN) in SIGNAL_UNITS for name in one.names)]
    return [one for one in drawn if case.off is not None or not one.needs_twin][:MOST_PROPERTIES]


def _draw_robustness(axes: Any, case: Case, one: Property) -> None:
    dt, nothing = 1.0 / case.scenario.options.rate_hz, np.zeros(0)  # no metric is asked for
    twin = None if case.off is None else Flown(case.off.rows, nothing)
    values = one.over_time(Flown(case.flight.rows, nothing), dt, twin)
    step = max(1, len(values) // DRAWN_POINTS)
    time, shown = case.flight.rows[: len(values) : step, COLUMN.time_s], values[::step]
    axes.plot(time, shown, color=_LAW, linewidth=1.2)
    axes.fill_between(time, shown, 0.0, where=shown < 0.0, color=_OUTSIDE, alpha=0.4, linewidth=0.0)
    axes.axhline(0.0, color=_OUTSIDE, linewidth=1.0)
    axes.set(ylabel=f"robustness\n[{one.unit}]" if one.unit else "robustness")
    axes.set_title(one.formula, fontsize=7, loc="left", pad=2)


def _draw_changes(axes: Any, rows: FloatArray) -> None:
    time = rows[:, COLUMN.time_s]
    axes.plot(time, rows[:, COLUMN.protection_stick], label="stick", color="#1f5fa8", linewidth=1.1)
    axes.plot(time, rows[:, COLUMN.protection_lever], label="lever", color="#c77700", linewidth=1.1)
    for column, label, colour in (
        (COLUMN.protection_lateral_stick, "lateral stick", "#2e7d32"), (COLUMN.protection_pedal, "pedals", "#ad1457"),
    ):  # fmt: skip
        if rows[:, column].any():
            axes.plot(time, rows[:, column], label=label, color=colour, linewidth=1.1)
    rate = rows[:, COLUMN.protection_nacelle_rate_deg_s] / 7.5
    axes.plot(time, rate, label="nacelle rate / 7.5 deg/s", color="#5c3a92", linewidth=1.1)
    axes.set_ylim(*_at_least(axes.get_ylim(), 0.2))
    axes.set(ylabel="what the law\nadded")
    axes.legend(loc="best", fontsize="small", ncols=3)


def _draw_lanes(axes: Any, found: Sequence[dict[str, Any]]) -> None:
    """One lane for each channel, coloured by the limit the law acted for."""
    acted = {item["channel"] for item in found}
    names = [channel for place, (channel, _) in enumerate(_CHANNELS) if place < 3 or channel in acted]
    seen: set[str] = set()
    for item in found:
        limit = item["limit"]
        place = LIMIT_KINDS.index(limit) if limit in LIMIT_KINDS else len(LIMIT_KINDS)
        axes.broken_barh(
            [(item["from_s"], max(item["to_s"] - item["from_s"], 0.02))],
            (names.index(item["channel"]) - 0.35, 0.7),
            color=_REASON_COLOURS[place % len(_REASON_COLOURS)],
            label=None if limit in seen else LIMIT_WORDS.get(limit, "a limit of the law's own"),
        )
        seen.add(limit)
    axes.set(xlabel="time [s]", ylim=(len(names) - 0.5, -0.5), yticks=range(len(names)), yticklabels=names)
    axes.set_ylabel("law acts")
    if seen:
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.6), fontsize="small", ncols=3, frameon=False)
    else:
        axes.text(0.5, 0.5, "the law did not act", transform=axes.transAxes, ha="center", va="center", color=_OFF)


def _at_least(limits: tuple[float, float], span: float) -> tuple[float, float]:
    """An axis that does not blow noise up to its full height."""
    low, high = limits
    short = max(0.0, span - (high - low)) / 2.0
    return low - short, high + short


def _thinned(rows: FloatArray) -> FloatArray:
    return rows[:: max(1, len(rows) // DRAWN_POINTS)]
