"""Tests of envelope protection as data: what a scenario's ``[trial]`` says, checked and in SI."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from rtsim.errors import InputError
from rtsim.loop.script import Pulse
from rtsim.units import deg
from scenarios.files.expectation import Expectation, clause_of, clause_problems
from scenarios.files.trial_schema import PulseTable, TrialTable

TrialKind = Literal["nominal", "misuse", "failure", "unprotectable"]
LARGEST_PULSES = {"stick": 2.0, "lever": 1.0, "lateral_stick": 2.0, "pedal": 2.0}
"""Largest amounts that mean something: from stop to stop."""


@dataclass(frozen=True, slots=True)
class Trial:
    """What makes a scenario a test of envelope protection."""

    kind: TrialKind
    """``nominal`` (a law has nothing to do), ``misuse``, ``failure``, or ``unprotectable`` (depth is bounded only)."""
    law: str
    """Law under test unless another is asked for."""
    off_leaves: tuple[str, ...]
    """What the unprotected twin must violate, else the test is vacuous."""
    off_depth_kt: float
    """How deep it must leave the corridor at least [kn]."""
    no_harm_height: float
    """Height the law may lose beyond what its twin lost [m]."""
    clauses: tuple[Expectation, ...]
    """The scenario's own expectations."""


def trial_problems(
    pulses: Sequence[PulseTable],
    trial: TrialTable | None,
    *,
    has_events: bool,
    flight: Mapping[str, Any],
    file: str,
) -> list[InputError]:
    """Mistakes in ``[[pulses]]`` and ``[trial]`` that involve more than one key.

    Args:
        pulses: The script.
        trial: The test, or None.
        has_events: Whether the scenario hands the controls over.
        flight: The options that it gives, by field.
    """
    found = _pulse_problems(pulses, file)
    return found if trial is None else found + _test_problems(trial, has_events=has_events, flight=flight, file=file)


def _pulse_problems(pulses: Sequence[PulseTable], file: str) -> list[InputError]:
    found = []
    for number, pulse in enumerate(pulses):
        largest = LARGEST_PULSES.get(pulse.channel, 12.0)
        if abs(pulse.amount) > largest:
            found.append(
                InputError(
                    "is out of range",
                    file=file,
                    key=f"pulses[{number}].amount",
                    value=pulse.amount,
                    allowed=f"-{largest:g} to {largest:g} for the {pulse.channel.replace('_', ' ')}",
                )
            )
        if pulse.replaces and pulse.channel == "switch":
            key = f"pulses[{number}].replaces"
            found.append(InputError("has no meaning for the switch", file=file, key=key, mend="delete it"))
    return found


def _test_problems(trial: TrialTable, *, has_events: bool, flight: Mapping[str, Any], file: str) -> list[InputError]:
    found = []
    if has_events:
        found.append(InputError("cannot be flown as a trial", file=file, key="events", mend="delete events or [trial]"))
    for key in ("pilot", "nacelle"):
        if ":" in flight.get(key, ""):
            mend = f"delete [trial], or flight.{key}: trials are flown by the MOCM and by built-in nacelle control"
            value = flight[key]
            found.append(
                InputError("cannot be flown as a trial", file=file, key=f"flight.{key}", value=value, mend=mend)
            )
    if trial.kind in {"misuse", "failure", "unprotectable"} and not trial.off_leaves:
        found.append(
            InputError(
                "is missing",
                file=file,
                key="trial.off_leaves",
                mend="say what the unprotected flight must violate, else the test may be vacuous",
            )
        )
    if trial.kind == "nominal" and trial.off_leaves:
        found.append(InputError("contradicts kind nominal", file=file, key="trial.off_leaves", mend="delete it"))
    for number, clause in enumerate(trial.expect):
        from rtsim.measures.metrics import TRIAL_METRICS  # loads compiled code

        key = f"trial.expect[{number}]"
        found += clause_problems(
            clause,
            known=TRIAL_METRICS,
            noun="a metric of trials",
            twin=True,
            file=file,
            key=key,
        )
    return found


def trial_of(table: TrialTable | None, protection: str | None = None) -> Trial | None:
    """Bring a checked ``[trial]`` to its form in the program.

    Args:
        table: From a scenario file, without contradictions.
        protection: What ``[flight]`` says of it; the law under test where ``[trial]`` names none.
    """
    if table is None:
        return None
    return Trial(
        kind=table.kind,
        law=table.law or protection or "full",
        off_leaves=tuple(table.off_leaves),
        off_depth_kt=table.off_depth_kt,
        no_harm_height=table.no_harm_height_m,
        clauses=tuple(clause_of(item.name, item, of=item.of) for item in table.expect),
    )


def pulses_of(tables: Sequence[PulseTable]) -> tuple[Pulse, ...]:
    """Bring checked pulses to SI.

    Args:
        tables: From a scenario file, without contradictions.
    """
    return tuple(
        Pulse(
            channel=table.channel,
            start=table.time_s,
            duration=table.duration_s,
            amount=deg(table.amount) if table.channel == "switch" else table.amount,
            shape=table.shape,
            period=table.period_s,
            replaces=table.replaces,
        )
        for table in tables
    )
