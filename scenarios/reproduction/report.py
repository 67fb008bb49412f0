"""One self-contained HTML report: claim table, figures, Table 1, what was flown. No scripts, nothing from elsewhere."""

from __future__ import annotations

import base64
import html
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path

from scenarios.reproduction.claims import Claim
from scenarios.reproduction.drawing import FigurePlan
from scenarios.reproduction.flights import VARIANTS
from scenarios.reproduction.judges import PRINTED_TIMES
from scenarios.reproduction.measures import table_1_times
from scenarios.reproduction.study import Study

_ROWS = (
    ("airspeed, kn", ("0", "24", "40", "61", "80", "105", "130", "150", "170", "170")),
    ("nacelle, deg", ("90", "82", "82", "75", "75", "50", "50", "0", "0", "0")),
)


def report_html(study: Study, plans: Sequence[FigurePlan], files: Mapping[int, Sequence[Path]], *, version: str) -> str:
    """Write the report.

    Args:
        study: What was flown and judged.
        plans: The figures.
        files: Their files, SVG first.
        version: Version of rtsim.

    Returns:
        A whole HTML document with all pictures inside.
    """
    held = sum(claim.holds for claim in study.claims)
    fallen = [claim for claim in study.claims if not claim.holds]
    style = (resources.files("scenarios.reproduction") / "data" / "report.css").read_text(encoding="utf-8")
    names = ", ".join(f'<a href="#{claim.text.id}">{claim.text.id}</a>' for claim in fallen)
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Tiltrotor conversion: the paper's claims, flown again</title>
<style>
{style}</style>
</head>
<body>
<header>
<h1>Tiltrotor conversion: the paper's claims, flown again</h1>
<p>“Simulation of tiltrotor maneuvers using linear parameter varying models”, every figure and claim, from flights of
the Bell XV-15 by a MOCM pilot in rtsim {_text(version)}.</p>
<p class="verdict"><b>{held} of {len(study.claims)} claims hold.</b> {"Not: " + names + "." if fallen else ""}</p>
</header>
<main>
<h2 id="claims">Claims</h2>
<p>A claim counts as flown by the baseline, {_text(VARIANTS[0].title)}; the last column says why, and with which other
aircraft models and pilots the verdict is the same. Numbers are of this run.</p>
{_claim_table(study.claims)}
<h2 id="table-1">Table 1</h2>
{_table_1()}
<h2 id="figures">Figures</h2>
<p>Numbered as in the paper, drawn from our own flights at 250 Hz in calm air, pilot noise off.</p>
{"".join(_figure(plan, files[plan.number][0]) for plan in plans)}
<h2 id="flights">Flights</h2>
<p>Flown by the baseline. Oscillation: flown minus trimmed flapping, RMS from 3 s on. The same table for the other
variants follows it, folded.</p>
{_flight_tables(study)}
<h2 id="method">What was flown</h2>
{_method(study)}
</main>
</body>
</html>
"""


def _text(value: str) -> str:
    return html.escape(value)


def _claim_table(claims: Sequence[Claim]) -> str:
    rows = []
    for claim in claims:
        text = claim.text
        kind, word = ("yes", "holds") if claim.holds else ("no", "does not hold")
        rows.append(
            f'<tr id="{text.id}"><td><code>{text.id}</code><br><small>{_text(text.where)}</small></td>'
            f'<td data-name="claim">{_text(text.claim)}<br><small>{_text(text.paper)}</small></td>'
            f'<td data-name="measured">{_text(claim.measured_text)}</td>'
            f'<td data-name="verdict" class="{kind}">{word}</td>'
            f'<td data-name="why">{_text(claim.why)}<br><small>{_text(claim.carried)}</small></td></tr>'
        )
    head = "<tr><th>id</th><th>claim, and what the paper says</th><th>measured</th><th>verdict</th><th>why</th></tr>"
    table = f'<table class="claims"><thead>{head}</thead><tbody>{"".join(rows)}</tbody></table>'
    return f'<div class="wide">{table}</div>\n'


def _table_1() -> str:
    lines = [*_ROWS, ("time, printed, s", tuple(f"{time:g}" for time in PRINTED_TIMES))]
    lines.append(("time, by the rule, s", tuple(f"{time:.2f}" for time in table_1_times())))
    by_nacelle = [f"{time:.2f}" for time in table_1_times(rule="nacelle")[:-1]]
    lines.append(("time, by equation 5 alone, s", (*by_nacelle, "–")))
    body = "".join(
        f"<tr><th>{_text(name)}</th>{''.join(f'<td>{_text(value)}</td>' for value in values)}</tr>"
        for name, values in lines
    )
    return (
        f'<div class="wide"><table class="numbers">{body}</table></div>\n<p>Rule: a segment lasts as long as the '
        "slower of its motions needs, nacelle step / 3 deg/s or airspeed step / cap, with caps of 3 kn/s, 4 kn/s "
        "from 105 to 130 kn and 5 kn/s on the downstop; then 4 s of hold.</p>\n"
    )


def _figure(plan: FigurePlan, path: Path) -> str:
    data = base64.b64encode(path.read_bytes()).decode("ascii")
    return (
        f'<figure id="figure-{plan.number}"><img alt="{_text(plan.title)}" src="data:image/svg+xml;base64,{data}">'
        f"<figcaption><b>Figure {plan.number}. {_text(plan.title)}.</b> {_text(plan.caption)}</figcaption></figure>\n"
    )


def _flight_tables(study: Study) -> str:
    tables: list[str] = []
    for variant in VARIANTS:
        if variant.name not in study.evidence:
            continue
        table = _flight_table(study, variant.name)
        if tables:
            table = f"<details><summary>{_text(variant.title)}</summary>{table}</details>"
        tables.append(table)
    return "\n".join(tables)


def _flight_table(study: Study, variant: str) -> str:
    head = (
        "path", "170 kn at, s", "flapping peak, deg", "at, s", "integral, deg s", "oscillation, deg",
        "stick rate RMS, in/s", "altitude within, m", "pitch, deg", "margin design / 1980, kn", "end",
    )  # fmt: skip
    rows = []
    for name, one in study.evidence[variant].measures.items():
        metrics = one.metrics
        values = (
            study.paths[name].title if name not in _TITLES else _TITLES[name],
            f"{one.time_to_170_kt_s:.1f}",
            f"{metrics.flapping_deg.peak:.2f}",
            f"{metrics.flapping_deg.peak_time_s:.1f}",
            f"{metrics.flapping_deg.integral_deg_s:.0f}",
            f"{one.oscillation_rms_deg:.2f}",
            f"{one.stick_rate_in_s:.2f}",
            f"{metrics.altitude_m.max_deviation:.1f}",
            f"{metrics.pitch_deg.min:.0f} to {metrics.pitch_deg.max:.0f}",
            f"{metrics.corridor.worst_margin_kt:.0f} / {one.margin_flight_kt:.0f}",
            one.end_reason or "completed",
        )
        rows.append("<tr>" + "".join(f"<td>{_text(value)}</td>" for value in values) + "</tr>")
    heading = "".join(f"<th>{_text(word)}</th>" for word in head)
    return (
        f'<div class="wide"><table class="numbers left"><thead><tr>{heading}</tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table></div>"
    )


_TITLES = {
    "typical": "Table 1, linear in time",
    "typical_3deg": "Table 1, nacelles at 3 deg/s, then held",
    "typical_8deg": "Table 1, nacelles at 8 deg/s, then held",
    "fast_side": "Least trim flapping, 1.5 kn/s",
    "near_stall": "Along the stall limit, 2 kn/s",
    "centre_line": "Centre line at 3 deg/s",
    "centre_line_variable": "Centre line at variable rate, 4 kn/s",
    "fast_side_table_1_caps": "Least trim flapping, caps of Table 1",
    "near_stall_table_1_caps": "Along the stall limit, caps of Table 1",
    "centre_line_variable_3": "Centre line at variable rate, 3 kn/s",
}


def _method(study: Study) -> str:
    variants = "".join(f"<li>{_text(variant.title)}</li>" for variant in VARIANTS if variant.name in study.evidence)
    return (
        "<p>Aircraft: XV-15, 13 000 lb, sea level, symmetric plane, 589 rpm, flaps 40/25; trims and linear models of "
        "our own blade-element model, so differences to the paper's CAMRAD/JA and MASST models are part of what is "
        "compared. Pilot: MOCM with one set of weights, gains designed at every grid point. References: airspeed "
        "behind a 1.5 rad/s and nacelle behind a 3 rad/s critically damped filter.</p>"
        f"<p>Variants:</p><ul>{variants}</ul>"
        f"<p>Database <code>{_text(study.database_hash)}</code>. "
        "Repeat with <code>rtsim reproduce --out DIR</code>.</p>"
    )
