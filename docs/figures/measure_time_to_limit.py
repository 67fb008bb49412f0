"""Measures how good the predicted time to the corridor's boundary is; prints the tables of docs/protection.md.

Flies the unprotected flights of the misuse campaign, lets the margin monitor watch them, and compares what it predicted
a lead before each crossing with what then happened.

Usage: python docs/figures/measure_time_to_limit.py [RUNS_OF_EACH_CLASS]
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from importlib import resources

from rtsim.loop.option_tables import given
from rtsim.loop.options import FlightOptions
from rtsim.protection.assessment import assess_warnings
from rtsim.protection.monitor import MarginHistory, MarginMonitor
from scenarios.campaign.draws import draw_plan
from scenarios.campaign.spec import parse_campaign
from scenarios.campaign.trial import Bench


def histories(campaign: str, plant: str, runs: int) -> Iterator[MarginHistory]:
    """Fly a library campaign without protection and watch it."""
    file = resources.files("scenarios.campaign").joinpath("library", f"{campaign}.toml")
    spec, problems = parse_campaign(file.read_text(encoding="utf-8"), file=str(file))
    if spec is None:
        raise problems[0]
    bench, monitor = Bench(), MarginMonitor(spec.corridor)
    options = FlightOptions(**given(spec)).changed({"plant": plant})
    for number in range(len(spec.classes)):
        for run in range(runs):
            plan = draw_plan(spec, seed=0, class_number=number, run=run, options=options)
            yield monitor.history(bench.fly(plan, "off").rows)


def main() -> None:
    """Print one table for each plant."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    for campaign, plant in (("misuse", "lpv"), ("misuse", "nonlinear"), ("nominal", "lpv")):
        quality = assess_warnings(histories(campaign, plant, runs if plant == "lpv" else max(1, runs // 4)))
        print(f"\n{campaign}, {plant}")
        if quality.leads[0].crossings:
            print("| lead, s | crossings | predicted | mean error, s | standard deviation, s |\n|---|---|---|---|---|")
            for lead in quality.leads:
                share = f"{100.0 * lead.detected:.0f} %"
                print(f"| {lead.lead:g} | {lead.crossings} | {share} | {lead.bias:+.2f} | {lead.deviation:.2f} |")
        print(f"warnings at 2.5 s: {quality.alarms}, followed by no crossing within 6 s: {quality.false_alarms}")


if __name__ == "__main__":
    main()
