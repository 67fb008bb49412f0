"""A trial flight frame by frame from Python, for laws and pilots that are not compiled; the same numbers."""

from __future__ import annotations

import time
from dataclasses import fields
from typing import TYPE_CHECKING

import numpy as np

from rtsim.command import Command, Margins, Pilot, Reference, Sensors
from rtsim.frame import COLUMN, FloatArray
from rtsim.loop import advance_kernels as simulation
from rtsim.loop.data import CLOCK_END, CLOCK_FRAME, END_NONE, Scratch
from rtsim.loop.observe_kernels import sense
from rtsim.protection import law_data
from rtsim.protection.chain import LawChain
from rtsim.protection.limits import LIMIT_KINDS
from rtsim.units import DEGREE
from scenarios.campaign import trial_kernels as kernels
from scenarios.files.script_kernels import script_command

if TYPE_CHECKING:
    from scenarios.campaign.trial import Flying

_REASON_COLUMN = {
    "stick": COLUMN.protection_stick_reason,
    "lever": COLUMN.protection_lever_reason,
    "nacelle_rate": COLUMN.protection_nacelle_reason,
}
_REASON_NUMBER: dict[str, float] = {name: float(number + 1) for number, name in enumerate(LIMIT_KINDS)}
_SENSOR_NAMES = tuple(item.name for item in fields(Sensors))[: law_data.SENSE_DOWNSTOP]
REASON_OTHER = float(len(LIMIT_KINDS) + 1)
"""Reason of an intervention for a limit that rtsim has no name for, or for none given."""


def fly_in_python(flying: Flying, laws: LawChain | None, pilot: Pilot | None) -> tuple[int, int]:
    """Fly until the rows are full or the flight ends.

    Args:
        flying: The flight, prepared.
        laws: Laws written in Python; None: the compiled law of the flight.
        pilot: A pilot written in Python; None: the built-in one.

    Returns:
        Frames flown, and decisions that took the laws longer than the time between two of them.
    """
    tables, state, scratch = flying.tables, flying.state, flying.scratch
    script = (flying.pulses, flying.script_state)
    asked_of_pilot = script if pilot is None else (flying.pulses[:0], flying.script_state)
    command, sensors = scratch.asked, np.zeros(law_data.SENSOR_COUNT)
    slow = 0
    for k in range(len(flying.rows)):
        if state.clock[CLOCK_END] != END_NONE:
            return k, slow
        row = flying.rows[k]
        kernels.ask_pilot(tables, state, scratch, row, asked_of_pilot, command)
        if pilot is not None:
            sense(state, scratch, row, sensors)
            asked = pilot.step(sensors_object(sensors), _reference(flying, scratch), tables.dt)
            command[:] = asked.stick, asked.lever, asked.nacelle_rate
            script_command(script[0], script[1], float(row[COLUMN.time_s]), command)
        noise = (flying.noise[0][k], flying.noise[1][k])
        if laws is None:
            simulation.advance(tables, state, scratch, row, (command, command, *noise))
        else:
            simulation.shape(tables, state, scratch, command)
            if laws.due(k):
                sense(state, scratch, row, sensors)
            began = time.perf_counter()
            _ask_laws(laws, k, sensors, scratch, row)
            slow += time.perf_counter() - began > laws.period
            simulation.complete(tables, state, scratch, row, (command, *noise))
        kernels.take_notice(tables, state, scratch, row, script, flying.reaction)
    return len(flying.rows), slow


def sensors_object(values: FloatArray) -> Sensors:
    """Sensor values as laws and pilots see them.

    Args:
        values: In the order of ``rtsim.protection.law_data``.
    """
    numbers = values.tolist()
    return Sensors(
        **dict(zip(_SENSOR_NAMES, numbers, strict=False)),
        on_downstop=numbers[law_data.SENSE_DOWNSTOP] != 0.0,
        nacelle_ok=numbers[law_data.SENSE_NACELLE_OK] != 0.0,
    )


def _ask_laws(laws: LawChain, frame: int, sensors: FloatArray, scratch: Scratch, row: FloatArray) -> None:
    """Ask the chain where it is due, limit what would act, and note who changed what and why."""
    asked = Command(*scratch.command.tolist())
    if laws.due(frame):
        laws.decide(frame, sensors_object(sensors), asked, Margins(*scratch.shown[1:5].tolist()))
    limited = laws.apply(asked)
    row[COLUMN.protection_stick] = limited.stick - asked.stick
    row[COLUMN.protection_lever] = limited.lever - asked.lever
    row[COLUMN.protection_nacelle_rate_deg_s] = (limited.nacelle_rate - asked.nacelle_rate) / DEGREE
    row[COLUMN.time_to_limit_s] = NO_PREDICTION
    for channel, column in _REASON_COLUMN.items():
        row[column] = REASON_OTHER if getattr(limited, channel) != getattr(asked, channel) else 0.0
    for noted in laws.interventions:
        column = _REASON_COLUMN.get(noted.intervention.channel)
        if column is not None and row[column] != 0.0:
            row[column] = _REASON_NUMBER.get(noted.intervention.limit, REASON_OTHER)
    scratch.command[:] = limited.stick, limited.lever, limited.nacelle_rate


NO_PREDICTION = 6.0
"""Time to limit where nobody predicts it: the horizon of the monitor [s]."""


def _reference(flying: Flying, scratch: Scratch) -> Reference:
    now = float(flying.state.clock[CLOCK_FRAME]) * flying.tables.dt
    target = scratch.target.tolist()
    return Reference(
        airspeed=target[0],
        airspeed_rate=target[1],
        nacelle_angle=flying.programme.at(now).nacelle_angle,
        nacelle_rate=target[4],
        altitude=target[2],
    )
