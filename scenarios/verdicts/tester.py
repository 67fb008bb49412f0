"""Flies scenarios as tests and judges them: with a law and without, the same seed, by bounds and by each other."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.choices import HAND_PILOT
from rtsim.errors import RtsimError
from rtsim.frame import SIGNAL_COUNT, history_sha256
from rtsim.loop.aircraft import database_of
from rtsim.loop.options import FlightOptions
from rtsim.measures.metrics import FlightMetrics, TrialMetrics
from rtsim.properties.formula import parse_property
from scenarios.campaign.chunks import LawVariant, flown_of, fly_law, law_chain, present_folder
from scenarios.campaign.events import new_violations
from scenarios.campaign.trial import TRIAL_CORRIDOR, Bench, FlightPlan, TrialFlight
from scenarios.files.expectation import Expectation
from scenarios.files.scenario import Scenario
from scenarios.files.trial import Trial
from scenarios.flight.flight_setup import flight_setup
from scenarios.flight.result import clause_value

LAW_CLAUSE = "law"
"""Metric of the clause that the law runs without failing."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One clause and what the flight made of it."""

    name: str
    """What was expected, in words."""
    metric: str
    """What was measured; ``off.`` or ``difference.`` before it where it is not the protected flight's."""
    held: bool
    """Whether it held."""
    value: float | str | None
    """What was measured."""
    limit: str
    """What was allowed."""

    @property
    def sentence(self) -> str:
        """What to say where it failed: ``metric=value want limit``."""
        value = f"{self.value:.4g}" if isinstance(self.value, float) else str(self.value)
        return f"{self.metric}={value} want {self.limit}"


@dataclass(frozen=True, slots=True, eq=False)
class FlightHistory:
    """The history of one flight of a case."""

    rows: FloatArray = field(repr=False)
    """Frame rows."""
    end_reason: str
    """Why it ended by itself, or empty."""

    @property
    def history_sha256(self) -> str:
        """Hash of the history."""
        return history_sha256([self.rows])


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """One scenario, flown and judged."""

    scenario: Scenario
    """What was flown."""
    law: str
    """Law under test."""
    kind: str
    """Kind of the trial, or ``flight`` for a scenario that is judged by its flight alone."""
    findings: tuple[Finding, ...]
    """Every clause."""
    metrics: dict[str, float]
    """Metrics of the protected flight."""
    off_metrics: dict[str, float]
    """Metrics of its unprotected twin; empty where there is none."""
    flight: FlightHistory
    """The protected flight."""
    off: FlightHistory | None
    """Its unprotected twin."""
    wall_s: float
    """Time it took [s]."""
    error: str = ""
    """What kept it from being flown or judged; empty where nothing did."""
    note: str = ""
    """What is worth knowing of the law and depends on the machine, so that nothing is judged by it."""

    @property
    def name(self) -> str:
        """Name of the scenario."""
        return self.scenario.name

    @property
    def verdict(self) -> Literal["passed", "failed", "error"]:
        """How it went."""
        if self.error:
            return "error"
        return "passed" if all(finding.held for finding in self.findings) else "failed"

    @property
    def failures(self) -> tuple[Finding, ...]:
        """Clauses that did not hold."""
        return tuple(finding for finding in self.findings if not finding.held)

    @property
    def law_failure(self) -> str:
        """What the law under test did wrong by itself (raised, hung, gave NaN ...); empty where it ran."""
        return next((str(item.value) for item in self.failures if item.metric == LAW_CLAUSE), "")

    def summary(self) -> dict[str, object]:
        """The case as JSON values."""
        return {
            "name": self.name,
            "kind": self.kind,
            "law": self.law,
            "verdict": self.verdict,
            "error": self.error,
            "note": self.note,
            "seed": self.scenario.options.seed,
            "plant": self.scenario.options.plant,
            "database": self.scenario.options.database,
            "database_hash": _aircraft_hash(self.scenario.options),
            **self.scenario.options.condition.attributes,
            "corridor_name": self.scenario.options.corridor_name,
            "failures": [finding.sentence for finding in self.failures],
            "expectations": [
                {
                    "name": item.name,
                    "metric": item.metric,
                    "held": item.held,
                    "value": item.value,
                    "limit": item.limit,
                }
                for item in self.findings
            ],
            "metrics": self.metrics,
            "off_metrics": self.off_metrics,
            "end_reason": self.flight.end_reason,
            "history_sha256": self.flight.history_sha256,
            "off_history_sha256": None if self.off is None else self.off.history_sha256,
            "wall_s": self.wall_s,
        }


def _aircraft_hash(options: FlightOptions) -> str:
    """Hash of the aircraft; empty where there is none, which is the case's error."""
    try:
        return database_of(options.aircraft).aircraft_hash
    except RtsimError:
        return ""


class Tester:
    """Flies cases; keeps what is costly to load."""

    def __init__(self, *, law: str | None = None, **options: Any) -> None:
        """Remember what to test.

        Args:
            law: Law under test in every scenario; None: each scenario's own.
            options: Options of every flight instead of each scenario's, by field of ``FlightOptions``, SI.

        Raises:
            InputError: There is no such law, an option is out of range, or the database cannot be used.
        """
        database_of(FlightOptions().changed(options).aircraft)
        self._law, self._options = law, options
        self._folder = present_folder()
        self._bench = Bench()
        if law is not None:
            law_chain(law, self._folder)

    def run(self, scenario: Scenario) -> Case:
        """Fly and judge one scenario.

        Args:
            scenario: The scenario; with a ``[trial]`` it is flown with a law and without.

        Raises:
            InputError: It cannot be flown.
        """
        scenario = scenario.with_options(**self._options)
        if scenario.trial is None:
            return self._flight_case(scenario)
        return self._trial_case(judged_scenario(scenario), scenario.trial)

    def _trial_case(self, scenario: Scenario, trial: Trial) -> Case:
        begin = time.perf_counter()
        law = self._law or trial.law
        law_chain(law, self._folder)
        bench = self._bench
        plan = plan_of(scenario)
        off = bench.fly(plan, "off", keep=True)
        flown = fly_law(bench, plan, LawVariant(law), folder=self._folder, repeat=True, keep=True)
        findings = [
            *_law_findings(flown),
            *_default_findings(trial, flown.metrics, off.metrics),
            *_clause_findings(scenario, trial, flown, off),
            *_flight_findings(scenario, flown),
        ]
        return Case(
            scenario=scenario,
            law=law,
            kind=trial.kind,
            findings=tuple(findings),
            metrics=dict(flown.metrics),
            off_metrics=dict(off.metrics),
            flight=FlightHistory(flown.rows, flown.end_reason),
            off=FlightHistory(off.rows, off.end_reason),
            wall_s=time.perf_counter() - begin,
            note=flown.late,
        )

    def _flight_case(self, scenario: Scenario) -> Case:
        """A scenario without a trial: one flight, judged by its own expectations."""
        from scenarios.files.options import Overrides
        from scenarios.flight.runner import fly

        begin = time.perf_counter()
        record = fly(scenario, speed="max", overrides=Overrides(protection=self._law))
        asked = {clause.name: clause for clause in scenario.expectations}
        findings = []
        for item in record.verdicts:
            clause = asked.get(item.name)
            metric = "completed" if clause is None else clause.metric
            words = str(item.limit) if clause is None else clause.words
            value = None if item.value is None else float(item.value)
            findings.append(Finding(item.name, metric, item.held, value, words))
        return Case(
            scenario=record.scenario,
            law=record.scenario.options.protection,
            kind="flight",
            findings=tuple(findings),
            metrics={},
            off_metrics={},
            flight=FlightHistory(record.rows, "" if record.completed else record.end_reason),
            off=None,
            wall_s=time.perf_counter() - begin,
        )


def plan_of(scenario: Scenario) -> FlightPlan:
    """The flight of a scenario, without a law."""
    return FlightPlan(flight_setup(scenario), scenario.duration)


def judged_scenario(scenario: Scenario) -> Scenario:
    """The scenario in the corridor it is judged by: its own; else trials, whatever the law, that of trials.

    Args:
        scenario: The scenario.
    """
    corridor = TRIAL_CORRIDOR if scenario.trial is not None else None
    return scenario.with_options(corridor=scenario.options.corridor or corridor)


def is_test(scenario: Scenario) -> bool:
    """Whether a scenario can be flown and judged without a person."""
    judged = scenario.trial is not None or bool(scenario.expectations)
    return judged and scenario.options.pilot != HAND_PILOT


def broken_case(scenario: Scenario, law: str | None, problem: str) -> Case:
    """A scenario that could not be flown.

    Args:
        law: Law that was asked for; None: the scenario's own.
        problem: What kept it from being flown.
    """
    trial = scenario.trial
    law = law or (trial.law if trial is not None else scenario.options.protection)
    return Case(
        scenario=judged_scenario(scenario),
        law=law,
        kind=trial.kind if trial is not None else "flight",
        findings=(),
        metrics={},
        off_metrics={},
        flight=FlightHistory(np.zeros((0, SIGNAL_COUNT)), ""),
        off=None,
        wall_s=0.0,
        error=problem,
    )


def _law_findings(flown: TrialFlight) -> list[Finding]:
    """A law that failed has failed the test, whatever the flight looks like."""
    found: Sequence[str] = flown.law_problems
    return [
        Finding(
            "the law runs without failing", LAW_CLAUSE, not found, "; ".join(found) if found else "ran", "no failure"
        )
    ]


def _default_findings(trial: Trial, law: TrialMetrics, off: TrialMetrics) -> list[Finding]:
    """What is expected of every trial: no harm, and that there was something to protect from."""
    found = [
        Finding(
            f"not vacuous: the unprotected flight violates {name}",
            f"off.{name}",
            name in off.exceeded,
            "violated" if name in off.exceeded else "kept",
            "violated",
        )
        for name in trial.off_leaves
    ]
    if trial.off_depth_kt > 0.0:
        depth = off["depth_kt"]
        name = "not vacuous: the unprotected flight leaves the corridor far enough"
        found.append(Finding(name, "off.depth_kt", depth >= trial.off_depth_kt, depth, f">= {trial.off_depth_kt:g}"))
    most = off["height_lost_m"] + trial.no_harm_height
    lost = law["height_lost_m"]
    words = f"<= {most:.4g} (off + {trial.no_harm_height:g})"
    found.append(Finding("no harm: height", "height_lost_m", lost <= most, lost, words))
    new = sorted(new_violations(law, off))
    found.append(
        Finding(
            "no harm: no limit exceeded that was kept without the law",
            "new_violations",
            not new,
            ", ".join(new) if new else "none",
            "none",
        )
    )
    return found


def _clause_findings(scenario: Scenario, trial: Trial, flown: TrialFlight, off: TrialFlight) -> list[Finding]:
    found = []
    for clause in trial.clauses:
        of_law, of_off = (_measured(clause, flight, off, scenario) for flight in (flown, off))
        value = {"law": of_law, "off": of_off, "difference": of_law - of_off}[clause.of]
        metric = clause.metric if clause.of == "law" else f"{clause.of}.{clause.metric}"
        found.append(Finding(clause.name, metric, clause.holds(value), value, clause.words))
    return found


def _measured(clause: Expectation, flight: TrialFlight, off: TrialFlight, scenario: Scenario) -> float:
    """What a clause of a trial measures of one of its two flights."""
    if not clause.formula:
        return flight.metrics[clause.metric]
    dt = 1.0 / scenario.options.rate_hz
    return parse_property(clause.formula).robustness(flown_of(flight), dt, flown_of(off)).value


def _flight_findings(scenario: Scenario, flown: TrialFlight) -> list[Finding]:
    """The scenario's ``[[expect]]`` clauses, of the protected flight."""
    found = []
    metrics, dt = FlightMetrics(flown.metrics.numbers), 1.0 / scenario.options.rate_hz
    for clause in scenario.expectations:
        value = clause_value(clause, metrics, flown.rows, dt)
        found.append(Finding(clause.name, clause.metric, clause.holds(value), value, clause.words))
    return found
