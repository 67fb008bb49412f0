"""Flies the recorded commands of a log again and compares the history bit by bit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rtsim.aids.design import switch_of
from rtsim.arrays import FloatArray
from rtsim.command import Command
from rtsim.errors import InputError
from rtsim.frame import COLUMN, SIGNAL_NAMES, history_sha256
from rtsim.guests import readable
from rtsim.loop.options import declared
from rtsim.loop.simulation import MODES, Simulation
from rtsim.protection.tables import LAW_NAMES
from scenarios.files.disturbances import DISTURBANCE_KINDS, disturbance_from_event
from scenarios.flight.flight_setup import setup_from_json, versions
from telemetry.log.format import LogEvent
from telemetry.log.reader import FlightLog, read_log

ACTING_KINDS = frozenset({"reset", "pilot", "aid", "flaps", "throttle", "law", "override"})
"""Events besides those of the air and of failures that a replay repeats."""


@dataclass(frozen=True, slots=True)
class Difference:
    """The first value in which a replay differs from its log."""

    row: int
    """Row of the history, from 0."""
    frame: int
    """Number of the frame; counts from the last reset."""
    signal: str
    """Name of the first differing signal of that row, in declared order."""
    recorded: float
    """Value in the log."""
    replayed: float
    """Value of the replay."""


@dataclass(frozen=True, slots=True)
class ReplayResult:
    """What a replay found."""

    same: bool
    """Whether every value of every frame is the same."""
    rows: int
    """Frames compared."""
    recorded_sha256: str
    """Hash of the recorded history, computed from the log's rows."""
    stated_sha256: str | None
    """Hash the log was closed with; None for a cut-off log. Where it differs, the rows were damaged or edited."""
    replayed_sha256: str
    """Hash of the replayed history."""
    difference: Difference | None
    """Where it differs first; None where it does not."""
    complete: bool
    """Whether the log was closed properly; a cut-off log is replayed as far as it goes."""
    changed_versions: tuple[str, ...]
    """Versions and databases that differ from those of the recording, in words."""


def replay_log(path: str | Path, *, trust: bool = False) -> ReplayResult:
    """Fly a log again.

    Args:
        path: The flight log.
        trust: Import and run the code of laws that the log names (``MODULE:CLASS``).

    Raises:
        InputError: If it is no log, has no frames, or was written with other signals.
    """
    log = read_log(path)
    recorded = log.history
    if not len(recorded):
        raise InputError("holds no frames", file=str(path), mend="record a flight of at least a second")
    setup = _setup(log)
    named = [name for name in setup.options.protection.split(",") if name.strip() not in LAW_NAMES]
    if named and not trust:
        raise InputError(
            f"the log names code that would be run: {', '.join(readable(name) for name in named)}",
            file=str(log.path),
            mend="look at it first; then replay with --trust",
        )
    simulation = Simulation(setup)
    replayed = fly_recording(simulation, recorded, log.events)
    recorded_hash = history_sha256([recorded])
    stated_hash = None if log.summary is None else log.summary.get("history_sha256")
    difference = first_difference(recorded, replayed)
    return ReplayResult(
        same=difference is None and stated_hash in {None, recorded_hash},
        rows=len(recorded),
        recorded_sha256=recorded_hash,
        stated_sha256=stated_hash,
        replayed_sha256=history_sha256([replayed]),
        difference=difference,
        complete=log.summary is not None,
        changed_versions=_changes(log, simulation.database_hash),
    )


def fly_recording(simulation: Simulation, recorded: FloatArray, events: Sequence[LogEvent]) -> FloatArray:
    """Give a simulation the recorded commands and events, row by row.

    Args:
        simulation: At frame 0, with the recorded setup.
        recorded: The recorded history, shape (rows, SIGNAL_COUNT).
        events: The recorded events; those that change the flight name the row before which they act.

    Returns:
        The replayed history, shape (rows flown, SIGNAL_COUNT).
    """
    acting = [event for event in events if event.kind in {*ACTING_KINDS, *DISTURBANCE_KINDS}]
    replayed = np.empty_like(recorded)
    due = 0
    for row in range(len(recorded)):
        while due < len(acting) and acting[due].data["row"] <= row:
            _act(simulation, acting[due])
            due += 1
        if simulation.finished:
            return replayed[:row]
        command = Command(
            float(recorded[row, COLUMN.pilot_stick]),
            float(recorded[row, COLUMN.pilot_lever]),
            float(recorded[row, COLUMN.pilot_nacelle_rate_rad_s]),
        )
        replayed[row] = simulation.step(command)
    return replayed


def first_difference(recorded: FloatArray, replayed: FloatArray) -> Difference | None:
    """Compare two histories bit by bit.

    Args:
        recorded: One, shape (rows, SIGNAL_COUNT).
        replayed: The other; where it is shorter, its missing rows differ.

    Returns:
        The first difference in time, then in declared order of the signals; None where there is none.
    """
    common = min(len(recorded), len(replayed))
    # As integers: a NaN equals itself, and 0.0 differs from -0.0, as in the hash.
    left = np.ascontiguousarray(recorded[:common]).view(np.int64)
    right = np.ascontiguousarray(replayed[:common]).view(np.int64)
    rows = np.flatnonzero((left != right).any(axis=1))
    if not rows.size:
        if len(recorded) == len(replayed):
            return None
        return Difference(common, int(recorded[common, COLUMN.frame]), "frame", float(common), float("nan"))
    row = int(rows[0])
    column = int(np.argmax(left[row] != right[row]))
    return Difference(
        row,
        int(recorded[row, COLUMN.frame]),
        SIGNAL_NAMES[column],
        float(recorded[row, column]),
        float(replayed[row, column]),
    )


def _act(simulation: Simulation, event: LogEvent) -> None:
    if event.kind == "reset":
        simulation.reset()
        return
    if event.kind == "aid":
        simulation.set_aid(switch_of(str(event.data["aid"])), bool(event.data["on"]))
        return
    if event.kind == "flaps":
        simulation.set_flaps(float(event.data["angle"]))
        return
    if event.kind == "throttle":
        simulation.set_throttle_trim(float(event.data["share"]))
        return
    if event.kind == "override":
        simulation.set_protection_override(bool(event.data["on"]))
        return
    if event.kind == "law":
        _act_on_law(simulation, event)
        return
    if event.kind in DISTURBANCE_KINDS:
        simulation.disturb(disturbance_from_event(event.kind, event.data))
        return
    mode = str(event.data["mode"])
    for name in MODES:
        if name == mode:
            simulation.set_pilot(name)


def _act_on_law(simulation: Simulation, event: LogEvent) -> None:
    if simulation.laws is not None and event.data["ended"]:
        simulation.laws.end(str(event.data["law"]))
    elif simulation.laws is not None and event.data["what"] == "skipped":
        simulation.laws.skip(str(event.data["law"]))


def _setup(log: FlightLog) -> Any:
    try:
        setup = setup_from_json(log.metadata.setup["flight"])
    except (KeyError, TypeError) as error:
        raise InputError(
            f"does not say how it was flown ({error})",
            file=str(log.path),
            mend=f"replay it with the version that wrote it ({log.metadata.versions.get('rtsim', 'unknown')})",
        ) from None
    # A log that travels takes the files that it names along, beside it.
    named = {item.name: Path(getattr(setup.options, item.name)).name for item in declared().values() if item.is_file}
    there = {
        name: str(log.path.parent / file) for name, file in named.items() if file and (log.path.parent / file).is_file()
    }
    return setup.with_options(**there)


def _changes(log: FlightLog, database_hash: str) -> tuple[str, ...]:
    found = []
    if log.metadata.database_hash != database_hash:
        found.append(f"database {log.metadata.database_hash[:12]} then, {database_hash[:12]} now")
    present = versions()
    for name, then in log.metadata.versions.items():
        if present.get(name) != then:
            found.append(f"{name} {then} then, {present.get(name, 'unknown')} now")
    return tuple(found)
