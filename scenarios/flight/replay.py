"""Flies the recorded commands of a log again and compares the history bit by bit."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
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
from rtsim.outside import understanding
from rtsim.protection.tables import LAW_NAMES
from rtsim.versions import versions
from scenarios.files.disturbances import DISTURBANCE_KINDS, disturbance_from_event
from scenarios.flight.flight_setup import setup_from_json
from telemetry.log.format import EVENTS_FILE, LogEvent
from telemetry.log.reader import FlightLog, read_log

ACTING_KINDS = frozenset({"reset", "pilot", "aid", "flaps", "throttle", "rotor_speed", "law", "override"})
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
    acting = [(_row(event), _action(event)) for event in events if event.kind in {*ACTING_KINDS, *DISTURBANCE_KINDS}]
    replayed = np.empty_like(recorded)
    due = 0
    for row in range(len(recorded)):
        while due < len(acting) and acting[due][0] <= row:
            acting[due][1](simulation)
            due += 1
        if simulation.finished:
            return replayed[:row]
        command = Command(
            float(recorded[row, COLUMN.pilot_stick]),
            float(recorded[row, COLUMN.pilot_lever]),
            float(recorded[row, COLUMN.pilot_nacelle_rate_rad_s]),
            float(recorded[row, COLUMN.pilot_lateral_stick]),
            float(recorded[row, COLUMN.pilot_pedal]),
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


def _row(event: LogEvent) -> int:
    """The row before which an event acts."""
    row = event.data.get("row")
    if not isinstance(row, int) or row < 0:
        raise _nonsense(event, f"row is {row!r}")
    return row


def _action(event: LogEvent) -> Callable[[Simulation], None]:
    """What an event does to a simulation."""
    try:
        return _understood(event.kind, event.data)
    except InputError as error:
        raise _nonsense(event, str(error).rstrip(".")) from None
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise _nonsense(event, f"{type(error).__name__} {error}") from None


def _nonsense(event: LogEvent, problem: str) -> InputError:
    return InputError(
        f"the event '{event.kind}' at {event.time_s:g} s cannot be repeated: {problem}",
        file=EVENTS_FILE,
        mend="restore the file, or record the flight again",
    )


def _understood(kind: str, data: Mapping[str, Any]) -> Callable[[Simulation], None]:
    if kind == "reset":
        return Simulation.reset
    if kind == "aid":
        aid, on = switch_of(str(data["aid"])), bool(data["on"])
        return lambda simulation: simulation.set_aid(aid, on)
    if kind == "flaps":
        angle = _number(data["angle"])
        return lambda simulation: simulation.set_flaps(angle)
    if kind == "throttle":
        share = _number(data["share"])
        return lambda simulation: simulation.set_throttle_trim(share)
    if kind == "rotor_speed":
        speed = _number(data["speed"])
        return lambda simulation: simulation.set_rotor_speed(speed)
    if kind == "override":
        active = bool(data["on"])
        return lambda simulation: simulation.set_protection_override(active)
    if kind == "law":
        return _action_on_law(str(data["law"]), ended=bool(data["ended"]), what=str(data.get("what")))
    if kind in DISTURBANCE_KINDS:
        disturbance = disturbance_from_event(kind, data)
        return lambda simulation: simulation.disturb(disturbance)
    mode = next((name for name in MODES if name == data["mode"]), None)
    return lambda simulation: None if mode is None else simulation.set_pilot(mode)


def _number(value: Any) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError("is no finite number")
    return number


def _action_on_law(law: str, *, ended: bool, what: str) -> Callable[[Simulation], None]:
    def act(simulation: Simulation) -> None:
        if simulation.laws is not None and ended:
            simulation.laws.end(law)
        elif simulation.laws is not None and what == "skipped":
            simulation.laws.skip(law)

    return act


def _setup(log: FlightLog) -> Any:
    mend = f"replay it with the version that wrote it ({log.metadata.versions.get('rtsim', 'unknown')})"
    with understanding("account of how the log was flown", file=log.path, mend=mend):
        setup = setup_from_json(log.metadata.setup["flight"])
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
