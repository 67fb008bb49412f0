"""Verdicts as one HTML file that needs nothing else: table, corridor paths, margins over time, interventions."""

from __future__ import annotations

import html
from collections.abc import Sequence

import rtsim
from rtsim.measures.metrics import TRIAL_METRICS
from scenarios.verdicts.picture import interventions, picture
from scenarios.verdicts.tester import Case

_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2rem auto; max-width: 76rem; color: #1c2430; padding: 0 1rem }
h1 { margin-bottom: .2rem } h2 { margin-top: 2.6rem; border-top: 2px solid #d8dee6; padding-top: 1rem }
table { border-collapse: collapse; margin: .6rem 0 1.2rem } th, td { padding: .25rem .7rem; text-align: left;
border-bottom: 1px solid #d8dee6; vertical-align: top } th { white-space: nowrap }
.passed { color: #12703a } .failed, .error { color: #b3261e; font-weight: 600 }
td.number, th.number { text-align: right; font-variant-numeric: tabular-nums } img { max-width: 100% }
code { color: #445 } .remark { color: #56606c } summary { cursor: pointer; color: #1f5fa8 }
@media print { h2 { break-before: page } }
"""


_EXPLANATION = (
    "<p class='remark'>Every trial is flown twice with the same seed: with the law under test, and without (off). "
    "Depth is the largest airspeed outside the conversion corridor; height lost is below the altitude to hold.</p>"
)


def html_report(cases: Sequence[Case], *, title: str = "rtsim test") -> str:
    """Write the report.

    Args:
        cases: What was flown and judged.
        title: Its heading.

    Returns:
        The HTML text, pictures included.
    """
    counts = {word: sum(case.verdict == word for case in cases) for word in ("passed", "failed", "error")}
    words = ", ".join(
        f"<span class='{word}'>{count} {'in error' if word == 'error' else word}</span>"
        for word, count in counts.items()
        if count
    )
    parts = [
        f"<!doctype html><html lang='en'><meta charset='utf-8'><title>{html.escape(title)}</title>",
        f"<style>{_STYLE}</style><h1>{html.escape(title)}</h1>",
        f"<p>{len(cases)} scenario{'s' * (len(cases) != 1)}: {words}.</p><p class='remark'>{_conditions(cases)}</p>",
        _overview(cases),
        _EXPLANATION,
        *(_section(case) for case in cases),
        "</html>\n",
    ]
    return "\n".join(parts)


def _conditions(cases: Sequence[Case]) -> str:
    """What all cases have in common."""
    found = [f"rtsim {rtsim.__version__}"]
    for words, values in (
        ("aircraft model", {case.scenario.options.plant for case in cases}),
        ("corridor", {case.scenario.options.corridor_name for case in cases}),
        ("law under test", {case.law for case in cases}),
        ("seed", {str(case.scenario.options.seed) for case in cases}),
    ):
        if len(values) == 1:
            found.append(f"{words} {html.escape(values.pop())}")
    return ", ".join(found) + "."


def _overview(cases: Sequence[Case]) -> str:
    rows = []
    for case in cases:
        words = case.error or "; ".join(item.sentence for item in case.failures)
        numbers = "".join(
            f"<td class='number'>{f'{values[name]:.1f}' if values else ''}</td>"
            for name in ("depth_kt", "height_lost_m")
            for values in (case.metrics, case.off_metrics)
        )
        rows.append(
            f"<tr><td><a href='#{html.escape(case.name)}'>{html.escape(case.name)}</a></td>"
            f"<td>{html.escape(case.kind)}</td><td>{html.escape(case.law)}</td>"
            f"<td class='{case.verdict}'>{case.verdict}</td>{numbers}<td>{html.escape(words)}</td></tr>"
        )
    headings = "".join(f"<th class='number'>{words}</th>" for words in ("depth kn", "off", "height lost m", "off"))
    return (
        f"<table id='verdicts'><tr><th>scenario</th><th>kind</th><th>law</th><th>verdict</th>{headings}"
        f"<th>what failed</th></tr>{''.join(rows)}</table>"
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
        f"<td class='number'>{_number(case.off_metrics.get(name))}</td>"
        f"<td class='remark'>{html.escape(TRIAL_METRICS[name])}</td></tr>"
        for name, value in case.metrics.items()
    )
    name, scenario, options = html.escape(case.name), case.scenario, case.scenario.options
    heading = f"<h2 id='{name}'>{name}: <span class='{case.verdict}'>{case.verdict}</span></h2>"
    about = f"<p>{html.escape(scenario.title)}. {html.escape(scenario.description)}</p>"
    flown = (
        f"{html.escape(case.kind)}; aircraft model {options.plant}, corridor {options.corridor_name}, "
        f"law {html.escape(case.law)}, seed {options.seed}."
    )
    parts = [heading, about, f"<p class='remark'>{flown}</p>"]
    endings = {"with the law": case.flight.end_reason, "without": "" if case.off is None else case.off.end_reason}
    parts += [f"<p>Ended early {words}: {html.escape(text)}</p>" for words, text in endings.items() if text]
    if case.error:
        parts.append(f"<p class='error'>{html.escape(case.error)}</p>")
    if clauses:
        headings = (
            "<tr><th>expectation</th><th>metric</th><th class='number'>value</th><th>want</th><th>verdict</th></tr>"
        )
        parts.append(f"<table>{headings}{clauses}</table>")
    if len(case.flight.rows):
        parts.append(f"<img alt='corridor path, margins and interventions of {name}' src='{picture(case)}'>")
        parts.append(_interventions(case))
    if metrics:
        headings = "<tr><th>metric</th><th class='number'>law</th><th class='number'>off</th><th>meaning</th></tr>"
        parts.append(f"<details><summary>All metrics</summary><table>{headings}{metrics}</table></details>")
    return "\n".join(parts)


def _number(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else "" if value is None else str(value)


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
    headings = "<tr><th class='number'>from s</th><th class='number'>to s</th><th>channel</th><th>limit</th></tr>"
    words = f"The law acted {len(found)} time{'s' * (len(found) != 1)}"
    return f"<details><summary>{words}</summary><table>{headings}{rows}</table>{more}</details>"
