"""A trial flight frame by frame from Python, for laws and pilots that are not compiled; the same numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtsim import simulation_kernels as simulation
from rtsim.command import Command, Margins, Pilot, Reference, Sensors
from rtsim.frame import COLUMN, FloatArray
from rtsim.protection import law_data, law_kernels
from rtsim.protection.chain import LawChain
from rtsim.protection.limits import LIMIT_KINDS
from scenarios.campaign import trial_kernels as kernels
from scenarios.script_kernels import script_command

if TYPE_CHECKING:
    from scenarios.campaign.trial import Flying

_REASON_PLACE = {
    "stick": kernels.A_STICK_REASON,
    "lever": kernels.A_LEVER_REASON,
    "nacelle_rate": kernels.A_RATE_REASON,
}
_REASON_NUMBER = {name: float(number + 1) for number, name in enumerate(LIMIT_KINDS)}
REASON_OTHER = float(len(LIMIT_KINDS) + 1)
"""Reason of an intervention for a limit that rtsim has no name for, or for none given."""


def fly_in_python(
    flying: Flying,
    law: LawChain | law_data.ProtectionTables,
    pilot: Pilot | None,
    work: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
) -> int:
    """Fly until the rows are full or the flight ends.

    Args:
        flying: The flight, prepared.
        law: Laws written in Python, or the tables of a built-in one.
        pilot: A pilot written in Python; None: the built-in one.
        work: Sensors, law's work space, command, limited command.

    Returns:
        Frames flown.
    """
    sensors, law_work, command, applied = work
    law_state = np.zeros(law_data.LAW_STATE_SIZE)
    if not isinstance(law, LawChain):
        law_kernels.law_start(law, law_state)
    tables, state, scratch = flying.tables, flying.state, flying.scratch
    script = (flying.pulses, flying.script_state)
    asked_of_pilot = script if pilot is None else (flying.pulses[:0], flying.script_state)
    for k in range(len(flying.rows)):
        if state.clock[simulation.CLOCK_END] != simulation.END_NONE:
            return k
        row, action = flying.rows[k], flying.actions[k]
        kernels.ask_pilot(tables, state, scratch, row, asked_of_pilot, command)
        if pilot is not None or isinstance(law, law_data.ProtectionTables) or law.due(k):
            kernels.fill_sensors(row, state, scratch, sensors)
        if pilot is not None:
            asked = pilot.step(sensors_object(sensors), _reference(flying, scratch), tables.dt)
            command[:] = asked.stick, asked.lever, asked.nacelle_rate
            script_command(script[0], script[1], float(row[COLUMN.time_s]), command)
        action[:] = 0.0
        if isinstance(law, LawChain):
            _ask_laws(law, k, sensors, command, scratch, applied, action)
        else:
            law_kernels.protect(law, law_state, k, sensors, command, applied, law_work)
            action[kernels.A_STICK_REASON] = law_state[law_data.L_STICK_CAUSE]
            action[kernels.A_LEVER_REASON] = law_state[law_data.L_LEVER_CAUSE]
            action[kernels.A_RATE_REASON] = law_state[law_data.L_RATE_CAUSE]
            action[kernels.A_TIME] = law_state[law_data.L_TIME]
        action[:3] = applied - command
        noise = flying.noise
        kernels.finish_frame(
            tables, state, scratch, row, (command, applied, noise[0][k], noise[1][k]), script, flying.reaction
        )
    return len(flying.rows)


def sensors_object(values: FloatArray) -> Sensors:
    """Sensor values as laws and pilots see them.

    Args:
        values: In the order of ``rtsim.protection.law_kernels``.
    """
    numbers = values.tolist()
    return Sensors(
        *numbers[: law_data.SENSE_DOWNSTOP],
        on_downstop=numbers[law_data.SENSE_DOWNSTOP] != 0.0,
        nacelle_ok=numbers[law_data.SENSE_NACELLE_OK] != 0.0,
    )


def _ask_laws(
    laws: LawChain,
    frame: int,
    sensors: FloatArray,
    command: FloatArray,
    scratch: simulation.Scratch,
    applied: FloatArray,
    action: FloatArray,
) -> None:
    """Ask the chain where it is due, limit the command, and note who changed what and why."""
    asked = Command(*command.tolist())
    if laws.due(frame):
        laws.decide(frame, sensors_object(sensors), asked, Margins(*scratch.shown[1:5].tolist()))
    limited = laws.apply(asked)
    applied[:] = limited.stick, limited.lever, limited.nacelle_rate
    for channel, place in enumerate(_REASON_PLACE.values()):
        if applied[channel] != command[channel]:
            action[place] = REASON_OTHER
    for noted in laws.interventions:
        place_of = _REASON_PLACE.get(noted.intervention.channel)
        if place_of is not None and action[place_of] != 0.0:
            action[place_of] = _REASON_NUMBER.get(noted.intervention.limit, REASON_OTHER)


def _reference(flying: Flying, scratch: simulation.Scratch) -> Reference:
    time = float(flying.state.clock[simulation.CLOCK_FRAME]) * flying.tables.dt
    target = scratch.target.tolist()
    return Reference(
        airspeed=target[0],
        airspeed_rate=target[1],
        nacelle_angle=flying.programme.at(time).nacelle_angle,
        nacelle_rate=target[4],
        altitude=target[2],
    )
