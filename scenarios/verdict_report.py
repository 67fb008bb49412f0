"""Verdicts as one HTML file that needs nothing else: table, corridor paths, margins over time, interventions."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Sequence
from typing import Any

import numpy as np

from rtsim.frame import COLUMN, FloatArray
from rtsim.protection import load_boundary
from rtsim.protection.limits import LIMIT_KINDS
from rtsim.units import to_deg, to_kt
from scenarios.verdict import Case

DRAWN_POINTS = 1500
"""Points of a line in a picture."""
_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2rem auto; max-width: 72rem; color: #1c2430; padding: 0 1rem }
table { border-collapse: collapse; margin: .6rem 0 1.2rem } th, td { padding: .25rem .7rem; text-align: left;
border-bottom: 1px solid #d8dee6; vertical-align: top } .passed { color: #12703a } .failed, .error { color: #b3261e }
td.number { text-align: right; font-variant-numeric: tabular-nums } img { max-width: 100% } code { color: #445 }
"""
_CHANNELS = (
    ("stick", COLUMN.protection_stick_reason),
    ("lever", COLUMN.protection_lever_reason),
    ("nacelle", COLUMN.protection_nacelle_reason),
)


def html_report(cases: Sequence[Case], *, title: str = "rtsim test") -> str:
    """Write the report.

    Args:
        cases: What was flown and judged.
        title: Its heading.

    Returns:
        The HTML text, pictures included.
    """
    passed = sum(case.verdict == "passed" for case in cases)
    parts = [
        f"<!doctype html><html lang='en'><meta charset='utf-8'><title>{html.escape(title)}</title>",
        f"<style>{_STYLE}</style><h1>{html.escape(title)}</h1>",
        f"<p>{passed} of {len(cases)} scenarios passed.</p>",
        _overview(cases),
        *(_section(case) for case in cases),
        "</html>\n",
    ]
    return "\n".join(parts)


def _overview(cases: Sequence[Case]) -> str:
    rows = []
    for case in cases:
        words = case.error or "; ".join(item.sentence for item in case.failures)
        rows.append(
            f"<tr><td><a href='#{html.escape(case.name)}'>{html.escape(case.name)}</a></td>"
            f"<td>{html.escape(case.kind)}</td><td>{html.escape(case.law)}</td>"
            f"<td class='{case.verdict}'>{case.verdict}</td><td>{html.escape(words)}</td></tr>"
        )
    return (
        "<table id='verdicts'><tr><th>scenario</th><th>kind</th><th>law</th><th>verdict</th><th>what failed</th></tr>"
        + "".join(rows)
        + "</table>"
    )


def _section(case: Case) -> str:
    clauses = "".join(
        f"<tr><td>{html.escape(item.name)}</td><td><code>{html.escape(item.metric)}</code></td>"
        f"<td class='number'>{html.escape(_number(item.value))}</td><td>{html.escape(item.limit)}</td>"
        f"<td class='{'passed' if item.held else 'failed'}'>{'held' if item.held else 'failed'}</td></tr>"
        for item in case.findings
    )
    metrics = "".join(
        f"<tr><td><code>{html.escape(name)}</code></td><td class='number'>{value:.4g}</td>"
        f"<td class='number'>{_number(case.off_metrics.get(name))}</td></tr>"
        for name, value in case.metrics.items()
    )
    name, scenario = html.escape(case.name), case.scenario
    heading = f"<h2 id='{name}'>{name}: <span class='{case.verdict}'>{case.verdict}</span></h2>"
    about = f"<p>{html.escape(scenario.title)}. {html.escape(scenario.description)}</p>"
    flown = f"Plant {html.escape(scenario.plant)}, law {html.escape(case.law)}, seed {scenario.seed}"
    ending = html.escape(case.error or case.flight.end_reason)
    parts = [heading, about, f"<p>{flown}. {ending}</p>"]
    if clauses:
        headings = "<tr><th>expectation</th><th>metric</th><th>value</th><th>want</th><th></th></tr>"
        parts.append(f"<table>{headings}{clauses}</table>")
    if len(case.flight.rows):
        parts.append(f"<img alt='corridor path, margins and interventions of {name}' src='{_picture(case)}'>")
        parts.append(_interventions(case))
    if metrics:
        headings = "<tr><th>metric</th><th>law</th><th>off</th></tr>"
        parts.append(f"<details><summary>All metrics</summary><table>{headings}{metrics}</table></details>")
    return "\n".join(parts)


def _number(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else "" if value is None else str(value)


def reason_name(reason: float) -> str:
    """Name of the limit behind a recorded reason.

    Args:
        reason: Number as recorded; 0 is none.
    """
    number = int(reason) - 1
    return LIMIT_KINDS[number] if 0 <= number < len(LIMIT_KINDS) else "law's own" if number >= 0 else ""


def interventions(rows: FloatArray) -> list[dict[str, Any]]:
    """When a law acted, on which channel and why; pauses shorter than 0.5 s do not part what belongs together.

    Args:
        rows: Frame rows.

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


def _interventions(case: Case) -> str:
    found = interventions(case.flight.rows) if len(case.flight.rows) else []
    if not found:
        return "<p>The law did not act.</p>"
    rows = "".join(
        f"<tr><td class='number'>{item['from_s']:.2f}</td><td class='number'>{item['to_s']:.2f}</td>"
        f"<td>{item['channel']}</td><td>{html.escape(item['limit'])}</td></tr>"
        for item in found[:60]
    )
    more = f"<p>and {len(found) - 60} more</p>" if len(found) > 60 else ""
    return "<table><tr><th>from s</th><th>to s</th><th>channel</th><th>limit</th></tr>" + rows + "</table>" + more


def _picture(case: Case) -> str:
    """The pictures of a case as a data address."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 6.4), layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=(1.15, 1.0))
    _draw_path(figure.add_subplot(grid[:, 0]), case)
    margin = figure.add_subplot(grid[0, 1])
    for label, rows, colour in _flights(case):
        margin.plot(rows[:, COLUMN.time_s], rows[:, COLUMN.margin_kt], color=colour, label=label)
    margin.axhline(0.0, color="#b3261e", linewidth=0.8)
    margin.set(ylabel="margin [kn]")
    margin.legend(loc="best", fontsize="small")
    height = figure.add_subplot(grid[1, 1], sharex=margin)
    for _, rows, colour in _flights(case):
        height.plot(rows[:, COLUMN.time_s], rows[:, COLUMN.altitude_m], color=colour)
    height.set(ylabel="altitude [m]")
    acted = figure.add_subplot(grid[2, 1], sharex=margin)
    rows = _thinned(case.flight.rows)
    time = rows[:, COLUMN.time_s]
    acted.plot(time, rows[:, COLUMN.protection_stick], label="stick", color="#1f5fa8")
    acted.plot(time, rows[:, COLUMN.protection_lever], label="lever", color="#c77700")
    acted.plot(
        time, rows[:, COLUMN.protection_nacelle_rate_deg_s] / 7.5, label="nacelle rate / 7.5 deg/s", color="#5c3a92"
    )
    acted.set(xlabel="time [s]", ylabel="law's share")
    acted.legend(loc="best", fontsize="small")
    stream = io.BytesIO()
    figure.savefig(stream, format="svg", metadata={"Date": None})
    return "data:image/svg+xml;base64," + base64.b64encode(stream.getvalue()).decode()


def _flights(case: Case) -> list[tuple[str, FloatArray, str]]:
    found = [] if case.off is None else [("off", _thinned(case.off.rows), "#9aa5b1")]
    return [*found, (case.law, _thinned(case.flight.rows), "#12703a")]


def _draw_path(axes: Any, case: Case) -> None:
    corridor = load_boundary(case.scenario.corridor or ("flight" if case.off is not None else "design"))
    angles = np.linspace(0.0, np.pi / 2.0, 181)
    axes.plot(to_kt(np.asarray(corridor.low.at(angles))), to_deg(angles), color="#b3261e", linewidth=1.2)
    axes.plot(to_kt(np.asarray(corridor.high.at(angles))), to_deg(angles), color="#b3261e", linewidth=1.2)
    for label, rows, colour in _flights(case):
        axes.plot(rows[:, COLUMN.airspeed_kt], rows[:, COLUMN.nacelle_deg], color=colour, label=label)
    rows = case.flight.rows
    if len(rows):
        axes.plot(rows[0, COLUMN.airspeed_kt], rows[0, COLUMN.nacelle_deg], "o", color="#1c2430", markersize=5)
    axes.set(xlabel="airspeed [kn]", ylabel="nacelle angle [deg]", ylim=(-3.0, 95.0))
    axes.set_xlim(min(-20.0, axes.get_xlim()[0]), max(200.0, min(axes.get_xlim()[1], 300.0)))
    axes.legend(loc="best", fontsize="small")


def _thinned(rows: FloatArray) -> FloatArray:
    return rows[:: max(1, len(rows) // DRAWN_POINTS)]
