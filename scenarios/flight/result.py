"""What is left of a flight: its history by signal name, its measures, its verdicts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rtsim.arrays import FloatArray
from rtsim.errors import OutputError, closest
from rtsim.frame import SIGNAL_NAMES, SIGNALS
from rtsim.measures.metrics import FlightMetrics
from rtsim.realtime.report import Spread, TimingReport
from scenarios.files.expectation import Expectation
from scenarios.files.scenario import Scenario
from telemetry.log.format import LogEvent


@dataclass(frozen=True, slots=True)
class Verdict:
    """One expectation and what the flight made of it."""

    name: str
    """What was expected, in words."""
    held: bool
    """Whether it held."""
    value: float | bool | None
    """What was measured."""
    limit: float | bool | list[float]
    """What was allowed: a bound, or ``[minimum, maximum]``."""
    metric: str = ""
    """The metric that was measured, its unit in its name; empty for the first verdict, that the flight is completed."""


@dataclass(frozen=True, slots=True, eq=False)
class FlightRecord(Mapping[str, FloatArray]):
    """One flight. ``record["airspeed_kt"]`` is a signal over time, in the unit of its name."""

    scenario: Scenario
    """What was flown."""
    rows: FloatArray
    """The frame history, shape (frames, SIGNAL_COUNT), read-only."""
    metrics: FlightMetrics | None
    """What was measured; None where not one frame was flown."""
    timing: TimingReport
    """How the loop went."""
    events: tuple[LogEvent, ...]
    """What happened, in order."""
    completed: bool
    """Whether the flight was flown to its end."""
    end_reason: str
    """Why it ended, as a sentence without full stop."""
    history_sha256: str
    """Hash of the frame history."""
    verdicts: tuple[Verdict, ...]
    """The scenario's expectations, judged."""
    database_hash: str
    """Hash of the LPV database that was flown."""
    watched: Mapping[str, Any] = field(default_factory=dict)
    """Least margins to every limit (``limits``) and what protection did (``interventions``); empty where unwatched."""
    mavlink: Mapping[str, Any] | None = None
    """What passed by MAVLink: port, age of the sticks, counts; None where there was none."""
    failure: OutputError | None = None
    """The log or view that failed while the flight went on; None where all was well."""

    def __repr__(self) -> str:
        """Say what was flown and how it ended; the numbers would be pages."""
        return (
            f"<FlightRecord {self.scenario.name}: {len(self.rows)} frames at {self.scenario.options.rate_hz} Hz, "
            f"{self.end_reason}; flight['airspeed_kt'], .metrics, .verdicts, .events>"
        )

    def __getitem__(self, name: str) -> FloatArray:
        """One signal over the flight, shape (frames,).

        Args:
            name: One of ``rtsim.frame.SIGNAL_NAMES``.
        """
        if name not in SIGNAL_NAMES:
            raise KeyError(f"{name!r} is not a signal; similar ones: {', '.join(closest(name, SIGNAL_NAMES)[:3])}")
        return self.rows[:, SIGNAL_NAMES.index(name)]

    def __iter__(self) -> Any:
        return iter(SIGNAL_NAMES)

    def __len__(self) -> int:
        return len(SIGNAL_NAMES)

    def unit(self, name: str) -> str:
        """The unit of a signal as shown on axes; empty where it has none.

        Args:
            name: One of ``rtsim.frame.SIGNAL_NAMES``.
        """
        return next(signal.unit for signal in SIGNALS if signal.name == name)

    @property
    def held(self) -> bool:
        """Whether the flight was completed, or stopped by hand, and no expectation failed."""
        ended_well = self.completed or self.timing.ending == "stopped"
        return ended_well and all(verdict.held for verdict in self.verdicts)

    def summary(self) -> dict[str, Any]:
        """Everything ``rtsim fly --json`` prints, with its keys."""
        scenario, timing = self.scenario, self.timing
        options = scenario.options.shown()
        result: dict[str, Any] = {
            "scenario": scenario.name,
            **{key: options[key] for key in ("pilot", "plant", "outer_loop", "protection", "rate_hz", "seed")},
            "corridor_name": scenario.options.corridor_name,
            "options": options,
            "duration_s": timing.duration_s,
            "wall_s": timing.wall_s,
            "real_time_factor": timing.real_time_factor,
            "frames": timing.frames,
            "completed": self.completed,
            "end_reason": self.end_reason,
            "overruns": timing.overruns,
            "lateness_us": _spread(timing.lateness_us, "p50", "p99", "max"),
            "drift_frames": timing.drift_frames,
            "work_us": _spread(timing.work_us, "p50", "p99"),
            "work_cpu_us": _spread(timing.work_cpu_us, "p50", "p99"),
            "history_sha256": self.history_sha256,
            "database_sha256": self.database_hash,
        }
        result.update(self.metrics.asdict() if self.metrics is not None else {})
        result.update(self.watched)
        if self.mavlink is not None:
            result["mavlink"] = dict(self.mavlink)
        promised = ("name", "held", "value", "limit")
        result["expectations"] = [{key: getattr(verdict, key) for key in promised} for verdict in self.verdicts]
        return result


def _spread(spread: Spread | None, *names: str) -> dict[str, float | None]:
    return {name: None if spread is None else getattr(spread, name) for name in names}


def judge(
    scenario: Scenario, metrics: FlightMetrics | None, rows: FloatArray, *, completed: bool, end_reason: str
) -> tuple[Verdict, ...]:
    """Judge a flight by its scenario's expectations; being completed is the first of them.

    Args:
        metrics: What was measured.
        rows: The frame history.
        completed: Whether it was flown to its end.
        end_reason: Why it ended.
    """
    if not scenario.expectations:
        return ()
    whole = "the flight is completed" if completed else f"the flight is completed ({end_reason})"
    verdicts = [Verdict(whole, completed, completed, True)]
    for clause in scenario.expectations:
        value = None if metrics is None else clause_value(clause, metrics, rows, 1.0 / scenario.options.rate_hz)
        verdicts.append(Verdict(clause.name, clause.holds(value), value, clause.limit, clause.metric))
    return tuple(verdicts)


def clause_value(clause: Expectation, metrics: FlightMetrics, rows: FloatArray, dt: float) -> float | None:
    """What a clause of ``[[expect]]`` measures of a flight: a metric, or the robustness of a property.

    Args:
        clause: The clause.
        metrics: What was measured.
        rows: The frame history.
    """
    if not clause.formula:
        return metrics.value(clause.metric)
    from rtsim.properties.formula import Flown, parse_property  # loads its reader

    return parse_property(clause.formula).robustness(Flown(rows, metrics.numbers), dt).value
